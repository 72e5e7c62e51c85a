//! A pair's cost to second order about the transform at which its matches were found (method 5.4): 28 numbers
//! instead of the 73 of the exact sums, for what is stored and is not solved far from there.
//!
//! With `D = T0^-1 T = [M|u]` the motion is `d = (u, v)`, `[v]x = (M - M^T) / 2`, which is bounded however far it
//! goes, and the cost `F(d) = c + 2 g d + d H d`: at `T0` value, gradient and Gauss-Newton matrix are the exact ones.

use super::BlockSums;
use super::PairBlock;
use nalgebra::{Matrix3, Matrix3x4, Vector3};
use tessera_geometry::{Matrix6, Pose, Vector6, from_upper_triangle, upper_triangle};

/// A pair's cost about a transform, to second order.
#[derive(Clone, Debug, PartialEq)]
pub struct Quadratic {
    h: Matrix6,
    g: Vector6,
    c: f64,
}

/// Numbers of the triangle, and of all.
const N_TRIANGLE: usize = 21;
const N_NUMBERS: usize = 28;

impl Quadratic {
    /// The cost of sums about the transform at which their matches were found.
    pub fn of(target_from_query: &Pose, sums: &BlockSums) -> Self {
        let (h, g, c) = PairBlock::new(target_from_query, sums).linearise(target_from_query);
        Self { h, g, c }
    }

    /// The upper triangle of `H` row by row, `g` and `c`, in single precision, for storing: what is rounded off
    /// is below the noise.
    pub fn to_numbers(&self) -> Vec<f32> {
        let triangle = upper_triangle(&self.h);
        triangle.iter().chain(self.g.iter()).chain(std::iter::once(&self.c)).map(|v| *v as f32).collect()
    }

    /// The inverse of [`Self::to_numbers`]; `None` unless there are 28.
    pub fn from_numbers(numbers: &[f32]) -> Option<Self> {
        let numbers: &[f32; N_NUMBERS] = numbers.try_into().ok()?;
        let numbers = numbers.map(f64::from);
        let (triangle, rest) = numbers.split_at(N_TRIANGLE);
        let (g, c) = rest.split_at(6);
        Some(Self { h: from_upper_triangle(triangle), g: Vector6::from_column_slice(g), c: c[0] })
    }

    pub(super) fn cost(&self, origin: &Matrix3x4<f64>, at: &Matrix3x4<f64>) -> f64 {
        let (d, _) = motion(origin, at);
        self.c + 2.0 * self.g.dot(&d) + d.dot(&(self.h * d))
    }

    pub(super) fn displacement(&self, origin: &Matrix3x4<f64>, at: &Matrix3x4<f64>) -> f64 {
        let (d, _) = motion(origin, at);
        d.dot(&(self.h * d))
    }

    pub(super) fn linearise(&self, origin: &Matrix3x4<f64>, at: &Matrix3x4<f64>) -> (Matrix6, Vector6, f64) {
        let (d, turned) = motion(origin, at);
        // u + M rho; and as M [p]x + [p]x M^T = [(tr M - M^T) p]x, v + (tr M - M^T) phi / 2.
        let mut j = Matrix6::zeros();
        j.fixed_view_mut::<3, 3>(0, 0).copy_from(&turned);
        let by_turn = (Matrix3::identity() * turned.trace() - turned.transpose()) * 0.5;
        j.fixed_view_mut::<3, 3>(3, 3).copy_from(&by_turn);
        let hd = self.h * d;
        (j.transpose() * self.h * j, j.transpose() * (self.g + hd), self.c + d.dot(&(2.0 * self.g + hd)))
    }
}

/// The motion `d` and the turn `M` from the origin to a transform.
fn motion(origin: &Matrix3x4<f64>, at: &Matrix3x4<f64>) -> (Vector6, Matrix3<f64>) {
    let back = origin.fixed_view::<3, 3>(0, 0).transpose();
    let turned = back * at.fixed_view::<3, 3>(0, 0);
    let u = back * (at.column(3) - origin.column(3));
    let v = Vector3::new(
        turned[(2, 1)] - turned[(1, 2)],
        turned[(0, 2)] - turned[(2, 0)],
        turned[(1, 0)] - turned[(0, 1)],
    ) * 0.5;
    (Vector6::new(u.x, u.y, u.z, v.x, v.y, v.z), turned)
}
