//! Poses and camera in one system; the poses eliminated (Schur complement).

use crate::parameters::{N_PARAMETERS, Parameters};
use crate::residuals::{N_PAIR, PairSums};
use nalgebra::{SMatrix, SVector};
use tessera_geometry::{Matrix6, Twist, Vector6, adjoint};
use tessera_numerics::{BlockCholesky, Isa};

/// A matrix over the camera's parameters.
pub(crate) type CameraMatrix = SMatrix<f64, N_PARAMETERS, N_PARAMETERS>;

type Border = SMatrix<f64, 6, N_PARAMETERS>;

/// The border and the gradient of one pose: the right-hand sides of its six rows.
const N_SIDES: usize = N_PARAMETERS + 1;
type SideTerms = SMatrix<f64, 6, N_SIDES>;

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
    fn new(pair: &PairSums) -> Self {
        Self {
            // J_target = -J_query Ad(query_from_target) (method 4.1).
            ad: adjoint(&pair.target_from_query.inverse()),
            h: pair.h.fixed_view::<6, 6>(0, 0).into_owned(),
            border: pair.h.fixed_view::<6, N_PARAMETERS>(0, 6).into_owned(),
            g: pair.g.fixed_rows::<6>(0).into_owned(),
        }
    }
}

/// Eliminates the poses, the first one fixed; `None` when the system cannot be factorised.
pub(crate) fn reduce(pairs: &[PairSums], n_poses: usize) -> Option<Reduced> {
    let mut poses = PoseSystem::new(n_poses);
    let (mut camera, mut camera_gradient) = (CameraMatrix::zeros(), Parameters::zeros());
    for pair in pairs {
        poses.add(pair);
        camera += pair.h.fixed_view::<N_PARAMETERS, N_PARAMETERS>(6, 6);
        camera_gradient += pair.g.fixed_rows::<N_PARAMETERS>(6);
    }
    let follow = poses.solve()?;
    let mut reduced = Reduced { information: camera, gradient: camera_gradient, follow };
    for ((by_camera, step), border) in reduced.follow.iter().zip(poses.borders.iter().skip(1)) {
        reduced.information -= border.transpose() * by_camera;
        reduced.gradient -= border.transpose() * step;
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

    /// A pair's part in the camera's equations with the poses following: its information, and its gradient
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

/// The normal equations of the poses, bordered by the camera: sums over all pairs, by pose.
struct PoseSystem {
    diagonal: Vec<Matrix6>,
    /// Blocks below the diagonal between free poses, by row and column among them.
    pattern: Vec<(usize, usize)>,
    blocks: Vec<Matrix6>,
    borders: Vec<Border>,
    gradients: Vec<Vector6>,
}

impl PoseSystem {
    fn new(n_poses: usize) -> Self {
        Self {
            diagonal: vec![Matrix6::zeros(); n_poses],
            pattern: Vec::new(),
            blocks: Vec::new(),
            borders: vec![Border::zeros(); n_poses],
            gradients: vec![Vector6::zeros(); n_poses],
        }
    }

    fn add(&mut self, pair: &PairSums) {
        let s = Shares::new(pair);
        let (i, j) = (pair.query, pair.target);
        let h_ad = s.h * s.ad;
        self.diagonal[i] += s.h;
        self.diagonal[j] += s.ad.transpose() * h_ad;
        // The first pose is fixed. The lower triangle: the larger index is the row.
        if i.min(j) > 0 {
            self.pattern.push((i.max(j) - 1, i.min(j) - 1));
            self.blocks.push(if i > j { -h_ad } else { -h_ad.transpose() });
        }
        self.borders[i] += s.border;
        self.borders[j] -= s.ad.transpose() * s.border;
        self.gradients[i] += s.g;
        self.gradients[j] -= s.ad.transpose() * s.g;
    }

    /// `(H + damping) [X, x] = [border, gradient]` for the free poses; `None` when it cannot be
    /// factorised.
    fn solve(&self) -> Option<Vec<(Border, Vector6)>> {
        let n_free = self.diagonal.len().checked_sub(1)?;
        let trace: f64 = self.diagonal.iter().map(|block| block.trace()).sum();
        let damping = POSE_DAMPING * trace / (6 * self.diagonal.len()) as f64 + f64::MIN_POSITIVE;
        let mut factor = BlockCholesky::new(n_free, &self.pattern, Isa::Auto.arch());
        factor.factorise(&self.diagonal[1..], &self.blocks, damping, &mut || ()).ok()?;
        let sides: Vec<SideTerms> = self.borders[1..]
            .iter()
            .zip(&self.gradients[1..])
            .map(|(border, gradient)| {
                let mut sides = SideTerms::zeros();
                sides.fixed_columns_mut::<N_PARAMETERS>(0).copy_from(border);
                sides.set_column(N_PARAMETERS, gradient);
                sides
            })
            .collect();
        let solved = factor
            .solve_columns(&sides)
            .into_iter()
            .map(|x| (x.fixed_columns::<N_PARAMETERS>(0).into_owned(), x.column(N_PARAMETERS).into_owned()));
        Some(solved.collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;
    use tessera_geometry::exp;
    use tessera_numerics::SplitMix64;

    /// A pair with random sums of full rank.
    fn pair(random: &mut SplitMix64, query: usize, target: usize) -> PairSums {
        let mut uniform = || random.next_u64() as f64 / u64::MAX as f64 - 0.5;
        let target_from_query = exp(&Twist::from_vector(&Vector6::from_fn(|_, _| uniform())));
        let root = SMatrix::<f64, N_PAIR, N_PAIR>::from_fn(|_, _| uniform());
        let (h, g) = (root.transpose() * root, SVector::from_fn(|_, _| uniform()));
        PairSums { query, target, target_from_query, h, g, sigmas_sq: 1.0, n_matches: 1 }
    }

    /// `[J, 1]`: the derivative of a pair's unknowns by all free poses and the camera.
    fn derivative(pair: &PairSums, n_free: usize) -> DMatrix<f64> {
        let mut by_all = DMatrix::zeros(N_PAIR, 6 * n_free + N_PARAMETERS);
        let ad = adjoint(&pair.target_from_query.inverse());
        if pair.query > 0 {
            by_all.view_mut((0, 6 * (pair.query - 1)), (6, 6)).fill_with_identity();
        }
        if pair.target > 0 {
            by_all.view_mut((0, 6 * (pair.target - 1)), (6, 6)).copy_from(&-ad);
        }
        by_all.view_mut((6, 6 * n_free), (N_PARAMETERS, N_PARAMETERS)).fill_with_identity();
        by_all
    }

    #[test]
    fn the_reduced_system_is_the_schur_complement_of_the_whole_one() {
        let (n_poses, mut random) = (7, SplitMix64::for_frame(5, 0));
        let edges = [(1, 0), (2, 1), (1, 2), (3, 2), (4, 3), (5, 4), (6, 5), (0, 6), (2, 6)];
        let pairs: Vec<PairSums> = edges.iter().map(|&(i, j)| pair(&mut random, i, j)).collect();
        let n_free = n_poses - 1;
        let n = 6 * n_free + N_PARAMETERS;
        let (mut h, mut g) = (DMatrix::<f64>::zeros(n, n), DMatrix::<f64>::zeros(n, 1));
        for pair in &pairs {
            let by_all = derivative(pair, n_free);
            h += by_all.transpose() * DMatrix::from_fn(N_PAIR, N_PAIR, |r, c| pair.h[(r, c)]) * &by_all;
            g += by_all.transpose() * DMatrix::from_fn(N_PAIR, 1, |r, _| pair.g[r]);
        }
        let poses = h.view((0, 0), (6 * n_free, 6 * n_free)).into_owned();
        let border = h.view((0, 6 * n_free), (6 * n_free, N_PARAMETERS)).into_owned();
        let by_camera = poses.lu().solve(&border).unwrap();
        let information = h.view((6 * n_free, 6 * n_free), (N_PARAMETERS, N_PARAMETERS)).into_owned()
            - border.transpose() * &by_camera;
        let gradient = g.view((6 * n_free, 0), (N_PARAMETERS, 1)).into_owned()
            - by_camera.transpose() * g.view((0, 0), (6 * n_free, 1));
        let reduced = reduce(&pairs, n_poses).unwrap();
        // The poses' damping is 1e-7 of their mean information.
        for r in 0..N_PARAMETERS {
            assert!((reduced.gradient[r] - gradient[(r, 0)]).abs() < 1e-5 * gradient.amax(), "gradient {r}");
            for c in 0..N_PARAMETERS {
                let far = (reduced.information[(r, c)] - information[(r, c)]).abs();
                assert!(far < 1e-5 * information.amax(), "information {r}, {c}: {far}");
            }
        }
    }

    #[test]
    fn without_a_pose_there_is_no_system() {
        assert!(reduce(&[], 0).is_none());
    }
}
