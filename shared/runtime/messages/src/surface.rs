//! A surface on its way from the reconstruction to the alignment.

use crate::frame::Kind;
use crate::message::{Message, Refusal, StepTimes};
use crate::rotation::{RotationBits, UpBits};
use crate::surface_payload::{MAX_FEATURES, check_features, read_features, vertices_of_features};
use bytemuck::{Pod, Zeroable};
use tessera_surface::{Grid, Vertex, WorkloadLevel};

/// Header of a surface; the payload is one [`Vertex`] per grid node, row by row, and behind them the
/// features of the frame's colour image ([`crate::write_features`]).
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct SurfaceHeader {
    /// Frame index as the source counts.
    pub index: u64,
    /// Epoch of the frame message it was made from.
    pub epoch: u64,
    /// Sensor time.
    pub stamp_nanos: i64,
    /// Frames that the source left out before this one (live mode).
    pub dropped_before: u64,
    /// Relocalisation is asked for from this index on, as in the frame; 0: it was never asked for.
    pub relocalise_from: u64,
    /// Columns of the grid.
    pub width: u32,
    /// Rows of the grid.
    pub height: u32,
    /// Pixels between grid nodes.
    pub step: u32,
    /// [`Kind`] as written by [`Kind::to_wire`].
    pub kind: u32,
    /// Vertices that may be aligned to.
    pub n_valid: u32,
    /// Workload level of the frame, 0 (full) to 3; 0 in lossless mode.
    pub workload: u32,
    /// Features behind the vertices.
    pub n_features: u32,
    /// Zero.
    pub reserved: u32,
    /// What a gyroscope measured.
    pub rotation: RotationBits,
    /// What an accelerometer measured.
    pub up: UpBits,
    /// When each step happened.
    pub times: StepTimes,
}

impl Message for SurfaceHeader {
    const NAME: &'static str = "tessera.SurfaceHeader.v6";
}

/// What the run's configuration says of every surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SurfaceExpectation {
    /// Shape of the grid.
    pub grid: Grid,
    /// First index that cannot be in flight; `None` in live mode.
    pub limit: Option<u64>,
}

impl SurfaceHeader {
    /// Checks header and vertices against the configuration.
    ///
    /// # Errors
    /// A [`Refusal`] that names the frame, what was found and what was expected.
    pub fn validate(&self, expected: &SurfaceExpectation, vertices: &[Vertex]) -> Result<Kind, Refusal> {
        let index = self.index;
        let kind = Kind::check(index, self.kind)?;
        let grid = expected.grid;
        Refusal::unless_equal(index, "grid width", self.width.into(), grid.width as u64)?;
        Refusal::unless_equal(index, "grid height", self.height.into(), grid.height as u64)?;
        Refusal::unless_equal(index, "grid step", self.step.into(), grid.step as u64)?;
        let n_features = self.n_features as usize;
        if n_features > MAX_FEATURES {
            return Err(Refusal::Value {
                index,
                what: "number of features",
                found: n_features.to_string(),
                rule: "at most 1000",
            });
        }
        let expected_len = grid.len().saturating_add(vertices_of_features(n_features));
        Refusal::unless_equal(index, "number of vertices", vertices.len() as u64, expected_len as u64)?;
        self.rotation.read(index)?;
        self.up.read(index)?;
        Refusal::unless_reached(index, self.relocalise_from)?;
        let highest = if expected.limit.is_some() { WorkloadLevel::Full } else { WorkloadLevel::Least };
        if self.workload as usize > highest.level() {
            return Err(Refusal::Value {
                index,
                what: "workload",
                found: self.workload.to_string(),
                rule: "0 in lossless mode, 0 to 3 in live mode",
            });
        }
        match expected.limit {
            Some(limit) if index >= limit => return Err(Refusal::Future { index, limit }),
            _ => {}
        }
        check_features(index, &read_features(vertices, grid.len()))?;
        let vertices = vertices.get(..grid.len());
        if kind == Kind::Frame && !vertices.is_some_and(all_finite) {
            return Err(Refusal::Value {
                index,
                what: "a vertex",
                found: "not finite".into(),
                rule: "finite numbers in every vertex",
            });
        }
        Ok(kind)
    }

    /// How much work the frame gets.
    pub fn workload(&self) -> WorkloadLevel {
        WorkloadLevel::from_level(self.workload.into()).unwrap_or_default()
    }
}

/// Whether every number is finite: no exponent has all bits set. Branch-free, so that it vectorises.
fn all_finite(vertices: &[Vertex]) -> bool {
    const EXPONENT: u32 = 0x7f80_0000;
    let bad = |value: f32| u32::from(value.to_bits() & EXPONENT == EXPONENT);
    vertices.chunks(256).all(|chunk| {
        chunk.iter().fold(0, |sum, v| {
            let [x, y, z] = v.position;
            let [nx, ny, nz] = v.normal;
            sum | bad(x) | bad(y) | bad(z) | bad(nx) | bad(ny) | bad(nz)
        }) == 0
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_indices_and_numbers_are_checked() {
        let grid = Grid { width: 4, height: 2, step: 4 };
        let expected = SurfaceExpectation { grid, limit: Some(5) };
        let good = SurfaceHeader { index: 3, width: 4, height: 2, step: 4, ..SurfaceHeader::default() };
        let vertices = vec![Vertex::default(); 8];
        assert_eq!(good.validate(&expected, &vertices), Ok(Kind::Frame));
        let text = |header: SurfaceHeader, vertices: &[Vertex]| {
            header.validate(&expected, vertices).unwrap_err().to_string()
        };
        assert!(text(good, &vertices[..7]).contains("number of vertices is 7, expected 8"));
        assert!(text(SurfaceHeader { index: 5, ..good }, &vertices).contains("not in flight"));
        assert!(
            text(SurfaceHeader { relocalise_from: 4, ..good }, &vertices).contains("relocalise_from is 4")
        );
        assert!(text(SurfaceHeader { width: 9, ..good }, &vertices).contains("grid width is 9"));
        assert!(text(SurfaceHeader { workload: 1, ..good }, &vertices).contains("workload is 1"));
        let live = SurfaceExpectation { limit: None, ..expected };
        let lowered = SurfaceHeader { workload: 3, ..good };
        assert_eq!(
            (lowered.validate(&live, &vertices), lowered.workload()),
            (Ok(Kind::Frame), WorkloadLevel::Least)
        );
        assert!(SurfaceHeader { workload: 4, ..good }.validate(&live, &vertices).is_err());
        let mut broken = vertices.clone();
        broken[6].normal[1] = f32::NAN;
        assert!(text(good, &broken).contains("finite"));
        broken[6].normal[1] = f32::NEG_INFINITY;
        assert!(text(good, &broken).contains("finite"));
    }
}
