//! Observable combinations of parameters under the motion, with their standard deviations.

use crate::parameters::{N_PARAMETERS, Parameters};
use crate::system::{CameraMatrix, Reduced};
use crate::widths::Widths;
use nalgebra::SymmetricEigen;

/// One combination of parameters, in the steps of [`Widths`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Direction {
    /// Unit vector over the steps.
    pub(crate) vector: Parameters,
    /// Its information; 0 where the motion does not determine it.
    information: f64,
    /// Its standard deviation by the frames alone, widths; infinite without information.
    pub(crate) std: f64,
}

impl Direction {
    /// Share of the frames' estimate that is taken; the rest is the start's.
    pub(crate) fn share(&self) -> f64 {
        1.0 / (1.0 + self.std * self.std)
    }

    /// Solves along this direction; 0 without information.
    fn inverse(&self) -> f64 {
        if self.information > 0.0 { 1.0 / self.information } else { 0.0 }
    }
}

/// The camera's system in the steps of [`Widths`].
pub(crate) struct Directions {
    widths: Widths,
    gradient: Parameters,
    variance: CameraMatrix,
    /// Best determined first.
    pub(crate) all: Vec<Direction>,
}

impl Directions {
    /// `variance`: of the gradient, in the parameters' own units.
    pub(crate) fn new(reduced: &Reduced, variance: &CameraMatrix, widths: Widths) -> Self {
        let to = widths.to_parameters;
        let information = to.transpose() * reduced.information * to;
        let variance = to.transpose() * variance * to;
        let eigen = SymmetricEigen::new(0.5 * (information + information.transpose()));
        // What rounding leaves of a parameter that takes no part is no information.
        let least = 1e-14 * eigen.eigenvalues.max().max(0.0);
        let mut all: Vec<Direction> = (0..N_PARAMETERS)
            .map(|k| {
                let vector: Parameters = eigen.eigenvectors.column(k).into_owned();
                let information = if eigen.eigenvalues[k] > least { eigen.eigenvalues[k] } else { 0.0 };
                let pull = vector.dot(&(variance * vector)).max(0.0).sqrt();
                let std = if information > 0.0 { pull / information } else { f64::INFINITY };
                Direction { vector, information, std }
            })
            .collect();
        all.sort_by(|a, b| b.information.total_cmp(&a.information));
        Self { gradient: to.transpose() * reduced.gradient, variance, all, widths }
    }

    /// The step from `present` to the most probable camera: along each direction the frames'
    /// estimate and the start, each by its weight.
    pub(crate) fn step(&self, start: &Parameters, present: &Parameters) -> Parameters {
        let moved = self.widths.from_parameters * (present - start);
        let mut wanted = Parameters::zeros();
        for direction in &self.all {
            // Directions are orthogonal in the information: each is solved by itself.
            let along =
                direction.vector.dot(&moved) - direction.vector.dot(&self.gradient) * direction.inverse();
            wanted += direction.vector * (direction.share() * along);
        }
        self.widths.to_parameters * (wanted - moved)
    }

    /// Covariance of the parameters, in their own units: the frames' by its share, the start's by
    /// the rest.
    pub(crate) fn covariance(&self) -> CameraMatrix {
        let mut by_frames = CameraMatrix::zeros();
        let mut of_start = CameraMatrix::zeros();
        for direction in &self.all {
            let outer = direction.vector * direction.vector.transpose();
            let share = direction.share();
            by_frames += outer * (share * direction.inverse());
            of_start += outer * ((1.0 - share) * (1.0 - share));
        }
        let to = self.widths.to_parameters;
        to * (by_frames * self.variance * by_frames + of_start) * to.transpose()
    }

    /// A direction in the parameters' own units.
    pub(crate) fn in_parameters(&self, direction: &Direction) -> Parameters {
        self.widths.to_parameters * direction.vector
    }

    /// For each parameter the share of it that stays at the start, 0 to 1.
    pub(crate) fn held(&self) -> Parameters {
        let to = self.widths.to_parameters;
        let (mut kept, mut whole) = (Parameters::zeros(), Parameters::zeros());
        for direction in &self.all {
            let along = (to * direction.vector).map(|x| x * x);
            kept += along * (1.0 - direction.share());
            whole += along;
        }
        kept.zip_map(&whole, |kept, whole| if whole > 0.0 { kept / whole } else { 1.0 })
    }
}
