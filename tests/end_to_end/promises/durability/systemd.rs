//! A run under the system's own supervisor: the units, and what the stages tell it.

use crate::common::{Run, room, wait_for};
use crate::requirements::missing;
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// A socket that listens as systemd does.
struct Listener {
    socket: UnixDatagram,
    path: PathBuf,
    heard: Vec<String>,
}

impl Listener {
    fn new(folder: &Path, name: &str) -> Self {
        let path = folder.join(format!("{name}.notify"));
        let socket = UnixDatagram::bind(&path).unwrap();
        socket.set_nonblocking(true).unwrap();
        Self { socket, path, heard: Vec::new() }
    }

    /// Hands a service what systemd would hand it.
    fn environment(&self, command: &mut Command) {
        command.env("NOTIFY_SOCKET", &self.path).env("WATCHDOG_USEC", "400000");
    }

    fn count(&mut self, word: &str) -> usize {
        let mut bytes = [0; 256];
        while let Ok(n) = self.socket.recv(&mut bytes) {
            self.heard.push(String::from_utf8_lossy(&bytes[..n]).into_owned());
        }
        self.heard.iter().filter(|heard| *heard == word).count()
    }
}

/// Starts a stage as its unit does.
fn stage(run: &Run, name: &str, listener: &Listener, kill_points: &str) -> Child {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tessera"));
    command.args(["stage", name, "--run-dir"]).arg(run.out()).env("TESSERA_KILL_POINTS", kill_points);
    listener.environment(&mut command);
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
}

#[test]
fn a_held_run_with_stages_of_others_keeps_its_bytes() {
    let undisturbed = room();
    assert!(undisturbed.finish().success());
    let run = room().with(&["--hold"]).with_faults("");
    let mut of_run = Listener::new(run.dir.path(), "run");
    let mut command = run.command();
    of_run.environment(&mut command);
    let mut holder = command.spawn().unwrap();
    wait_for("the run to be ready", || of_run.count("READY=1") == 1);
    let names = ["sensor", "reconstruct", "align", "optimise"];
    let mut listeners = names.map(|name| Listener::new(run.dir.path(), name));
    // The aligner stops in the middle, so that all of them can be looked at.
    let plans = ["sent:9", "", "journaled:17,received:25:stop", ""];
    let mut children: Vec<Child> = (0..4).map(|k| stage(&run, names[k], &listeners[k], plans[k])).collect();
    // As systemd would: who dies is started again.
    for (k, plan) in [(0, ""), (2, "received:25:stop")] {
        assert!(!children[k].wait().unwrap().success(), "{} was to die", names[k]);
        children[k] = stage(&run, names[k], &listeners[k], plan);
    }
    let stopped = run.wait_until_stopped("align");
    for (k, name) in names.iter().enumerate() {
        let n_lives = if plans[k].is_empty() { 1 } else { 2 };
        wait_for(&format!("{name} to be ready"), || listeners[k].count("READY=1") == n_lives);
        // One that is frozen gives no sign of life: that is how systemd knows.
        if *name != "align" {
            let before = listeners[k].count("WATCHDOG=1");
            wait_for(&format!("{name} to live"), || listeners[k].count("WATCHDOG=1") > before + 1);
        }
    }
    let before = listeners[2].count("WATCHDOG=1");
    std::thread::sleep(Duration::from_millis(600));
    assert_eq!(listeners[2].count("WATCHDOG=1"), before, "frozen and yet alive");
    crate::common::signal(stopped, "CONT");
    assert!(holder.wait().unwrap().success(), "{}", run.log());
    for (child, name) in children.iter_mut().zip(names) {
        assert!(matches!(child.wait().unwrap().code(), Some(0 | 75)), "{name}\n{}", run.log());
    }
    assert!(of_run.count("WATCHDOG=1") > 1);
    run.assert_same_bytes(&undisturbed, "stages started by hand");
    assert_eq!(run.leftovers(), Vec::<PathBuf>::new());
    let summary: serde_json::Value = serde_json::from_slice(&run.output("summary.json")).unwrap();
    assert_eq!((&summary["ended"], &summary["restarts"]["align"]), (&"finished".into(), &1.into()));
    // Started again, it finds that all is done.
    let again = room_of(&run);
    assert!(again.status.success());
    run.assert_same_bytes(&undisturbed, "held again");
}

fn room_of(run: &Run) -> std::process::Output {
    run.command().output().unwrap()
}

#[test]
fn a_supervised_stage_is_the_supervisors_and_not_systemds() {
    let run = room();
    let mut listener = Listener::new(run.dir.path(), "run");
    let mut command = run.command();
    listener.environment(&mut command);
    assert!(command.output().unwrap().status.success());
    assert_eq!(listener.count("READY=1"), 1, "{:?}", listener.heard);
}

#[test]
fn the_units_are_what_systemd_understands() {
    if Command::new("systemd-analyze").arg("--version").output().is_err() {
        missing("systemd", "there is no systemd-analyze here");
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/systemd");
    let mut units = Vec::new();
    for item in std::fs::read_dir(folder).unwrap() {
        let path = item.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "service") {
            // It looks whether the program is there.
            let text = std::fs::read_to_string(&path).unwrap();
            let text = text.replace("/usr/local/bin/tessera", env!("CARGO_BIN_EXE_tessera"));
            let name = path.file_name().unwrap().to_str().unwrap().replace('@', "@desk");
            std::fs::write(dir.path().join(&name), text).unwrap();
            units.push(dir.path().join(name));
        }
    }
    assert_eq!(units.len(), 5);
    let output = Command::new("systemd-analyze").arg("verify").args(&units).output().unwrap();
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    let ours: Vec<&str> = text.lines().filter(|line| line.contains("tessera")).collect();
    assert!(output.status.success() && ours.is_empty(), "{text}");
}
