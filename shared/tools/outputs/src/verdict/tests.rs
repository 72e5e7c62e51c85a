use super::*;
use crate::truth::{Truth, Turns};
use tessera_evaluation::LateralScale;
use tessera_features::FocalRatio;

fn good() -> Facts {
    Facts {
        ended: Ended::Finished,
        n_read: 400,
        n_processed: 400,
        n_loops_closed: 5,
        units_per_metre: 1000.0,
        ..Facts::default()
    }
}

fn span(first: u64, last: u64) -> Span {
    Span { first, last, from_s: first as f64 / 30.0, to_s: last as f64 / 30.0 }
}

fn check(facts: &Facts, grade: Grade, words: &[&str]) {
    let verdict = verdict(facts);
    assert_eq!(verdict.grade, grade, "{verdict:?}");
    let text = verdict.for_people();
    for word in words {
        assert!(text.contains(word), "{text} lacks {word}");
    }
    for reason in &verdict.reasons {
        assert_eq!(reason.advice.is_empty(), reason.grade == Grade::Good, "{reason:?}");
    }
}

#[test]
fn a_good_run_has_no_reasons_or_notes_alone() {
    assert_eq!(verdict(&good()), Verdict::default());
    assert_eq!(verdict(&good()).in_one_line(), "verdict good");
    let short = Facts { n_untracked: 3, untracked: vec![span(10, 12)], n_loops_rejected: 1, ..good() };
    check(
        &short,
        Grade::Good,
        &["3 of 400 frames not tracked", "frames 10 to 12 (0.3 to 0.4 s)", "1 verified loops"],
    );
}

#[test]
fn colour_that_is_not_believed_is_a_note() {
    let foreign = Facts { unbelieved_colour: Some(-1.93), ..good() };
    check(&foreign, Grade::Good, &["colour was not used", "log odds -1.9"]);
}

#[test]
fn frames_without_a_pose_make_it_doubtful_and_half_of_them_failed() {
    let lost = Facts { n_untracked: 85, untracked: vec![span(315, 399)], ends_untracked: true, ..good() };
    check(
        &lost,
        Grade::Doubtful,
        &["verdict     doubtful", "85 of 400", "frames 315 to 399", "to the end", "try:"],
    );
    check(
        &Facts { n_untracked: 200, untracked: vec![span(200, 399)], ..good() },
        Grade::Failed,
        &["200 of 400"],
    );
    let apart = |n| Facts { n_submaps: 2, apart: [(1, n)].into(), ..good() };
    check(
        &apart(150),
        Grade::Doubtful,
        &["1 submap was never joined: 150 frames are in files of their own (trajectory_submap_1.txt)"],
    );
    check(&apart(5), Grade::Good, &["5 frames are in files"]);
    let many: Vec<Span> = (0..5).map(|k| span(20 * k, 20 * k + k)).collect();
    check(
        &Facts { n_untracked: 15, untracked: many, ..good() },
        Grade::Doubtful,
        &["frames 80 to 84", "2 more"],
    );
}

#[test]
fn frames_without_depth_are_not_told_to_move_more_slowly() {
    let empty = Facts { n_untracked: 399, n_without_depth: 399, untracked: vec![span(1, 399)], ..good() };
    check(&empty, Grade::Failed, &["399 of them hold too little depth", "tessera check SOURCE"]);
    assert!(!verdict(&empty).for_people().contains("slowly"));
    check(&Facts { n_processed: 1, n_read: 1, ..good() }, Grade::Doubtful, &["one frame alone"]);
}

#[test]
fn what_was_assumed_is_a_note_of_a_good_run() {
    let assumed = Facts { source_warnings: vec!["the camera is assumed".to_owned()], ..good() };
    check(&assumed, Grade::Good, &["the camera is assumed"]);
}

#[test]
fn deviations_drops_broken_images_and_rejected_loops_are_named() {
    let uncertain = Facts { n_uncertain: 100, first_uncertain: Some(246), worst_deviation_m: 4.6, ..good() };
    check(
        &uncertain,
        Grade::Doubtful,
        &["100 of 400 frames are uncertain by more than 0.1 m, 4.60 m", "frame 246"],
    );
    check(&Facts { n_dropped: 10, ..good() }, Grade::Good, &["10 of 400 frames dropped"]);
    check(&Facts { n_dropped: 100, ..good() }, Grade::Doubtful, &["without --live"]);
    check(&Facts { n_missing: 1, ..good() }, Grade::Doubtful, &["1 missing"]);
    let broken = |n: u64| (0..n).map(|k| (k, "d.png: gone".to_owned())).collect();
    check(&Facts { broken: broken(1), ..good() }, Grade::Good, &["1 of 400", "frame 0: d.png: gone"]);
    check(&Facts { broken: broken(9), ..good() }, Grade::Doubtful, &["again"]);
    let colour: std::collections::BTreeMap<u64, String> = broken(40)
        .into_iter()
        .map(|(k, problem): (u64, String)| (k, format!("{}{problem}", BrokenFrames::COLOUR)))
        .collect();
    check(
        &Facts { broken: colour, ..good() },
        Grade::Good,
        &["40 of 400 frames went without their colour", "frame 0: d.png: gone"],
    );
    check(
        &Facts { n_loops_rejected: 9, ..good() },
        Grade::Doubtful,
        &["9 verified loops rejected", "5 closed"],
    );
}

#[test]
fn degenerate_for_long_is_a_reason_and_for_a_moment_a_note() {
    let with = |n, degenerate| Facts { n_degenerate: n, degenerate, ..good() };
    check(&with(2, vec![span(10, 11)]), Grade::Good, &["2 of 400 frames are degenerate", "frames 10 to 11"]);
    check(
        &with(16, vec![span(10, 25)]),
        Grade::Doubtful,
        &["frames 10 to 25 (0.3 to 0.8 s)", "try: record with colour"],
    );
    let spread = (0..25).map(|k| span(10 * k, 10 * k)).collect();
    check(&with(25, spread), Grade::Doubtful, &["25 of 400 frames are degenerate", "22 more"]);
}

#[test]
fn how_a_run_ended_weighs_most() {
    check(&Facts { n_processed: 0, ..good() }, Grade::Failed, &["no frame was processed"]);
    check(&Facts { ended: Ended::Failed, ..good() }, Grade::Failed, &["a stage failed after 400 of 400"]);
    let interrupted = Facts { ended: Ended::Interrupted, n_processed: 9, ..good() };
    check(&interrupted, Grade::Doubtful, &["not finished: 9 of 400", "tessera resume"]);
    check(&Facts { is_nowhere: true, ..good() }, Grade::Failed, &["no frame was found in the map"]);
}

#[test]
fn positions_far_from_the_ground_truth_are_doubtful() {
    let off = |ate_m, spread_m| {
        let truth = Some(Truth { scale: 1.0, is_telling: false, ate_m, spread_m, turns: Turns::AsRead });
        verdict(&Facts { truth, ..good() })
    };
    let room = off(0.3, 1.2);
    assert_eq!(room.grade, Grade::Doubtful);
    assert!(room.reasons[0].found.contains("off by 0.30 m"), "{room:?}");
    assert_eq!([off(0.09, 0.2).grade, off(0.3, 12.0).grade], [Grade::Good; 2], "a drift");
}

#[test]
fn wrong_units_and_lenses_are_named_with_the_likely_value() {
    let against = |scale, is_telling| Facts {
        truth: Some(Truth { scale, is_telling, ate_m: 0.0, spread_m: 1.0, turns: Turns::AsRead }),
        ..good()
    };
    check(
        &against(5.02, true),
        Grade::Failed,
        &["5.02 times too small", "units_per_metre = 1000 is wrong, about 199 is"],
    );
    let millimetres = against(1000.3, true);
    check(
        &millimetres,
        Grade::Failed,
        &["1000.30 times too small: the ground truth is in millimetres, or units"],
    );
    let mut turned = against(1.0, false);
    turned.truth.as_mut().unwrap().turns = Turns::WAtOtherEnd;
    check(&turned, Grade::Good, &["fit only if w is at the other end of its quaternions"]);
    turned.truth.as_mut().unwrap().turns = Turns::Mirrored;
    check(&turned, Grade::Doubtful, &["fit only in a mirror", "left-handed axes"]);
    check(&against(0.21, true), Grade::Failed, &["4.76 times too large", "5000 is likely"]);
    check(&against(5.0, false), Grade::Good, &[]);
    check(&against(1.2, true), Grade::Good, &[]);
    let refined = |to| Facts { focal_px: 500.0, refined_focal_px: Some([500.0, to]), ..good() };
    check(
        &refined(560.0),
        Grade::Doubtful,
        &["about 560 px (deviation 17 px) is likely, not the camera's 500 px (+12 %)", "camera_refined.toml"],
    );
    check(&refined(510.0), Grade::Good, &[]);
    let doubt = Facts { source_doubts: vec!["median depth is 5.5 m".to_owned()], ..good() };
    check(&doubt, Grade::Doubtful, &["median depth is 5.5 m", "--camera"]);
}

#[test]
fn a_wrong_focal_length_is_told_once_by_all_evidence() {
    let seen = |ratio, sigma, n_pairs| Facts {
        focal_px: 500.0,
        seen_focal: Some(FocalRatio { ratio, sigma, n_pairs }),
        ..good()
    };
    check(
        &seen(1.13, 0.005, 60),
        Grade::Doubtful,
        &["not the camera's 500 px", "features of turned views", "--camera"],
    );
    check(&seen(0.9, 0.005, 60), Grade::Doubtful, &["about 442 px"]);
    check(&seen(1.07, 0.001, 60), Grade::Good, &[]);
    check(&seen(1.13, 0.08, 60), Grade::Good, &[]);
    check(&seen(1.13, 0.01, 7), Grade::Good, &[]);
    let across = |scale, sigma, turn_per_metre, units| {
        let lateral = Some(LateralScale { scale, sigma, n_groups: 12, turn_per_metre });
        let truth = Truth { scale: units, is_telling: true, ate_m: 0.0, spread_m: 1.0, turns: Turns::AsRead };
        Facts { focal_px: 500.0, truth: Some(truth), lateral, ..good() }
    };
    check(&across(1.1, 0.01, 0.3, 1.0), Grade::Doubtful, &["about 550 px", "500 px", "ground truth"]);
    check(&across(1.04, 0.001, 0.3, 1.0), Grade::Good, &[]);
    check(&across(1.1, 0.06, 0.3, 1.0), Grade::Good, &[]);
    // As on freiburg1_rpy, which turns: an alarm would be false.
    check(&across(1.127, 0.02, 5.0, 1.0), Grade::Good, &[]);
    let across = across(1.0, 0.01, 5.0, 2.4);
    let both = Facts { truth: across.truth, lateral: across.lateral, ..seen(0.88, 0.005, 60) };
    let verdict = verdict(&both);
    assert_eq!(verdict.reasons.len(), 1, "the lens made the lengths: {verdict:?}");
    assert!(verdict.reasons[0].found.contains("focal length"), "{verdict:?}");
}
