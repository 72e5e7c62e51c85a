//! Poses and camera in one system; the poses eliminated (Schur complement).

use crate::parameters::{N_PARAMETERS, Parameters};
use crate::residuals::{N_PAIR, PairSums};
use faer::linalg::solvers::Solve;
use faer::sparse::{SparseColMat, Triplet};
use faer::{Mat, Par, Side};
use nalgebra::{SMatrix, SVector};
use tessera_geometry::{Matrix6, Twist, Vector6, adjoint};

/// A matrix over the camera's parameters.
pub(crate) type CameraMatrix = SMatrix<f64, N_PARAMETERS, N_PARAMETERS>;

type Border = SMatrix<f64, 6, N_PARAMETERS>;

/// Damping of the poses relative to their mean information: a pose direction that no pair sees
/// (along a corridor) stays, and the weakest real one is far stronger.
const POSE_DAMPING: f64 = 1e-7;

/// The camera's own system once the poses follow it.
pub(crate) struct Reduced {
    /// Information of the camera with the poses free.
    pub(crate) information: CameraMatrix,
    /// Gradient of half the cost.
    pub(crate) gradient: Parameters,
    /// For each free pose its derivative by the camera, and its own step.
    follow: Vec<(Border, Vector6)>,
}

/// One pair's share of the pose graph.
struct Shares {
    ad: Matrix6,
    h: Matrix6,
    border: Border,
    g: Vector6,
}

impl Shares {
    fn of(pair: &PairSums) -> Self {
        Self {
            // J_target = -J_query Ad(query_from_target) (SPEC 4.1).
            ad: adjoint(&pair.target_from_query.inverse()),
            h: pair.h.fixed_view::<6, 6>(0, 0).into_owned(),
            border: pair.h.fixed_view::<6, N_PARAMETERS>(0, 6).into_owned(),
            g: pair.g.fixed_rows::<6>(0).into_owned(),
        }
    }
}

/// Eliminates the poses, the first one fixed; `None` when the system cannot be factorised.
pub(crate) fn reduce(pairs: &[PairSums], n_poses: usize) -> Option<Reduced> {
    let n_free = n_poses.checked_sub(1)?;
    let mut blocks = Vec::with_capacity(pairs.len() * 3);
    let mut borders = vec![Border::zeros(); n_poses];
    let mut gradients = vec![Vector6::zeros(); n_poses];
    let (mut camera, mut camera_gradient) = (CameraMatrix::zeros(), Parameters::zeros());
    for pair in pairs {
        let s = Shares::of(pair);
        let (i, j) = (pair.query, pair.target);
        let h_ad = s.h * s.ad;
        blocks.push((i, i, s.h));
        blocks.push((j, j, s.ad.transpose() * h_ad));
        // The lower triangle: the larger index is the row.
        blocks.push(if i > j { (i, j, -h_ad) } else { (j, i, -h_ad.transpose()) });
        borders[i] += s.border;
        borders[j] -= s.ad.transpose() * s.border;
        gradients[i] += s.g;
        gradients[j] -= s.ad.transpose() * s.g;
        camera += pair.h.fixed_view::<N_PARAMETERS, N_PARAMETERS>(6, 6);
        camera_gradient += pair.g.fixed_rows::<N_PARAMETERS>(6);
    }
    let solution = solve(&blocks, &borders, &gradients, n_free)?;
    let follow: Vec<(Border, Vector6)> = (0..n_free)
        .map(|p| {
            let at = |r: usize, c: usize| solution[(6 * p + r, c)];
            (Border::from_fn(at), Vector6::from_fn(|r, _| at(r, N_PARAMETERS)))
        })
        .collect();
    let mut reduced = Reduced { information: camera, gradient: camera_gradient, follow };
    for (p, (by_camera, step)) in reduced.follow.iter().enumerate() {
        reduced.information -= borders[p + 1].transpose() * by_camera;
        reduced.gradient -= borders[p + 1].transpose() * step;
    }
    Some(reduced)
}

impl Reduced {
    /// Step of pose `index` when the camera takes `step`.
    pub(crate) fn pose_step(&self, index: usize, step: &Parameters) -> Twist {
        let Some((by_camera, own)) = index.checked_sub(1).and_then(|p| self.follow.get(p)) else {
            return Twist::default();
        };
        Twist::from_vector(&-(own + by_camera * step))
    }

    /// What a pair says of the camera with the poses following: its information, and its gradient
    /// once the camera has taken `step`.
    pub(crate) fn share_of(&self, pair: &PairSums, step: &Parameters) -> (CameraMatrix, Parameters) {
        let ad = adjoint(&pair.target_from_query.inverse());
        let mut follow = SMatrix::<f64, N_PAIR, N_PARAMETERS>::identity();
        follow
            .fixed_view_mut::<6, N_PARAMETERS>(0, 0)
            .copy_from(&(ad * self.by_camera(pair.target) - self.by_camera(pair.query)));
        follow.fixed_view_mut::<N_PARAMETERS, N_PARAMETERS>(6, 0).copy_from(&CameraMatrix::identity());
        let [by_query, by_target] =
            [pair.query, pair.target].map(|pose| self.pose_step(pose, step).to_vector());
        let mut moved = SVector::<f64, N_PAIR>::zeros();
        moved.fixed_rows_mut::<6>(0).copy_from(&(by_query - ad * by_target));
        moved.fixed_rows_mut::<N_PARAMETERS>(6).copy_from(step);
        (follow.transpose() * pair.h * follow, follow.transpose() * (pair.g + pair.h * moved))
    }

    fn by_camera(&self, index: usize) -> Border {
        index.checked_sub(1).and_then(|p| self.follow.get(p)).map_or(Border::zeros(), |f| f.0)
    }
}

/// `(H + damping) x = [border, gradient]` for the free poses.
fn solve(
    blocks: &[(usize, usize, Matrix6)],
    borders: &[Border],
    gradients: &[Vector6],
    n_free: usize,
) -> Option<Mat<f64>> {
    let trace: f64 = blocks.iter().filter(|b| b.0 == b.1).map(|b| b.2.trace()).sum();
    let damping = POSE_DAMPING * trace / (6 * borders.len()) as f64 + f64::MIN_POSITIVE;
    let mut triplets = Vec::with_capacity(blocks.len() * 36);
    for &(row, column, block) in blocks.iter().filter(|b| b.0 > 0 && b.1 > 0) {
        for c in 0..6 {
            for r in 0..6 {
                triplets.push(Triplet::new(6 * (row - 1) + r, 6 * (column - 1) + c, block[(r, c)]));
            }
        }
    }
    triplets.extend((0..6 * n_free).map(|k| Triplet::new(k, k, damping)));
    faer::set_global_parallelism(Par::Seq);
    let matrix = SparseColMat::<usize, f64>::try_new_from_triplets(6 * n_free, 6 * n_free, &triplets).ok()?;
    let factor = matrix.sp_cholesky(Side::Lower).ok()?;
    let rhs = Mat::from_fn(6 * n_free, N_PARAMETERS + 1, |r, c| {
        let (p, r) = (r / 6 + 1, r % 6);
        if c < N_PARAMETERS { borders[p][(r, c)] } else { gradients[p][r] }
    });
    Some(factor.solve(rhs))
}
