// The map and the trajectory in 3D: points and lines in WebGL 2, drawn only when something changes.
// Axes of the page: right, forward, up, metres. Axes of a camera: right, down, forward.
(() => {
'use strict';

const POINT_SHADER = `#version 300 es
in vec3 position; in vec2 folded; in vec3 rgb;
uniform mat4 clip_from_page; uniform vec3 low, size, eye; uniform float dot_px_m, least_px; uniform bool backs, lit;
out vec3 shade;
void main() {
  vec3 at = low + size * position;
  vec3 n = vec3(folded, 1.0 - abs(folded.x) - abs(folded.y));
  if (n.z < 0.0) n.xy = (1.0 - abs(n.yx)) * vec2(n.x < 0.0 ? -1.0 : 1.0, n.y < 0.0 ? -1.0 : 1.0);
  gl_Position = clip_from_page * vec4(at, 1.0);
  // A surface seen from behind hides what is in front of it: the ceiling, the near wall.
  if (!backs && dot(n, eye - at) < 0.0) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  gl_PointSize = clamp(dot_px_m / gl_Position.w, least_px, 24.0);
  // As by a lamp at the eye: without it surfaces of one colour are silhouettes.
  shade = lit ? rgb * (0.5 + 0.5 * abs(dot(normalize(n), normalize(eye - at)))) : rgb;
}`;
// A line is a ribbon of four corners; a line of no length is a square dot.
const LINE_SHADER = `#version 300 es
in vec3 begin, end; in vec4 look;
uniform mat4 clip_from_page; uniform vec2 half_px; uniform float ratio;
out vec3 shade;
void main() {
  vec4 a = clip_from_page * vec4(begin, 1.0), b = clip_from_page * vec4(end, 1.0);
  const float near = 0.02;
  shade = look.rgb;
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  if (a.w < near && b.w < near) return;
  if (a.w < near) a = mix(b, a, (b.w - near) / (b.w - a.w));
  else if (b.w < near) b = mix(a, b, (a.w - near) / (a.w - b.w));
  vec2 p = a.xy / a.w * half_px, q = b.xy / b.w * half_px;
  vec2 along = length(q - p) > 0.001 ? normalize(q - p) : vec2(1.0, 0.0);
  vec2 across = vec2(-along.y, along.x);
  float reach = 0.5 * look.w * ratio;
  vec2 at = gl_VertexID > 1 ? q + reach * along : p - reach * along;
  gl_Position = vec4((at + ((gl_VertexID & 1) == 0 ? -reach : reach) * across) / half_px, 0.0, 1.0);
}`;
const COLOUR_SHADER = `#version 300 es
precision mediump float;
in vec3 shade; out vec4 colour;
void main() { colour = vec4(shade, 1.0); }`;

const BACKGROUND = [0.10, 0.12, 0.15];
const STATES = ['tracked', 'lost', 'relocalising', 'dropped'];
const STATE_COLOURS = [[0.35, 0.72, 1.0], [1.0, 0.35, 0.15], [1.0, 0.70, 0.10], [0.6, 0.6, 0.6]];
// Closed, closed by the aligner alone, not verified, rejected.
const LOOP_COLOURS = [[0.25, 0.90, 0.60], [0.85, 0.55, 0.95], [1.0, 0.75, 0.25], [1.0, 0.35, 0.15]];
// Of several robots each has its own.
const of_state = (scene, k) => {
  const { frames, robots } = scene;
  return robots.length && frames.state[k] === 0 ? robots[frames.robot[k]].rgb.map(v => v / 255) : STATE_COLOURS[frames.state[k]];
};
const UNKNOWN = [0.45, 0.45, 0.45];
// From dark violet over blue and green to yellow: it gets lighter all the way.
const RAMP = [[0.35, 0.15, 0.50], [0.26, 0.40, 0.70], [0.15, 0.62, 0.60], [0.40, 0.80, 0.40], [0.99, 0.91, 0.20]];
const JOIN_COLOUR = [0.95, 0.45, 0.85], MEASURE_COLOUR = [1.0, 1.0, 1.0];
const HALF_FOV = Math.PI / 6;
// Within so many pixels of a click is what was meant, and a hand that moves less has clicked.
const REACH_PX = 9, CLICK_PX = 4;

function ramp(share) {
  const place = Math.min(Math.max(share, 0), 1) * (RAMP.length - 1);
  const k = Math.min(Math.floor(place), RAMP.length - 2);
  return RAMP[k].map((c, i) => c + (RAMP[k + 1][i] - c) * (place - k));
}

function decoded(Kind, text) {
  const bytes = Uint8Array.from(atob(text), c => c.charCodeAt(0));
  return new Kind(bytes.buffer);
}

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const three = (array, k) => [array[3 * k], array[3 * k + 1], array[3 * k + 2]];
const add = (a, b, factor) => a.map((v, i) => v + factor * b[i]);

function quantile(values, share) {
  const sorted = Float64Array.from(values).filter(Number.isFinite).sort();
  return sorted.length ? sorted[Math.floor(share * (sorted.length - 1))] : 0;
}

// Axes of the camera in the page: the columns of the matrix of a quaternion x, y, z, w.
function axes([x, y, z, w]) {
  return [
    [1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)],
    [2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)],
    [2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)],
  ];
}

// Column by column: clip_from_page of an eye that looks forward.
function projection(eye, right, down, forward, aspect, near) {
  const scale = 1 / Math.tan(HALF_FOV), far = 20000 * near;
  const x = scale / Math.max(aspect, 1e-3), y = -scale;
  const depth = (far + near) / (far - near), shift = -2 * far * near / (far - near);
  const row = (axis, factor) => [...axis.map(v => factor * v), -factor * dot(axis, eye)];
  const rows = [row(right, x), row(down, y), row(forward, depth), row(forward, 1)];
  rows[2][3] += shift;
  const matrix = new Float32Array(16);
  rows.forEach((r, i) => r.forEach((v, j) => { matrix[4 * j + i] = v; }));
  return matrix;
}

function program(gl, vertex, names) {
  const made = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, COLOUR_SHADER]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(made, shader);
  }
  names.forEach((name, place) => gl.bindAttribLocation(made, place, name));
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made));
  return { made, at: name => gl.getUniformLocation(made, name) };
}

// Reads what the page holds of a run.
function read(text) {
  const data = JSON.parse(text), { points, frames, keyframes, loops } = data;
  const position = decoded(Uint16Array, points.position);
  const scene = {
    ...data, position, n_points: position.length / 3,
    normal: decoded(Int8Array, points.normal), rgb: decoded(Uint8Array, points.rgb),
    keyframe_of: decoded(Uint16Array, points.keyframe),
    frames: {
      index: decoded(Uint32Array, frames.index), time_s: decoded(Float32Array, frames.time_s),
      state: decoded(Uint8Array, frames.state), part: decoded(Uint8Array, frames.part),
      submap: decoded(Uint8Array, frames.submap), robot: decoded(Uint8Array, frames.robot),
      position: decoded(Float32Array, frames.position), std_m: decoded(Float32Array, frames.std_m),
      rotation: Array.from(decoded(Int16Array, frames.rotation), v => v / 32767),
    },
    keyframes: {
      position: decoded(Float32Array, keyframes.position), of_map: decoded(Uint8Array, keyframes.of_map),
      std_m: decoded(Float32Array, keyframes.std_m), submap: decoded(Uint8Array, keyframes.submap),
    },
    loops: {
      ends: decoded(Float32Array, loops.ends), verdict: decoded(Uint8Array, loops.verdict),
      submap: decoded(Uint8Array, loops.submap),
    },
    truth: decoded(Float32Array, data.truth),
  };
  scene.has_colour = scene.rgb.some((v, k) => v !== scene.rgb[k % 3]);
  const heights = [];
  for (let k = 0; k < scene.n_points; k += 1 + Math.floor(scene.n_points / 5000)) heights.push(coordinate(scene, k, 2));
  scene.heights = [quantile(heights, 0.02), quantile(heights, 0.98)];
  const known = [...scene.keyframes.std_m, ...scene.frames.std_m].filter(v => v > 0);
  scene.stds = [quantile(known, 0.02), quantile(known, 0.98)];
  return scene;
}

// The part and the submap of each point: parts follow each other, and a point is of the submap of the
// keyframe that saw it first.
function places(scene) {
  const part = new Uint8Array(scene.n_points), submap = new Uint8Array(scene.n_points);
  let k = 0;
  scene.parts.forEach((of, place) => {
    const first = Math.max(0, scene.submaps.findIndex(submap => submap.part === place));
    for (const end = k + of.n_points; k < end; k++) {
      part[k] = place;
      submap[k] = scene.keyframes.submap[scene.keyframe_of[k]] ?? first;
    }
  });
  return { part, submap };
}

// The normal of a point, as the shader unfolds it.
function normal(scene, k) {
  let [x, y] = [scene.normal[2 * k] / 127, scene.normal[2 * k + 1] / 127];
  const z = 1 - Math.abs(x) - Math.abs(y);
  if (z < 0) [x, y] = [(1 - Math.abs(y)) * (x < 0 ? -1 : 1), (1 - Math.abs(x)) * (y < 0 ? -1 : 1)];
  return [x, y, z];
}

// Where a place of the page is in the picture: across, up, depth, and the distance along the axis of view.
const projected = (matrix, at) => [0, 1, 2, 3].map(i => at.reduce((sum, v, j) => sum + matrix[4 * j + i] * v, matrix[12 + i]));

const coordinate = (scene, k, axis) => scene.low[axis] + scene.size[axis] * scene.position[3 * k + axis] / 65535;

// Colour of a standard deviation, on a scale of decades.
function of_std(scene, std_m) {
  const [low, high] = scene.stds.map(v => Math.log(Math.max(v, 1e-6)));
  return std_m > 0 ? ramp((Math.log(std_m) - low) / Math.max(high - low, 1e-6)) : UNKNOWN;
}

function point_colours(scene, mode) {
  if (mode === 'image') return scene.has_colour ? scene.rgb : scene.rgb.map(() => 200);
  const colours = new Uint8Array(3 * scene.n_points);
  const [low, high] = scene.heights, stds = Array.from(scene.keyframes.std_m, v => of_std(scene, v));
  for (let k = 0; k < scene.n_points; k++) {
    const colour = mode === 'height'
      ? ramp((coordinate(scene, k, 2) - low) / Math.max(high - low, 1e-6))
      : stds[scene.keyframe_of[k]] ?? UNKNOWN;
    for (let i = 0; i < 3; i++) colours[3 * k + i] = 255 * colour[i];
  }
  return colours;
}

// Lines of each layer as ten numbers: begin, end, colour, width in pixels.
function layers(scene, mode, is_on) {
  const { frames, keyframes, loops, truth } = scene;
  const line = (a, b, colour, width) => [...a, ...b, ...colour, width];
  const out = { truth: [], keyframes: [], trajectory: [], loops: [], joins: [], refused: [] };
  for (let k = 1; k < truth.length / 3; k++) out.truth.push(line(three(truth, k - 1), three(truth, k), [0.7, 0.73, 0.76], 1.5));
  for (let k = 1; k < frames.index.length; k++) {
    // Another map, another robot, or another run of it.
    if (!is_on(frames.submap[k])) continue;
    if (frames.part[k] !== frames.part[k - 1] || frames.robot[k] !== frames.robot[k - 1] || frames.index[k] < frames.index[k - 1]) continue;
    const is_tracked = frames.state[k] === 0;
    const colour = mode === 'uncertainty' && is_tracked ? of_std(scene, frames.std_m[k]) : of_state(scene, k);
    out.trajectory.push(line(three(frames.position, k - 1), three(frames.position, k), colour, is_tracked ? 2 : 3));
  }
  for (let k = 0; k < keyframes.of_map.length; k++) {
    if (!is_on(keyframes.submap[k])) continue;
    const at = three(keyframes.position, k);
    out.keyframes.push(line(at, at, keyframes.of_map[k] ? [0.9, 0.62, 0.1] : [1.0, 0.93, 0.6], 3.5));
  }
  for (let k = 0; k < loops.verdict.length; k++) {
    const verdict = loops.verdict[k], [a, b] = [loops.submap[2 * k], loops.submap[2 * k + 1]];
    if (!is_on(a) || !is_on(b)) continue;
    const is_join = a !== b && verdict === 0;
    const layer = is_join ? out.joins : verdict < 2 ? out.loops : out.refused;
    layer.push(line(three(loops.ends, 2 * k), three(loops.ends, 2 * k + 1), is_join ? JOIN_COLOUR : LOOP_COLOURS[verdict], 1.5));
  }
  return out;
}

// A camera as a pyramid that is open in front.
function marker(scene, k, size) {
  const { frames } = scene, at = three(frames.position, k);
  const [right, down, forward] = axes(frames.rotation.slice(4 * k, 4 * k + 4));
  const corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([x, y]) =>
    add(add(add(at, forward, size), right, 0.66 * x * size), down, 0.5 * y * size));
  const colour = of_state(scene, k).map(v => 0.4 + 0.6 * v);
  return corners.flatMap((corner, i) => [
    [...at, ...corner, ...colour, 2.5], [...corner, ...corners[(i + 1) % 4], ...colour, 2.5],
  ]);
}

function view(box, place) {
  const find = selector => box.querySelector(selector);
  const canvas = find('canvas'), slider = find('input[type=range]'), output = find('output');
  const fail = words => {
    find('.fault').textContent = words;
    find('.fault').hidden = false;
    canvas.hidden = true;
    box.querySelectorAll('.walk, .controls, .note').forEach(control => { control.style.display = 'none'; });
  };
  const gl = canvas.getContext('webgl2', { antialias: true, preserveDrawingBuffer: true });
  if (!gl) return fail('This browser cannot draw in 3D (WebGL 2): the plots below show the same from above.');
  canvas.addEventListener('webglcontextlost', () => fail('The browser gave up the view in 3D: load the page again.'));

  const scene = read(find('script').textContent), n_frames = scene.frames.index.length;
  const shown = {}, place_of = places(scene), off = new Set(), is_on = submap => !off.has(submap);
  let mode = scene.has_colour ? 'image' : 'height', eye = {}, is_through = false, is_awaited = false, timer = 0;

  if (!scene.has_colour) find('[data-set=colour] [value=image]').textContent = 'grey';
  find('[data-set=colour]').value = mode;

  // Buffers.
  const points = program(gl, POINT_SHADER, ['position', 'folded', 'rgb']);
  const lines = program(gl, LINE_SHADER, ['begin', 'end', 'look']);
  const buffer = data => {
    const made = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, made);
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
    return made;
  };
  const columns = [
    [buffer(scene.position), 3, gl.UNSIGNED_SHORT], [buffer(scene.normal), 2, gl.BYTE], [buffer(scene.rgb), 3, gl.UNSIGNED_BYTE],
  ];
  const ribbons = {};
  const put = (name, rows) => {
    if (ribbons[name]) gl.deleteBuffer(ribbons[name].data);
    ribbons[name] = { data: buffer(new Float32Array(rows.flat())), n: rows.length };
  };
  const recolour = () => {
    gl.deleteBuffer(columns[2][0]);
    columns[2][0] = buffer(point_colours(scene, mode));
    Object.entries(layers(scene, mode, is_on)).forEach(([name, rows]) => put(name, rows));
    const of_mode = { height: scene.heights.map(v => (Math.round(100 * v) / 100 || 0).toFixed(2) + ' m'), uncertainty: scene.stds.map(v => (1000 * v).toFixed(1) + ' mm') };
    find('.ramp').hidden = !of_mode[mode];
    find('.ramp b').textContent = (of_mode[mode] ?? []).join(' to ');
    redraw();
  };

  // Which points are drawn.
  let visible = { n: 0 };
  const choose = () => {
    const chosen = Uint32Array.from({ length: scene.n_points }, (_, k) => k).filter(k => is_on(place_of.submap[k]));
    if (visible.data) gl.deleteBuffer(visible.data);
    visible = { data: gl.createBuffer(), n: chosen.length, chosen };
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, visible.data);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, chosen, gl.STATIC_DRAW);
  };
  choose();

  // Where the picture is taken from.
  const spread = [0, 1, 2].map(axis => {
    const values = [];
    const n = scene.n_points || n_frames, step = 1 + Math.floor(n / 5000);
    for (let k = 0; k < n; k += step) values.push(scene.n_points ? coordinate(scene, k, axis) : scene.frames.position[3 * k + axis]);
    return [quantile(values, 0.01), quantile(values, 0.99)];
  });
  const radius = Math.max(0.3, 0.5 * Math.hypot(...spread.map(([low, high]) => high - low)));
  const whole = pitch => {
    const aspect = Math.min(1, canvas.clientWidth / Math.max(canvas.clientHeight, 1));
    eye = { target: spread.map(([low, high]) => 0.5 * (low + high)), yaw: -0.6, pitch, distance: 0.8 * radius / Math.sin(HALF_FOV) / aspect };
    if (pitch > 1.5) eye.yaw = 0;
    is_through = false;
    redraw();
  };
  const pose = () => {
    const k = Number(slider.value);
    if (is_through && n_frames) {
      return [three(scene.frames.position, k), ...axes(scene.frames.rotation.slice(4 * k, 4 * k + 4))];
    }
    const [sy, cy, sp, cp] = [Math.sin(eye.yaw), Math.cos(eye.yaw), Math.sin(eye.pitch), Math.cos(eye.pitch)];
    const forward = [sy * cp, cy * cp, -sp], right = [cy, -sy, 0];
    return [add(eye.target, forward, -eye.distance), right, cross(forward, right), forward];
  };

  const draw = () => {
    is_awaited = false;
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map(v => Math.max(1, Math.round(v * ratio)));
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
    const [at, right, down, forward] = pose();
    const clip_from_page = projection(at, right, down, forward, width / height, is_through ? 0.05 : Math.max(0.05, 0.01 * eye.distance));
    gl.viewport(0, 0, width, height);
    gl.clearColor(...BACKGROUND, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    draw_points(clip_from_page, at, height, ratio);
    draw_lines(clip_from_page, width, height, ratio);
    last_view = { clip_from_page, at };
    place_labels(clip_from_page);
  };
  let last_view = null;
  const redraw = () => {
    if (!is_awaited) requestAnimationFrame(draw);
    is_awaited = true;
  };
  const draw_points = (clip_from_page, at, height, ratio) => {
    gl.useProgram(points.made);
    gl.enable(gl.DEPTH_TEST);
    columns.forEach(([data, n, kind], place) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, data);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, n, kind, true, 0, 0);
      gl.vertexAttribDivisor(place, 0);
    });
    gl.uniformMatrix4fv(points.at('clip_from_page'), false, clip_from_page);
    gl.uniform3fv(points.at('low'), scene.low);
    gl.uniform3fv(points.at('size'), scene.size);
    gl.uniform3fv(points.at('eye'), at);
    gl.uniform1f(points.at('dot_px_m'), 1.3 * scene.voxel_m * 0.5 * height / Math.tan(HALF_FOV));
    gl.uniform1f(points.at('least_px'), 1.5 * ratio);
    gl.uniform1i(points.at('backs'), shown.backs ? 1 : 0);
    gl.uniform1i(points.at('lit'), mode === 'image' && scene.has_colour ? 0 : 1);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, visible.data);
    gl.drawElements(gl.POINTS, visible.n, gl.UNSIGNED_INT, 0);
  };
  const draw_lines = (clip_from_page, width, height, ratio) => {
    // On top of the points, so that no wall hides the trajectory.
    gl.useProgram(lines.made);
    gl.disable(gl.DEPTH_TEST);
    gl.uniformMatrix4fv(lines.at('clip_from_page'), false, clip_from_page);
    gl.uniform2f(lines.at('half_px'), 0.5 * width, 0.5 * height);
    gl.uniform1f(lines.at('ratio'), ratio);
    for (const [name, { data, n }] of Object.entries(ribbons)) {
      if (shown[name] === false || !n) continue;
      gl.bindBuffer(gl.ARRAY_BUFFER, data);
      [[3, 0], [3, 12], [4, 24]].forEach(([count, offset], place) => {
        gl.enableVertexAttribArray(place);
        gl.vertexAttribPointer(place, count, gl.FLOAT, false, 40, offset);
        gl.vertexAttribDivisor(place, 1);
      });
      gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, n);
    }
  };

  // Names of maps that are apart.
  const labels = scene.parts.length < 2 ? [] : scene.parts.map(part => {
    const label = document.createElement('span');
    label.textContent = part.name;
    find('.stage').append(label);
    return { label, at: part.label, is_there: () => scene.submaps.some((submap, k) => submap.part === scene.parts.indexOf(part) && is_on(k)) };
  });

  // The distance between two points that were clicked.
  const ruler = document.createElement('span');
  let measured = [];
  ruler.className = 'ruler';
  find('.stage').append(ruler);
  const between = () => measured[0].at.map((v, i) => 0.5 * (v + measured.at(-1).at[i]));
  labels.push({ label: ruler, at: null, is_there: () => measured.length > 0 });
  const measure = picked => {
    measured = !picked ? [] : measured.length === 1 ? [measured[0], picked] : [picked];
    const [a, b] = measured;
    const dots = measured.map(({ at }) => [...at, ...at, ...MEASURE_COLOUR, 7]);
    const is_one_map = b && a.part === b.part;
    put('measured', is_one_map ? [...dots, [...a.at, ...b.at, ...MEASURE_COLOUR, 2]] : dots);
    // To a tenth of what the points are means of.
    const digits = Math.max(2, Math.ceil(1 - Math.log10(scene.voxel_m || 1)));
    const distance = b && Math.hypot(...a.at.map((v, i) => v - b.at[i]));
    ruler.textContent = !a ? '' : !b ? 'click a second point' : is_one_map ? `${distance.toFixed(digits)} m` : 'no distance: these maps are not joined';
    ruler.dataset.ends = JSON.stringify(measured.map(({ at }) => at));
    labels.at(-1).at = a ? between() : null;
    redraw();
  };
  // The nearest point that is seen about a place of the picture.
  const pick = event => {
    if (!last_view) return null;
    const box = canvas.getBoundingClientRect(), { clip_from_page, at: from } = last_view;
    let nearest = null;
    for (const k of visible.chosen) {
      const at = [0, 1, 2].map(axis => coordinate(scene, k, axis));
      const [x, y, , w] = projected(clip_from_page, at);
      if (w < 0.02 || nearest && w > nearest.w) continue;
      if (!shown.backs && dot(normal(scene, k), add(from, at, -1)) < 0) continue;
      const [dx, dy] = [box.left + box.width * (0.5 + 0.5 * x / w) - event.clientX, box.top + box.height * (0.5 - 0.5 * y / w) - event.clientY];
      if (Math.hypot(dx, dy) <= REACH_PX) nearest = { at, w, part: place_of.part[k] };
    }
    return nearest;
  };
  const place_labels = matrix => labels.forEach(({ label, at, is_there }) => {
    label.hidden = !is_there();
    if (label.hidden) return;
    const [x, y, , w] = projected(matrix, at);
    label.hidden = w < 0.05 || Math.abs(x) > w || Math.abs(y) > w;
    label.style.left = `${50 + 50 * x / w}%`;
    label.style.top = `${50 - 50 * y / w}%`;
  });

  // Plots follow the walk, and a click into one over time leads there. Of several runs on a page none does.
  const is_alone = document.querySelectorAll('.scene').length === 1;
  const plots = [...document.querySelectorAll('[data-follow]')].filter(() => is_alone).map(plot => {
    const [x0, x1, y0, y1, left, right, bottom, top] = plot.dataset.frame.split(' ').map(Number);
    const is_time = plot.dataset.follow === 'time', chosen = plot.dataset.follow.split(' ').map(Number);
    const now = document.createElement('i');
    now.className = is_time ? 'now line' : 'now dot';
    plot.append(now);
    if (is_time) now.style.cssText = `top:${100 * top}%;height:${100 * (bottom - top)}%`;
    const across = x => 100 * (left + (right - left) * (x - x0) / (x1 - x0));
    const up = y => 100 * (bottom + (top - bottom) * (y - y0) / (y1 - y0));
    if (is_time) plot.addEventListener('click', event => {
      const box = plot.getBoundingClientRect();
      const time = x0 + (x1 - x0) * ((event.clientX - box.left) / box.width - left) / (right - left);
      const { time_s } = scene.frames;
      let nearest = 0;
      time_s.forEach((t, k) => { if (Math.abs(t - time) < Math.abs(time_s[nearest] - time)) nearest = k; });
      slider.value = nearest;
      stop();
      walk();
    });
    const mark = (time, position) => {
      const [x, y] = is_time ? [time, y0] : chosen.map(axis => position[axis]);
      now.hidden = x < x0 || x > x1 || y < y0 || y > y1;
      now.style.left = `${across(x)}%`;
      if (!is_time) now.style.top = `${up(y)}%`;
    };
    return { mark };
  });

  // The walk along the frames.
  const walk = () => {
    const k = Number(slider.value), { frames } = scene;
    if (!n_frames) return;
    put('marker', is_through ? [] : marker(scene, k, 0.08 * radius));
    const std_m = frames.std_m[k], part = scene.parts.length > 1 ? `, ${scene.parts[frames.part[k]].name}` : '';
    const known = std_m >= 0 ? `, σ ${(1000 * std_m).toFixed(1)} mm` : '';
    plots.forEach(plot => plot.mark(frames.time_s[k], three(frames.position, k)));
    const robot = scene.robots.length ? `${scene.robots[frames.robot[k]].name}: ` : '';
    output.textContent = `${robot}frame ${frames.index[k]}, ${frames.time_s[k].toFixed(2)} s, ${STATES[frames.state[k]]}${known}${part}`;
    redraw();
  };
  const stop = () => { clearInterval(timer); timer = 0; find('[data-do=play]').textContent = 'play'; };
  const play = () => {
    if (timer) return stop();
    const last = Number(slider.max), step = Math.max(1, Math.round(last / 400));
    if (Number(slider.value) >= last) slider.value = 0;
    find('[data-do=play]').textContent = 'stop';
    timer = setInterval(() => {
      slider.value = Number(slider.value) + step;
      walk();
      if (Number(slider.value) >= last) stop();
    }, 40);
  };

  // Turning, moving, zooming with mouse and fingers.
  const fingers = new Map();
  let pressed = null;
  const pan = (dx, dy) => {
    const [, right, down] = pose(), metres = 2 * eye.distance * Math.tan(HALF_FOV) / Math.max(canvas.clientHeight, 1);
    eye.target = add(add(eye.target, right, -dx * metres), down, -dy * metres);
  };
  const zoom = factor => { eye.distance = Math.min(Math.max(eye.distance * factor, 0.05), 50 * radius); };
  const leave = () => { if (is_through) { is_through = false; walk(); } };
  const spread_of = () => {
    const [a, b] = [...fingers.values()];
    return { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2, apart: Math.max(1, Math.hypot(a.x - b.x, a.y - b.y)) };
  };
  canvas.addEventListener('pointerdown', event => {
    canvas.setPointerCapture(event.pointerId);
    pressed = fingers.size || event.button ? null : { x: event.clientX, y: event.clientY };
    fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  });
  const is_near = event => pressed && Math.hypot(event.clientX - pressed.x, event.clientY - pressed.y) < CLICK_PX;
  canvas.addEventListener('pointerup', event => { if (is_near(event) && !event.shiftKey) measure(pick(event)); });
  for (const kind of ['pointerup', 'pointercancel']) canvas.addEventListener(kind, event => fingers.delete(event.pointerId));
  canvas.addEventListener('pointermove', event => {
    const before = fingers.get(event.pointerId);
    if (!before || is_near(event)) return;
    pressed = null;
    leave();
    const two = fingers.size === 2 ? spread_of() : null;
    fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    const [dx, dy] = [event.clientX - before.x, event.clientY - before.y];
    if (two) {
      const now = spread_of();
      zoom(two.apart / now.apart);
      pan(now.x - two.x, now.y - two.y);
    } else if (event.shiftKey || event.buttons & 6) {
      pan(dx, dy);
    } else {
      eye.yaw += 0.008 * dx;
      eye.pitch = Math.min(Math.max(eye.pitch + 0.008 * dy, -1.57), 1.57);
    }
    redraw();
  });
  canvas.addEventListener('contextmenu', event => event.preventDefault());
  canvas.addEventListener('wheel', event => {
    event.preventDefault();
    leave();
    zoom(Math.exp(0.0015 * Math.min(Math.max(event.deltaY * (event.deltaMode ? 30 : 1), -300), 300)));
    redraw();
  }, { passive: false });

  // A page that is loaded again, as that of a run that goes on, is seen from the same place.
  const name = `tessera ${location.pathname} ${place}`;
  window.addEventListener('pagehide', () => {
    const value = { eye, mode, is_through, k: Number(slider.value), is_last: slider.value === slider.max };
    try { sessionStorage.setItem(name, JSON.stringify(value)); } catch { /* It is forgotten. */ }
  });
  const restore = () => {
    let kept = null;
    try { kept = JSON.parse(sessionStorage.getItem(name)); } catch { /* There is none. */ }
    if (!kept?.eye?.target) return;
    ({ eye, mode, is_through } = kept);
    find('[data-set=colour]').value = mode;
    slider.value = kept.is_last ? slider.max : kept.k;
  };

  // Controls.
  box.querySelectorAll('[data-show]').forEach(check => {
    const follow = () => { shown[check.dataset.show] = check.checked; redraw(); };
    check.addEventListener('change', follow);
    follow();
  });
  box.querySelectorAll('[data-submap]').forEach(check => check.addEventListener('change', () => {
    off[check.checked ? 'delete' : 'add'](Number(check.dataset.submap));
    choose();
    recolour();
  }));
  find('[data-set=colour]').addEventListener('change', event => { mode = event.target.value; recolour(); });
  slider.addEventListener('input', () => { stop(); walk(); });
  const buttons = { play, whole: () => whole(0.6), above: () => whole(1.57), camera: () => { is_through = true; } };
  box.querySelectorAll('[data-do]').forEach(button => button.addEventListener('click', () => { buttons[button.dataset.do](); walk(); }));
  new ResizeObserver(redraw).observe(canvas);
  whole(0.6);
  restore();
  recolour();
  walk();
}

document.querySelectorAll('.scene').forEach(view);
})();
