//! What the matches of a pair tell of the readout of its two frames (method 1.6).

use crate::association::columns::Columns3;
use crate::association::found::Found;
use crate::association::queries::Chosen;
use crate::association::target::ShutterTable;
use crate::gicp::information_along_normals;
use std::array::from_fn;
use tessera_numerics::lanes::{LANES, Lanes, Real, cross, dot};

/// Sums over matches `e` of information `Omega`, `E` the change of `e` with the seconds from a frame's first row to
/// its last, `J` that with the query's pose (right tangent, translation first).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReadoutSums {
    /// `sum J^T Omega E`.
    pub coupling: [f64; 6],
    /// `sum E^T Omega E`.
    pub information: f64,
    /// `sum E^T Omega e`.
    pub gradient: f64,
}

/// Adds up the matches found last, along their normals.
pub(crate) struct SumReadout<'a> {
    pub(crate) found: &'a Found,
    pub(crate) chosen: &'a Chosen,
    /// Query points in the target's frame.
    pub(crate) q: &'a Columns3,
    /// `target_from_query`: rotation row by row, then translation.
    pub(crate) motion: &'a [f32; 12],
    pub(crate) query: ShutterTable,
    pub(crate) target: ShutterTable,
    /// Rows of the grids of query and target.
    pub(crate) n_rows: [f32; 2],
    pub(crate) epsilon: f32,
}

impl pulp::WithSimd for SumReadout<'_> {
    type Output = ReadoutSums;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) -> ReadoutSums {
        let mut lanes = [Lanes::ZERO; 8];
        for at in (0..self.found.len()).step_by(LANES) {
            self.add_lanes(at, &mut lanes);
        }
        let [coupling @ .., information, gradient] =
            lanes.map(|lane| lane.0.iter().map(|&v| f64::from(v)).sum::<f64>());
        ReadoutSums { coupling, information, gradient }
    }
}

impl SumReadout<'_> {
    #[inline(always)]
    fn add_lanes(&self, at: usize, sums: &mut [Lanes; 8]) {
        let m = |k: usize| Lanes::splat(self.motion[k]);
        let (a, q, e) = (self.chosen.points.load(at), self.q.load(at), self.found.e.load(at));
        let (na, nb) = (self.found.na.load(at), self.found.nb.load(at));
        let u: [Lanes; 3] = from_fn(|k| na[k] + nb[k]);
        let d: [Lanes; 3] = from_fn(|k| na[k] - nb[k]);
        let w = information_along_normals(Lanes::load(&self.found.weight, at), d, self.epsilon);
        // The normal in the query's frame.
        let n: [Lanes; 3] = from_fn(|k| m(k) * u[0] + m(k + 3) * u[1] + m(k + 6) * u[2]);
        let b: [Lanes; 3] = from_fn(|k| q[k] + e[k]);
        let [of_query, of_target] = [
            (Lanes::load(self.chosen.rows(), at), self.n_rows[0]),
            (Lanes::load(&self.found.row, at), self.n_rows[1]),
        ]
        .map(|(row, n)| (row + Lanes::splat(0.5)) * Lanes::splat(1.0 / n) - Lanes::splat(0.5));
        let slope = dot(u, self.target.speed(b)) * of_target - dot(n, self.query.speed(a)) * of_query;
        let (weighted, lever) = (w * slope, cross(a, n));
        for k in 0..3 {
            sums[k] = sums[k] - weighted * n[k];
            sums[k + 3] = sums[k + 3] - weighted * lever[k];
        }
        sums[6] = sums[6] + weighted * slope;
        sums[7] = sums[7] + weighted * dot(u, e);
    }
}
