//! Other programs and other users: they stop no restart, and see nothing that is not theirs.

use crate::common::{Run, process_of, room, signal, wait_for};
use crate::requirements::missing;
use std::io::Read;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use tessera_settings::Settings;
use tessera_stage::{RunFile, RunFiles};
use tessera_transport::Link;

const FRAMES: u64 = 300;

/// Tells [`a_viewer_that_takes_every_place`] that it is the viewer, and of which run.
const VIEWER_VARIABLE: &str = "TESSERA_TEST_VIEWER";

/// Not a test of its own: the process that another test starts.
#[test]
fn a_viewer_that_takes_every_place() {
    let Some(run_dir) = std::env::var_os(VIEWER_VARIABLE) else { return };
    let files = RunFiles::new(Path::new(&run_dir));
    let file = RunFile::read(&files).unwrap();
    let settings = Settings::from_toml(&std::fs::read_to_string(files.config()).unwrap(), "config").unwrap();
    let layout = file.layout(&settings);
    let link = Link::open(&file.identity, &layout, "viewer").unwrap();
    // Sensor and reconstruct read the flow, the supervisor the beats; the rest is free.
    let n = |places: usize, taken: usize| 0..places - taken;
    let poses: Vec<_> = n(layout.poses().subscribers, 0).map(|_| link.pose_subscriber().unwrap()).collect();
    let flow: Vec<_> = n(layout.flow().subscribers, 2).map(|_| link.flow_subscriber().unwrap()).collect();
    let beats: Vec<_> = n(layout.beats().subscribers, 1).map(|_| link.beat_subscriber().unwrap()).collect();
    let frames: Vec<_> =
        n(layout.frames().subscribers, 1).map(|_| link.frame_subscriber().unwrap()).collect();
    let surfaces = n(layout.surfaces().subscribers, 1).map(|_| link.surface_subscriber().unwrap());
    let surfaces: Vec<_> = surfaces.collect();
    println!("all places taken: {}", poses.len() + flow.len() + beats.len() + frames.len() + surfaces.len());
    // Frozen here by the test, and killed at its end.
    loop {
        std::thread::park();
    }
}

struct Viewer(Child);

impl Viewer {
    fn of(run: &Run) -> Self {
        let mut child = process_of(module_path!(), "a_viewer_that_takes_every_place")
            .env(VIEWER_VARIABLE, run.out())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut said = String::new();
        let mut stdout = child.stdout.take().unwrap();
        while !said.contains("all places taken") {
            let mut bytes = [0; 256];
            let n = stdout.read(&mut bytes).unwrap();
            assert!(n > 0, "the viewer ended: {said}");
            said.push_str(&String::from_utf8_lossy(&bytes[..n]));
        }
        signal(child.id(), "STOP");
        Self(child)
    }
}

impl Drop for Viewer {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn a_frozen_viewer_on_every_place_stops_no_restart() {
    let undisturbed = room().frames(FRAMES);
    assert!(undisturbed.finish().success());
    // The aligner stops itself, so that the run does not end before the viewer is there.
    let run = room().frames(FRAMES).with(&["--set", "flow.hang_s=600"]).with_faults("align=computed:20:stop");
    let mut child = run.start();
    let align = run.wait_until_stopped("align");
    let viewer = Viewer::of(&run);
    for stage in ["sensor", "reconstruct", "optimise"] {
        let victim = run.stage_pid(stage);
        signal(victim, "KILL");
        let ready = |pid: &u32| run.log().contains(&format!("{stage}[{pid}] ready"));
        wait_for("the successor", || run.pids_of(stage).iter().any(|pid| *pid != victim && ready(pid)));
    }
    signal(align, "KILL");
    assert!(child.wait().unwrap().success(), "{}", run.log());
    assert_eq!(run.n_deaths(), 4, "{}", run.log());
    drop(viewer);
    run.assert_same_bytes(&undisturbed, "beside a frozen viewer");
    assert_eq!(run.leftovers(), Vec::<PathBuf>::new());
}

/// Whether another user could read or write a path, tried as that user.
fn as_another_user(path: &Path) -> &'static str {
    let script = r#"[ -d "$1" ] && { ls "$1" && exit 10; ( : > "$1/x" ) && exit 11; exit 0; }
                    cat "$1" > /dev/null && exit 10; ( : >> "$1" ) && exit 11; exit 0"#;
    let status = Command::new("setpriv")
        .args(["--reuid=65534", "--regid=65534", "--clear-groups", "sh", "-c", script, "sh"])
        .arg(path)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .unwrap();
    match status.code() {
        Some(0) => "nothing",
        Some(10) => "read",
        Some(11) => "write",
        other => panic!("the probe ended with {other:?}"),
    }
}

#[test]
fn another_user_can_neither_read_nor_write_what_a_run_has() {
    let probe = Command::new("setpriv").args(["--reuid=65534", "--clear-groups", "true"]).output();
    if !probe.is_ok_and(|output| output.status.success()) {
        missing("root", "only root can become another user, with setpriv");
        return;
    }
    let run = room().frames(100_000);
    // The test's own folder lets everybody in, so that the run's is what keeps them out.
    std::fs::set_permissions(run.dir.path(), std::fs::Permissions::from_mode(0o755)).unwrap();
    let open = run.dir.path().join("open");
    std::fs::write(&open, "x").unwrap();
    assert_eq!(as_another_user(&open), "read", "the probe must be able to see what is open");
    let mut child = run.start();
    run.wait_until_busy();
    let file = RunFile::read(&RunFiles::new(&run.out())).unwrap();
    let prefix = run.prefix();
    let shared = std::fs::read_dir("/dev/shm").unwrap().flatten().map(|item| item.path());
    let shared = shared.filter(|path| path.file_name().unwrap().to_string_lossy().starts_with(&prefix));
    let durable = std::fs::read_dir(run.out()).unwrap().flatten().map(|item| item.path());
    let private = [file.identity.root.clone(), file.identity.config_file.clone(), run.out()];
    let mut n = 0;
    for path in shared.chain(durable).chain(private) {
        assert_eq!(as_another_user(&path), "nothing", "{}", path.display());
        n += 1;
    }
    assert!(n > 20, "{n}");
    signal(child.id(), "TERM");
    assert_eq!(child.wait().unwrap().code(), Some(130));
}

#[test]
fn a_damaged_counter_of_nodes_is_told_and_cured() {
    let undisturbed = room().frames(FRAMES);
    assert!(undisturbed.finish().success());
    let run = room().frames(FRAMES).with(&["--set", "flow.hang_s=600"]).with_faults("align=computed:20:stop");
    let mut child = run.start();
    let align = run.wait_until_stopped("align");
    let prefix = run.prefix();
    let shared = std::fs::read_dir("/dev/shm").unwrap().flatten().map(|item| item.path());
    let counters: Vec<PathBuf> = shared
        .filter(|path| {
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            name.starts_with(&prefix) && name.ends_with(".global_mgmt")
        })
        .collect();
    assert!(!counters.is_empty());
    for path in &counters {
        let meta = std::fs::metadata(path).unwrap();
        assert_eq!(meta.permissions().mode() & 0o777, 0o600, "{}", path.display());
        std::fs::write(path, vec![0xff; meta.len() as usize]).unwrap();
    }
    signal(align, "KILL");
    let mut text = String::new();
    let status = child.wait().unwrap();
    child.stderr.take().unwrap().read_to_string(&mut text).unwrap();
    assert_eq!(status.code(), Some(4), "{text}");
    assert!(text.contains("cannot open a node in") && text.contains("tessera resume"), "{text}");
    assert_eq!(run.leftovers(), Vec::<PathBuf>::new());
    let resumed = Command::new(env!("CARGO_BIN_EXE_tessera"))
        .args(["resume", "--quiet"])
        .arg(run.out())
        .output()
        .unwrap();
    assert!(resumed.status.success(), "{}\n{}", String::from_utf8_lossy(&resumed.stderr), run.log());
    run.assert_same_bytes(&undisturbed, "after a damaged counter");
}
