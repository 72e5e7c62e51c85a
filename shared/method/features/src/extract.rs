//! From an image to features.

use crate::descriptor::describe;
use crate::detect::{CellGrid, Corner, ScoreRows, detect};
use crate::feature::Feature;
use crate::patch::Patch;
use crate::pattern::Pattern;
use crate::picture::Picture;
use crate::pyramid::{self, Plane, scale, to_full};
use crate::settings::FeatureSettings;
use crate::spread::{Cells, quotas};

/// Buffers of [`extract`], which grow with the first image and stay, and the instruction set.
#[derive(Clone, Debug)]
pub struct ExtractWorkspace {
    arch: pulp::Arch,
    pattern: Pattern,
    planes: Vec<Plane>,
    line: Vec<u8>,
    scores: ScoreRows,
    levels: Vec<Level>,
    chosen: Vec<u32>,
}

/// The corners of a level.
#[derive(Clone, Debug, Default)]
struct Level {
    corners: Vec<Corner>,
    cells: Cells,
}

impl ExtractWorkspace {
    /// Buffers for loops compiled for `arch`; the instruction set does not change a bit of the result.
    pub fn new(arch: pulp::Arch) -> Self {
        Self {
            arch,
            pattern: Pattern::new(),
            planes: Vec::new(),
            line: Vec::new(),
            scores: ScoreRows::default(),
            levels: Vec::new(),
            chosen: Vec::new(),
        }
    }
}

/// Extracts the features of an image: at most `settings.max_features`, spread over the image, in
/// order of level, row and column.
///
/// An image without contrast, or without a pixel 18 px away from every border, has none.
pub fn extract(
    picture: &Picture<'_>,
    settings: &FeatureSettings,
    workspace: &mut ExtractWorkspace,
) -> Vec<Feature> {
    let mut features = Vec::with_capacity(settings.max_features as usize);
    let arch = workspace.arch;
    arch.dispatch(Extraction { picture, settings, workspace, features: &mut features });
    features
}

/// The extraction compiled for each instruction set.
struct Extraction<'a, 'b> {
    picture: &'a Picture<'b>,
    settings: &'a FeatureSettings,
    workspace: &'a mut ExtractWorkspace,
    features: &'a mut Vec<Feature>,
}

impl pulp::WithSimd for Extraction<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) {
        let Self { picture, settings, workspace: w, features } = self;
        let n_levels = (settings.levels as usize).max(1);
        w.planes.resize_with(n_levels, Plane::default);
        w.levels.resize_with(n_levels, Level::default);
        pyramid::build(picture, &mut w.planes, &mut w.line);
        for (plane, level) in w.planes.iter().zip(&mut w.levels) {
            let grid = CellGrid::new(plane.width, plane.height, settings.cell_px as usize);
            let thresholds = [settings.threshold, settings.low_threshold];
            detect(plane, &grid, thresholds, &mut w.scores, &mut level.corners);
            level.cells.fill(&level.corners, grid.n_cells());
        }
        let available: Vec<usize> = w.levels.iter().map(|level| level.cells.len()).collect();
        let scales: Vec<f32> = (0..n_levels).map(scale).collect();
        let quotas = quotas(settings.max_features as usize, &available, &scales);
        let mut patch = Patch::EMPTY;
        for (index, level) in w.levels.iter_mut().enumerate() {
            level.cells.choose(quotas[index], &mut w.chosen);
            w.chosen.sort_unstable_by_key(|&corner| level.corners[corner as usize].place());
            for &corner in &w.chosen {
                let corner = &level.corners[corner as usize];
                patch.fill(&w.planes[index], corner.row.into(), corner.column.into());
                features.push(feature(corner, &patch, &w.pattern, index, settings.sigma_px));
            }
        }
    }
}

#[inline(always)]
fn feature(corner: &Corner, patch: &Patch, pattern: &Pattern, level: usize, sigma_px: f32) -> Feature {
    let [along_columns, along_rows] = patch.moments();
    let angle_rad = libm::atan2f(along_rows as f32, along_columns as f32);
    let scale = scale(level);
    Feature {
        pixel: corner.sub_pixel().map(|position| to_full(position, scale)),
        angle_rad,
        response: f32::from(corner.score),
        sigma_px: sigma_px * scale,
        level: level as u8,
        reserved: [0; 3],
        descriptor: describe(patch, angle_rad, pattern),
    }
}
