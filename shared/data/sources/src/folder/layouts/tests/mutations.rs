//! Folders with a fault, made by chance from valid ones: each is refused, or says what is wrong, or has
//! the frames of the valid one.

use super::*;
use tessera_numerics::SplitMix64;

/// Folders made; each from a seed of its own.
const N_MUTATIONS: u64 = 2000;
const N_FRAMES: u16 = 12;
/// Kinds of folders: a third of them with depth as OpenEXR.
const N_KINDS: usize = 6;
const UNITS_PER_METRE: f32 = 2000.0;
/// One colour stamp that is off moves the frames behind it by its share of the running offset (method 1.7): so many
/// nanoseconds are less than a millimetre of a camera that walks.
const SAME_TIME_NANOS: u64 = 2_000_000;

/// `TESSERA_SEED=N` tries others.
fn first_seed() -> u64 {
    std::env::var("TESSERA_SEED").map_or(0, |seed| seed.parse().unwrap())
}

/// A valid folder: its images by name, and its text files.
struct Valid {
    images: Vec<(String, Vec<u8>)>,
    texts: Vec<(&'static str, String)>,
    has_times: bool,
}

const CAMERA_FILES: [&str; 4] = ["camera.toml", "intrinsic.json", "info.txt", "metadata.json"];

/// An OpenEXR image of one depth in metres, not compressed.
pub(super) fn exr_of((width, height): (u32, u32), metres: f32) -> Vec<u8> {
    let attribute = |name: &str, value: &[u8]| {
        [name.as_bytes(), b"\0x\0", &(value.len() as u32).to_le_bytes(), value].concat()
    };
    let window = [0, 0, width - 1, height - 1].map(u32::to_le_bytes).concat();
    let channels = b"Z\0\x02\0\0\0\0\0\0\0\x01\0\0\0\x01\0\0\0\0";
    let mut file = b"\x76\x2f\x31\x01\x02\0\0\0".to_vec();
    file.extend([attribute("channels", channels), attribute("compression", &[0])].concat());
    file.extend([attribute("dataWindow", &window), vec![0]].concat());
    let begin = file.len() as u32 + 8 * height;
    (0..height).for_each(|row| file.extend(u64::from(begin + row * (8 + 4 * width)).to_le_bytes()));
    for row in 0..height {
        file.extend([row, 4 * width].map(u32::to_le_bytes).concat());
        file.extend(metres.to_le_bytes().repeat(width as usize));
    }
    file
}

/// Images of depth whose value is their number, and of colour.
fn images(depth: impl Fn(u16) -> String, colour: impl Fn(u16) -> String) -> Vec<(String, Vec<u8>)> {
    let folder = Folder::new();
    folder.colour("c.jpg", SIZE, 90);
    let jpg = fs::read(folder.path().join("c.jpg")).unwrap();
    let mut images = Vec::new();
    for k in 0..N_FRAMES {
        folder.depth("d.png", 1000 + k);
        images.push((depth(k), fs::read(folder.path().join("d.png")).unwrap()));
        images.push((colour(k), jpg.clone()));
    }
    images
}

fn valid(kind: usize) -> Valid {
    let exr = |depth: fn(u16) -> String, colour: fn(u16) -> String| {
        let mut images = images(depth, colour);
        for (pair, k) in images.chunks_mut(2).zip(0_u16..) {
            pair[0].1 = exr_of(SIZE, f32::from(1000 + k) / UNITS_PER_METRE);
        }
        images
    };
    let json = r#"{"width": 32, "height": 24, "intrinsic_matrix": [30.0, 0, 0, 0, 30.0, 0, 15.5, 11.5, 1], "depth_scale": 2000.0, "fps": 15.0}"#;
    let info = "m_depthWidth = 32\nm_depthHeight = 24\nm_depthShift = 2000\nm_calibrationDepthIntrinsic = 30 0 15.5 0 0 30 11.5 0 0 0 1 0 0 0 0 1\n";
    match kind {
        0 => {
            let stamp = |k: u16| format!("1700000000.{:06}", 100_000 + u32::from(k) * 33_333);
            let list = |end: &str| {
                (0..N_FRAMES).map(|k| format!("{} {end}/{k}.{end}\n", stamp(k))).collect::<String>()
            };
            let truth: String = (0..N_FRAMES).map(|k| format!("{} 0 0 {k} 0 0 0 1\n", stamp(k))).collect();
            Valid {
                images: images(|k| format!("png/{k}.png"), |k| format!("jpg/{k}.jpg")),
                texts: vec![
                    ("depth.txt", list("png")),
                    ("rgb.txt", list("jpg")),
                    ("groundtruth.txt", truth),
                    ("camera.toml", CAMERA.to_owned()),
                ],
                has_times: true,
            }
        }
        1 => Valid {
            images: images(|k| format!("depth/{k:05}.png"), |k| format!("color/{k:05}.jpg")),
            texts: vec![("intrinsic.json", json.to_owned())],
            has_times: false,
        },
        2 => {
            let name = |k: u16| 1_700_000_000_100_000_000_u64 + u64::from(k) * 33_333_333;
            Valid {
                images: images(|k| format!("depth/{}.png", name(k)), |k| format!("color/{}.jpg", name(k))),
                texts: vec![("intrinsic.json", json.to_owned())],
                has_times: true,
            }
        }
        3 => Valid {
            images: exr(|k| format!("depth/{k:05}.exr"), |k| format!("color/{k:05}.jpg")),
            texts: vec![("intrinsic.json", json.to_owned())],
            has_times: false,
        },
        4 => {
            let times: Vec<String> =
                (0..N_FRAMES).map(|k| format!("{}", 7.5 + f64::from(k) / 30.0)).collect();
            let text = format!(
                "{{\"w\": 32, \"h\": 24,\n\"K\": [30.0, 0, 0, 0, 30.0, 0, 15.5, 11.5, 1],\n\"fps\": 30,\n\"frameTimestamps\": [{}]}}",
                times.join(", ")
            );
            Valid {
                images: exr(|k| format!("depth/{k}.exr"), |k| format!("rgb/{k}.jpg")),
                texts: vec![("metadata.json", text)],
                has_times: true,
            }
        }
        _ => Valid {
            images: images(|k| format!("frame-{k:06}.depth.png"), |k| format!("frame-{k:06}.color.jpg")),
            texts: vec![("info.txt", info.to_owned())],
            has_times: false,
        },
    }
}

/// A fault in the text of a file. Of a camera no digit changes: another number is another camera.
fn fault_of_text(name: &str, text: &str, chance: &mut SplitMix64) -> String {
    let is_camera = CAMERA_FILES.contains(&name);
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let line = chance.below(lines.len());
    match chance.below(7) {
        0 => drop(lines.remove(line)),
        1 if !is_camera => lines.insert(line, lines[line].clone()),
        2 => {
            let other = chance.below(lines.len());
            lines.swap(line, other);
        }
        3 => {
            let cut = &text[..chance.below(text.len())];
            let is_digit = |c: char| c.is_ascii_digit() || c == '.';
            return if is_camera { cut.trim_end_matches(is_digit).to_owned() } else { cut.to_owned() };
        }
        4 if !is_camera => {
            // The clock is set back, or the stamps are not set.
            let is_set_back = chance.below(2) == 0;
            for line in lines.iter_mut().skip(line) {
                let rest = line.split_once(' ').map_or(String::new(), |(_, rest)| rest.to_owned());
                *line =
                    if is_set_back { line.replacen("17000000", "16999999", 1) } else { format!("0 {rest}") };
            }
        }
        _ => {
            let at = chance.below(text.len());
            let is_number =
                text.as_bytes()[at].is_ascii_digit() || [b'.', b'-'].contains(&text.as_bytes()[at]);
            let into = char::from(b' ' + chance.below(95) as u8);
            if !(is_camera && (is_number || into.is_ascii_digit() || into == '.' || into == '-')) {
                let mut changed = text.to_owned();
                changed.replace_range(at..=at, &into.to_string());
                return changed;
            }
        }
    }
    lines.join("\n") + "\n"
}

/// What is seen of a folder: value and time of each depth image that can be read.
fn frames(source: &FolderSource) -> Vec<(u16, i64)> {
    let n = (SIZE.0 * SIZE.1) as usize;
    let (mut depth, mut colour) = (vec![0; n], vec![0; 3 * n]);
    let mut seen = Vec::new();
    for index in 0..source.n_frames().unwrap() {
        let mut buffers = FrameBuffers { depth: &mut depth, colour: &mut colour };
        if source.read_what_is_there(index, &mut buffers).unwrap().1.is_none() {
            seen.push((depth[n / 2], source.stamp_nanos(index).unwrap()));
        }
    }
    seen
}

/// A valid folder that is there, and what is seen of it.
struct Made {
    of: Valid,
    folder: Folder,
    expected: Vec<(u16, i64)>,
    camera: tessera_geometry::Camera,
}

fn made(kind: usize) -> Made {
    let (of, folder) = (valid(kind), Folder::new());
    of.images.iter().for_each(|(name, bytes)| folder.write(name, bytes));
    of.texts.iter().for_each(|(name, text)| folder.write(name, text));
    let whole = folder.open();
    let (expected, camera) = (frames(&whole), whole.camera().clone());
    assert_eq!((expected.len(), whole.warnings()), (usize::from(N_FRAMES), &[] as &[String]));
    Made { of, folder, expected, camera }
}

/// Renames or removes an image; answers its name, and the new one if it has one.
fn fault_of_image(made: &Made, chance: &mut SplitMix64) -> (usize, String) {
    let at = chance.below(made.of.images.len());
    let before = &made.of.images[at].0;
    let (inside, name) =
        before.rsplit_once('/').map_or((String::new(), before.as_str()), |(a, b)| (format!("{a}/"), b));
    let renamed = match chance.below(5) {
        0 => format!("copy of {name}"),
        1 => name.replace('0', "9"),
        2 => name.replacen('.', "_small.", 1),
        3 => format!("1{name}"),
        _ => return (at, String::new()),
    };
    (at, format!("{inside}{renamed}"))
}

#[test]
fn a_folder_with_a_fault_is_refused_or_says_so_or_is_read_as_without_it() {
    let kinds: Vec<Made> = (0..N_KINDS).map(made).collect();
    let (mut n_refused, mut n_warned, mut n_same) = (0, 0, 0);
    let mut silent = Vec::new();
    let first = first_seed();
    for seed in first..first + N_MUTATIONS {
        let mut chance = SplitMix64::new(seed);
        let made = &kinds[chance.below(kinds.len())];
        let path = |name: &str| made.folder.path().join(name);
        let (what, (name, content), extra) = if chance.below(3) == 0 {
            let (at, renamed) = fault_of_image(made, &mut chance);
            let (name, content) = &made.of.images[at];
            if path(&renamed).is_file() {
                continue;
            }
            fs::remove_file(path(name)).unwrap();
            if !renamed.is_empty() {
                made.folder.write(&renamed, content);
            }
            (format!("{name} became '{renamed}'"), (name.as_str(), content.as_slice()), renamed)
        } else {
            let (name, text) = &made.of.texts[chance.below(made.of.texts.len())];
            let fault = fault_of_text(name, text, &mut chance);
            made.folder.write(name, &fault);
            (format!("{name}:\n{fault}"), (*name, text.as_bytes()), String::new())
        };
        match FolderSource::open(made.folder.path(), None, None) {
            Err(_) => n_refused += 1,
            Ok(source) if !(source.warnings().is_empty() && source.doubts().is_empty()) => n_warned += 1,
            Ok(source) => {
                n_same += 1;
                let found = frames(&source);
                let values: Vec<u16> = found.iter().map(|(value, _)| *value).collect();
                // An image that is gone from the list or the folder is a gap; one that is broken is named when it is read.
                let n_read_or_named = source.n_frames().unwrap() as usize;
                let is_same = values.is_sorted()
                    && n_read_or_named + 1 >= made.expected.len()
                    && source.camera() == &made.camera;
                // Frames that have a number and no time have that of a rate, which the camera file may state.
                let is_as_before = |(value, stamp): &&(u16, i64)| {
                    let is_near = |before: &&(u16, i64)| before.1.abs_diff(*stamp) <= SAME_TIME_NANOS;
                    made.expected.iter().filter(is_near).any(|before| before.0 == *value)
                };
                let n_as_before = found.iter().filter(is_as_before).count();
                // A run without a single image that can be read is refused.
                let is_read = !found.is_empty();
                if is_read && (!is_same || (made.of.has_times && n_as_before + 2 < made.expected.len())) {
                    silent.push(format!("seed {seed}: {what}\n{found:?}"));
                }
            }
        }
        if !extra.is_empty() {
            fs::remove_file(path(&extra)).unwrap();
        }
        made.folder.write(name, content);
    }
    let first = silent[..silent.len().min(12)].join("\n");
    assert!(silent.is_empty(), "{} are read otherwise without a word:\n{first}", silent.len());
    // Each of these happens, so that none of the rules above is empty.
    assert!(n_refused > 100 && n_warned > 100 && n_same > 100, "{n_refused} {n_warned} {n_same}");
}

/// A `.r3d` with changed bytes: in its metadata, lists and images alike.
#[test]
fn a_packed_recording_with_a_fault_is_refused_or_says_so_or_is_read_as_without_it() {
    let folder = super::record3d::recording(
        r#", "dw": 32, "dh": 32, "frameTimestamps": [7.5, 7.6, 7.7, 7.8, 7.9, 8.0, 8.1, 8.2, 8.3, 8.4, 8.5]"#,
    );
    let path = super::record3d::packed(&folder, "a.r3d", true);
    let whole = fs::read(&path).unwrap();
    let (n, mut n_refused, mut n_broken, mut n_same) = (32 * 32, 0, 0, 0);
    let read = || {
        let source =
            crate::open(&crate::SourceSpec::parse(&path.display().to_string()), &SourceOptions::default())
                .map_err(|_| true)?;
        let mut seen = Vec::new();
        for index in 0..source.n_frames().unwrap() {
            let (mut depth, mut colour) = (vec![0; n], vec![0; 3 * n]);
            let mut buffers = FrameBuffers { depth: &mut depth, colour: &mut colour };
            source.read(index, &mut buffers).map_err(|_| false)?;
            seen.push((source.stamp_nanos(index), depth, colour));
        }
        Ok((source.camera().clone(), source.warnings().to_vec(), seen))
    };
    let expected = read().unwrap();
    for seed in first_seed()..first_seed() + 400 {
        let mut chance = SplitMix64::new(seed);
        let mut bytes = whole.clone();
        // Half of them in the list at the end, where names are.
        let from = if seed % 2 == 0 { whole.len() - 900 } else { 0 };
        let at = from + chance.below(whole.len() - from);
        match chance.below(4) {
            0 => bytes.truncate(at),
            1 => drop(bytes.remove(at)),
            _ => bytes[at] ^= 1 << chance.below(8),
        }
        fs::write(&path, bytes).unwrap();
        match read() {
            Err(true) => n_refused += 1,
            Err(false) => n_broken += 1,
            Ok((_, warnings, _)) if !warnings.is_empty() => n_broken += 1,
            Ok((camera, _, seen)) => {
                // A file whose name changed is a gap.
                assert_eq!(camera, expected.0, "seed {seed}");
                assert!(seen.len() + 1 >= expected.2.len(), "seed {seed}");
                let is_as_before = |frame| expected.2.contains(frame);
                let n_same_frames = seen.iter().filter(|frame| is_as_before(frame)).count();
                assert!(n_same_frames + 1 >= seen.len(), "seed {seed}: {n_same_frames} of {}", seen.len());
                n_same += 1;
            }
        }
    }
    assert!(n_refused > 50 && n_broken > 20 && n_same > 20, "{n_refused} {n_broken} {n_same}");
}
