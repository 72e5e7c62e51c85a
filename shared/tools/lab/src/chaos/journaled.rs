//! Records that were in the journals of a run before a fault, and must be there at its end: outputs tell of
//! those of a recording, which a run may compute again, and of a live run nothing does.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use tessera_journal::{Ending, inspect_framing};
use tessera_stage::RunFiles;

/// Bytes of the journals that no fault may take.
#[derive(Debug, Default)]
pub(super) struct Journaled(BTreeMap<PathBuf, Vec<u8>>);

impl Journaled {
    /// Takes in what is whole now; names each journal that lost records since the last look.
    pub(super) fn look(&mut self, files: &RunFiles) -> Vec<String> {
        let mut lost = Vec::new();
        for path in journals(files) {
            let before = self.0.entry(path.clone()).or_default();
            let now = whole(&path).unwrap_or_default();
            if now.starts_with(before) {
                *before = now;
            } else {
                let n = before.len();
                lost.push(format!("{} lost some of {n} bytes that were journaled", path.display()));
            }
        }
        lost
    }

    /// Allows what a damage to the end of a journal takes: its last records cannot be told from torn ones.
    pub(super) fn allow_torn_ends(&mut self, files: &RunFiles) {
        for path in journals(files) {
            let Ok(found) = inspect_framing(&path) else { continue };
            if let (Ending::Torn { .. }, Some(before)) = (found.ending, self.0.get_mut(&path)) {
                before.truncate(usize::try_from(found.whole_bytes).unwrap_or(usize::MAX));
            }
        }
    }
}

fn journals(files: &RunFiles) -> [PathBuf; 2] {
    [files.align_journal(), files.optimise_journal()]
}

/// The whole records of a journal; `None` where it is not there yet, or cannot be read.
fn whole(path: &Path) -> Option<Vec<u8>> {
    let n = inspect_framing(path).ok()?.whole_bytes;
    let mut bytes = std::fs::read(path).ok()?;
    bytes.truncate(usize::try_from(n).ok()?);
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;
    use tessera_journal::{Journal, RecordKind};

    const TEST: RecordKind<u64> = RecordKind::only("test", 7);

    #[test]
    fn records_that_are_gone_are_named_and_a_torn_end_is_allowed() {
        let dir = tempfile::tempdir().unwrap();
        let files = RunFiles::new(dir.path());
        let path = files.align_journal();
        let mut journaled = Journaled::default();
        assert_eq!(journaled.look(&files), [""; 0], "nothing is there yet");
        let (mut journal, _) = Journal::open(&path, TEST, Duration::ZERO, |_| Ok(())).unwrap();
        let mut ends = Vec::new();
        for k in 0..4 {
            journal.append(&k, false).unwrap();
            ends.push(journal.mark().len_bytes() as usize);
            assert_eq!(journaled.look(&files), [""; 0], "it grows");
        }
        let bytes = std::fs::read(&path).unwrap();
        // A record less, as a journal that was cut.
        std::fs::write(&path, &bytes[..ends[2]]).unwrap();
        let lost = journaled.look(&files);
        assert!(lost.len() == 1 && lost[0].contains("align.journal lost some of"), "{lost:?}");
        // A bit in the middle may cost nothing, one in the last record that record.
        let flipped_at = |at: usize| {
            let mut bytes = bytes.clone();
            bytes[at] ^= 1;
            bytes
        };
        std::fs::write(&path, flipped_at(ends[1] - 1)).unwrap();
        journaled.allow_torn_ends(&files);
        std::fs::write(&path, &bytes[..ends[0]]).unwrap();
        assert_eq!(journaled.look(&files).len(), 1);
        std::fs::write(&path, flipped_at(ends[3] - 1)).unwrap();
        journaled.allow_torn_ends(&files);
        std::fs::write(&path, &bytes[..ends[2]]).unwrap();
        assert_eq!(journaled.look(&files), [""; 0]);
        std::fs::write(&path, &bytes[..ends[1]]).unwrap();
        assert_eq!(journaled.look(&files).len(), 1);
    }
}
