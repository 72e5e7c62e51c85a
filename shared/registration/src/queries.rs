//! Samples moved to their frame's stamp, ready to be matched.

use crate::columns::Columns3;
use crate::sampling::Sample;
use crate::target::ShutterTable;

/// Query points and normals in the camera frame at the frame's stamp.
#[derive(Clone, Debug, Default)]
pub struct Queries {
    pub(crate) points: Columns3,
    pub(crate) normals: Columns3,
}

impl Queries {
    /// Removes the readout motion from the samples.
    pub fn fill(&mut self, samples: &[Sample], shutter: &ShutterTable) {
        self.points.clear();
        self.normals.clear();
        for sample in samples {
            let seconds = shutter.row_time_s(f32::from(sample.grid_row));
            self.points.push(shutter.move_point(sample.point, seconds));
            self.normals.push(shutter.turn(sample.normal, seconds));
        }
    }

    /// Number of queries.
    pub fn len(&self) -> usize {
        self.points.x.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.points.x.is_empty()
    }
}
