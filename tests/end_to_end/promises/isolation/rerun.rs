//! `tessera run --rerun` and `tessera view`: a run as Rerun has it, and the run as without a viewer.

use crate::common::{Run, room, wait_for};
use crate::requirements::missing;
use std::net::{TcpListener, TcpStream};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::Duration;

const FRAMES: u64 = 60;

/// The program that is built apart, where it was built.
fn is_built() -> bool {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("view/target/release/tessera-view");
    if !path.is_file() {
        missing("viewer", "it is not built: cargo build --release --manifest-path view/Cargo.toml");
    }
    path.is_file()
}

/// Rerun's own command line, to read files back.
fn rerun() -> Option<PathBuf> {
    let installed = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/viewer/bin/rerun");
    let on_path = std::env::var_os("PATH").unwrap_or_default();
    let mut places = std::env::split_paths(&on_path).map(|folder| folder.join("rerun")).chain([installed]);
    let found = places.find(|path| path.is_file());
    if found.is_none() {
        missing("rerun", "python3 -m venv target/viewer && target/viewer/bin/pip install rerun-sdk==0.36.3");
    }
    found
}

fn tessera(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tessera")).args(arguments).output().unwrap()
}

fn verify(rerun: &Path, file: &Path) {
    let verified = Command::new(rerun).args(["rrd", "verify"]).arg(file).output().unwrap();
    assert!(verified.status.success(), "{}", String::from_utf8_lossy(&verified.stderr));
}

/// What a file has of each entity, by Rerun's own reader.
fn print(rerun: &Path, file: &Path) -> String {
    let output = Command::new(rerun).args(["rrd", "print"]).arg(file).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn assert_whole(printed: &str, has_latency: bool) {
    let mut entities = vec![
        "/world/camera",
        "/world/camera/image",
        "/world/camera/surface",
        "/world/map/0/surface",
        "/world/map/1",
        "/world/graph/1/lines",
        "/world/trajectory/online/0",
        "/world/trajectory/final",
        "/certainty/position",
        "/states",
    ];
    if has_latency {
        entities.extend(["/latency/align", "/latency/end_to_end"]);
    }
    for entity in entities {
        assert!(printed.contains(entity), "no {entity}; is view/target up to date?\n{printed}");
    }
}

#[test]
fn a_run_that_is_recorded_has_its_bytes_and_the_recording_is_whole() {
    if !is_built() {
        return;
    }
    let undisturbed = room().frames(FRAMES);
    assert!(undisturbed.finish().success());
    let dir = tempfile::tempdir().unwrap();
    let live = dir.path().join("live.rrd");
    let run: Run = room().frames(FRAMES).with(&["--rerun", live.to_str().unwrap()]);
    let output = run.command().output().unwrap();
    assert!(output.status.success() && output.stderr.is_empty(), "{output:?}\n{}", run.log());
    run.assert_same_bytes(&undisturbed, "it was recorded for Rerun");
    assert_eq!(run.leftovers(), Vec::<PathBuf>::new());
    // Afterwards, from the folder alone.
    let after = dir.path().join("after.rrd");
    let viewed = tessera(&["view", run.out().to_str().unwrap(), "--save", after.to_str().unwrap()]);
    assert!(viewed.status.success(), "{}", String::from_utf8_lossy(&viewed.stderr));
    let without = dir.path().join("without.rrd");
    let words = ["--save", without.to_str().unwrap(), "--images-per-s", "0"];
    assert!(tessera(&[&["view", run.out().to_str().unwrap()], &words[..]].concat()).status.success());
    for file in [&live, &after, &without] {
        let bytes = std::fs::read(file).unwrap();
        assert!(bytes.starts_with(b"RRF") && bytes.len() > 10_000, "{}", file.display());
    }
    let Some(rerun) = rerun() else { return };
    for file in [&live, &after, &without] {
        verify(&rerun, file);
    }
    assert_whole(&print(&rerun, &live), true);
    assert_whole(&print(&rerun, &after), false);
    assert!(!print(&rerun, &without).contains("/world/camera/surface"));
}

#[test]
fn a_viewer_that_is_open_is_fed() {
    if !is_built() {
        return;
    }
    let Some(rerun) = rerun() else { return };
    let run = room().frames(FRAMES);
    assert!(run.finish().success());
    let dir = tempfile::tempdir().unwrap();
    let received = dir.path().join("received.rrd");
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port().to_string();
    // A viewer without a window, which writes down what it is sent.
    let mut viewer = Command::new(&rerun)
        .args(["--bind", "127.0.0.1", "--port", &port, "--save"])
        .arg(&received)
        .stderr(Stdio::null())
        // What PyPI has under that name starts the program itself as its child.
        .process_group(0)
        .spawn()
        .unwrap();
    wait_for("the viewer", || TcpStream::connect(format!("127.0.0.1:{port}")).is_ok());
    let url = format!("rerun+http://127.0.0.1:{port}/proxy");
    let viewed = tessera(&["view", run.out().to_str().unwrap(), "--connect", &url]);
    assert!(viewed.status.success(), "{}", String::from_utf8_lossy(&viewed.stderr));
    // It has all of it before it writes it.
    let size = || std::fs::metadata(&received).map_or(0, |meta| meta.len());
    let mut seen = 0;
    wait_for("the viewer to write", || {
        std::thread::sleep(Duration::from_millis(500));
        let grew = size() > seen.max(10_000);
        seen = size();
        seen > 10_000 && !grew
    });
    let group = format!("-{}", viewer.id());
    assert!(Command::new("kill").args(["-INT", "--", &group]).status().unwrap().success());
    viewer.wait().unwrap();
    assert_whole(&print(&rerun, &received), false);
}

#[test]
fn what_cannot_be_shown_is_told() {
    if !is_built() {
        return;
    }
    let told = |arguments: &[&str]| {
        let output = tessera(arguments);
        assert_eq!(output.status.code(), Some(2), "{output:?}");
        String::from_utf8(output.stderr).unwrap()
    };
    assert!(told(&["view", "no-such-run", "--save", "x.rrd"]).contains("no run \"no-such-run\""));
    let words = told(&["run", "room", "--frames", "2", "--rerun", "no/such/folder/x.rrd"]);
    assert!(words.contains("--rerun no/such/folder/x.rrd: expected a file in a folder that is there"));
}
