//! Frames in the journal of a run, read back for the count.

use std::collections::BTreeMap;
use std::path::Path;
use tessera_journal::{Follower, JournalError};
use tessera_slam::AlignRecord;
use tessera_stage::{ALIGN_JOURNAL, RunFiles};

/// Frames by what became of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct FrameCount {
    /// Frames in the source, as the journal's end says; 0 without an end.
    pub(super) n_frames: u64,
    /// Indices that are not in the journal.
    pub(super) lost: u64,
    /// Records beyond the first of an index.
    pub(super) duplicated: u64,
    /// Indices journaled as left out (live mode).
    pub(super) skipped: u64,
}

/// Counts the frames of a run directory.
///
/// # Errors
/// Where the journal cannot be read.
pub(super) fn count(run_dir: &Path) -> Result<FrameCount, JournalError> {
    let mut journal = Follower::open(&RunFiles::new(run_dir).align_journal(), ALIGN_JOURNAL)?;
    let mut records = Vec::new();
    while let Some(record) = journal.next()? {
        records.push(record);
    }
    Ok(tally(&records))
}

fn tally(records: &[AlignRecord]) -> FrameCount {
    let mut count = FrameCount::default();
    let mut times: BTreeMap<u64, u64> = BTreeMap::new();
    for record in records {
        match record {
            AlignRecord::Frame(frame) => *times.entry(frame.index).or_default() += 1,
            AlignRecord::Skipped(skipped) => {
                count.skipped += skipped.n();
                skipped.listed().for_each(|index| *times.entry(index).or_default() += 1);
            }
            AlignRecord::Map(_) | AlignRecord::Correction(_) => {}
            AlignRecord::End { n_frames, .. } => count.n_frames = *n_frames,
        }
    }
    let n_seen = times.range(..count.n_frames).count() as u64;
    count.lost = count.n_frames - n_seen;
    count.duplicated = times.values().map(|n| n - 1).sum();
    count
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_slam::SkippedFrames;

    #[test]
    fn lost_and_repeated_frames_are_counted() {
        let skipped = |frames| AlignRecord::Skipped(SkippedFrames { frames, reason: String::new() });
        let mut records: Vec<AlignRecord> = [0..2, 1..2, 3..4, 3..4, 3..4].map(skipped).into();
        records.push(AlignRecord::End { n_frames: 6, request: None });
        let expected = FrameCount { n_frames: 6, lost: 3, duplicated: 3, skipped: 6 };
        assert_eq!(tally(&records), expected);
    }
}
