//! Settings of the reconstruction, with the defaults of the default preset beside them.

use serde::{Deserialize, Serialize};
use tessera_numerics::{Isa, SettingError, check_range};

/// Combination of the angle test and the length test of eq. 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EdgeRule {
    /// Either test suffices: far walls survive depth quantisation.
    #[default]
    Or,
    /// Both tests must pass: the paper's wording.
    And,
}

/// Choice of the depth of an `n x n` cell of pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CellSample {
    /// The raw pixel at the cell's corner (the paper): a hole there costs the vertex.
    Corner,
    /// The mean disparity of the pixels of the cell that lie on one surface, at their mean pixel.
    #[default]
    Mean,
}

/// Treatment of vertices at depth edges by the filter, where rings are one-sided.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BoundaryRule {
    /// Leave the point, filter the normal.
    #[default]
    Keep,
    /// Treat it like any other vertex (the paper).
    Full,
}

/// Where the normals come from once the points are filtered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NormalsAfterFilter {
    /// The filtered normals of eq. 6.
    #[default]
    Filtered,
    /// Eq. 8 again, on the filtered points (the paper's Fig. 2).
    Recompute,
}

/// Settings of the reconstruction (method 1-3).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SurfaceSettings {
    /// Subsampling step `n`: 1, 2, 4 or 8 pixels between vertices.
    pub step: u32,
    /// Choice of a cell's depth.
    pub cell_sample: CellSample,
    /// Largest depth that counts as a measurement, metres.
    pub max_depth_m: f32,
    /// Combination of the two edge tests (eq. 1).
    pub edge_rule: EdgeRule,
    /// Rings of the multilateral filter, 0 to 4; 0 switches it off.
    pub filter_rings: u32,
    /// Weight of the L1 difference of normals in the filter (eq. 7, beta); calibration raises it.
    #[serde(skip)]
    pub filter_normal: f32,
    /// Treatment of depth edges by the filter.
    pub filter_boundary: BoundaryRule,
    /// Source of the normals after filtering.
    pub normals_after_filter: NormalsAfterFilter,
    /// Vector instructions; `run.isa` sets them for all algorithms.
    #[serde(skip)]
    pub isa: Isa,
}

impl Default for SurfaceSettings {
    fn default() -> Self {
        Self {
            step: 4,
            cell_sample: CellSample::Mean,
            max_depth_m: 8.0,
            edge_rule: EdgeRule::Or,
            filter_rings: 1,
            filter_normal: 1.0,
            filter_boundary: BoundaryRule::Keep,
            normals_after_filter: NormalsAfterFilter::Filtered,
            isa: Isa::Auto,
        }
    }
}

impl SurfaceSettings {
    /// Checks every range, NaN included.
    ///
    /// # Errors
    /// Names the first key that is out of range, its value and the rule.
    pub fn check(&self) -> Result<(), SettingError> {
        if ![1, 2, 4, 8].contains(&self.step) {
            return Err(SettingError {
                key: "step",
                found: self.step.to_string(),
                rule: "1, 2, 4 or 8".into(),
            });
        }
        check_range("max_depth_m", self.max_depth_m.into(), 0.5, 50.0)?;
        check_range("filter_rings", self.filter_rings.into(), 0.0, 4.0)?;
        check_range("filter_normal", self.filter_normal.into(), 0.0, 1e4)
    }
}
