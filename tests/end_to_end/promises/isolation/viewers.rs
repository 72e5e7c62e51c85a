//! A viewer of a run changes nothing: started, stopped, killed or frozen.

use crate::common::{Run, process_of, room, signal, wait_for};
use crate::requirements::missing;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use tessera_settings::Settings;
use tessera_stage::{RunFile, RunFiles};
use tessera_transport::Link;

const FRAMES: u64 = 90;

/// Tells [`a_subscriber_of_poses`] that it is one, and of which run.
const SUBSCRIBER_VARIABLE: &str = "TESSERA_TEST_SUBSCRIBER";

/// Not a test of its own: the process that another test starts.
#[test]
fn a_subscriber_of_poses() {
    let Some(run_dir) = std::env::var_os(SUBSCRIBER_VARIABLE) else { return };
    let files = RunFiles::new(Path::new(&run_dir));
    let file = RunFile::read(&files).unwrap();
    let settings = Settings::from_toml(&std::fs::read_to_string(files.config()).unwrap(), "config").unwrap();
    let link = Link::open(&file.identity, &file.layout(&settings), "subscriber").unwrap();
    let poses = link.pose_subscriber().unwrap();
    std::fs::write(Path::new(&run_dir).with_file_name("subscribed"), "").unwrap();
    loop {
        while poses.receive().unwrap().is_some() {}
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
}

/// A process that is killed at the end of the test, whatever happens.
struct Viewer(Child);

impl Viewer {
    fn start(command: &mut Command) -> Self {
        Self(command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap())
    }

    fn tessera(arguments: &[&str]) -> Self {
        Self::start(Command::new(env!("CARGO_BIN_EXE_tessera")).args(arguments))
    }

    fn subscriber(run: &Run) -> Self {
        let mut command = process_of(module_path!(), "a_subscriber_of_poses");
        command.env(SUBSCRIBER_VARIABLE, run.out());
        let viewer = Self::start(&mut command);
        let sign = run.out().with_file_name("subscribed");
        wait_for("the subscriber", || sign.exists());
        std::fs::remove_file(sign).unwrap();
        viewer
    }
}

impl Drop for Viewer {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The program of `tessera view`, where it was built.
fn viewer_program() -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("view/target/release/tessera-view");
    if !path.is_file() {
        missing("viewer", "tessera-view is not built, see docs/viewer.md");
        return None;
    }
    Some(path)
}

#[test]
fn viewers_come_and_go_and_no_byte_changes() {
    let undisturbed = room().frames(FRAMES);
    assert!(undisturbed.finish().success());
    // One stage stops itself, so that the run cannot end before the viewers are there.
    let run =
        room().frames(FRAMES).with(&["--set", "flow.hang_s=600"]).with_faults("reconstruct=sent:30:stop");
    let mut child = run.start();
    let stopped = run.wait_until_stopped("reconstruct");
    let out = run.out().display().to_string();

    let frozen = Viewer::subscriber(&run);
    signal(frozen.0.id(), "STOP");
    let listening = Viewer::subscriber(&run);
    let json = Viewer::tessera(&["top", &run.name, "--json", "--interval", "0.05"]);
    let metrics = Viewer::tessera(&["top", &run.name, "--metrics", "127.0.0.1:0"]);
    // Killed in the middle of their work.
    drop(Viewer::subscriber(&run));
    for _ in 0..3 {
        let mut killed = Viewer::tessera(&["top", &run.name, "--json", "--interval", "0.05"]);
        std::thread::sleep(std::time::Duration::from_millis(150));
        assert!(killed.0.try_wait().unwrap().is_none(), "it ended by itself");
        drop(killed);
    }
    for command in [&["report", &out][..], &["status", &out]] {
        let status = Command::new(env!("CARGO_BIN_EXE_tessera")).args(command).output().unwrap().status;
        assert!(status.success(), "{command:?}");
    }
    assert!(run.out().join("report.html").exists(), "a report of the run so far");
    let view = viewer_program().map(|program| {
        let file = |name: &str| run.dir.path().join(name);
        let start = |name| Viewer::start(Command::new(&program).arg(run.out()).arg("--save").arg(file(name)));
        let killed = start("killed.rrd");
        wait_for("the viewer's first bytes", || {
            std::fs::metadata(file("killed.rrd")).is_ok_and(|meta| meta.len() > 0)
        });
        drop(killed);
        start("whole.rrd")
    });

    signal(stopped, "CONT");
    assert!(child.wait().unwrap().success(), "{}", run.log());
    drop((frozen, listening, json, metrics));
    run.assert_same_bytes(&undisturbed, "it was looked at");
    assert_eq!(run.n_deaths(), 0, "{}", run.log());
    if let Some(mut view) = view {
        wait_for("the viewer to end with its run", || view.0.try_wait().unwrap().is_some());
        assert!(view.0.wait().unwrap().success());
    }
    assert_eq!(run.leftovers(), Vec::<PathBuf>::new());
}

#[test]
fn a_run_that_cannot_be_read_hides_no_other() {
    let run = room().with(&["--set", "flow.hang_s=600"]).with_faults("reconstruct=sent:10:stop");
    let mut child = run.start();
    let stopped = run.wait_until_stopped("reconstruct");
    let config = run.out().join("config.toml");
    let text = std::fs::read_to_string(&config).unwrap();
    std::fs::write(&config, format!("{text}\n[of_another_version]\n")).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_tessera")).args(["status", "--json"]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let runs: Vec<serde_json::Value> = serde_json::from_slice(&output.stdout).unwrap();
    let this = runs.iter().find(|found| found["name"] == run.name.as_str()).unwrap();
    assert!(this["problem"].as_str().is_some_and(|words| words.contains("of_another_version")), "{this}");
    let output = Command::new(env!("CARGO_BIN_EXE_tessera")).args(["status"]).output().unwrap();
    let words = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && words.contains("warning: "), "{words}");
    std::fs::write(&config, text).unwrap();
    signal(stopped, "CONT");
    assert!(child.wait().unwrap().success(), "{}", run.log());
}

#[test]
fn a_stage_that_says_nothing_is_alive_to_status() {
    let run = room().with(&["--set", "flow.hang_s=600"]).with_faults("reconstruct=sent:10:stop");
    let mut child = run.start();
    let stopped = run.wait_until_stopped("reconstruct");
    let silent = run.stage_pid("optimise");
    signal(silent, "STOP");
    let states = || {
        let output = Command::new(env!("CARGO_BIN_EXE_tessera"))
            .args(["status", &run.name, "--json"])
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let status: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        let of = |stage: &serde_json::Value| {
            let text = |key: &str| stage[key].as_str().unwrap().to_owned();
            (text("stage"), text("state"), stage["pid"].as_u64().unwrap())
        };
        status["stages"].as_array().unwrap().iter().map(of).collect::<Vec<_>>()
    };
    let silence = ("optimise".to_owned(), "alive, silent".to_owned(), u64::from(silent));
    assert!(states().contains(&silence), "{:?}", states());
    for pid in [silent, stopped] {
        signal(pid, "CONT");
    }
    assert!(child.wait().unwrap().success(), "{}", run.log());
}
