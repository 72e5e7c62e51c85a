//! The simulated building: lost in it at a place never seen, and back.

mod common;

use common::{Step, scene, step_frame};
use rayon::prelude::*;
use tessera_evaluation::{EvaluationOptions, Trajectory, evaluate};
use tessera_offline::{Method, RawFrame, Run, State};
use tessera_sources::{SceneName, SimulationOptions, Source};

#[test]
fn lost_on_the_way_to_a_lobby_never_seen_and_back_in_the_workshop() {
    let source = scene(SceneName::Building, &SimulationOptions::default());
    // Half of the last room of the northern row; then, the lens uncovered in the eastern lobby, back from there.
    // The camera is so fast that each frame becomes a keyframe.
    let mut steps: Vec<Step> = (1830..2000).step_by(3).map(Step::See).collect();
    let n_seen = steps.len();
    steps.extend([Step::Covered; 15]);
    steps.extend((2040..2440).rev().step_by(3).map(Step::See));
    let mut run = Run::new(source.camera(), &Method::default()).unwrap();
    let numbered: Vec<(usize, Step)> = steps.iter().copied().enumerate().collect();
    for some in numbered.chunks(16) {
        let frames: Vec<RawFrame> = some.par_iter().map(|&(k, step)| step_frame(&source, k, step)).collect();
        frames.iter().for_each(|frame| drop(run.push(frame)));
    }
    let records = run.finish();
    let states: Vec<State> = records.frames().map(|frame| frame.state).collect();
    assert!(states[..n_seen].iter().all(|state| *state == State::Tracking));
    let submaps = records.submaps();
    assert_eq!((submaps.n(), submaps.n_components()), (2, 1));
    // A second after the lens was uncovered it goes on in a submap, and is lost no more.
    assert!(states[n_seen + 15 + 35..].iter().all(|state| *state == State::Tracking));
    let join = records.frames().find(|frame| frame.change.join.is_some()).unwrap();
    assert!(join.change.request.is_some(), "both are optimised together: {}", join.reason());

    let all = &source.ground_truth().unwrap().poses;
    let (mut truth, mut estimate) = (Trajectory::default(), Trajectory::default());
    for ((step, frame), pose) in steps.iter().zip(records.frames()).zip(&records.last().poses) {
        if let (Step::See(index), State::Tracking) = (step, frame.state) {
            truth.push(frame.stamp_nanos, all[*index as usize]).unwrap();
            estimate.push(frame.stamp_nanos, *pose).unwrap();
        }
    }
    let ate_m = evaluate(&estimate, &truth, &EvaluationOptions::default()).unwrap().ate_rmse_m;
    assert!(ate_m < 0.05, "{ate_m} m");
}
