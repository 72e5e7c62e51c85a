//! Times of images that have a number: frame numbers at a rate, or stamps.

use super::asked::Asked;
use super::files::{Numbered, wrong};
use crate::SourceError;
use crate::folder::list::ListEntry;
use crate::folder::names::NameClock;
use std::collections::BTreeMap;
use std::path::Path;

/// What the numbers of a layout mean.
pub(super) struct FrameTimes {
    clock: NameClock,
    fps: f64,
    /// Where stamps are to be frames at the rate of `--fps`: the place of each.
    ranks: Option<BTreeMap<u64, u64>>,
    /// For people.
    pub(super) words: String,
}

impl FrameTimes {
    /// Recognises the numbers of the depth images; `stated`: frames a second by a file.
    ///
    /// # Errors
    /// They may be frames or stamps.
    pub(super) fn of(
        images: &[Numbered],
        asked: &Asked,
        stated: Option<f64>,
        folder: &Path,
    ) -> Result<Self, SourceError> {
        let numbers: Vec<u64> = images.iter().map(|image| image.number).collect();
        let (fps, words) = asked.rate(stated);
        match NameClock::of(&numbers) {
            Ok((NameClock::Frames, _)) => Ok(Self { clock: NameClock::Frames, fps, ranks: None, words }),
            Ok((clock, how)) if asked.fps.is_none() => {
                Ok(Self { clock, fps, ranks: None, words: format!("{how} in the names of the images") })
            }
            Err(reason) if asked.fps.is_none() => Err(wrong(folder, reason)),
            Err(_) => Ok(Self { clock: NameClock::Frames, fps, ranks: None, words }),
            Ok(_) => {
                let ranks = numbers.iter().copied().zip(0..).collect();
                Ok(Self { clock: NameClock::Frames, fps, ranks: Some(ranks), words })
            }
        }
    }

    /// Time of a number, nanoseconds.
    pub(super) fn nanos(&self, number: u64) -> Option<i64> {
        let number = match &self.ranks {
            Some(ranks) => *ranks.get(&number)?,
            None => number,
        };
        Some(self.clock.nanos(number, self.fps))
    }

    /// Images at their times.
    pub(super) fn entries(&self, images: &[Numbered]) -> Vec<ListEntry> {
        let entry = |image: &Numbered| {
            Some(ListEntry { stamp_nanos: self.nanos(image.number)?, file: image.file.clone() })
        };
        let mut entries: Vec<ListEntry> = images.iter().filter_map(entry).collect();
        entries.dedup_by_key(|entry| entry.stamp_nanos);
        entries
    }
}
