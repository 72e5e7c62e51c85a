//! How the colour camera lies against the depth camera, from the disagreement of their poses (method 14.2).
//!
//! A reference gives the relative pose of a frame from surfaces and, about `x_f = -N_f^-1 (g_f + K p)`, from
//! features, where `p` are the errors that all features share: lag and focal ratio. With `S = s_s^2 N_s^-1 + s_f^2 N_f^-1` (the noise scales, method 9.5) the disagreement
//! `d = x_s - x_f` is `N(-N_f^-1 K p, S)`: normal equations of `p` whose deviations are those of the poses, in
//! directions that the surfaces leave open as large as they are there.

use crate::features::colour_model::ColourModel;
use crate::features::residuals::{PairMotion, RobustResidual};
use nalgebra::{Matrix2, Matrix3x2, Matrix6x2, Vector2, Vector3};
use tessera_features::Correspondence;
use tessera_geometry::{Matrix6, Pose, Twist, Vector6, hat};

/// Lag, and focal ratio less one.
pub(crate) type ColourParameters = Vector2<f64>;
/// A matrix over the parameters.
pub(crate) type ParameterMatrix = Matrix2<f64>;
/// `K = sum J^T Omega E`: how a pair's gradient changes with the parameters.
pub(crate) type Coupling = Matrix6x2<f64>;

/// Normal equations of the parameters, about those in effect.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct ParameterSums {
    pub(crate) information: ParameterMatrix,
    pub(crate) gradient: ColourParameters,
}

impl ParameterSums {
    /// Adds a pair: `pull` is the gradient of the surfaces at the joint optimum of the two groups, `of_features`
    /// and `joint` their scaled normal matrices, `coupling` scaled as the features.
    pub(crate) fn add(
        &mut self,
        pull: &Vector6,
        (of_features, joint): (&Matrix6, &Matrix6),
        coupling: &Coupling,
        weight: f64,
    ) -> Option<()> {
        let alone = of_features.cholesky()?.solve(coupling);
        let information = coupling.transpose() * (alone - joint.cholesky()?.solve(coupling));
        self.information += (information + information.transpose()) * (0.5 * weight);
        self.gradient += alone.transpose() * pull * weight;
        Some(())
    }
}

/// The coupling of a pair's inliers at the pose that they agree on; `velocities` of query and target.
pub(crate) fn coupling(
    inliers: &[Correspondence],
    target_from_query: &Pose,
    velocities: [&Twist; 2],
    model: &ColourModel,
) -> Coupling {
    let mut sum = Coupling::zeros();
    let rotation = target_from_query.rotation.to_rotation_matrix().into_inner();
    let at = PairMotion::from(target_from_query);
    for residual in inliers.iter().filter_map(|c| RobustResidual::of(c, &at)) {
        let [query, target] = velocities;
        let slope = moves(&residual.b, target, model) - rotation * moves(&residual.a, query, model);
        let weighted = residual.omega * slope;
        let turned = rotation.transpose() * weighted;
        // e(T exp(x)) = b - R (a + rho + phi x a) - t.
        let lever = hat(&residual.a);
        let mut rows = Coupling::zeros();
        rows.fixed_rows_mut::<3>(0).copy_from(&-turned);
        rows.fixed_rows_mut::<3>(3).copy_from(&-(lever * turned));
        sum += rows;
    }
    sum
}

/// How a feature's point moves with each parameter: along the surface, which is taken as facing the camera.
fn moves(p: &Vector3<f64>, velocity: &Twist, model: &ColourModel) -> Matrix3x2<f64> {
    let by_lag = velocity.phi.cross(p) + velocity.rho;
    let by_ratio = Vector3::new(p.x, p.y, 0.0) / -model.focal_ratio;
    Matrix3x2::from_columns(&[by_lag - p * (by_lag.z / p.z), by_ratio])
}
