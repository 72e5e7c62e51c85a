//! Open3D and Redwood: `depth/` in millimetres, `color/`, `images/` or `rgb/`, a pinhole camera in
//! JSON, poses in a `.log`; and whatever else has depth and colour in two folders. Names hold frame
//! numbers or times; Redwood's hold both, `000012-000000400000.png`, microseconds.

use super::super::list::ListEntry;
use super::super::names::{MOST_FRAME_STEP, NameMeaning, Understood, understand};
use super::asked::ChosenCamera;
use super::files::{names, number_nanos, size_of, some_depth, wrong};
use super::{Asked, FoundLayout, pose};
use crate::SourceError;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use tessera_frames::cameras::named_camera;

pub(super) const NAME: &str = "Open3D or Redwood (depth/, color/, camera JSON)";

const DEPTH: &str = "depth";
/// Ends of the names of depth images.
const DEPTH_ENDS: [&str; 6] = ["png", "pgm", "npy", "tif", "tiff", "exr"];
const COLOUR_FOLDERS: [&str; 10] =
    ["color", "colour", "image", "images", "rgb", "img", "imgs", "colors", "rgb_images", "color_images"];
const UNITS_PER_METRE: f64 = 1000.0;
/// Digits of Redwood's names: a running number, and microseconds.
const REDWOOD_DIGITS: (std::ops::RangeInclusive<usize>, usize) = (6..=7, 12);

pub(super) fn is(folder: &Path) -> bool {
    depth_folder(folder).is_some()
}

/// The folder of depth: `depth` in any capitals, else the only one with depth images and `depth` in its name.
fn depth_folder(folder: &Path) -> Option<String> {
    let has_depth = |name: &String| {
        let is_depth =
            |file: &String| DEPTH_ENDS.iter().any(|end| file.to_lowercase().ends_with(&format!(".{end}")));
        names(&folder.join(name)).iter().any(is_depth)
    };
    the_one(folder, |name| name == DEPTH, |name| name.contains(DEPTH), has_depth)
}

/// The folder of colour: one of the usual names, else the only one with such a word in its name.
fn colour_folder(folder: &Path, depth: &str) -> Option<String> {
    let is_named = |name: &str| {
        !name.contains(DEPTH) && ["color", "colour", "rgb"].iter().any(|word| name.contains(word))
    };
    let usual = |name: &str| COLOUR_FOLDERS.contains(&name);
    the_one(folder, usual, is_named, |name| name != depth)
}

/// The first folder inside whose name is usual, in small letters, else the only one that is named so.
fn the_one(
    folder: &Path,
    is_usual: impl Fn(&str) -> bool,
    is_named: impl Fn(&str) -> bool,
    is_good: impl Fn(&String) -> bool,
) -> Option<String> {
    let named: Vec<String> = names(folder)
        .into_iter()
        .filter(|name| is_named(&name.to_lowercase()) || is_usual(&name.to_lowercase()))
        .filter(|name| folder.join(name).is_dir() && is_good(name))
        .collect();
    let usual = named.iter().find(|name| is_usual(&name.to_lowercase()));
    usual.or(named.first().filter(|_| named.len() == 1)).cloned()
}

pub(super) fn read(folder: &Path, asked: &Asked) -> Result<FoundLayout, SourceError> {
    let depth_folder = depth_folder(folder).unwrap_or_else(|| DEPTH.to_owned());
    let mut depth = NamedImages::of(folder, &depth_folder, &DEPTH_ENDS, asked)?;
    let colour_folder = colour_folder(folder, &depth_folder);
    let mut colour = match &colour_folder {
        Some(name) => NamedImages::of(
            folder,
            name,
            &["jpg", "jpeg", "png", "bmp", "webp", "tif", "tiff", "ppm", "pgm"],
            asked,
        )?,
        None => NamedImages::default(),
    };
    let moved = colour.moved_to(&mut depth);
    let is_redwood = depth.stems.first().is_some_and(|stem| is_of_redwood(stem));
    let chosen = asked.camera_or_beside(folder, &depth.unset(), UNITS_PER_METRE, || {
        let is_it = is_redwood && size_of(folder, &depth.unset())? == (640, 480);
        Ok(match is_it {
            true => {
                let from = "the PrimeSense default of Redwood, 525 px, by the names of the images";
                Some(ChosenCamera::assumed(named_camera("primesense")?, from))
            }
            false => None,
        })
    })?;
    let (fps, words) = asked.rate(chosen.fps);
    let times = depth.times(asked.fps.is_some(), fps);
    let (words, has_times) = match &depth.meaning {
        NameMeaning::Times(_, how) if asked.fps.is_none() => (how.clone(), true),
        _ => (words, false),
    };
    let entries = some_depth(depth.entries(&times), folder, "depth/NUMBER.png")?;
    let n_same = depth.files.len().saturating_sub(entries.len());
    let colour_times = match &moved {
        // One for one, in the order of their numbers.
        Some(_) => times.clone(),
        None => colour.times_beside(&depth, &times, asked.fps.is_some(), fps, has_times),
    };
    let mut found = FoundLayout::new(NAME, chosen, entries, colour.entries(&colour_times));
    found.no_colour = match &colour_folder {
        Some(name) if colour.files.is_empty() => Some(format!("{name}/ holds no images")),
        Some(_) => None,
        None => {
            Some(format!("there is none of the folders {} beside depth/", COLOUR_FOLDERS[..5].join(", ")))
        }
    };
    if colour_folder.is_none() {
        found.take_video_beside(folder, asked);
    }
    if n_same > 0 {
        found.warnings.push(format!("{n_same} depth images repeat the time of another and are left out"));
    }
    found.warnings.extend(depth.warning.iter().chain(&colour.warning).cloned());
    found.warnings.extend(moved);
    if !has_times && asked.fps.is_none() {
        found.warnings.extend(unread_times(folder));
    }
    found.warnings.extend(depth.wide_steps(fps).filter(|_| asked.fps.is_none()));
    // Open3D's own sample has odometry.log beside trajectory.log: motions from frame to frame.
    let logs: Vec<String> = names(folder).into_iter().filter(|name| name.ends_with(".log")).collect();
    if let Some(log) = logs.iter().find(|name| !name.contains("odometry")) {
        let times: Vec<i64> = found.depth.iter().map(|entry| entry.stamp_nanos).collect();
        found.take_truth(pose::of_log(&folder.join(log), &times));
    }
    found.notes.push(("times", words));
    Ok(found)
}

/// A file that may hold the times of images whose names have none: which of them it counts, and in what,
/// nothing says.
fn unread_times(folder: &Path) -> Option<String> {
    let is_text =
        |name: &str| ["txt", "csv", "json", "npy"].iter().any(|end| name.ends_with(&format!(".{end}")));
    let is_named = |name: &str| is_text(name) && (name.contains("time") || name.contains("stamp"));
    let name = names(folder).into_iter().find(|name| is_named(&name.to_lowercase()))?;
    Some(format!(
        "{name} is not read, and the names of the images are no times: a depth.txt with lines of: timestamp filename gives them, --fps N a rate"
    ))
}

/// Whether a name is as Redwood writes them.
fn is_of_redwood(stem: &str) -> bool {
    let (running, micros) = REDWOOD_DIGITS;
    let is_digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    stem.split_once('-')
        .is_some_and(|(a, b)| is_digits(a) && is_digits(b) && running.contains(&a.len()) && b.len() == micros)
}

/// The images of a folder whose names are of one form.
struct NamedImages {
    stems: Vec<String>,
    files: Vec<PathBuf>,
    meaning: NameMeaning,
    warning: Option<String>,
}

impl Default for NamedImages {
    fn default() -> Self {
        Self {
            stems: Vec::new(),
            files: Vec::new(),
            meaning: NameMeaning::Numbers(Vec::new()),
            warning: None,
        }
    }
}

impl NamedImages {
    fn of(folder: &Path, sub: &str, ends: &[&str], asked: &Asked) -> Result<Self, SourceError> {
        let is_image = |end: &str| ends.iter().any(|known| known.eq_ignore_ascii_case(end));
        let names: Vec<String> = names(&folder.join(sub))
            .into_iter()
            .filter(|name| name.rsplit_once('.').is_some_and(|(_, end)| is_image(end)))
            .collect();
        let stems: Vec<&str> =
            names.iter().map(|name| name.rsplit_once('.').map_or("", |(stem, _)| stem)).collect();
        let Understood { kept, meaning, warning } =
            understand(&stems, asked.fps.is_some()).map_err(|reason| wrong(&folder.join(sub), reason))?;
        Ok(Self {
            stems: kept.iter().filter_map(|at| stems.get(*at)).map(|stem| (*stem).to_owned()).collect(),
            files: kept
                .iter()
                .filter_map(|at| names.get(*at))
                .map(|name| Path::new(sub).join(name))
                .collect(),
            meaning,
            warning: warning.map(|warning| format!("{sub}/: {warning}")),
        })
    }

    /// That numbers rise by more than frames do, and what they are taken for.
    fn wide_steps(&self, fps: f64) -> Option<String> {
        let NameMeaning::Numbers(numbers) = &self.meaning else { return None };
        let mut numbers = numbers.clone();
        numbers.sort_unstable();
        let steps = numbers.iter().zip(numbers.iter().skip(1));
        let step = steps.map(|(before, after)| after.saturating_sub(*before)).min()?;
        (step > MOST_FRAME_STEP).then(|| {
            format!(
                "the numbers in the names of the images rise by {step}: they are taken for frames, {:.3} s apart at {fps} a second; --fps N gives another rate, and a depth.txt the times themselves",
                step as f64 / fps
            )
        })
    }

    fn unset(&self) -> Vec<ListEntry> {
        self.files.iter().map(|file| ListEntry { stamp_nanos: 0, file: file.clone() }).collect()
    }

    /// Time of each image: its own, or by its number, or by its place where a rate is given.
    fn times(&self, is_rate_given: bool, fps: f64) -> Vec<i64> {
        match &self.meaning {
            NameMeaning::Numbers(numbers) => {
                numbers.iter().map(|number| number_nanos(*number, fps)).collect()
            }
            NameMeaning::Times(times, _) if !is_rate_given => times.clone(),
            NameMeaning::Times(times, _) => {
                let mut sorted = times.clone();
                sorted.sort_unstable();
                let rank = |time: &i64| sorted.partition_point(|other| other < time) as u64;
                times.iter().map(|time| number_nanos(rank(time), fps)).collect()
            }
        }
    }

    /// Numbers without a gap that begin elsewhere than those of as many depth images: both count the same
    /// images, as a sentence. The images of both are then in the order of their numbers.
    fn moved_to(&mut self, depth: &mut Self) -> Option<String> {
        self.sort_by_number();
        depth.sort_by_number();
        let (NameMeaning::Numbers(own), NameMeaning::Numbers(others)) = (&self.meaning, &depth.meaning)
        else {
            return None;
        };
        let is_whole = |numbers: &[u64]| {
            numbers
                .iter()
                .zip(numbers.iter().skip(1))
                .all(|(before, after)| after.checked_sub(*before) == Some(1))
        };
        let (first, first_depth) = (own.first()?, others.first()?);
        (own.len() == others.len() && own.len() > 1 && first != first_depth && is_whole(own) && is_whole(others))
            .then(|| {
                format!(
                    "colour is numbered from {first}, depth from {first_depth}, both without a gap: they are paired in their order"
                )
            })
    }

    fn sort_by_number(&mut self) {
        let NameMeaning::Numbers(numbers) = &mut self.meaning else { return };
        let mut all: Vec<(u64, String, PathBuf)> = numbers
            .iter()
            .copied()
            .zip(std::mem::take(&mut self.stems))
            .zip(std::mem::take(&mut self.files))
            .map(|((number, stem), file)| (number, stem, file))
            .collect();
        all.sort();
        numbers.clear();
        for (number, stem, file) in all {
            numbers.push(number);
            self.stems.push(stem);
            self.files.push(file);
        }
    }

    /// Times of colour: those of depth for images of the same name, where their own cannot be compared.
    fn times_beside(
        &self,
        depth: &Self,
        depth_times: &[i64],
        is_rate_given: bool,
        fps: f64,
        has_times: bool,
    ) -> Vec<i64> {
        let own_are_times = matches!(self.meaning, NameMeaning::Times(..)) && !is_rate_given;
        let by_name: BTreeMap<&str, i64> =
            depth.stems.iter().map(String::as_str).zip(depth_times.iter().copied()).collect();
        let n_named = self.stems.iter().filter(|stem| by_name.contains_key(stem.as_str())).count();
        let own = self.times(is_rate_given, fps);
        if own_are_times == has_times && !is_rate_given || n_named.saturating_mul(2) <= self.stems.len() {
            return own;
        }
        let time = |(stem, own): (&String, &i64)| by_name.get(stem.as_str()).copied().unwrap_or(*own);
        self.stems.iter().zip(&own).map(time).collect()
    }

    /// NamedImages by time; where two have the same, the first.
    fn entries(&self, times: &[i64]) -> Vec<ListEntry> {
        let entry = |(stamp_nanos, file): (&i64, &PathBuf)| ListEntry {
            stamp_nanos: *stamp_nanos,
            file: file.clone(),
        };
        let mut entries: Vec<ListEntry> = times.iter().zip(&self.files).map(entry).collect();
        entries.sort_by(|a, b| (a.stamp_nanos, &a.file).cmp(&(b.stamp_nanos, &b.file)));
        entries.dedup_by_key(|entry| entry.stamp_nanos);
        entries
    }
}
