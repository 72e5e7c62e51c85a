//! The sums of one pair over its matches, eight at a time (SPEC 4.2, 5.4).

use crate::block::BlockSums;

/// One correspondence, both frames at their stamps.
#[derive(Clone, Copy, Debug)]
pub struct Match {
    /// Query point in its own frame, metres.
    pub a: [f32; 3],
    /// Residual `b - T a` in the target's frame, metres.
    pub e: [f32; 3],
    /// Query's normal in the target's frame.
    pub na: [f32; 3],
    /// Target's normal.
    pub nb: [f32; 3],
    pub(crate) vertex: u32,
    pub(crate) distance_sq: f32,
    /// Normal residual in standard deviations of depth.
    pub sigmas: f32,
    /// Factor of its cost.
    pub weight: f32,
}

impl Match {
    /// A correspondence of weight one.
    pub fn new(a: [f32; 3], e: [f32; 3], na: [f32; 3], nb: [f32; 3]) -> Self {
        Self { a, e, na, nb, weight: 1.0, ..Self::NONE }
    }

    /// A match that counts nothing, to fill lanes up.
    const NONE: Self = Self {
        a: [0.0; 3],
        e: [0.0; 3],
        na: [0.0; 3],
        nb: [0.0; 3],
        vertex: 0,
        distance_sq: 0.0,
        sigmas: 0.0,
        weight: 0.0,
    };
}

/// Matches summed in one `f32` run before they go into `f64` sums.
const CHUNK: usize = 256;
/// Lanes of the sums: fixed, so that the bits do not depend on the machine.
const LANES: usize = 8;

/// The sums of SPEC 5.4 over all matches: `f32` lanes inside fixed chunks, `f64` across them.
/// Compiled for each instruction set; the lanes and the order are the same on all.
pub(crate) struct Accumulate<'a> {
    pub(crate) matches: &'a [Match],
    pub(crate) epsilon: f32,
}

impl pulp::WithSimd for Accumulate<'_> {
    type Output = BlockSums;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) -> BlockSums {
        accumulate(self.matches, self.epsilon)
    }
}

#[inline(always)]
fn accumulate(matches: &[Match], epsilon: f32) -> BlockSums {
    let mut sums = BlockSums { n: matches.len() as u32, ..BlockSums::default() };
    for chunk in matches.chunks(CHUNK) {
        let mut lanes = [[0.0f32; LANES]; 73];
        let (whole, rest) = chunk.as_chunks::<LANES>();
        for eight in whole {
            add_lanes(eight, epsilon, &mut lanes);
        }
        if !rest.is_empty() {
            let mut eight = [Match::NONE; LANES];
            eight[..rest.len()].copy_from_slice(rest);
            add_lanes(&eight, epsilon, &mut lanes);
        }
        let mut total = lanes.iter().map(|lane| lane.iter().map(|&v| f64::from(v)).sum::<f64>());
        for value in sums.q.iter_mut().chain(&mut sums.l).chain(std::iter::once(&mut sums.c)) {
            *value += total.next().unwrap_or(0.0);
        }
    }
    sums
}

type Lane = [f32; LANES];

#[inline(always)]
fn lane(f: impl Fn(usize) -> f32) -> Lane {
    std::array::from_fn(f)
}

/// Adds eight matches.
#[inline(always)]
fn add_lanes(matches: &[Match; LANES], epsilon: f32, sums: &mut [Lane; 73]) {
    let s = 1.0 - epsilon;
    let tilde =
        [lane(|l| matches[l].a[0]), lane(|l| matches[l].a[1]), lane(|l| matches[l].a[2]), [1.0; LANES]];
    let e = [lane(|l| matches[l].e[0]), lane(|l| matches[l].e[1]), lane(|l| matches[l].e[2])];
    let na = [lane(|l| matches[l].na[0]), lane(|l| matches[l].na[1]), lane(|l| matches[l].na[2])];
    let nb = [lane(|l| matches[l].nb[0]), lane(|l| matches[l].nb[1]), lane(|l| matches[l].nb[2])];
    let w = lane(|l| matches[l].weight);
    let u: [Lane; 3] = std::array::from_fn(|c| lane(|l| na[c][l] + nb[c][l]));
    let d: [Lane; 3] = std::array::from_fn(|c| lane(|l| na[c][l] - nb[c][l]));
    let dot = |x: &[Lane; 3], l: usize| x[0][l] * x[0][l] + x[1][l] * x[1][l] + x[2][l] * x[2][l];
    // SPEC 4.2: no inverse, no division by zero, and good to 1e-6 in f32.
    let plus = lane(|l| w[l] * 0.25 * s / (2.0 * epsilon + 0.5 * s * dot(&d, l)));
    let minus = lane(|l| w[l] * 0.25 * s / (2.0 * epsilon + 0.5 * s * dot(&u, l)));
    let entry = |r: usize, c: usize| {
        lane(|l| {
            let half = if r == c { 0.5 * w[l] } else { 0.0 };
            half + plus[l] * u[r][l] * u[c][l] + minus[l] * d[r][l] * d[c][l]
        })
    };
    let omega = [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)];
    let oe = [
        lane(|l| omega[0][l] * e[0][l] + omega[1][l] * e[1][l] + omega[2][l] * e[2][l]),
        lane(|l| omega[1][l] * e[0][l] + omega[3][l] * e[1][l] + omega[4][l] * e[2][l]),
        lane(|l| omega[2][l] * e[0][l] + omega[4][l] * e[1][l] + omega[5][l] * e[2][l]),
    ];
    let mut at = 0;
    for k in 0..4 {
        for m in k..4 {
            let product = lane(|l| tilde[k][l] * tilde[m][l]);
            for o in &omega {
                for l in 0..LANES {
                    sums[at][l] += product[l] * o[l];
                }
                at += 1;
            }
        }
    }
    for t in &tilde {
        for component in &oe {
            for l in 0..LANES {
                sums[at][l] += t[l] * component[l];
            }
            at += 1;
        }
    }
    for l in 0..LANES {
        sums[72][l] += e[0][l] * oe[0][l] + e[1][l] * oe[1][l] + e[2][l] * oe[2][l];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};

    #[test]
    fn the_closed_form_information_equals_the_inverse() {
        let epsilon = 1e-3f64;
        let normals = [
            (Vector3::new(0.0, 0.0, -1.0), Vector3::new(0.0, 0.0, -1.0)),
            (Vector3::new(0.6, 0.0, -0.8), Vector3::new(0.0, 0.0, -1.0)),
            (Vector3::new(0.6, 0.0, -0.8), Vector3::new(0.61, 0.02, -0.79).normalize()),
            (Vector3::new(1.0, 0.0, 0.0), Vector3::new(0.0, 1.0, 0.0)),
        ];
        for (na, nb) in normals {
            let e = Vector3::new(0.01, -0.02, 0.005);
            let m = Match {
                a: [0.0; 3],
                e: [e.x as f32, e.y as f32, e.z as f32],
                na: [na.x as f32, na.y as f32, na.z as f32],
                nb: [nb.x as f32, nb.y as f32, nb.z as f32],
                vertex: 0,
                distance_sq: 0.0,
                sigmas: 0.0,
                weight: 1.0,
            };
            let sums = accumulate(&[m], epsilon as f32);
            let sigma = |n: &Vector3<f64>| Matrix3::identity() - n * n.transpose() * (1.0 - epsilon);
            let exact = (sigma(&na) + sigma(&nb)).try_inverse().unwrap();
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
