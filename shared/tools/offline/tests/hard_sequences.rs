//! Sequences that are harder than a quiet walk: a person, few frames a second, holes, great speed,
//! and scenes whose shape does not fix the pose.

mod common;

use common::{ate_m, frames, run, scene};
use tessera_geometry::translation_rotation_norms;
use tessera_offline::{Method, RawFrame};
use tessera_sources::{SceneName, SimulationOptions, Source};

/// Takes away so many per cent of the pixels, scattered, others in each frame.
fn make_holes(frames: &mut [RawFrame], percent: u64) {
    for (k, frame) in frames.iter_mut().enumerate() {
        for (i, depth) in frame.depth.iter_mut().enumerate() {
            let mut hash = (i as u64) ^ ((k as u64) << 32) ^ 0x9e37_79b9_7f4a_7c15;
            hash = (hash ^ (hash >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            hash = (hash ^ (hash >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            if (hash >> 32) % 100 < percent {
                *depth = 0;
            }
        }
    }
}

#[test]
fn a_person_walking_through_does_not_carry_the_map_along() {
    let source = scene(SceneName::Room, &SimulationOptions { person: true, ..Default::default() });
    let indices: Vec<u64> = (0..120).collect();
    let records = run(&source, &Method::default(), &frames(&source, &indices));
    assert_eq!(records.n_untracked(), 0);
    let error_m = ate_m(&source, &indices, &records.online());
    assert!(error_m < 0.01, "ATE {error_m} m");
}

#[test]
fn five_frames_a_second_full_of_holes_are_enough() {
    let source = scene(SceneName::Room, &SimulationOptions::default());
    // About 45 mm and 7 degrees between frames.
    let indices: Vec<u64> = (0..360).step_by(6).collect();
    let mut frames = frames(&source, &indices);
    make_holes(&mut frames, 37);
    let records = run(&source, &Method::default(), &frames);
    assert_eq!(records.n_untracked(), 0);
    let error_m = ate_m(&source, &indices, &records.last());
    assert!(error_m < 0.01, "ATE {error_m} m");
}

#[test]
fn surfaces_hold_the_room_with_nine_tenths_of_the_depth_missing() {
    let source = scene(SceneName::Room, &SimulationOptions::default());
    let indices: Vec<u64> = (0..40).collect();
    let mut frames = frames(&source, &indices);
    // Five in six of the vertices are at a border, where nothing matches.
    make_holes(&mut frames, 90);
    let records = run(&source, &common::surfaces_alone(), &frames);
    assert_eq!(records.n_untracked(), 0);
    let error_m = ate_m(&source, &indices, &records.online());
    assert!(error_m < 0.02, "ATE {error_m} m");
}

#[test]
fn frames_a_long_stride_apart_are_enough() {
    let source = scene(SceneName::House, &SimulationOptions::default());
    let truth = &source.ground_truth().unwrap().poses;
    let mut indices: Vec<u64> = vec![0];
    for k in 1..700 {
        let stride = truth[indices[indices.len() - 1] as usize].inverse() * truth[k as usize];
        let (moved_m, turned_rad) = translation_rotation_norms(&stride);
        if moved_m >= 0.155 || turned_rad >= 6.7f64.to_radians() {
            indices.push(k);
        }
    }
    assert!(indices.len() > 30, "{} frames", indices.len());
    let records = run(&source, &Method::default(), &frames(&source, &indices));
    assert_eq!(records.n_untracked(), 0);
    let error_m = ate_m(&source, &indices, &records.last());
    assert!(error_m < 0.03, "ATE {error_m} m");
}

#[test]
fn backwards_and_two_and_a_half_times_as_fast_gives_the_same_room() {
    let source = scene(SceneName::Room, &SimulationOptions::default());
    let indices: Vec<u64> = (0..100).map(|k| 250 - k * 5 / 2).collect();
    let records = run(&source, &Method::default(), &frames(&source, &indices));
    assert_eq!(records.n_untracked(), 0);
    let error_m = ate_m(&source, &indices, &records.last());
    assert!(error_m < 0.01, "ATE {error_m} m");
}

#[test]
fn features_hold_what_a_wall_leaves_free() {
    let source = scene(SceneName::Wall, &SimulationOptions::default());
    let indices: Vec<u64> = (0..60).collect();
    let records = run(&source, &Method::default(), &frames(&source, &indices));
    assert_eq!(records.n_untracked(), 0);
    let error_m = ate_m(&source, &indices, &records.online());
    assert!(error_m < 0.005, "ATE {error_m} m");
}
