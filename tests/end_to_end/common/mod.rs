//! Running the real executable over real shared memory, each run under its own name.
#![allow(dead_code, unreachable_pub, reason = "each test file uses a part of it")]

pub mod ros;

use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Output, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};
use tessera_slam::AlignRecord;
use tessera_stage::ALIGN_JOURNAL;

/// Frames of the runs here: enough for several keyframes.
pub const FRAMES: &str = "40";

/// A small camera, so that a run takes little time.
const CAMERA: &str = "width = 160\nheight = 120\nfx = 131.25\nfy = 131.25\ncx = 79.5\ncy = 59.5\n\
                      units_per_metre = 5000.0\n";

/// A camera for what a small one does not see.
const CAMERA_320: &str = "width = 320\nheight = 240\nfx = 262.5\nfy = 262.5\ncx = 159.5\ncy = 119.5\n\
                          units_per_metre = 5000.0\n";

/// The outputs that must be the same bytes whatever happened.
pub const OUTPUTS: [&str; 4] = ["trajectory.txt", "trajectory_online.txt", "keyframes.txt", "map.ply"];

/// All state is thrown away after each frame and read back.
pub const FORGETFUL: &str = "experiment.run.forget_every=1";

/// Writes the small camera to a file.
pub fn write_camera(path: &Path) {
    std::fs::write(path, CAMERA).unwrap();
}

/// A run's folder and name, both of its own.
pub struct Run {
    pub dir: tempfile::TempDir,
    pub name: String,
    source: String,
    frames: String,
    arguments: Vec<String>,
    environment: Vec<(String, String)>,
}

/// A small run of the simulated room.
pub fn room() -> Run {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("camera.toml"), CAMERA).unwrap();
    let name = format!("test-{}-{}", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
    let source = "room".into();
    Run { dir, name, source, frames: FRAMES.into(), arguments: Vec::new(), environment: Vec::new() }
        .with(&["--set", "surface.step=2"])
}

impl Run {
    /// The folder of another run of the same name, which a test fills.
    pub fn in_folder(of: &Run) -> Run {
        let dir = tempfile::tempdir().unwrap();
        let (name, source, frames) = (of.name.clone(), of.source.clone(), of.frames.clone());
        Run { dir, name, source, frames, arguments: of.arguments.clone(), environment: Vec::new() }
    }
}

/// A test that fails leaves no process behind.
impl Drop for Run {
    fn drop(&mut self) {
        for pid in self.processes(" run ").into_iter().chain(self.processes(" stage ")) {
            let _ = Command::new("kill").args(["-KILL", &pid.to_string()]).status();
        }
    }
}

impl Run {
    pub fn with(mut self, arguments: &[&str]) -> Self {
        self.arguments.extend(arguments.iter().map(ToString::to_string));
        self
    }

    pub fn frames(mut self, n: u64) -> Self {
        self.frames = n.to_string();
        self
    }

    /// Another source than the simulated room.
    pub fn of(mut self, source: &Path) -> Self {
        self.source = source.display().to_string();
        self
    }

    pub fn named(mut self, name: &str) -> Self {
        self.name = name.into();
        self
    }

    /// Faults on purpose, in this run and not where it is resumed.
    pub fn with_faults(self, plan: &str) -> Self {
        self.with(&["--faults", plan])
    }

    pub fn with_env(mut self, name: &str, value: &str) -> Self {
        self.environment.push((name.into(), value.into()));
        self
    }

    pub fn out(&self) -> PathBuf {
        self.dir.path().join("out")
    }

    pub fn command(&self) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tessera"));
        command
            .args(["run", &self.source, "--quiet", "--name", &self.name, "--camera"])
            .arg(self.dir.path().join("camera.toml"))
            .arg("--out")
            .arg(self.out())
            .args(["--frames", &self.frames])
            .args(&self.arguments)
            .envs(self.environment.iter().cloned())
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        command
    }

    pub fn start(&self) -> Child {
        self.command().spawn().unwrap()
    }

    /// Runs a command on this run's folder, to its end.
    pub fn tessera(&self, arguments: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_tessera")).args(arguments).arg(self.out()).output().unwrap()
    }

    /// Runs to the end; a failure shows the log.
    pub fn finish(&self) -> ExitStatus {
        let output = self.command().output().unwrap();
        if !output.status.success() {
            eprintln!(
                "{}{}",
                String::from_utf8_lossy(&output.stdout),
                String::from_utf8_lossy(&output.stderr)
            );
            eprintln!("{}", self.log());
        }
        output.status
    }

    pub fn log(&self) -> String {
        std::fs::read_to_string(self.out().join("log.txt")).unwrap_or_default()
    }

    /// Deaths that the supervisor has noticed.
    pub fn n_deaths(&self) -> usize {
        let log = self.log();
        log.lines().filter(|line| line.contains(" supervisor[") && line.contains(" died: ")).count()
    }

    /// Frames in the aligner's journal so far.
    pub fn n_processed(&self) -> usize {
        let path = self.out().join("align.journal");
        let Ok(mut journal) = tessera_journal::Follower::open(&path, ALIGN_JOURNAL) else {
            return 0;
        };
        let records = std::iter::from_fn(|| journal.next().ok().flatten());
        records.filter(|record| matches!(record, AlignRecord::Frame(_))).count()
    }

    /// Beginning of the names of this run's shared memory.
    pub fn prefix(&self) -> String {
        let text = std::fs::read_to_string(self.out().join("run.json")).unwrap();
        let run: serde_json::Value = serde_json::from_str(&text).unwrap();
        run["identity"]["prefix"].as_str().unwrap().to_string()
    }

    /// Names in shared memory and private folders that belong to this run.
    pub fn leftovers(&self) -> Vec<PathBuf> {
        let text = std::fs::read_to_string(self.out().join("run.json")).unwrap();
        let run: serde_json::Value = serde_json::from_str(&text).unwrap();
        let root = PathBuf::from(run["identity"]["root"].as_str().unwrap());
        let mut left: Vec<PathBuf> = Vec::new();
        for folder in [Path::new("/dev/shm"), root.parent().unwrap()] {
            // The private folder goes with the last run in it.
            let items = std::fs::read_dir(folder).into_iter().flatten().flatten();
            left.extend(items.map(|item| item.path()).filter(|path| {
                let name = path.file_name().unwrap().to_string_lossy().into_owned();
                name.starts_with(&self.prefix()) || name == format!("{}.run", self.name)
            }));
        }
        left
    }

    pub fn output(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.out().join(name)).unwrap_or_else(|e| panic!("{name}: {e}\n{}", self.log()))
    }

    /// Fails unless all outputs are the same bytes as those of `other`.
    pub fn assert_same_bytes(&self, other: &Run, what: &str) {
        for name in OUTPUTS {
            assert!(self.output(name) == other.output(name), "{name} differs: {what}\n{}", self.log());
        }
    }

    /// Waits until the aligner has journaled something.
    pub fn wait_until_busy(&self) {
        wait_for("the first records", || {
            std::fs::metadata(self.out().join("align.journal")).is_ok_and(|meta| meta.len() > 4096)
        });
    }

    /// Process id of one stage.
    pub fn stage_pid(&self, stage: &str) -> u32 {
        let pids = self.processes(&format!(" stage {stage} "));
        assert_eq!(pids.len(), 1, "{stage}\n{}", self.log());
        pids[0]
    }

    /// Waits until a stage has stopped itself, as `--faults` told it: then the run cannot
    /// end before a slow test gets round to it.
    pub fn wait_until_stopped(&self, stage: &str) -> u32 {
        let mut stopped = None;
        wait_for("a stage to stop itself", || {
            let word = format!(" stage {stage} ");
            stopped = self.processes(&word).into_iter().find(|pid| {
                let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
                stat.rsplit(") ").next().is_some_and(|rest| rest.starts_with('T'))
            });
            stopped.is_some()
        });
        stopped.unwrap()
    }

    /// Process ids of one stage: none while it is dead.
    pub fn pids_of(&self, stage: &str) -> Vec<u32> {
        self.processes(&format!(" stage {stage} "))
    }

    /// Process ids of the stages.
    pub fn stage_pids(&self) -> Vec<u32> {
        self.processes(" stage ")
    }

    fn processes(&self, word: &str) -> Vec<u32> {
        let out = self.out().display().to_string();
        let mut pids = Vec::new();
        for item in std::fs::read_dir("/proc").unwrap().flatten() {
            let Ok(pid) = item.file_name().to_string_lossy().parse::<u32>() else { continue };
            let line = std::fs::read(item.path().join("cmdline")).unwrap_or_default();
            let line = String::from_utf8_lossy(&line).replace('\0', " ");
            if line.contains(word) && line.contains(&out) {
                pids.push(pid);
            }
        }
        pids
    }
}

/// This executable as another process, which runs one test of a module alone.
pub fn process_of(module: &str, test: &str) -> Command {
    let (_, module) = module.split_once("::").unwrap();
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["--exact", &format!("{module}::{test}"), "--nocapture"]);
    command
}

/// Waits until something holds; the limit is only there for what never comes.
pub fn wait_for(what: &str, mut holds: impl FnMut() -> bool) {
    let deadline = Instant::now() + Duration::from_secs(180);
    while !holds() {
        assert!(Instant::now() < deadline, "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Sends a signal to a process.
pub fn signal(pid: u32, name: &str) {
    assert!(Command::new("kill").args([&format!("-{name}"), &pid.to_string()]).status().unwrap().success());
}

/// A Python under `target/` with packages of PyPI; `None`, with the reason printed, without
/// Python or network. The folder is made once and kept.
pub fn python(name: &str, packages: &[&str]) -> Option<PathBuf> {
    let target = Path::new(env!("CARGO_BIN_EXE_tessera")).parent()?.parent()?;
    let folder = target.join(format!("python-{name}"));
    let (python, done) = (folder.join("bin/python"), folder.join("packages.txt"));
    // One test installs, others that need the same packages wait for it.
    let lock = std::fs::File::create(target.join(format!("python-{name}.lock"))).ok()?;
    lock.lock().ok()?;
    if std::fs::read_to_string(&done).is_ok_and(|there| there == packages.join("\n")) {
        return Some(python);
    }
    let mut venv = Command::new("python3");
    venv.args(["-m", "venv", "--clear"]).arg(&folder);
    let mut install = Command::new(&python);
    install.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]).args(packages);
    for mut command in [venv, install] {
        let failed = match command.output() {
            Ok(output) if output.status.success() => continue,
            Ok(output) => String::from_utf8_lossy(&output.stderr).into_owned(),
            Err(error) => error.to_string(),
        };
        let why = failed.lines().last().unwrap_or_default();
        crate::requirements::missing("python", format_args!("no Python with {packages:?}: {why}"));
        return None;
    }
    std::fs::write(done, packages.join("\n")).ok()?;
    Some(python)
}

/// Writes frames of the room as a folder in the TUM layout, colour as PNG: the same in every reader.
pub fn write_folder(folder: &Path, camera: &Path, n: u64) {
    let stamps = write_images(folder, camera, n);
    let nanos = |stamp: i64| format!("{}.{:09}", stamp / 1_000_000_000, stamp % 1_000_000_000);
    write_lists(folder, stamps.into_iter().zip(0..).map(|(stamp, image)| (nanos(stamp), image)));
}

/// Writes frames of the room in any order, 30 a second, as a folder in the TUM layout; `None` is a
/// covered lens.
pub fn write_scenario(folder: &Path, camera: &Path, frames: &[Option<u64>]) {
    let n = frames.iter().flatten().max().map_or(0, |last| last + 1);
    write_images(folder, camera, n);
    let (width, height) = (160, 120);
    let black = |name: String, n_bytes: usize, color| {
        let bytes = vec![0; n_bytes * width * height];
        image::save_buffer(folder.join(name), &bytes, width as u32, height as u32, color).unwrap();
    };
    black(format!("d{n}.png"), 2, image::ExtendedColorType::L16);
    black(format!("c{n}.png"), 3, image::ExtendedColorType::Rgb8);
    let row = |(k, frame): (usize, &Option<u64>)| (format!("{:.6}", k as f64 / 30.0), frame.unwrap_or(n));
    write_lists(folder, frames.iter().enumerate().map(row));
}

/// A covered lens after 30 frames, then a place never seen, and back into the old map: a submap begins,
/// and is joined before the end.
pub fn lost_and_found() -> Run {
    let run = room().with(&["--set", "mapping.submaps.after_s=0.3"]);
    let mut frames: Vec<Option<u64>> = (0..30).map(Some).collect();
    frames.extend([None; 5]);
    frames.extend((10..=110).rev().map(Some));
    let folder = run.dir.path().join("recording");
    write_scenario(&folder, &run.dir.path().join("camera.toml"), &frames);
    run.frames(frames.len() as u64).of(&folder)
}

/// Out of the building's lift and back into it, up to another storey, and out of it.
pub fn carried_by_a_lift() -> Run {
    let run = room();
    let camera = run.dir.path().join("camera.toml");
    std::fs::write(&camera, CAMERA_320).unwrap();
    let frames: Vec<u64> = (0..330).chain((0..330).rev()).chain(6490..7000).step_by(3).collect();
    let folder = run.dir.path().join("recording");
    write_images_of("building", &folder, &camera, &frames);
    let row = |(k, frame): (usize, &u64)| (format!("{:.6}", k as f64 * 3.0 / 30.0), *frame);
    write_lists(&folder, frames.iter().enumerate().map(row));
    run.frames(frames.len() as u64).of(&folder)
}

/// Writes images of the room and the camera; answers their stamps, nanoseconds.
pub fn write_images(folder: &Path, camera: &Path, n: u64) -> Vec<i64> {
    write_images_of("room", folder, camera, &(0..n).collect::<Vec<_>>())
}

/// Writes these images of a scene and the camera; answers their stamps, nanoseconds.
fn write_images_of(scene: &str, folder: &Path, camera: &Path, indices: &[u64]) -> Vec<i64> {
    let options = tessera_sources::SourceOptions {
        camera: Some(camera.display().to_string()),
        frames: indices.iter().max().map(|last| last + 1),
        ..tessera_sources::SourceOptions::default()
    };
    let source = tessera_sources::open(&tessera_sources::SourceSpec::parse(scene), &options).unwrap();
    let (width, height) = (source.camera().width, source.camera().height);
    let n_pixels = (width * height) as usize;
    let (mut depth, mut colour) = (vec![0u16; n_pixels], vec![0u8; 3 * n_pixels]);
    std::fs::create_dir_all(folder).unwrap();
    std::fs::copy(camera, folder.join("camera.toml")).unwrap();
    let mut write = |index| {
        let info = source
            .read(index, &mut tessera_sources::FrameBuffers { depth: &mut depth, colour: &mut colour })
            .unwrap();
        let save = |name: String, bytes: &[u8], color| {
            image::save_buffer(folder.join(name), bytes, width, height, color).unwrap();
        };
        save(format!("d{index}.png"), bytemuck::cast_slice(&depth), image::ExtendedColorType::L16);
        save(format!("c{index}.png"), &colour, image::ExtendedColorType::Rgb8);
        info.stamp_nanos
    };
    indices.iter().map(|index| write(*index)).collect()
}

/// Writes the lists of a folder: stamps, and which image comes then.
pub fn write_lists(folder: &Path, rows: impl Iterator<Item = (String, u64)>) {
    let (mut depth, mut colour) = (String::new(), String::new());
    for (stamp, image) in rows {
        depth += &format!("{stamp} d{image}.png\n");
        colour += &format!("{stamp} c{image}.png\n");
    }
    std::fs::write(folder.join("depth.txt"), depth).unwrap();
    std::fs::write(folder.join("rgb.txt"), colour).unwrap();
}
