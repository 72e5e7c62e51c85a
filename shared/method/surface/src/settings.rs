//! Settings of the reconstruction, with the defaults of the default preset beside them.

use serde::{Deserialize, Serialize};
use tessera_geometry::NoiseModel;
use tessera_numerics::{Isa, SettingError, check_range};

/// How the angle test and the length test of eq. 1 are joined.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EdgeRule {
    /// Either test suffices: far walls survive depth quantisation.
    #[default]
    Or,
    /// Both tests must pass: the paper's wording.
    And,
}

/// How the length tolerance of eq. 4 grows with the subsampling step `n`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LengthRule {
    /// `2 n sigma(z)`.
    #[default]
    Linear,
    /// `2 n^2 sigma(z)`, the other reading.
    Quadratic,
}

/// Which depth stands for an `n x n` cell of pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CellSample {
    /// The raw pixel at the cell's corner (the paper): a hole there costs the vertex.
    Corner,
    /// The raw pixel nearest to the cell's corner that has a measurement.
    Nearest,
    /// The mean disparity of the pixels of the cell that lie on one surface, at their mean pixel.
    #[default]
    Mean,
}

/// Which brightness stands for a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CellBrightness {
    /// That of the pixel in the middle: enough for the filter, and the cheapest.
    #[default]
    Pixel,
    /// The mean of all pixels: for the alignment by brightness, which needs gradients that fine
    /// texture does not disturb.
    Mean,
}

/// What the filter does with vertices at depth edges, where rings are one-sided.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BoundaryRule {
    /// Leave the point, filter the normal.
    #[default]
    Keep,
    /// Move the point along its normal only.
    AlongNormal,
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
    /// Which depth stands for a cell.
    pub cell_sample: CellSample,
    /// Which brightness stands for a cell.
    pub cell_brightness: CellBrightness,
    /// Depth beyond this is no measurement, metres.
    pub max_depth_m: f32,
    /// Noise model of the depth (eq. 5).
    pub noise: NoiseModel,
    /// How the two edge tests are joined (eq. 1).
    pub edge_rule: EdgeRule,
    /// Angle between an edge and the line of sight below which it is shadowed, degrees (eq. 1).
    pub edge_angle_deg: f32,
    /// How the length tolerance grows with `step` (eq. 4).
    pub length_rule: LengthRule,
    /// Rings of the multilateral filter, 0 to 4; 0 switches it off.
    pub filter_rings: u32,
    /// Passes of the filter.
    pub filter_passes: u32,
    /// Weight of distance in the filter, per metre (eq. 7, alpha).
    pub filter_position: f32,
    /// Weight of the L1 difference of normals in the filter (eq. 7, beta).
    pub filter_normal: f32,
    /// Weight of the brightness difference in the filter (eq. 7, gamma).
    pub filter_intensity: f32,
    /// Whether a vertex takes part in its own mean, with weight 1.
    pub filter_include_self: bool,
    /// What the filter does at depth edges.
    pub filter_boundary: BoundaryRule,
    /// Where the normals come from after filtering.
    pub normals_after_filter: NormalsAfterFilter,
    /// Vertices whose normal is nearly perpendicular to the line of sight are dropped: least cosine.
    pub min_view_cosine: f32,
    /// Vector instructions; `run.isa` sets them for all algorithms.
    #[serde(skip)]
    pub isa: Isa,
}

impl Default for SurfaceSettings {
    fn default() -> Self {
        Self {
            step: 4,
            cell_sample: CellSample::Mean,
            cell_brightness: CellBrightness::Pixel,
            max_depth_m: 8.0,
            noise: NoiseModel::Paper,
            edge_rule: EdgeRule::Or,
            edge_angle_deg: 12.5,
            length_rule: LengthRule::Linear,
            filter_rings: 1,
            filter_passes: 1,
            filter_position: 1.0,
            filter_normal: 1.0,
            filter_intensity: 1.0,
            filter_include_self: true,
            filter_boundary: BoundaryRule::Keep,
            normals_after_filter: NormalsAfterFilter::Filtered,
            min_view_cosine: 0.15,
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
        check_range("edge_angle_deg", self.edge_angle_deg.into(), 0.0, 45.0)?;
        check_range("filter_rings", self.filter_rings.into(), 0.0, 4.0)?;
        check_range("filter_passes", self.filter_passes.into(), 1.0, 10.0)?;
        check_range("filter_position", self.filter_position.into(), 0.0, 1e4)?;
        check_range("filter_normal", self.filter_normal.into(), 0.0, 1e4)?;
        check_range("filter_intensity", self.filter_intensity.into(), 0.0, 1e4)?;
        check_range("min_view_cosine", self.min_view_cosine.into(), 0.0, 0.9)
    }
}
