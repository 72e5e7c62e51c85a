//! How the features of a pair move with the errors that all of them share: lag and focal ratio of colour (method 14.4).

use crate::estimation::colour_model::ColourModel;
use crate::estimation::colour_pose::Coupling;
use crate::pairs::residuals::{PairMotion, RobustResidual};
use crate::pairs::weighted_pair::FeaturePair;
use nalgebra::{Matrix3x2, Vector3};
use tessera_geometry::{Twist, hat};

/// The coupling of a pair's inliers at the pose that they agree on; `velocities` of query and target.
pub(crate) fn coupling(pair: &FeaturePair, velocities: [&Twist; 2], model: &ColourModel) -> Coupling {
    let mut sum = Coupling::zeros();
    let FeaturePair { target_from_query, inliers, .. } = pair;
    let rotation = target_from_query.rotation.to_rotation_matrix().into_inner();
    let at = PairMotion::from(target_from_query);
    for residual in inliers.iter().filter_map(|c| RobustResidual::of(c, &at, pair.variance_factor)) {
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
