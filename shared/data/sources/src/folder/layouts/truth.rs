//! Ground truth beside the images: what of it cannot be used is left out and named, and the run goes on.

use super::FoundLayout;
use crate::SourceError;
use std::path::Path;
use tessera_evaluation::{Trajectory, format_stamp, read_tum_rows};

/// Poses in the form of TUM, and a sentence on rows that are left out.
///
/// # Errors
/// The file cannot be read, or has no row that can be used.
pub(super) fn of_tum(path: &Path) -> Result<(Trajectory, Option<String>), SourceError> {
    let rows = read_tum_rows(path)?;
    let sentence = rows.first_problem.map(|problem| {
        format!("{} rows of the ground truth are left out, the first: {problem}", rows.n_left_out)
    });
    Ok((rows.trajectory, sentence))
}

/// A sentence where no frame is of the time of the ground truth.
fn apart(truth: &Trajectory, stamps: &[i64]) -> Option<String> {
    let [first, .., last] = truth.stamps_nanos[..] else { return None };
    let (from, to) = (stamps.iter().min()?, stamps.iter().max()?);
    (*to < first || *from > last).then(|| {
        let [first, last, from, to] = [first, last, *from, *to].map(format_stamp);
        format!(
            "the ground truth is of {first} to {last} s, the frames of {from} to {to} s: nothing is compared; do their clocks differ? tessera evaluate trajectory.txt groundtruth.txt --time-offset auto finds how far"
        )
    })
}

impl FoundLayout {
    /// Takes poses in, with a warning where they are of another time, or one that there are none.
    pub(super) fn take_truth(&mut self, poses: Result<Option<Trajectory>, SourceError>) {
        match poses {
            Ok(truth) => {
                let stamps: Vec<i64> = self.depth.iter().map(|entry| entry.stamp_nanos).collect();
                self.warnings.extend(truth.as_ref().and_then(|truth| apart(truth, &stamps)));
                self.ground_truth = truth;
            }
            Err(error) => self.warnings.push(format!("the ground truth is left out: {error}")),
        }
    }

    /// The same of a file in the form of TUM, if it is there.
    pub(super) fn take_tum_truth(&mut self, path: &Path) {
        if !path.exists() {
            return;
        }
        let read = of_tum(path).map(|(truth, sentence)| {
            self.warnings.extend(sentence);
            Some(truth)
        });
        self.take_truth(read);
    }
}
