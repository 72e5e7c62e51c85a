//! The pipeline is the method and nothing else: four processes and one write the same records and
//! the same trajectory.

use std::process::Command;
use tessera_evaluation::write_tum;
use tessera_journal::Follower;
use tessera_offline::{Method, RawFrame, Records, Run, Source};
use tessera_outputs::{Replay, map_points, write_ply};
use tessera_settings::Settings;
use tessera_slam::{AlignRecord, StoreSlot};
use tessera_stage::ALIGN_JOURNAL;

/// Where a surface lies is the pipeline's own; all else must agree to the bit.
fn without_slot(mut record: AlignRecord) -> AlignRecord {
    if let AlignRecord::Frame(frame) = &mut record
        && let Some(keyframe) = &mut frame.change.new_keyframe
    {
        keyframe.slot = StoreSlot::default();
    }
    record
}

fn offline(settings: &Settings) -> Vec<AlignRecord> {
    let (spec, options) = settings.source();
    pushed(settings, &*tessera_sources::open(&spec, &options).unwrap()).finish().records
}

/// A run that has seen all frames of the source.
fn pushed(settings: &Settings, source: &dyn Source) -> Run {
    let method = Method {
        surface: settings.surface.clone(),
        registration: settings.registration.clone(),
        mapping: settings.mapping.clone(),
    };
    let mut run = Run::new(source.camera(), &method).unwrap();
    for index in 0..source.n_frames().unwrap() {
        run.push(&RawFrame::read(source, index).unwrap());
    }
    run
}

/// Settings under which a short walk has loops and corrections before its end.
const EARLY_LOOPS: [&str; 10] = [
    "--set",
    "mapping.keyframe.translation_m=0.02",
    "--set",
    "mapping.keyframe.rotation_deg=1.5",
    "--set",
    "mapping.loop.min_frames=10",
    "--set",
    "experiment.mapping.loop.request_interval=3",
    "--set",
    "experiment.mapping.loop.delay_frames=5",
];

/// The aligner's records so far, surfaces' places left out.
fn journal(run: &crate::common::Run) -> Vec<AlignRecord> {
    let mut journal = Follower::open(&run.out().join("align.journal"), ALIGN_JOURNAL).unwrap();
    let mut records = Vec::new();
    while let Some(record) = journal.next().unwrap() {
        records.push(without_slot(record));
    }
    records
}

/// Compares a run's journal with what one process makes of the same settings: all of it, or the
/// beginning where the run was interrupted. Returns as many of the offline records.
fn assert_same_records(run: &crate::common::Run) -> Vec<AlignRecord> {
    let text = String::from_utf8(run.output("config.toml")).unwrap();
    let mut expected = offline(&Settings::from_toml(&text, "config.toml").unwrap());
    let found = journal(run);
    for (position, found) in found.iter().enumerate() {
        let expected = expected.get(position).expect("the journal is longer");
        // As text: NaN stands for what is not known, and is not equal to itself.
        let (found, expected) = (format!("{found:?}"), format!("{:?}", without_slot(expected.clone())));
        assert!(found == expected, "record {position} differs:\n{found}\nfrom\n{expected}");
    }
    expected.truncate(found.len());
    expected
}

fn is_ended(records: &[AlignRecord]) -> bool {
    records.iter().any(|record| matches!(record, AlignRecord::End { .. }))
}

fn n_corrections(records: &[AlignRecord]) -> usize {
    records.iter().filter(|record| matches!(record, AlignRecord::Correction(_))).count()
}

/// Compares the bytes of a run's trajectories with those of the offline runner's poses; returns
/// the offline records.
fn assert_same_trajectory(run: &crate::common::Run) -> Vec<AlignRecord> {
    let records = Records { records: assert_same_records(run) };
    for (name, expected) in [("trajectory.txt", records.last()), ("trajectory_online.txt", records.online())]
    {
        let found = run.output(name);
        let header: Vec<u8> = found.split_inclusive(|b| *b == b'\n').take(2).flatten().copied().collect();
        let mut bytes = header;
        write_tum(&mut bytes, "", expected.stamps_nanos.iter().copied().zip(&expected.poses)).unwrap();
        assert!(bytes == found, "{name} differs from the offline runner's");
    }
    records.records
}

#[test]
fn four_processes_and_one_write_the_same_records() {
    let run = crate::common::room();
    assert!(run.finish().success());
    assert!(is_ended(&assert_same_trajectory(&run)));
}

#[test]
fn four_processes_and_one_write_the_same_map() {
    let run = crate::common::room().frames(30);
    assert!(run.finish().success());
    let text = String::from_utf8(run.output("config.toml")).unwrap();
    let settings = Settings::from_toml(&text, "config.toml").unwrap();
    let (spec, options) = settings.source();
    let source = tessera_sources::open(&spec, &options).unwrap();
    let going = pushed(&settings, &*source);
    let mut replay = Replay::default();
    going.records().iter().for_each(|record| replay.apply(record.clone()));
    let n_records = going.records().len();
    // The map can be had at any time.
    let early =
        map_points(source.camera(), &replay, &settings, |keyframe| going.keyframe_surface(keyframe)).len();
    let (records, map) = going.finish_with_map();
    records.records.into_iter().skip(n_records).for_each(|record| replay.apply(record));
    let points = map_points(source.camera(), &replay, &settings, |keyframe| &map.surfaces[keyframe as usize]);
    let mut bytes = Vec::new();
    write_ply(points.len(), points.iter().copied(), &[], &mut bytes).unwrap();
    assert!(bytes == run.output("map.ply"), "map.ply differs from the offline runner's");
    assert!(early > 1000 && early.abs_diff(points.len()) < points.len() / 10, "{early} of {}", points.len());
}

#[test]
fn four_processes_and_one_write_the_same_trajectory_with_a_budget_of_keyframes() {
    let run =
        crate::common::room().frames(90).with(&EARLY_LOOPS).with(&["--set", "mapping.keyframe.budget=10"]);
    assert!(run.finish().success());
    let records = assert_same_trajectory(&run);
    assert!(is_ended(&records) && n_corrections(&records) > 1);
    let mut keyframes = records.iter().filter_map(|record| match record {
        AlignRecord::Frame(frame) => frame.change.new_keyframe.as_ref(),
        _ => None,
    });
    assert!(keyframes.any(|keyframe| !keyframe.retires.is_empty()));
}

#[test]
fn an_interrupted_run_and_its_resumption_write_the_trajectory_of_one_process() {
    // The sensor stops itself, and is left alone: the interruption comes before the end on any machine.
    let run = crate::common::room()
        .frames(90)
        .with(&EARLY_LOOPS)
        .with(&["--set", "flow.hang_s=100"])
        .with_faults("sensor=sent:70:stop");
    let mut child = run.start();
    run.wait_until_stopped("sensor");
    crate::common::wait_for("a correction", || n_corrections(&journal(&run)) > 0);
    crate::common::signal(child.id(), "INT");
    child.wait().unwrap();
    let records = assert_same_trajectory(&run);
    assert!(!is_ended(&records) && n_corrections(&records) > 0, "{} records", records.len());
    let resumed = Command::new(env!("CARGO_BIN_EXE_tessera"))
        .args(["resume", "--quiet"])
        .arg(run.out())
        .status()
        .unwrap();
    assert!(resumed.success(), "{}", run.log());
    assert!(is_ended(&assert_same_trajectory(&run)));
}

#[test]
fn an_imu_says_the_same_bits_after_the_sensor_s_death() {
    let run = crate::common::room()
        .with(&["--set", "simulation.imu=true", "--set", "simulation.speed=2"])
        .with(&["--set", "mapping.world_up=gravity"])
        .with_faults("sensor=sent:0;reconstruct=sent:0;align=journaled:20");
    assert!(run.finish().success());
    let records = assert_same_records(&run);
    let mut frames = records.iter().filter_map(|r| match r {
        AlignRecord::Frame(frame) => Some(frame),
        _ => None,
    });
    let first = frames.next().unwrap();
    assert!(first.reason().contains("levelled by gravity"), "{}", first.reason());
    assert!(first.pose.rotation.is_some() && frames.all(|frame| frame.pose.rotation.is_some()));
}
