//! The exact sufficient statistics of all correspondences of one pair (eq. 11-13; method 5.3-5.4).
//!
//! With the information matrices and the correspondences frozen, the residual of a match
//! `(a, b)` is linear in the twelve numbers of `T = [R|t]`. Written around the transform
//! `T0` at which the matches were found, `e = e0 - (T - T0) a~` with `a~ = (a, 1)`, the cost is
//! `F(X) = X Q X - 2 l X + c` for `X = vec(T - T0)`: no large numbers cancel, and the inner
//! iterations cost nothing per point.

mod quadratic;

use nalgebra::{Matrix3, Matrix3x4, Vector3};
pub use quadratic::Quadratic;
use std::sync::Arc;
use tessera_geometry::{Matrix6, Pose, Vector6};

/// Raw sums over matches: `Q` (10 products of `a~` times 6 of `Omega`), `l` (4 times 3), `c`,
/// and the number of matches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockSums {
    /// `sum a~_k a~_l Omega`, pairs `(k, l)` in the order 00 01 02 03 11 12 13 22 23 33, each
    /// with the upper triangle of `Omega` row by row.
    pub q: [f64; 60],
    /// `sum a~_k Omega e0`.
    pub l: [f64; 12],
    /// `sum e0 Omega e0`.
    pub c: f64,
    /// Matches.
    pub n: u32,
}

impl BlockSums {
    /// Adds one residual `e0 = b - T0 a` with its information, of any kind.
    pub fn add(&mut self, a: &Vector3<f64>, e0: &Vector3<f64>, omega: &Matrix3<f64>) {
        let tilde = [a.x, a.y, a.z, 1.0];
        let upper =
            [omega[(0, 0)], omega[(0, 1)], omega[(0, 2)], omega[(1, 1)], omega[(1, 2)], omega[(2, 2)]];
        let weighted = omega * e0;
        let mut at = 0;
        for k in 0..4 {
            for m in k..4 {
                let product = tilde[k] * tilde[m];
                for entry in upper {
                    self.q[at] += product * entry;
                    at += 1;
                }
            }
            for c in 0..3 {
                self.l[3 * k + c] += tilde[k] * weighted[c];
            }
        }
        self.c += e0.dot(&weighted);
    }

    /// The same cost about another transform: exact. `from`: the transform that these sums are about.
    pub fn about(&self, from: &Pose, to: &Pose) -> Self {
        let x = matrix_of(to) - matrix_of(from);
        let terms = ExactTerms::new(self);
        let mut moved = *self;
        for k in 0..4 {
            let mut sum = Vector3::zeros();
            for m in 0..4 {
                sum += terms.q[PLACE[k][m]] * x.column(m);
            }
            (0..3).for_each(|c| moved.l[3 * k + c] -= sum[c]);
        }
        moved.c = terms.cost(&x);
        moved
    }

    /// Adds `factor` times another cost about the same transform; the number of matches stays.
    pub fn add_scaled(&mut self, other: &Self, factor: f64) {
        (0..60).for_each(|k| self.q[k] += factor * other.q[k]);
        (0..12).for_each(|k| self.l[k] += factor * other.l[k]);
        self.c += factor * other.c;
    }
}

/// The matches of a pair in two halves of the image: what they disagree by tells how far all of them err together.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HalfSums {
    /// Of the rows above.
    pub upper: BlockSums,
    /// Of the rows below.
    pub lower: BlockSums,
}

impl HalfSums {
    /// Both together.
    pub fn all(&self) -> BlockSums {
        let mut sums = self.upper;
        sums.add_scaled(&self.lower, 1.0);
        sums.n += self.lower.n;
        sums
    }
}

impl Default for BlockSums {
    fn default() -> Self {
        Self { q: [0.0; 60], l: [0.0; 12], c: 0.0, n: 0 }
    }
}

/// One pair's cost as a function of `target_from_query`.
#[derive(Clone, Debug)]
pub struct PairBlock {
    /// `T0`, where the matches were found, as a 3x4 matrix.
    origin: Matrix3x4<f64>,
    terms: BlockTerms,
    n: u32,
}

#[derive(Clone, Debug)]
enum BlockTerms {
    Exact(Arc<ExactTerms>),
    /// Where the sums over the matches were not kept.
    Quadratic(Arc<Quadratic>),
}

/// The cost of matches as sums, exact at any transform.
#[derive(Clone, Debug)]
struct ExactTerms {
    /// `Q` by pairs of columns, see [`PLACE`].
    q: [Matrix3<f64>; 10],
    l: [Vector3<f64>; 4],
    c: f64,
}

/// Where the block of columns `k` and `m` stands in `Q`: it is symmetric, and so is each block.
const PLACE: [[usize; 4]; 4] = [[0, 1, 2, 3], [1, 4, 5, 6], [2, 5, 7, 8], [3, 6, 8, 9]];

fn matrix_of(pose: &Pose) -> Matrix3x4<f64> {
    let mut m = Matrix3x4::zeros();
    m.fixed_view_mut::<3, 3>(0, 0).copy_from(pose.rotation.to_rotation_matrix().matrix());
    m.set_column(3, &pose.translation.vector);
    m
}

impl PairBlock {
    /// A block from its sums and the transform at which the matches were found.
    pub fn new(target_from_query: &Pose, sums: &BlockSums) -> Self {
        let terms = BlockTerms::Exact(Arc::new(ExactTerms::new(sums)));
        Self { origin: matrix_of(target_from_query), terms, n: sums.n }
    }

    /// A block of `n` matches from what is known of its cost about a transform.
    pub fn quadratic(target_from_query: &Pose, cost: Quadratic, n: u32) -> Self {
        Self { origin: matrix_of(target_from_query), terms: BlockTerms::Quadratic(Arc::new(cost)), n }
    }

    /// Matches in the block.
    pub fn n_matches(&self) -> u32 {
        self.n
    }

    /// The cost `sum e Omega e` at another transform: exact while the matches are frozen, unless the block is
    /// quadratic.
    pub fn cost(&self, target_from_query: &Pose) -> f64 {
        let at = matrix_of(target_from_query);
        match &self.terms {
            BlockTerms::Exact(terms) => terms.cost(&(at - self.origin)),
            BlockTerms::Quadratic(terms) => terms.cost(&self.origin, &at),
        }
    }

    /// How far the matched points are from where they were found, at another transform: `sum d^T Omega d` over their
    /// displacements, exact unless the block is quadratic.
    pub fn displacement(&self, target_from_query: &Pose) -> f64 {
        let at = matrix_of(target_from_query);
        match &self.terms {
            BlockTerms::Exact(terms) => terms.displacement(&(at - self.origin)),
            BlockTerms::Quadratic(terms) => terms.displacement(&self.origin, &at),
        }
    }

    /// Gauss-Newton terms for a right perturbation of the query's pose: `(H, g, F)` with
    /// `H d = -g` and `F` without the factor one half.
    pub fn linearise(&self, target_from_query: &Pose) -> (Matrix6, Vector6, f64) {
        let at = matrix_of(target_from_query);
        match &self.terms {
            BlockTerms::Exact(terms) => terms.linearise(&self.origin, &at),
            BlockTerms::Quadratic(terms) => terms.linearise(&self.origin, &at),
        }
    }
}

impl ExactTerms {
    fn new(sums: &BlockSums) -> Self {
        let mut q = [Matrix3::zeros(); 10];
        for (block, s) in q.iter_mut().zip(sums.q.chunks_exact(6)) {
            *block = Matrix3::new(s[0], s[1], s[2], s[1], s[3], s[4], s[2], s[4], s[5]);
        }
        let l = [0, 1, 2, 3].map(|k| Vector3::new(sums.l[3 * k], sums.l[3 * k + 1], sums.l[3 * k + 2]));
        Self { q, l, c: sums.c }
    }

    fn displacement(&self, x: &Matrix3x4<f64>) -> f64 {
        let mut squared = 0.0;
        for k in 0..4 {
            let mut sum = Vector3::zeros();
            for m in 0..4 {
                sum += self.q[PLACE[k][m]] * x.column(m);
            }
            squared += x.column(k).dot(&sum);
        }
        squared
    }

    fn cost(&self, x: &Matrix3x4<f64>) -> f64 {
        let mut cost = self.c;
        for k in 0..4 {
            let xk = x.column(k).into_owned();
            cost -= 2.0 * self.l[k].dot(&xk);
            let mut sum = Vector3::zeros();
            for m in 0..4 {
                sum += self.q[PLACE[k][m]] * x.column(m);
            }
            cost += xk.dot(&sum);
        }
        cost
    }

    fn linearise(&self, origin: &Matrix3x4<f64>, at: &Matrix3x4<f64>) -> (Matrix6, Vector6, f64) {
        let x = at - origin;
        let r = at.fixed_view::<3, 3>(0, 0).into_owned();
        let rt = r.transpose();
        let mut cost = self.c;
        let mut v = [Vector3::zeros(); 4];
        for k in 0..4 {
            for m in 0..4 {
                v[k] += self.q[PLACE[k][m]] * x.column(m);
            }
            let xk = x.column(k).into_owned();
            cost += xk.dot(&(v[k] - 2.0 * self.l[k]));
            v[k] = rt * (v[k] - self.l[k]);
        }
        let turned = self.q.map(|block| rt * block * r);
        // d t = R rho, d R e_k = -R [e_k]x phi: D_3 = R for rho, D_k = -R [e_k]x for phi.
        // [e_k]x has two entries: row k2, column k1 is 1, and row k1, column k2 is -1.
        let mut g_phi = Vector3::zeros();
        let mut h_rho_phi = Matrix3::zeros();
        let mut h_phi = Matrix3::zeros();
        for k in 0..3 {
            let (k1, k2) = ((k + 1) % 3, (k + 2) % 3);
            g_phi[k2] += v[k][k1];
            g_phi[k1] -= v[k][k2];
            let rho = &turned[PLACE[3][k]];
            for row in 0..3 {
                h_rho_phi[(row, k1)] -= rho[(row, k2)];
                h_rho_phi[(row, k2)] += rho[(row, k1)];
            }
            for m in 0..3 {
                let (m1, m2) = ((m + 1) % 3, (m + 2) % 3);
                let phi = &turned[PLACE[k][m]];
                h_phi[(k2, m1)] -= phi[(k1, m2)];
                h_phi[(k2, m2)] += phi[(k1, m1)];
                h_phi[(k1, m1)] += phi[(k2, m2)];
                h_phi[(k1, m2)] -= phi[(k2, m1)];
            }
        }
        let mut h = Matrix6::zeros();
        h.fixed_view_mut::<3, 3>(0, 0).copy_from(&turned[PLACE[3][3]]);
        h.fixed_view_mut::<3, 3>(0, 3).copy_from(&h_rho_phi);
        h.fixed_view_mut::<3, 3>(3, 0).copy_from(&h_rho_phi.transpose());
        h.fixed_view_mut::<3, 3>(3, 3).copy_from(&h_phi);
        let g = Vector6::new(v[3].x, v[3].y, v[3].z, g_phi.x, g_phi.y, g_phi.z);
        (h, g, cost)
    }
}

#[cfg(test)]
mod tests;
