//! Motion of a frame during its exposure, from the final poses around it.

use nalgebra::DMatrix;
use tessera_geometry::{Pose, Twist, Vector6, log};

/// Poses on either side that take part. Noise in a motion makes the readout look shorter; a cubic
/// through seven poses has three quarters of the noise of the two neighbours' difference, and
/// follows the tremor of a hand (2 Hz) to 1 %.
const HALF_WIDTH: usize = 3;
/// Those beyond the nearest are at most so far in time: three frames at 30 Hz.
const HALF_WIDTH_S: f64 = 0.11;
/// Frames farther apart say nothing of the motion.
const LONGEST_STEP_S: f64 = 0.5;

/// A frame's final pose.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moment {
    pub(crate) index: u64,
    pub(crate) stamp_nanos: i64,
    pub(crate) is_tracked: bool,
    pub(crate) world_from_camera: Pose,
}

/// Motion per second of frame `index`, in its camera's frame: the slope of a cubic through the
/// tracked frames around it, of a lower curve where there are few. `None` where it stands alone.
pub(crate) fn velocity(frames: &[Moment], index: u64) -> Option<Twist> {
    let at = frames.binary_search_by_key(&index, |frame| frame.index).ok()?;
    let own = &frames[at];
    let seconds = |frame: &Moment| frame.stamp_nanos.saturating_sub(own.stamp_nanos) as f64 * 1e-9;
    let takes_part = |frame: &&Moment| {
        let (apart, apart_s) = (frame.index.abs_diff(index), seconds(frame).abs());
        frame.is_tracked
            && apart <= HALF_WIDTH as u64
            && apart_s < if apart <= 1 { LONGEST_STEP_S } else { HALF_WIDTH_S }
    };
    let first = at.saturating_sub(HALF_WIDTH);
    let last = (at + HALF_WIDTH).min(frames.len() - 1);
    let near: Vec<&Moment> = frames[first..=last].iter().filter(takes_part).collect();
    let degree = match near.len() {
        0 | 1 => return None,
        2 => 1,
        3..=5 => 2,
        _ => 3,
    };
    // In units of the half width, so that all powers are of one size.
    let powers = DMatrix::from_fn(near.len(), degree + 1, |row, power| {
        (seconds(near[row]) / HALF_WIDTH_S).powi(power as i32)
    });
    let from_own = own.world_from_camera.inverse();
    let steps: Vec<Vector6> =
        near.iter().map(|frame| log(&(from_own * frame.world_from_camera)).to_vector()).collect();
    let steps = DMatrix::from_fn(near.len(), 6, |row, k| steps[row][k]);
    let fit = powers.svd(true, true).solve(&steps, 1e-12).ok()?;
    Some(Twist::from_vector(&(Vector6::from_fn(|k, _| fit[(1, k)]) / HALF_WIDTH_S)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use std::f64::consts::TAU;
    use tessera_geometry::exp;

    /// A hand at 30 Hz: a steady turn about y, and a sway along x of 2 Hz.
    fn hand(n: u64) -> Vec<Moment> {
        let pose = |s: f64| {
            let turn = Twist { rho: Vector3::zeros(), phi: Vector3::new(0.0, 0.5 * s, 0.0) };
            let sway = Twist { rho: Vector3::new(0.01 * (TAU * 2.0 * s).sin(), 0.0, 0.0), phi: turn.phi };
            exp(&Twist { phi: Vector3::zeros(), ..sway }) * exp(&turn)
        };
        let moment = |index: u64| Moment {
            index,
            stamp_nanos: index as i64 * 33_333_333,
            is_tracked: true,
            world_from_camera: pose(index as f64 / 30.0),
        };
        (0..n).map(moment).collect()
    }

    #[test]
    fn a_sway_and_a_turn_are_found_in_the_middle_and_at_both_ends() {
        let frames = hand(60);
        for (index, tolerance) in [(0, 0.2), (30, 0.01), (59, 0.2)] {
            let seconds = index as f64 / 30.0;
            let found = velocity(&frames, index).unwrap();
            assert!((found.phi.y - 0.5).abs() < 1e-3, "{found:?}");
            let sway_m_per_s = 0.01 * TAU * 2.0 * (TAU * 2.0 * seconds).cos();
            let in_camera = frames[index as usize].world_from_camera.rotation.inverse()
                * Vector3::new(sway_m_per_s, 0.0, 0.0);
            let error = (found.rho - in_camera).norm();
            assert!(error < tolerance * 0.126, "frame {index}: {error} of {sway_m_per_s} m/s");
        }
    }

    #[test]
    fn frames_that_were_not_tracked_take_no_part() {
        let mut frames = hand(9);
        for lost in [2, 6] {
            frames[lost].is_tracked = false;
            frames[lost].world_from_camera = Pose::translation(9.0, 9.0, 9.0);
        }
        let found = velocity(&frames, 4).unwrap();
        assert!((found.phi.y - 0.5).abs() < 1e-3 && found.rho.norm() < 0.2, "{found:?}");
    }

    #[test]
    fn a_frame_alone_has_no_motion() {
        let mut frames = hand(2);
        assert_eq!(velocity(&frames, 7), None);
        frames[1].stamp_nanos = 2_000_000_000;
        assert_eq!(velocity(&frames, 0), None);
    }
}
