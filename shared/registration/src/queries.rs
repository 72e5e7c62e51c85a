//! Samples moved to their frame's stamp, ready to be matched.

use crate::sampling::Sample;
use crate::target::{ShutterTable, rotate, transform};

/// Query points and normals in the camera frame at the frame's stamp.
#[derive(Clone, Debug, Default)]
pub struct Queries {
    pub(crate) points: Vec<[f32; 3]>,
    pub(crate) normals: Vec<[f32; 3]>,
}

impl Queries {
    /// Removes the readout motion from the samples.
    pub fn fill(&mut self, samples: &[Sample], shutter: &ShutterTable) {
        self.points.clear();
        self.normals.clear();
        if shutter.is_global() {
            self.points.extend(samples.iter().map(|s| s.point));
            self.normals.extend(samples.iter().map(|s| s.normal));
            return;
        }
        for sample in samples {
            let stamp_from_row = shutter.row(usize::from(sample.grid_row));
            self.points.push(transform(stamp_from_row, sample.point));
            self.normals.push(rotate(stamp_from_row, sample.normal));
        }
    }

    /// Number of queries.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }
}
