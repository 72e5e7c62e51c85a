//! The pipeline is the method and nothing else: four processes and one write the same records.

mod common;

use tessera_journal::Follower;
use tessera_mapping::{AlignRecord, StoreSlot};
use tessera_offline::{Method, RawFrame, Run};
use tessera_settings::Settings;

/// Where a surface lies is the pipeline's own; all else must agree to the bit.
fn without_slot(mut record: AlignRecord) -> AlignRecord {
    if let AlignRecord::Frame(frame) = &mut record
        && let Some(keyframe) = &mut frame.new_keyframe
    {
        keyframe.slot = StoreSlot::default();
    }
    record
}

fn offline(settings: &Settings) -> Vec<AlignRecord> {
    let (spec, options) = settings.source();
    let source = tessera_sources::open(&spec, &options).unwrap();
    let method = Method {
        surface: settings.surface.clone(),
        registration: settings.registration.clone(),
        mapping: settings.mapping.clone(),
    };
    let mut run = Run::new(source.camera(), &method).unwrap();
    for index in 0..source.n_frames().unwrap() {
        run.push(&RawFrame::read(&*source, index).unwrap());
    }
    run.finish().records
}

/// Compares a finished run's journal with what one process makes of the same settings.
fn assert_same_records(run: &common::Run) -> Vec<AlignRecord> {
    let text = String::from_utf8(run.output("config.toml")).unwrap();
    let expected = offline(&Settings::from_toml(&text, "config.toml").unwrap());
    let mut journal = Follower::<AlignRecord>::open(&run.out().join("align.journal"), "align").unwrap();
    for (position, expected) in expected.iter().enumerate() {
        let found = journal.next().unwrap().expect("the journal is shorter");
        // As text: NaN stands for what is not known, and is not equal to itself.
        let (found, expected) =
            (format!("{:?}", without_slot(found)), format!("{:?}", without_slot(expected.clone())));
        assert!(found == expected, "record {position} differs:\n{found}\nfrom\n{expected}");
    }
    assert!(journal.next().unwrap().is_none(), "the journal is longer");
    expected
}

#[test]
fn four_processes_and_one_write_the_same_records() {
    let run = common::room();
    assert!(run.finish().success());
    assert_same_records(&run);
}

#[test]
fn a_gyroscope_says_the_same_bits_after_the_sensor_s_death() {
    let run = common::room()
        .with(&["--set", "simulation.imu=true", "--set", "simulation.speed=2"])
        .with_env("TESSERA_KILL_PLAN", "sensor=sent:12;align=journaled:20");
    assert!(run.finish().success());
    let records = assert_same_records(&run);
    let frames = records.iter().filter_map(|r| match r {
        AlignRecord::Frame(frame) => Some(frame),
        _ => None,
    });
    assert!(frames.into_iter().all(|frame| frame.rotation.is_some()));
}
