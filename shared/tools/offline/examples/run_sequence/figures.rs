//! Figures of a run: errors by ground truth, submaps, loops, and whether the stated deviations hold.

use tessera_evaluation::{EvaluationOptions, Trajectory, evaluate};
use tessera_geometry::{Pose, adjoint, from_upper_triangle, log};
use tessera_offline::{Records, State};
use tessera_slam::{AlignRecord, FrameRecord, LoopRecord};

pub(super) fn report(sequence: &str, seed: u64, truth: Option<&Trajectory>, records: &Records, n: usize) {
    println!(
        "{sequence} seed {seed}: {n} frames, {} keyframes ({} culled), {} corrections, {} untracked",
        records.n_keyframes(),
        records.n_culled(),
        records.n_corrections(),
        records.n_untracked()
    );
    let n_free = records.frames().filter(|f| f.is_degenerate()).count();
    println!("    {n_free} frames with a degenerate direction");
    report_submaps(records);
    report_loops(records);
    let Some(truth) = truth else { return };
    let line =
        |name: &str, estimate: &Trajectory| match evaluate(estimate, truth, &EvaluationOptions::default()) {
            Ok(e) => println!(
                "    {name:7} ATE {:.5} m  RPE {:.5} m/s  {:.3} deg/s  end {:.4} m  ({} pairs)",
                e.ate_rmse_m,
                e.rpe_translation_rmse_m_per_s.unwrap_or(f64::NAN),
                e.rpe_rotation_rmse_deg_per_s.unwrap_or(f64::NAN),
                e.end_error_m,
                e.pairs
            ),
            Err(error) => println!("    {name}: {error}"),
        };
    line("online", &of_main_map(records, records.online()));
    report_certainty(records, truth);
    line("final", &of_main_map(records, records.last()));
    if let Some(refined) = records.refined_camera() {
        line("as was", &of_main_map(records, records.before_refinement()));
        let [before, after] = refined.residual_sigmas;
        println!(
            "    {:?}, moved {:.2} px, {} directions held, residual {before:.4} before, {after:.4} after",
            refined.camera, refined.moved_px, refined.n_held
        );
    }
}

/// The component with most tracked frames.
fn main_component(records: &Records) -> u32 {
    let mut n_frames = std::collections::BTreeMap::<u32, usize>::new();
    for (component, frame) in records.components().into_iter().zip(records.frames()) {
        *n_frames.entry(component).or_default() += usize::from(frame.state == State::Tracking);
    }
    // Of as many the first.
    n_frames.into_iter().rev().max_by_key(|(_, n)| *n).map_or(0, |(component, _)| component)
}

/// Frames that were tracked outside of the main map: their poses have a gauge of their own.
fn n_apart(records: &Records) -> usize {
    let main = main_component(records);
    let all = records.components().into_iter().zip(records.frames());
    all.filter(|(component, frame)| *component != main && frame.state == State::Tracking).count()
}

/// The poses of the main map's frames.
fn of_main_map(records: &Records, all: Trajectory) -> Trajectory {
    let main = main_component(records);
    let mut kept = Trajectory::default();
    let poses = all.stamps_nanos.into_iter().zip(all.poses);
    for ((stamp_nanos, pose), component) in poses.zip(records.components()) {
        if component == main {
            kept.stamps_nanos.push(stamp_nanos);
            kept.poses.push(pose);
        }
    }
    kept
}

/// One line of figures as JSON, those that need ground truth only where there is one.
pub(super) fn print_figures(sequence: &str, seed: u64, truth: Option<&Trajectory>, records: &Records) {
    let mut figures = serde_json::json!({
        "sequence": sequence,
        "seed": seed,
        "untracked": records.n_untracked(),
        "apart": n_apart(records),
        "keyframes": records.n_keyframes(),
    });
    let Some(truth) = truth else { return println!("{figures}") };
    for (name, estimate) in [("online", records.online()), ("final", records.last())] {
        let estimate = of_main_map(records, estimate);
        let Ok(e) = evaluate(&estimate, truth, &EvaluationOptions::default()) else { continue };
        figures[format!("ate_{name}_m")] = e.ate_rmse_m.into();
        figures[format!("rpe_{name}_m_per_s")] = e.rpe_translation_rmse_m_per_s.into();
    }
    let certainty = certainty(records, truth);
    figures["within_3_sigma"] = certainty.within.into();
    figures["normalised_error"] = certainty.normalised.into();
    println!("{figures}");
}

/// Submaps with what began and joined them, where there is more than one.
fn report_submaps(records: &Records) {
    let submaps = records.submaps();
    if submaps.n() < 2 {
        return;
    }
    println!("    {} submaps in {} components", submaps.n(), submaps.n_components());
    for frame in records.frames().filter(|f| f.change.join.is_some() || f.reason().contains("begins")) {
        println!("      frame {}: {}", frame.index, frame.reason());
    }
    for submap in 0..submaps.n() {
        let n = records.frames().filter(|f| f.submap == submap && f.state == State::Tracking).count();
        println!("      submap {submap} of component {}: {n} tracked frames", submaps.component(submap));
    }
}

/// How well the stated deviations tell the errors of relative poses over one second: the squared
/// error of each axis over its stated variance, that of the two frames' covariances together. Submaps have gauges of
/// their own: a pair is of one.
fn report_certainty(records: &Records, truth: &Trajectory) {
    let c = certainty(records, truth);
    println!(
        "    over 1 s: {:.1} % within 3 sigma, mean squared normalised error {:.2} (translation {:.2}), median error {:.4} m, stated {:.4} m",
        100.0 * c.within,
        c.normalised,
        c.translation,
        c.median_error_m,
        c.median_stated_m
    );
}

/// See [`report_certainty`].
struct Certainty {
    within: f64,
    normalised: f64,
    translation: f64,
    median_error_m: f64,
    median_stated_m: f64,
}

fn certainty(records: &Records, truth: &Trajectory) -> Certainty {
    let tracked: Vec<_> = records.frames().filter(|f| f.pose.covariance.len() == 21).collect();
    let (mut n, mut n_within, mut normalised, mut translation) = (0, 0, 0.0, 0.0);
    let (mut error_m, mut sigma_m) = (Vec::new(), Vec::new());
    for (k, first) in tracked.iter().enumerate() {
        let due = first.stamp_nanos + 1_000_000_000;
        let Some(second) = tracked[k..].iter().find(|f| f.stamp_nanos >= due) else { break };
        if first.submap != second.submap {
            continue;
        }
        let at = |f: &FrameRecord| true_pose(truth, f.stamp_nanos);
        let (Some(first_true), Some(second_true)) = (at(first), at(second)) else { continue };
        let [from, to] = [first, second].map(|f| Pose::from(&f.pose.world_from_camera));
        let relative = from.inverse() * to;
        let error = log(&(relative.inverse() * first_true.inverse() * second_true)).to_vector();
        let carry = adjoint(&relative.inverse());
        let covariance = from_upper_triangle(&second.pose.covariance)
            + carry * from_upper_triangle(&first.pose.covariance) * carry.transpose();
        let squared: Vec<f64> = (0..6).map(|i| error[i] * error[i] / covariance[(i, i)]).collect();
        n += 1;
        n_within += usize::from(squared.iter().all(|s| *s <= 9.0));
        normalised += squared.iter().sum::<f64>() / 6.0;
        translation += squared[..3].iter().sum::<f64>() / 3.0;
        error_m.push(error.fixed_rows::<3>(0).norm());
        sigma_m.push((0..3).map(|i| covariance[(i, i)]).sum::<f64>().sqrt());
    }
    error_m.sort_by(f64::total_cmp);
    sigma_m.sort_by(f64::total_cmp);
    let middle = |values: &[f64]| values.get(values.len() / 2).copied().unwrap_or(f64::NAN);
    let n = n as f64;
    Certainty {
        within: n_within as f64 / n,
        normalised: normalised / n,
        translation: translation / n,
        median_error_m: middle(&error_m),
        median_stated_m: middle(&sigma_m),
    }
}

/// The true pose at a time, between its two neighbours.
fn true_pose(truth: &Trajectory, stamp_nanos: i64) -> Option<Pose> {
    let after = truth.stamps_nanos.partition_point(|stamp| *stamp < stamp_nanos);
    let before = after.checked_sub(1)?;
    let (t0, t1) = (truth.stamps_nanos[before], *truth.stamps_nanos.get(after)?);
    let share = (stamp_nanos - t0) as f64 / (t1 - t0) as f64;
    (t1 - t0 < 100_000_000).then(|| truth.poses[before].lerp_slerp(&truth.poses[after], share))
}

/// Quantiles of the loop pairs' tests in the last correction.
fn report_loops(records: &Records) {
    let last = records.records.iter().rev().find_map(|r| match r {
        AlignRecord::Correction(applied) => Some(&applied.correction.loops),
        _ => None,
    });
    let Some(loops) = last.filter(|l| !l.is_empty()) else { return };
    let mut verdicts = std::collections::BTreeMap::new();
    loops.iter().for_each(|l| *verdicts.entry(format!("{:?}", l.verdict)).or_insert(0) += 1);
    println!("    {} loop pairs: {verdicts:?}", loops.len());
    let quantiles = |name: &str, value: fn(&LoopRecord) -> f64| {
        let mut values: Vec<f64> = loops.iter().map(value).collect();
        values.sort_by(f64::total_cmp);
        let at = |q: f64| values[((values.len() - 1) as f64 * q) as usize];
        println!(
            "      {name:22} 1 % {:.3}  10 % {:.3}  median {:.3}  90 % {:.3}  99 % {:.3}",
            at(0.01),
            at(0.1),
            at(0.5),
            at(0.9),
            at(0.99)
        );
    };
    quantiles("overlap", |l| l.overlap);
    quantiles("in front", |l| l.in_front);
    quantiles("inconsistency sigmas", |l| l.inconsistency_sigmas);
    quantiles("residual sigmas", |l| l.residual_sigmas);
}
