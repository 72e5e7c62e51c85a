//! The generalised ICP term (III-D): residual and information of each match, summed over a pair,
//! eight at a time (eq. 10-13; method 4, 5.4).
//!
//! For a match of a query point `a` with normal `n_a` and a target point `b` with normal `n_b`, and
//! `T = (R, t)` from the query's frame to the target's, `d = b - T a` is distributed as
//! `N(0, Sigma_b + R Sigma_a R^T)` (eq. 10), so that `T* = argmin sum e^T Omega e` (eq. 11) with
//!
//! ```text
//! e     = b - T a                                                                  (12)
//! Omega = (Sigma_b + R Sigma_a R^T)^-1,   Sigma = I - (1 - eps) n n^T (eq. 9)      (13)
//! ```
//!
//! A pair keeps the sums of `a~ a~^T (x) Omega`, `a~ (x) Omega e` and `e^T Omega e` with
//! `a~ = (a, 1)`: what the cost is a function of while the matches are frozen.

use crate::association::columns::Columns3;
use crate::association::found::Found;
use std::ops::Range;
use tessera_graph::{BlockSums, HalfSums};
use tessera_numerics::lanes::{LANES, Lanes, Real, dot};

/// Factor of the information across the normals. The search finds a partner beside every query, wherever along a
/// surface the pose has slid: across the normal a match repeats the pose at which it was found and measures
/// nothing. What is left keeps the equations of one plane solvable.
const TANGENTIAL: f32 = 0.01;

/// Matches summed in one `f32` run before they go into `f64` sums.
const CHUNK: usize = 256;

/// The sums of method 5.4 over all places with a weight: `f32` lanes inside fixed chunks, `f64`
/// across them. Compiled for each instruction set; the lanes and the order are the same on all.
pub(crate) struct Accumulate<'a> {
    pub(crate) found: &'a Found,
    /// Query points in their own frame.
    pub(crate) points: &'a Columns3,
    pub(crate) epsilon: f32,
}

impl pulp::WithSimd for Accumulate<'_> {
    type Output = HalfSums;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) -> HalfSums {
        // Places are in raster order.
        let len = self.found.len();
        let half = (len / 2).next_multiple_of(LANES);
        HalfSums { upper: accumulate(&self, 0..half), lower: accumulate(&self, half..len) }
    }
}

type GicpSums = [Lanes; 73];

#[inline(always)]
fn accumulate(it: &Accumulate<'_>, places: Range<usize>) -> BlockSums {
    let n = it.found.weight[places.clone()].iter().filter(|w| **w > 0.0).count() as u32;
    let mut sums = BlockSums { n, ..BlockSums::default() };
    for start in places.clone().step_by(CHUNK) {
        let mut lanes = [Lanes::ZERO; 73];
        for at in (start..places.end.min(start + CHUNK)).step_by(LANES) {
            // Queries are in raster order, and so are those without a match: whole lanes of them add zeros.
            if it.found.weight[at..at + LANES].iter().fold(0.0f32, |most, &weight| most.max(weight)) > 0.0 {
                add_lanes(it, at, &mut lanes);
            }
        }
        let mut total = lanes.iter().map(|lane| lane.0.iter().map(|&v| f64::from(v)).sum::<f64>());
        for value in sums.q.iter_mut().chain(&mut sums.l).chain(std::iter::once(&mut sums.c)) {
            *value += total.next().unwrap_or(0.0);
        }
    }
    sums
}

/// Factor of `u u^T` in Omega for `d`, and the other way round (method 4.2); `w`: the weight.
#[inline(always)]
pub(crate) fn information_along_normals(w: Lanes, d: [Lanes; 3], epsilon: f32) -> Lanes {
    let s = 1.0 - epsilon;
    let (two_epsilon, half_s) = (Lanes::splat(2.0 * epsilon), Lanes::splat(0.5 * s));
    w * Lanes::splat(0.25 * s) / (two_epsilon + half_s * dot(d, d))
}

/// Adds eight places.
#[inline(always)]
fn add_lanes(it: &Accumulate<'_>, at: usize, sums: &mut GicpSums) {
    let found = it.found;
    let w = Lanes::load(&found.weight, at);
    let (e, na, nb) = (found.e.load(at), found.na.load(at), found.nb.load(at));
    let [x, y, z] = it.points.load(at);
    let tilde = [x, y, z, Lanes::splat(1.0)];
    let u: [Lanes; 3] = std::array::from_fn(|c| na[c] + nb[c]);
    let d: [Lanes; 3] = std::array::from_fn(|c| na[c] - nb[c]);
    // Eq. 13 in closed form (method 4.2), with a' = R n_a, b' = n_b, u = a' + b', d = a' - b':
    // Omega = I/2 + (s/4) / (2 eps + s |d|^2/2) u u^T + (s/4) / (2 eps + s |u|^2/2) d d^T, s = 1 - eps.
    // No inverse, no division by zero, and good to 1e-6 in f32. Only the first of the three terms, that along the
    // normals, is what a match measures: see TANGENTIAL.
    let plus = information_along_normals(w, d, it.epsilon);
    let minus = information_along_normals(w, u, it.epsilon);
    let minus = minus * Lanes::splat(TANGENTIAL);
    let half = w * Lanes::splat(0.5 * TANGENTIAL);
    let entry = |r: usize, c: usize| plus * u[r] * u[c] + minus * d[r] * d[c];
    let omega =
        [half + entry(0, 0), entry(0, 1), entry(0, 2), half + entry(1, 1), entry(1, 2), half + entry(2, 2)];
    // Omega e, and the term e^T Omega e of eq. 11.
    let oe = [
        omega[0] * e[0] + omega[1] * e[1] + omega[2] * e[2],
        omega[1] * e[0] + omega[3] * e[1] + omega[4] * e[2],
        omega[2] * e[0] + omega[4] * e[1] + omega[5] * e[2],
    ];
    let cost = dot(e, oe);
    let mut at = 0;
    for k in 0..4 {
        for m in k..4 {
            let product = tilde[k] * tilde[m];
            for o in &omega {
                sums[at] = sums[at] + product * *o;
                at += 1;
            }
        }
    }
    for t in &tilde {
        for component in &oe {
            sums[at] = sums[at] + *t * *component;
            at += 1;
        }
    }
    sums[72] = sums[72] + cost;
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};

    /// One match in a run of lanes: the sums of `a~ = (0, 0, 0, 1)`.
    fn sums_of_one(e: [f32; 3], na: [f32; 3], nb: [f32; 3], epsilon: f32) -> BlockSums {
        let mut found = Found::default();
        found.resize(LANES);
        found.e.set(0, e);
        found.na.set(0, na);
        found.nb.set(0, nb);
        found.weight[0] = 1.0;
        let mut points = Columns3::default();
        points.resize(LANES);
        accumulate(&Accumulate { found: &found, points: &points, epsilon }, 0..LANES)
    }

    #[test]
    fn the_closed_form_information_equals_the_inverse() {
        let epsilon = 1e-3f64;
        let normals = [
            (Vector3::new(0.0, 0.0, -1.0), Vector3::new(0.0, 0.0, -1.0)),
            (Vector3::new(0.6, 0.0, -0.8), Vector3::new(0.0, 0.0, -1.0)),
            (Vector3::new(0.6, 0.0, -0.8), Vector3::new(0.61, 0.02, -0.79).normalize()),
            (Vector3::new(1.0, 0.0, 0.0), Vector3::new(0.0, 1.0, 0.0)),
        ];
        let single = |v: &Vector3<f64>| [v.x as f32, v.y as f32, v.z as f32];
        for (na, nb) in normals {
            let e = Vector3::new(0.01, -0.02, 0.005);
            let sums = sums_of_one(single(&e), single(&na), single(&nb), epsilon as f32);
            assert_eq!(sums.n, 1);
            let sigma = |n: &Vector3<f64>| Matrix3::identity() - n * n.transpose() * (1.0 - epsilon);
            let inverse = (sigma(&na) + sigma(&nb)).try_inverse().unwrap();
            // Along the normals all of it, of the rest a part.
            let (u, d) = (na + nb, na - nb);
            let s = 1.0 - epsilon;
            let along = u * u.transpose() * (0.25 * s / (2.0 * epsilon + 0.5 * s * d.norm_squared()));
            let exact = along + (inverse - along) * f64::from(TANGENTIAL);
            // a~ = (0, 0, 0, 1): the last six of Q are Omega itself.
            let upper = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
            for (k, (r, c)) in upper.into_iter().enumerate() {
                let error = (sums.q[54 + k] - exact[(r, c)]).abs();
                assert!(error < 1e-5 * exact.norm(), "{na:?} {nb:?}: {error}");
            }
            assert!((sums.c - e.dot(&(exact * e))).abs() < 1e-4 * sums.c);
        }
    }
}
