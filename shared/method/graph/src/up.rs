//! Up as an accelerometer measured it at some poses: what holds their roll and pitch (method 12.5).
//!
//! An instrument is a vertex of its own, whose pose is no place: its rotation `R_v` is that of a level camera, whose y
//! axis points down, and its translation is the constant error `b` of what it measures, as a share of gravity, in the
//! axes of the camera that carries it. Where `p = -R_i^T R_v e_y` is up as the poses have it, in the camera's axes, a
//! measured unit vector `u` has the residual
//!
//! `e = u - (I - u u^T) b - p`, `de/dphi_i = -[p]x`, `de/dphi_v = -R_i^T R_v [e_y]x`, `de/drho_v = -(I - u u^T) R_v`.
//!
//! A turn about up has no part in it: heading and position are left to the pairs.

use crate::solve::BlockSystem;
use crate::statistics::STILL_SIGMAS;
use nalgebra::{Matrix3, Matrix3x6, Vector3};
use std::f64::consts::LN_2;
use tessera_geometry::{Pose, hat};

/// Axes in which a direction is measured.
pub(crate) const AXES: f64 = 2.0;

/// Up at one pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Up {
    /// Vertex of the camera.
    pub vertex: usize,
    /// Vertex of the instrument.
    pub instrument: usize,
    /// Unit vector against gravity, in the camera's axes.
    pub in_camera: Vector3<f64>,
    /// Standard deviation about each horizontal axis, radians.
    pub sigma_rad: f64,
}

/// All measurements of up in a graph. Each counts by Student's t (Lange, Little and Taylor 1989), since a camera that
/// accelerates measures another direction.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ups {
    /// One by one.
    pub measured: Vec<Up>,
    /// Degrees of freedom of Student's t.
    pub freedom: f64,
    /// Information of the pair blocks for one of the inverse variance.
    pub unit: f64,
    /// Factor of all, at first 1: that by which the pairs' variance exceeds what they state. 0 takes them out.
    pub weight: f64,
    /// Degrees of freedom by which that factor is known to be 1.
    pub prior_freedom: f64,
}

impl Up {
    /// The residual, `R_i^T R_v`, and the part of the constant error that shows.
    fn residual(&self, poses: &[Pose]) -> (Vector3<f64>, Matrix3<f64>, Matrix3<f64>) {
        let (camera, instrument) = (&poses[self.vertex], &poses[self.instrument]);
        let turn = (camera.rotation.inverse() * instrument.rotation).to_rotation_matrix().into_inner();
        let across = Matrix3::identity() - self.in_camera * self.in_camera.transpose();
        (self.in_camera - across * instrument.translation.vector + turn.column(1), turn, across)
    }

    /// The residual with its derivatives by the camera's pose and the instrument's.
    fn linearise(&self, poses: &[Pose]) -> (Vector3<f64>, Matrix3x6<f64>, Matrix3x6<f64>) {
        let (e, turn, across) = self.residual(poses);
        let (mut of_camera, mut of_instrument) = (Matrix3x6::zeros(), Matrix3x6::zeros());
        of_camera.fixed_view_mut::<3, 3>(0, 3).copy_from(&hat(&turn.column(1).into_owned()));
        let world_from_instrument = poses[self.instrument].rotation.to_rotation_matrix().into_inner();
        of_instrument.fixed_view_mut::<3, 3>(0, 0).copy_from(&-(across * world_from_instrument));
        of_instrument.fixed_view_mut::<3, 3>(0, 3).copy_from(&-(turn * hat(&Vector3::y())));
        (e, of_camera, of_instrument)
    }

    /// Squared residual over its variance.
    fn squared(&self, e: &Vector3<f64>) -> f64 {
        e.norm_squared() / (self.sigma_rad * self.sigma_rad)
    }
}

impl Ups {
    /// Decrease of the cost that is too small to matter to this many unknowns, where anything was measured: what up
    /// tells of a slow lean is little beside the cost of all pairs.
    pub(crate) fn least_decrease(&self, n_unknowns: usize) -> Option<f64> {
        let still = STILL_SIGMAS * STILL_SIGMAS * self.unit;
        (!self.measured.is_empty()).then_some(still * n_unknowns as f64)
    }

    /// `(nu + 2) ln(1 + q / nu)` over all, `q` the squared residual over its variance.
    pub(crate) fn cost(&self, poses: &[Pose]) -> f64 {
        let of = |up: &Up| libm::log1p(up.squared(&up.residual(poses).0) / self.freedom);
        self.unit * self.weight * (self.freedom + AXES) * self.measured.iter().map(of).sum::<f64>()
    }

    /// What all disagree with the poses by, in units of their variance, by the median of their squares: accelerations
    /// and faults have no part in it.
    pub(crate) fn squares(&self, poses: &[Pose]) -> f64 {
        let squared = |up: &Up| up.squared(&up.residual(poses).0);
        let mut squared: Vec<f64> = self.measured.iter().map(squared).collect();
        squared.sort_by(f64::total_cmp);
        // The median of a chi-square of two axes is 2 ln 2.
        squared
            .get(squared.len() / 2)
            .map_or(0.0, |median| AXES * squared.len() as f64 * median / (2.0 * LN_2))
    }

    /// Adds all to the system of the free poses, which `slot` places, each at the weight that its residual has.
    pub(crate) fn add_to(&self, poses: &[Pose], slot: &[usize], system: &mut BlockSystem) {
        let mut next = 0;
        for up in &self.measured {
            let (e, of_camera, of_instrument) = up.linearise(poses);
            let student = (self.freedom + AXES) / (self.freedom + up.squared(&e));
            let weight = self.unit * self.weight * student / (up.sigma_rad * up.sigma_rad);
            let (i, j) = (slot[up.vertex], slot[up.instrument]);
            for (s, jacobian) in [(i, &of_camera), (j, &of_instrument)] {
                if s != usize::MAX {
                    system.diagonal[s] += jacobian.transpose() * jacobian * weight;
                    system.gradient[s] += jacobian.transpose() * e * weight;
                }
            }
            if i != usize::MAX
                && j != usize::MAX
                && let Some(place) = system.places.find((i, j), next)
            {
                next = place + 1;
                let across = of_camera.transpose() * of_instrument * weight;
                system.lower[place] += if i > j { across } else { across.transpose() };
            }
        }
    }
}

#[cfg(test)]
mod tests;
