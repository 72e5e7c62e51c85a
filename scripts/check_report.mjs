// The report in a browser: node check_report.mjs MODULES REPORT [PICTURES]
// MODULES is the folder with @sparticuz/chromium and puppeteer-core, PICTURES one for screenshots.
import assert from 'node:assert/strict';
import { createRequire } from 'node:module';
import path from 'node:path';
import { pathToFileURL } from 'node:url';

const [modules, report, pictures] = process.argv.slice(2);
const require = createRequire(path.join(path.resolve(modules), 'package.json'));
const of = name => { const found = require(name); return found.default ?? found; };
const chromium = of('@sparticuz/chromium'), puppeteer = of('puppeteer-core');

const browser = await puppeteer.launch({
  executablePath: await chromium.executablePath(), args: chromium.args, headless: 'shell',
});
const complaints = [];

async function open(width, height) {
  const page = await browser.newPage();
  // The driver complains of `pixels` below.
  const is_ours = message => message.text().includes('GPU stall due to ReadPixels');
  page.on('console', message => is_ours(message) || complaints.push(message.text()));
  page.on('pageerror', error => complaints.push(error.message));
  page.on('request', request => {
    if (!/^(file|data):/.test(request.url())) complaints.push(`it asks for ${request.url()}`);
  });
  const is_phone = width < 600;
  await page.setViewport({ width, height, isMobile: is_phone, hasTouch: is_phone });
  await page.goto(pathToFileURL(path.resolve(report)).href);
  await drawn(page);
  return page;
}

// Until what was asked for has been drawn.
const drawn = page => page.evaluate(() => new Promise(done => {
  let n = 0;
  const next = () => (n++ < 5 ? requestAnimationFrame(next) : done());
  next();
}));

// The picture as bytes: red, green, blue, opacity.
const pixels = async page => Buffer.from(await page.evaluate(() => {
  const canvas = document.querySelector('.scene canvas'), gl = canvas.getContext('webgl2');
  const bytes = new Uint8Array(4 * canvas.width * canvas.height);
  gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
  let text = '';
  for (let k = 0; k < bytes.length; k += 32768) text += String.fromCharCode(...bytes.subarray(k, k + 32768));
  return btoa(text);
}), 'base64');

// Share of the pixels that differ.
function difference(a, b) {
  assert.equal(a.length, b.length);
  let n = 0;
  for (let k = 0; k < a.length; k += 4) n += a[k] !== b[k] || a[k + 1] !== b[k + 1] || a[k + 2] !== b[k + 2];
  return n / (a.length / 4);
}

// Share of the pixels that are not of the most frequent colour.
function filled(picture) {
  const counts = new Map();
  for (let k = 0; k < picture.length; k += 4) {
    const colour = picture[k] << 16 | picture[k + 1] << 8 | picture[k + 2];
    counts.set(colour, (counts.get(colour) ?? 0) + 1);
  }
  return 1 - Math.max(...counts.values()) / (picture.length / 4);
}

async function picture(page, name, selector) {
  if (pictures) await (selector ? await page.$(selector) : page).screenshot({ path: path.join(pictures, name), fullPage: !selector });
}

async function after(page, what, least, act) {
  const before = await pixels(page);
  await act();
  await drawn(page);
  const share = difference(before, await pixels(page));
  assert.ok(share > least, `${what}: ${share} of the picture changes, expected more than ${least}`);
  console.log(`${what}: ${(100 * share).toFixed(1)} % of the picture changes`);
}

async function wide() {
  const page = await open(1100, 900);
  const share = filled(await pixels(page));
  assert.ok(share > 0.05, `the picture is blank: ${share}`);
  console.log(`the map fills ${(100 * share).toFixed(1)} % of the picture`);
  await picture(page, 'wide.png', 'section[id$=scene]');
  await (await page.$('.scene canvas')).scrollIntoView();
  const box = await (await page.$('.scene canvas')).boundingBox();
  const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
  const drag = async (dx, dy) => {
    await page.mouse.move(x, y);
    await page.mouse.down();
    await page.mouse.move(x + dx, y + dy, { steps: 4 });
    await page.mouse.up();
  };
  await after(page, 'dragging', 0.05, () => drag(120, 30));
  await after(page, 'shift-dragging', 0.05, async () => {
    await page.keyboard.down('Shift');
    await drag(60, 20);
    await page.keyboard.up('Shift');
  });
  await after(page, 'the wheel', 0.05, () => page.mouse.wheel({ deltaY: -200 }));
  const before = await pixels(page);
  await page.reload();
  await drawn(page);
  const moved = difference(before, await pixels(page));
  assert.ok(moved < 0.01, `loaded again: ${moved} of the picture changes`);
  await after(page, 'the whole map', 0.05, () => page.click('[data-do=whole]'));
  const words = () => page.$eval('.scene output', output => output.textContent);
  const said = await words();
  await after(page, 'the slider', 0.0002, () => page.$eval('.scene input[type=range]', slider => {
    slider.value = Math.floor(slider.max / 2);
    slider.dispatchEvent(new Event('input'));
  }));
  assert.notEqual(await words(), said);
  // The plots mark the same frame, and a click into one over time leads to another.
  const marks = () => page.$$eval('.now', all => all.map(mark => mark.hidden ? '' : mark.style.left));
  const marked = await marks(), middle = await words();
  assert.ok(marked.length >= 4 && marked.every(place => place.endsWith('%')), `marks in the plots: ${marked}`);
  await page.$$eval('[data-follow=time]', all => {
    const plot = all.find(plot => plot.getBoundingClientRect().width > 0), box = plot.getBoundingClientRect();
    plot.dispatchEvent(new MouseEvent('click', { clientX: box.left + 0.9 * box.width, clientY: box.top + 9 }));
  });
  assert.notEqual(await words(), middle);
  assert.notDeepEqual(await marks(), marked);
  for (const colour of ['height', 'uncertainty']) {
    await after(page, `colour by ${colour}`, 0.03, () => page.select('[data-set=colour]', colour));
  }
  await after(page, 'no trajectory', 0.0002, () => page.click('[data-show=trajectory]'));
  await after(page, 'walls from behind', 0.001, () => page.click('[data-show=backs]'));
  // Two clicks are a distance between points of the map.
  await page.click('[data-do=whole]');
  await drawn(page);
  const ruler = () => page.$eval('.ruler', label => ({ words: label.textContent, ends: JSON.parse(label.dataset.ends ?? '[]'), hidden: label.hidden }));
  // Where points are: a first click there waits for a second one.
  const hits = [];
  const clear = () => page.mouse.click(box.x + 3, box.y + 3);
  for (let column = 1; column < 12; column++) {
    const at = [box.x + box.width * column / 12, y + box.height * 0.1 * (column % 3 - 1)];
    await page.mouse.click(...at);
    if ((await ruler()).words === 'click a second point') hits.push(at);
    await clear();
  }
  assert.ok(hits.length >= 2, `clicks hit ${hits.length} points of the map`);
  await page.mouse.click(...hits[0]);
  await drawn(page);
  await after(page, 'a distance', 0.0001, () => page.mouse.click(...hits.at(-1)));
  const { words: distance, ends: [a, b] } = await ruler();
  const apart = Math.hypot(...a.map((v, k) => v - b[k]));
  assert.match(distance, /^\d+\.\d+ m$/);
  assert.ok(Math.abs(parseFloat(distance) - apart) < 0.01 && apart > 0.1, `${distance}, ends ${apart} m apart`);
  const off = await page.evaluate(end => {
    const { points, low, size, voxel_m } = JSON.parse(document.querySelector('.scene script').textContent);
    const steps = new Uint16Array(Uint8Array.from(atob(points.position), c => c.charCodeAt(0)).buffer);
    let nearest = Infinity;
    for (let k = 0; k < steps.length; k += 3) {
      nearest = Math.min(nearest, Math.hypot(...end.map((v, i) => v - low[i] - size[i] * steps[k + i] / 65535)));
    }
    return nearest / voxel_m;
  }, b);
  assert.ok(off < 0.01, `the end is ${off} voxels from the nearest point`);
  await picture(page, 'distance.png', '.scene .stage');
  await clear();
  await drawn(page);
  assert.ok((await ruler()).hidden, 'a click beside the map ends it');
  // Submaps by themselves, where there are several.
  if (await page.$('[data-submap]')) {
    await after(page, 'without a submap', 0.001, () => page.click('[data-submap]'));
    await after(page, 'with it', 0.001, () => page.click('[data-submap]'));
  }
  await after(page, 'from above', 0.05, () => page.click('[data-do=above]'));
  await after(page, 'through the camera', 0.05, () => page.click('[data-do=camera]'));
  await after(page, 'playing', 0.01, async () => {
    await page.click('[data-do=play]');
    await new Promise(done => setTimeout(done, 1000));
  });
  await page.close();
}

async function phone() {
  const page = await open(360, 740);
  await page.$$eval('details', all => all.forEach(details => { details.open = true; }));
  await drawn(page);
  const width = await page.evaluate(() => document.documentElement.scrollWidth);
  assert.ok(width <= 360, `the page is ${width} px wide on a phone`);
  // Nothing but what scrolls by itself reaches beyond its section.
  const cut = await page.$$eval('main *', all => all
    .filter(element => !element.closest('.scroll, .stage, svg') && element.getBoundingClientRect().right > 360.5)
    .map(element => element.outerHTML.slice(0, 80)));
  assert.deepEqual(cut, []);
  assert.ok(filled(await pixels(page)) > 0.05, 'the picture is blank on a phone');
  await picture(page, 'phone.png');
  await page.close();
}

await wide();
await phone();
await browser.close();
assert.deepEqual(complaints, []);
console.log('the report is whole in Chromium, wide and on a phone');
