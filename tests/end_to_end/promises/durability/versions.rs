//! A run that was recorded once is read for ever: of each version of the journals' records there is one in
//! `tests/data/runs`, as that version left it.

use crate::common::{room, write_camera};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::Duration;
use tessera_journal::{Follower, Journal, RecordKind};
use tessera_stage::{ALIGN_JOURNAL, OPTIMISE_JOURNAL};

/// What a later version must make of a run, beside what it rests on.
const EXPECTED: [&str; 2] = ["trajectory.txt", "keyframes.txt"];
/// What a run rests on.
const RECORDED: [&str; 5] =
    ["run.json", "config.toml", "align.journal", "optimise.journal", "keyframes.store"];

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/runs")
}

/// The run of the records that this program writes.
fn current() -> PathBuf {
    assert!(!runs().is_empty());
    this_version()
}

fn this_version() -> PathBuf {
    folder().join(format!("align-{}-optimise-{}", ALIGN_JOURNAL.version, OPTIMISE_JOURNAL.version))
}

/// Runs of all versions; with `TESSERA_UPDATE=1` that of this version is written first.
fn runs() -> Vec<PathBuf> {
    static WRITTEN: std::sync::Once = std::sync::Once::new();
    WRITTEN.call_once(|| {
        if std::env::var_os("TESSERA_UPDATE").is_some() {
            record(&this_version());
        }
    });
    let mut runs: Vec<PathBuf> =
        std::fs::read_dir(folder()).unwrap().map(|item| item.unwrap().path()).collect();
    runs.retain(|path| path.is_dir());
    runs.sort();
    runs
}

/// Records a run into `to`, without what is of this machine alone.
fn record(to: &Path) {
    let dir = tempfile::tempdir().unwrap();
    write_camera(&dir.path().join("camera.toml"));
    let status = Command::new(env!("CARGO_BIN_EXE_tessera"))
        .args(["run", "room", "--quiet", "--name", "recorded", "--camera", "camera.toml", "--out", "out"])
        .args(["--frames", "30", "--set", "surface.step=4"])
        .current_dir(dir.path())
        .status();
    assert!(status.unwrap().success());
    std::fs::create_dir_all(to).unwrap();
    for name in RECORDED.iter().chain(&EXPECTED) {
        std::fs::copy(dir.path().join("out").join(name), to.join(name)).unwrap();
    }
    // Of this machine: where the camera's file was, and its vector instructions.
    let config = std::fs::read_to_string(to.join("config.toml")).unwrap();
    let is_of_machine = |line: &&str| !line.starts_with("camera = ") && !line.starts_with("isa = ");
    let lines: Vec<&str> = config.lines().filter(is_of_machine).collect();
    std::fs::write(to.join("config.toml"), lines.join("\n") + "\n").unwrap();
}

/// A copy that may be written to, without what is expected of it.
fn copy(run: &Path) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    for name in RECORDED {
        std::fs::copy(run.join(name), dir.path().join(name)).unwrap();
    }
    dir
}

fn tessera(arguments: &[&str], run: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tessera")).args(arguments).arg(run).output().unwrap()
}

fn words(output: &Output) -> String {
    String::from_utf8_lossy(&[&output.stdout[..], &output.stderr[..]].concat()).into_owned()
}

#[test]
fn runs_of_each_version_are_whole_and_give_the_trajectory_that_they_gave() {
    for run in runs() {
        let copy = copy(&run);
        let verified = tessera(&["verify"], copy.path());
        assert!(verified.status.success(), "{}: {}", run.display(), words(&verified));
        let exported = tessera(&["export"], copy.path());
        assert!(exported.status.success(), "{}: {}", run.display(), words(&exported));
        for name in EXPECTED {
            let found = std::fs::read_to_string(copy.path().join(name)).unwrap();
            assert_eq!(
                found,
                std::fs::read_to_string(run.join(name)).unwrap(),
                "{name} of {}",
                run.display()
            );
        }
        let map = std::fs::read(copy.path().join("map.ply")).unwrap();
        assert!(map.len() > 10_000, "{} bytes of map", map.len());
    }
}

/// A base keeps surfaces as they travelled, in a journal of their own, and has no store.
#[test]
fn a_copy_of_a_base_is_verified_without_a_store() {
    let copy = copy(&current());
    std::fs::remove_file(copy.path().join("keyframes.store")).unwrap();
    assert_eq!(tessera(&["verify"], copy.path()).status.code(), Some(3), "neither store nor surfaces");
    // What its records hold is not asked for: those of another journal stand in for surfaces.
    let surfaces = copy.path().join("surfaces.journal");
    std::fs::copy(copy.path().join("align.journal"), &surfaces).unwrap();
    let verified = tessera(&["verify"], copy.path());
    assert!(verified.status.success() && words(&verified).contains("surfaces as they travel"));
    let mut bytes = std::fs::read(&surfaces).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&surfaces, bytes).unwrap();
    let verified = tessera(&["verify"], copy.path());
    assert_eq!(verified.status.code(), Some(3), "{}", words(&verified));
}

#[test]
fn a_run_starts_in_the_map_of_each_version() {
    for map in runs() {
        let run = room().frames(12).with(&["--set", "surface.step=4", "--map", map.to_str().unwrap()]);
        assert!(run.finish().success(), "{}", run.log());
        let summary: serde_json::Value = serde_json::from_slice(&run.output("summary.json")).unwrap();
        assert!(summary["map_keyframes"].as_u64().unwrap() > 1, "{summary}");
        let mut records = Follower::open(&run.out().join("align.journal"), ALIGN_JOURNAL).unwrap();
        let first = records.next().unwrap();
        assert!(matches!(first, Some(tessera_slam::AlignRecord::Map(_))), "{first:?}");
    }
}

#[test]
fn a_run_of_an_earlier_program_is_read_and_not_gone_on_with() {
    let copy = copy(&current());
    let path = copy.path().join("run.json");
    let mut file: serde_json::Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    file["version"] = "0.0.1".into();
    std::fs::write(&path, file.to_string()).unwrap();
    let config = std::fs::read_to_string(copy.path().join("config.toml")).unwrap();
    let with_removed = config.replace("[surface]\n", "[surface]\nedge_angle_deg = 14.0\n");
    assert_ne!(with_removed, config);
    std::fs::write(copy.path().join("config.toml"), with_removed).unwrap();
    for command in ["verify", "export"] {
        let output = tessera(&[command], copy.path());
        assert!(output.status.success(), "{command}: {}", words(&output));
    }
    let resumed = tessera(&["resume"], copy.path());
    assert_eq!(resumed.status.code(), Some(2));
    assert!(words(&resumed).contains("the run was started by Tessera 0.0.1"), "{}", words(&resumed));
    let map = copy.path().to_str().unwrap();
    let run = room().frames(12).with(&["--set", "surface.step=4", "--map", map]);
    assert!(run.finish().success(), "{}", run.log());
}

/// Each record of a journal, read and written again.
fn written_again<T: serde::Serialize + serde::de::DeserializeOwned>(
    path: &Path,
    kind: RecordKind<T>,
) -> Vec<u8> {
    let dir = tempfile::tempdir().unwrap();
    let again = dir.path().join("again");
    let (mut journal, _) = Journal::open(&again, kind, Duration::ZERO, |_| Ok(())).unwrap();
    let mut records = Follower::open(path, kind).unwrap();
    while let Some(record) = records.next().unwrap_or_else(|error| panic!("{error}; {WHAT_TO_DO}")) {
        journal.append(&record, false).unwrap();
    }
    std::fs::read(&again).unwrap()
}

const WHAT_TO_DO: &str = "the form of a record has changed: shared/runtime/stage/src/record_versions.rs says \
                          what is to be done, so that the runs of the form before stay readable";

#[test]
fn records_have_the_form_of_their_version() {
    let run = this_version();
    assert!(runs().contains(&run), "there is no run of this version; {WHAT_TO_DO}");
    let align = run.join("align.journal");
    assert!(written_again(&align, ALIGN_JOURNAL) == std::fs::read(&align).unwrap(), "{WHAT_TO_DO}");
    let optimise = run.join("optimise.journal");
    assert!(written_again(&optimise, OPTIMISE_JOURNAL) == std::fs::read(&optimise).unwrap(), "{WHAT_TO_DO}");
}
