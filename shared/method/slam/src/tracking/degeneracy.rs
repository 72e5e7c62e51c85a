//! Directions of a pose that its matches do not observe (method T63, T64).
//!
//! Translation and rotation are judged apart, in metres and radians, as standard deviations after
//! the other has been eliminated (Schur), and the motion is measured at the centroid of the scene:
//! about a camera far from it, rotation and translation are nearly the same thing.

use crate::estimation::motion_filter::FRAME_S;
use crate::map::cause::{DegenerateMotion, MotionKind};
use crate::map::context::Context;
use crate::settings::WindowSettings;
use nalgebra::{Matrix3, SymmetricEigen, Vector3};
use tessera_geometry::{Matrix6, Vector6, hat};
use tessera_graph::BlockSums;

/// A motion of the new frame that the surfaces do not resist.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DegenerateDirection {
    pub(crate) motion: DegenerateMotion,
    /// The tangent vector of the motion by one metre or radian, the centroid resting in a turn.
    pub(crate) tangent: Vector6,
    /// The tangent's component along the motion is the scalar product with this.
    pub(crate) coordinate: Vector6,
}

/// Weighted centroid of the matched queries in the camera frame.
pub(crate) fn centroid<'a>(sums: impl Iterator<Item = &'a BlockSums>) -> Vector3<f64> {
    let mut total = [0.0; 4];
    for s in sums {
        // Traces of the sums over a~_k a~_3 Omega: places 03, 13, 23 and 33.
        for (k, place) in [3, 6, 8, 9].into_iter().enumerate() {
            total[k] += s.q[6 * place] + s.q[6 * place + 3] + s.q[6 * place + 5];
        }
    }
    if total[3] > 0.0 { Vector3::new(total[0], total[1], total[2]) / total[3] } else { Vector3::zeros() }
}

/// The same where no more is known than the information `H` of the pose (right tangent, translation first), with
/// the weights `tr Omega - Omega` instead of traces: as its upper right part is `- sum Omega [a]x`, what of it
/// changes its sign when transposed is `- [sum (tr Omega - Omega) a]x`.
fn centroid_by_information(information: &Matrix6) -> Vector3<f64> {
    let [tt, tr] = [0, 3].map(|column| information.fixed_view::<3, 3>(0, column).into_owned());
    let odd = tr.transpose() - tr;
    let weighted = Vector3::new(odd[(2, 1)], odd[(0, 2)], odd[(1, 0)]);
    let weights = Matrix3::identity() * tt.trace() - tt;
    weights.try_inverse().map_or(Vector3::zeros(), |inverse| inverse * weighted)
}

/// The degenerate directions of a pose with this metric information (right tangent, translation first).
pub(crate) fn degenerate_directions(
    information: &Matrix6,
    centroid: &Vector3<f64>,
) -> Vec<DegenerateDirection> {
    // rho = rho_c + c x phi: the tangent in terms of the motion of the centroid.
    let mut shift = Matrix6::identity();
    shift.fixed_view_mut::<3, 3>(0, 3).copy_from(&hat(centroid));
    let h = shift.transpose() * information * shift;
    let block = |r: usize, c: usize| h.fixed_view::<3, 3>(r, c).into_owned();
    let (tt, tr, rr) = (block(0, 0), block(0, 3), block(3, 3));
    // A little information everywhere, far below any limit, keeps the inverses finite.
    let limit = WindowSettings::FREE_SIGMA;
    let floor = Matrix3::identity() * (1e-4 / (limit * limit));
    let schur = |a: &Matrix3<f64>, b: &Matrix3<f64>, d: &Matrix3<f64>| {
        d.try_inverse().map_or(*a, |inverse| a - b * inverse * b.transpose())
    };
    let translation = schur(&tt, &tr, &(rr + floor));
    let rotation = schur(&rr, &tr.transpose(), &(tt + floor));
    let mut degenerate = Vec::new();
    for (kind, matrix) in [(MotionKind::Translation, translation), (MotionKind::Rotation, rotation)] {
        let eigen = SymmetricEigen::new((matrix + matrix.transpose()) * 0.5);
        let best = 1.0 / eigen.eigenvalues.max().max(1e-12).sqrt();
        for (k, value) in eigen.eigenvalues.iter().enumerate() {
            let sigma = 1.0 / value.max(1e-12).sqrt();
            if sigma > limit && sigma > WindowSettings::FREE_RATIO * best {
                degenerate.push(direction(kind, eigen.eigenvectors.column(k).into_owned(), sigma, centroid));
            }
        }
    }
    degenerate
}

/// Whether matches of this information of a pose, in the blocks' units, resist every motion of the camera.
pub(crate) fn is_determined(context: &Context, information: &Matrix6) -> bool {
    let metric = information / context.matcher().metric_factor();
    let centroid = centroid_by_information(information);
    degenerate_directions(&metric, &centroid).is_empty()
}

fn direction(
    kind: MotionKind,
    axis: Vector3<f64>,
    sigma: f64,
    centroid: &Vector3<f64>,
) -> DegenerateDirection {
    let six = |rho: Vector3<f64>, phi: Vector3<f64>| Vector6::new(rho.x, rho.y, rho.z, phi.x, phi.y, phi.z);
    let (tangent, coordinate) = match kind {
        MotionKind::Translation => (six(axis, Vector3::zeros()), six(axis, centroid.cross(&axis))),
        MotionKind::Rotation => (six(centroid.cross(&axis), axis), six(Vector3::zeros(), axis)),
    };
    let motion = DegenerateMotion { kind, axis: axis.into(), sigma };
    DegenerateDirection { motion, tangent, coordinate }
}

/// Information that holds the degenerate directions where they are predicted, metric: as nothing resolves them, and from
/// frame to frame of a usual camera on with the square of the time, for a camera speeds up. `seconds` since the
/// frame that the prediction goes by; 0 where it is no prediction but a place.
pub(crate) fn hold(degenerate: &[DegenerateDirection], seconds: f64) -> Matrix6 {
    let frames = (seconds / FRAME_S).max(1.0);
    let sigma = WindowSettings::CONVERGED_STEP * frames * frames;
    let mut held = Matrix6::zeros();
    for f in degenerate {
        held += f.coordinate * f.coordinate.transpose() / (sigma * sigma);
    }
    held
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Information of points `p` with normals `n` at 5 mm each.
    fn of(points: &[(Vector3<f64>, Vector3<f64>)]) -> (Matrix6, Vector3<f64>) {
        let mut h = Matrix6::zeros();
        for (p, n) in points {
            let turn = p.cross(n);
            let j = Vector6::new(n.x, n.y, n.z, turn.x, turn.y, turn.z);
            h += j * j.transpose() / (0.005 * 0.005);
        }
        (h, points.iter().map(|(p, _)| p).sum::<Vector3<f64>>() / points.len() as f64)
    }

    fn plane(n: Vector3<f64>, offset: Vector3<f64>) -> Vec<(Vector3<f64>, Vector3<f64>)> {
        let u = if n.x.abs() > 0.5 { Vector3::y() } else { Vector3::x() };
        let v = n.cross(&u);
        (0..100).map(|k| (offset + u * (k / 10) as f64 * 0.2 + v * (k % 10) as f64 * 0.2, n)).collect()
    }

    #[test]
    fn a_wall_leaves_two_translations_and_a_turn_free_a_corridor_one_a_room_none() {
        let count = |points: &[(Vector3<f64>, Vector3<f64>)]| {
            let (h, c) = of(points);
            let degenerate = degenerate_directions(&h, &c);
            let translations = degenerate.iter().filter(|f| f.motion.kind == MotionKind::Translation).count();
            (translations, degenerate.len() - translations, degenerate)
        };
        let mut points = plane(Vector3::z(), Vector3::new(-1.0, -1.0, 3.0));
        let (t, r, degenerate) = count(&points);
        assert_eq!((t, r), (2, 1));
        for f in &degenerate {
            assert!((f.coordinate.dot(&f.tangent) - 1.0).abs() < 1e-9);
            let expected = if f.motion.kind == MotionKind::Rotation { 1.0 } else { 0.0 };
            assert!((f.motion.axis[2].abs() - expected).abs() < 1e-6, "{f:?}");
        }
        points = plane(Vector3::x(), Vector3::new(-1.0, -1.0, 1.0));
        points.extend(plane(Vector3::y(), Vector3::new(-1.0, 1.0, 1.0)));
        let (t, r, degenerate) = count(&points);
        assert_eq!((t, r), (1, 0));
        assert!(degenerate[0].motion.axis[2].abs() > 0.999);
        points.extend(plane(Vector3::z(), Vector3::new(-1.0, -1.0, 4.0)));
        assert_eq!(count(&points).2.len(), 0);
    }
}
