//! Faults on the network and deaths of both ends: nothing is lost, nothing comes twice, and the map is that
//! of a day without faults. `tessera chaos --fleet`, as a user calls it.

use crate::processes::fleet;
use crate::run::GrowingRun;
use flate2::Compression;
use flate2::write::DeflateEncoder;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Output, Stdio};
use std::sync::atomic::AtomicBool;
use tessera_fleet::chaos::{FleetChaosArguments, FleetFault, fleet_campaign};

/// Bytes of a file at least, however it travels.
pub(crate) fn deflated_bytes(path: &Path) -> u64 {
    let mut encoder = DeflateEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(&std::fs::read(path).unwrap()).unwrap();
    encoder.finish().unwrap().len() as u64
}

/// Two finished runs.
fn runs(dir: &Path) -> [PathBuf; 2] {
    [0, 1].map(|k| {
        let run = dir.join(format!("run-{k}"));
        let mut growing = GrowingRun::begin(&run, &format!("run{k}"), k);
        (0..160).for_each(|_| growing.grow());
        growing.end();
        run
    })
}

fn campaign(dir: &Path, runs: &[PathBuf; 2]) -> FleetChaosArguments {
    FleetChaosArguments {
        run: runs.to_vec(),
        times: 5,
        seed: 2,
        out: Some(dir.join("out")),
        patience_s: 300,
        whole: false,
        flip: false,
        json: false,
        quiet: true,
    }
}

fn chaos(runs: &[PathBuf; 2], arguments: &[&str]) -> Output {
    let mut command = fleet(&["chaos", "--times", "1", "--patience-s", "300"]);
    for run in runs {
        command.arg("--run").arg(run);
    }
    command.args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).output().unwrap()
}

#[test]
fn kills_and_faults_on_the_network_change_no_byte() {
    let dir = tempfile::tempdir().unwrap();
    let runs = runs(dir.path());
    for whole in [false, true] {
        let out = Some(dir.path().join(format!("out-{whole}")));
        disturb(&FleetChaosArguments { whole, out, ..campaign(dir.path(), &runs) });
    }
}

fn disturb(campaign: &FleetChaosArguments) {
    let report = fleet_campaign(
        Path::new(env!("CARGO_BIN_EXE_tessera-fleet")),
        campaign,
        &AtomicBool::new(false),
        &mut |_, _| (),
    )
    .unwrap();
    assert_eq!(report.broken, [""; 0]);
    assert_eq!(report.strikes.len(), 5 * FleetFault::ALL.len());
    assert!(report.is_map_identical && report.map_files > 0);
    for (robot, run) in report.robots.iter().zip(&campaign.run) {
        let least = deflated_bytes(&run.join("align.journal"));
        assert!(
            robot.identical && robot.carried.up_bytes >= least,
            "{} of {least} bytes",
            robot.carried.up_bytes
        );
    }
    assert!(report.robots.iter().any(|robot| robot.carried.repeated_bytes > 0), "something came twice");
    assert!(report.robots.iter().all(|robot| robot.carried.connections > 1), "links were cut");
    let copies = campaign.out.as_ref().unwrap().join("disturbed/robots");
    assert_eq!(std::fs::read_dir(copies).unwrap().count(), 2);
    let files = |name: &str| {
        ["robot1", "robot2"].map(|robot| {
            tessera_fleet::chaos::copy_of(&campaign.out.as_ref().unwrap().join("disturbed"), robot)
                .unwrap()
                .join(name)
                .is_file()
        })
    };
    assert_eq!(files("keyframes.store"), [campaign.whole; 2]);
    assert_eq!(files("surfaces.journal"), [!campaign.whole; 2]);
}

#[test]
fn the_command_says_what_struck_and_that_the_promise_was_kept() {
    let dir = tempfile::tempdir().unwrap();
    let runs = runs(dir.path());
    let before = std::fs::read_dir(&runs[0]).unwrap().count();
    let output = chaos(&runs, &["--json", "--seed", "4"]);
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{errors}");
    let lines: Vec<serde_json::Value> =
        output.stdout.split(|b| *b == b'\n').filter_map(|line| serde_json::from_slice(line).ok()).collect();
    let of = |event: &str| lines.iter().filter(|line| line["event"] == event).collect::<Vec<_>>();
    assert_eq!(of("fault").len(), FleetFault::ALL.len());
    let is_named = |fault: &&serde_json::Value| (fault["fault"] == "kill_base") == fault["robot"].is_null();
    assert!(of("fault").iter().all(is_named), "the fault of each robot says which");
    assert!(of("robot").len() == 2 && of("robot").iter().all(|robot| robot["identical"] == true));
    let [total] = of("total")[..] else { panic!("one total, of {lines:?}") };
    assert!(total["kept"] == true && total["map_identical"] == true, "{total}");
    assert_eq!(std::fs::read_dir(&runs[0]).unwrap().count(), before, "the user's run is only read");
}

/// The promise is judged, not assumed: one bit of a copy is enough.
#[test]
fn a_copy_that_was_tampered_with_breaks_the_promise() {
    let dir = tempfile::tempdir().unwrap();
    let runs = runs(dir.path());
    let out = dir.path().join("out");
    let output = chaos(&runs, &["--flip", "--out", out.to_str().unwrap()]);
    let [said, errors] = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes));
    assert_eq!(output.status.code(), Some(4), "{said}{errors}");
    assert!(said.contains("promise     BROKEN") && said.contains("run of 1 of 2 robots"), "{said}");
    assert!(said.contains("identical to the undisturbed base's"), "{said}");
    assert!(errors.contains("promise broken: robot1: ") && errors.contains("align.journal: "), "{errors}");
    assert!(out.join("disturbed/map/map.ply").is_file(), "everything stays for a look");
}

#[test]
fn runs_that_cannot_be_replayed_are_refused_in_words() {
    let dir = tempfile::tempdir().unwrap();
    let runs = runs(dir.path());
    let unfinished = dir.path().join("unfinished");
    let mut growing = GrowingRun::begin(&unfinished, "unfinished", 9);
    growing.grow();
    let refused = |runs: &[PathBuf; 2], code: i32, expected: &str| {
        let out = dir.path().join("out");
        let output = chaos(runs, &["--out", out.to_str().unwrap()]);
        let words = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(code) && words.contains(expected), "{words}");
        let _ = std::fs::remove_dir_all(out);
    };
    refused(&[runs[0].clone(), unfinished], 3, "the run has not ended");
    refused(&[runs[0].clone(), runs[0].clone()], 2, "is given twice");
    refused(&[runs[0].clone(), dir.path().join("nowhere")], 3, "nowhere");
    std::fs::create_dir_all(dir.path().join("out/taken")).unwrap();
    refused(&runs, 2, "expected an empty folder");
}
