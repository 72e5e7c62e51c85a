//! Valid folders in several layouts, and faults of one file.

use super::*;

/// A valid folder.
pub(super) struct ValidFolder {
    pub(super) name: &'static str,
    images: Vec<(String, Vec<u8>)>,
    texts: Vec<(&'static str, String)>,
}

/// A file that became another.
pub(super) struct Fault {
    file: String,
    before: Vec<u8>,
    after: Option<(String, Vec<u8>)>,
    pub(super) words: String,
}

impl Fault {
    pub(super) fn make(&self, folder: &Path) {
        fs::remove_file(folder.join(&self.file)).unwrap();
        if let Some((name, bytes)) = &self.after {
            fs::write(folder.join(name), bytes).unwrap();
        }
    }

    pub(super) fn mend(&self, folder: &Path) {
        if let Some((name, _)) = &self.after {
            fs::remove_file(folder.join(name)).unwrap();
        }
        fs::write(folder.join(&self.file), &self.before).unwrap();
    }
}

const CAMERA_JSON: &str = "{\n\"width\": 320,\n\"height\": 240,\n\"intrinsic_matrix\": [262.5, 0, 0, 0, 262.5, 0, 159.5, 119.5, 1],\n\"depth_scale\": 1000.0,\n\"fps\": 30.0\n}\n";
const CAMERA_YAML: &str = "image_width: 320\nimage_height: 240\ncamera_name: depth\ncamera_matrix:\n  rows: 3\n  cols: 3\n  data: [262.5, 0, 159.5, 0, 262.5, 119.5, 0, 0, 1]\ndistortion_model: plumb_bob\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [0, 0, 0, 0, 0]\n";
const INFO: &str = "m_depthWidth = 320\nm_depthHeight = 240\nm_depthShift = 1000\nm_calibrationDepthIntrinsic = 262.5 0 159.5 0 0 262.5 119.5 0 0 0 1 0 0 0 0 1\n";

pub(super) fn all(frames: &[Simulated]) -> Vec<ValidFolder> {
    let images = |depth: &dyn Fn(usize) -> String, colour: &dyn Fn(usize) -> String| {
        let mut images = Vec::new();
        for (k, frame) in frames.iter().enumerate() {
            images.push((depth(k), png(bytemuck::cast_slice(&frame.depth), ExtendedColorType::L16)));
            images.push((colour(k), png(&frame.rgb, ExtendedColorType::Rgb8)));
        }
        images
    };
    let stamp = |k: usize| format!("{:.6}", frames[k].stamp_nanos as f64 / 1e9);
    let list = |line: &dyn Fn(usize) -> String| (0..frames.len()).map(line).collect::<String>();
    let toml = toml::to_string(&camera()).unwrap();
    let (depth, colour) = (|k| format!("depth/{k}.png"), |k| format!("rgb/{k}.png"));
    vec![
        ValidFolder {
            name: "TUM",
            images: images(&depth, &colour),
            texts: vec![
                ("depth.txt", list(&|k| format!("{} depth/{k}.png\n", stamp(k)))),
                ("rgb.txt", list(&|k| format!("{} rgb/{k}.png\n", stamp(k)))),
                ("camera.toml", toml.clone()),
            ],
        },
        ValidFolder {
            name: "associations",
            images: images(&depth, &colour),
            texts: vec![
                ("associations.txt", list(&|k| format!("{0} depth/{k}.png {0} rgb/{k}.png\n", stamp(k)))),
                ("camera.yaml", CAMERA_YAML.to_owned()),
            ],
        },
        ValidFolder {
            name: "Open3D",
            images: images(&|k| format!("depth/{k:05}.png"), &|k| format!("color/{k:05}.png")),
            texts: vec![("intrinsic.json", CAMERA_JSON.to_owned())],
        },
        ValidFolder {
            name: "names as times",
            images: images(&|k| format!("depth/{}.png", frames[k].stamp_nanos), &|k| {
                format!("color/{}.png", frames[k].stamp_nanos)
            }),
            texts: vec![("camera.yaml", CAMERA_YAML.to_owned())],
        },
        ValidFolder {
            name: "7-Scenes names",
            images: images(&|k| format!("frame-{k:06}.depth.png"), &|k| format!("frame-{k:06}.color.png")),
            texts: vec![("info.txt", INFO.to_owned())],
        },
    ]
}

impl ValidFolder {
    pub(super) fn written(&self) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        let texts = self.texts.iter().map(|(name, text)| (*name, text.as_bytes()));
        for (name, bytes) in self.images.iter().map(|(name, bytes)| (name.as_str(), &bytes[..])).chain(texts)
        {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, bytes).unwrap();
        }
        folder
    }

    /// A fault by chance; `None`: the name is taken.
    pub(super) fn fault(&self, chance: &mut SplitMix64) -> Option<Fault> {
        if chance.below(3) > 0 {
            let (name, text) = &self.texts[chance.below(self.texts.len())];
            let after = fault_of_text(name, text, chance);
            return Some(Fault {
                file: (*name).to_owned(),
                before: text.clone().into_bytes(),
                words: format!("{name}:\n{after}"),
                after: Some(((*name).to_owned(), after.into_bytes())),
            });
        }
        let (file, before) = &self.images[chance.below(self.images.len())];
        let (inside, name) =
            file.rsplit_once('/').map_or(("", file.as_str()), |(inside, name)| (inside, name));
        let renamed = |name: String| {
            let full = if inside.is_empty() { name } else { format!("{inside}/{name}") };
            let is_taken = self.images.iter().any(|(known, _)| *known == full);
            (!is_taken).then(|| (full, before.clone()))
        };
        let after = match chance.below(6) {
            0 => Some(renamed(format!("copy of {name}"))?),
            1 => Some(renamed(name.replace('0', "9"))?),
            2 => Some(renamed(name.replacen('.', "_small.", 1))?),
            3 => Some(renamed(format!("1{name}"))?),
            4 => {
                let mut bytes = before.clone();
                let at = chance.below(bytes.len().min(60));
                bytes[at] ^= 1 << chance.below(8);
                Some((file.clone(), bytes))
            }
            _ => None,
        };
        let words = match &after {
            Some((name, _)) if name == file => format!("a bit of the head of {file} is another"),
            Some((name, _)) => format!("{file} became {name}"),
            None => format!("{file} is gone"),
        };
        Some(Fault { file: file.clone(), before: before.clone(), after, words })
    }
}

/// A fault in the text of a file. Of a camera no digit changes: another number is another camera.
fn fault_of_text(name: &str, text: &str, chance: &mut SplitMix64) -> String {
    let is_list = ["depth.txt", "rgb.txt", "associations.txt"].contains(&name);
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let line = chance.below(lines.len());
    match chance.below(7) {
        0 => drop(lines.remove(line)),
        1 if is_list => lines.insert(line, lines[line].clone()),
        2 => {
            let other = chance.below(lines.len());
            lines.swap(line, other);
        }
        3 => {
            let cut = &text[..chance.below(text.len())];
            let is_digit = |c: char| c.is_ascii_digit() || c == '.';
            return if is_list { cut.to_owned() } else { cut.trim_end_matches(is_digit).to_owned() };
        }
        4 if is_list => {
            let is_set_back = chance.below(2) == 0;
            for line in lines.iter_mut().skip(line) {
                let rest = line.split_once(' ').map_or(String::new(), |(_, rest)| rest.to_owned());
                *line =
                    if is_set_back { line.replacen("17000000", "16999999", 1) } else { format!("0 {rest}") };
            }
        }
        _ => {
            let at = chance.below(text.len());
            let is_number = |byte: u8| byte.is_ascii_digit() || [b'.', b'-'].contains(&byte);
            let into = b' ' + chance.below(95) as u8;
            if is_list || !(is_number(text.as_bytes()[at]) || is_number(into)) {
                let mut changed = text.to_owned();
                changed.replace_range(at..=at, &char::from(into).to_string());
                return changed;
            }
        }
    }
    lines.join("\n") + "\n"
}
