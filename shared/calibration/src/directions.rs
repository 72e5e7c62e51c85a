//! Which combinations of parameters the motion determines.

use crate::parameters::Parameters;
use crate::sizes;
use crate::system::{CameraMatrix, Reduced};
use nalgebra::SymmetricEigen;

/// One combination of parameters, in pixels of image motion (see `sizes`).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Direction {
    /// Unit vector over the scaled parameters.
    pub(crate) vector: Parameters,
    /// Its information.
    pub(crate) information: f64,
    /// Its standard deviation, pixels; infinite without information.
    pub(crate) std_px: f64,
}

impl Direction {
    /// Whether the frames determine it to better than `limit_px`.
    pub(crate) fn is_free(&self, limit_px: f64) -> bool {
        self.std_px <= limit_px
    }
}

/// The eigenvectors of the camera's information in scaled parameters, best determined first.
pub(crate) fn directions(reduced: &Reduced, sizes: &Parameters) -> Vec<Direction> {
    let scale = CameraMatrix::from_diagonal(sizes);
    let information = scale * reduced.information * scale;
    let variance = scale * reduced.gradient_variance * scale;
    let eigen = SymmetricEigen::new(0.5 * (information + information.transpose()));
    let mut found: Vec<Direction> = (0..sizes.len())
        .map(|k| {
            let vector: Parameters = eigen.eigenvectors.column(k).into_owned();
            let information = eigen.eigenvalues[k];
            let pull = (vector.dot(&(variance * vector))).max(0.0).sqrt();
            let std_px = if information > 0.0 { pull / information } else { f64::INFINITY };
            Direction { vector, information, std_px }
        })
        .collect();
    found.sort_by(|a, b| b.information.total_cmp(&a.information));
    found
}

/// The minimum over the free directions, the others kept at `start`: the step from `present`.
pub(crate) fn step(
    reduced: &Reduced,
    free: &[Direction],
    sizes: &Parameters,
    (start, present): (&Parameters, &Parameters),
) -> Parameters {
    let moved = sizes::in_pixels(&(present - start), sizes);
    let gradient = reduced.gradient.component_mul(sizes);
    let mut wanted = Parameters::zeros();
    for direction in free {
        // Directions are orthogonal in the information: each is solved by itself.
        let along = direction.vector.dot(&moved) - direction.vector.dot(&gradient) / direction.information;
        wanted += direction.vector * along;
    }
    (wanted - moved).component_mul(sizes)
}

/// Covariance of the parameters within the free directions, in the parameters' own units.
pub(crate) fn covariance(reduced: &Reduced, free: &[Direction], sizes: &Parameters) -> CameraMatrix {
    let scale = CameraMatrix::from_diagonal(sizes);
    let inverse: CameraMatrix = free.iter().map(|d| d.vector * d.vector.transpose() / d.information).sum();
    let variance = scale * reduced.gradient_variance * scale;
    scale * (inverse * variance * inverse) * scale
}
