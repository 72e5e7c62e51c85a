//! ICL-NUIM: `associations.txt` with lines `number depth/0.png number rgb/0.png`, and poses in
//! `livingRoom0.gt.freiburg` by the same numbers. Associations with times are read as well, and under any
//! name: many programs have one write such a list for oneself.

use super::super::list::{self, ListEntry, SEPARATORS, is_inside};
use super::asked::ChosenCamera;
use super::files::{names, number_nanos, text, wrong};
use super::{Asked, FoundLayout, truth, tum};
use crate::SourceError;
use std::io::Read;
use std::path::{Path, PathBuf};
use tessera_evaluation::Trajectory;
use tessera_frames::cameras::named_camera;

pub(super) const NAME: &str = "ICL-NUIM (associations.txt)";

const LIST: &str = "associations.txt";
/// Of a text that may be such a list, as much as has its first lines.
const HEAD_BYTES: u64 = 4096;
const SECOND: i64 = 1_000_000_000;
/// End of the names of its trajectories.
const TRUTH: &str = ".gt.freiburg";

pub(super) fn is(folder: &Path) -> bool {
    list_in(folder).is_some()
}

/// The list of a folder: by its usual name, else the first text whose lines pair images that are there.
fn list_in(folder: &Path) -> Option<String> {
    if folder.join(LIST).is_file() {
        return Some(LIST.to_owned());
    }
    let pairs_images = |name: &String| {
        let (mut head, path) = (Vec::new(), folder.join(name));
        // To open a pipe would wait for its writer.
        let file = path.is_file().then(|| std::fs::File::open(&path).ok())??;
        file.take(HEAD_BYTES).read_to_end(&mut head).ok()?;
        let head = String::from_utf8_lossy(&head);
        let line = head.lines().map(str::trim).find(|line| !line.is_empty() && !line.starts_with('#'))?;
        AssociationRow::parse(line).filter(|row| folder.join(row.depth.1).is_file())?;
        Some(())
    };
    names(folder).into_iter().find(|name| name.ends_with(".txt") && pairs_images(name).is_some())
}

pub(super) fn read(folder: &Path, asked: &Asked) -> Result<FoundLayout, SourceError> {
    let list = list_in(folder).unwrap_or_else(|| LIST.to_owned());
    let path = folder.join(&list);
    let (mut rows, mut lines): (Vec<AssociationRow>, Vec<(usize, &str)>) = (Vec::new(), Vec::new());
    let all = text(&path)?;
    for (number, line) in (1..).zip(all.lines()) {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let row = AssociationRow::parse(line).ok_or_else(|| unusable(&path, number, line))?;
        rows.push(row);
        lines.push((number, line));
    }
    if rows.is_empty() {
        return Err(SourceError::EmptyList { path });
    }
    let words: Vec<&str> = rows.iter().flat_map(|row| [row.depth.0, row.colour.0]).collect();
    let (stamps, is_numbered) = list::stamps(&words).map_err(|(at, _)| {
        let (number, line) = lines.get(at / 2).copied().unwrap_or_default();
        unusable(&path, number, line)
    })?;
    let entry =
        |stamp_nanos: &i64, file: &str| ListEntry { stamp_nanos: *stamp_nanos, file: PathBuf::from(file) };
    let pairs = rows.iter().zip(stamps.as_chunks().0);
    let (depth, colour): (Vec<ListEntry>, Vec<ListEntry>) =
        pairs.map(|(row, [depth, colour])| (entry(depth, row.depth.1), entry(colour, row.colour.1))).unzip();
    let units = tum::UNITS_PER_METRE;
    let chosen =
        asked.camera_or_beside(folder, &depth, units, || match is_numbered && is_of_icl(folder) {
            true => Ok(Some(ChosenCamera::assumed(named_camera("icl")?, "icl, that of ICL-NUIM"))),
            false => tum::camera_by_name(folder),
        })?;
    let (fps, how) = asked.rate(chosen.fps);
    let time =
        |nanos: i64| if is_numbered { number_nanos((nanos / SECOND).unsigned_abs(), fps) } else { nanos };
    let at_time = |entries: Vec<ListEntry>| -> Vec<ListEntry> {
        let entry = |entry: ListEntry| ListEntry { stamp_nanos: time(entry.stamp_nanos), ..entry };
        entries.into_iter().map(entry).collect()
    };
    let (depth, colour, sentences) =
        list::in_order(at_time(depth), at_time(colour), [list.as_str(), "its colour"]);
    let mut found = FoundLayout::new(NAME, chosen, depth, colour);
    found.warnings.extend(sentences);
    if list != LIST {
        found.notes.push(("list", list));
    }
    let truth = ground_truth(folder, &time).map(|truth| {
        truth.map(|(truth, sentence)| {
            found.warnings.extend(sentence);
            truth
        })
    });
    found.take_truth(truth);
    if is_numbered {
        found.notes.push(("times", how));
    }
    Ok(found)
}

/// Whether something besides the form says that the recording is of ICL-NUIM.
fn is_of_icl(folder: &Path) -> bool {
    const WORDS: [&str; 5] = ["icl", "livingroom", "living_room", "office_room", "traj"];
    let absolute = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
    let name = absolute.file_name().map(|name| name.to_string_lossy().to_lowercase()).unwrap_or_default();
    let is_named = WORDS.iter().any(|word| name.split(['-', ' ', '.']).any(|part| part.starts_with(word)));
    is_named || names(folder).iter().any(|name| name.ends_with(TRUTH))
}

fn unusable(path: &Path, line: usize, found: &str) -> SourceError {
    let is_pair = found.split(SEPARATORS).filter(|word| !word.is_empty()).count() == 2;
    let mend = match is_pair.then(|| path.file_name()).flatten() {
        Some(name) => {
            let name = name.to_string_lossy();
            format!(
                "; pairs without times are numbered by: awk '{{print NR, $1, NR, $2}}' {name} > a.txt && mv a.txt {name}"
            )
        }
        None => String::new(),
    };
    wrong(path, format!("line {line}: found '{found}', expected: number depth/FILE number rgb/FILE{mend}"))
}

/// Poses by number or time, as the images have.
fn ground_truth(
    folder: &Path,
    time: &impl Fn(i64) -> i64,
) -> Result<Option<(Trajectory, Option<String>)>, SourceError> {
    let names = names(folder);
    let name = names.iter().find(|name| name.ends_with(TRUTH) || *name == "groundtruth.txt");
    let Some(name) = name else { return Ok(None) };
    let (by_number, sentence) = truth::of_tum(&folder.join(name))?;
    let mut truth = Trajectory::default();
    for (stamp, pose) in by_number.stamps_nanos.iter().zip(&by_number.poses) {
        // Stamps that rise rise at any rate.
        let _ = truth.push(time(*stamp), *pose);
    }
    Ok(Some((truth, sentence)))
}

/// One pair of images: stamp and file of each.
struct AssociationRow<'a> {
    depth: (&'a str, &'a str),
    colour: (&'a str, &'a str),
}

impl<'a> AssociationRow<'a> {
    /// Reads a line; which of the two images is depth is told by its path.
    fn parse(line: &'a str) -> Option<Self> {
        let words: Vec<&str> = line.split(SEPARATORS).filter(|word| !word.is_empty()).collect();
        let [a, a_file, b, b_file] = words[..] else { return None };
        if ![a_file, b_file].iter().all(|file| is_inside(Path::new(file))) {
            return None;
        }
        match (a_file.contains("depth"), b_file.contains("depth")) {
            (true, false) => Some(Self { depth: (a, a_file), colour: (b, b_file) }),
            (false, true) => Some(Self { depth: (b, b_file), colour: (a, a_file) }),
            _ => None,
        }
    }
}
