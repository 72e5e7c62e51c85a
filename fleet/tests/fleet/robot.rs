//! Robots: runs of the program itself that leave their optimisations to a base.

use crate::processes::wait_for;
use crate::requirements::missing;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use tessera_geometry::{Pose, translation_rotation_norms};
use tessera_journal::Follower;
use tessera_slam::AlignRecord;
use tessera_stage::{ALIGN_JOURNAL, OPTIMISE_JOURNAL};

/// A small camera, so that a run takes little time.
const CAMERA: &str = "width = 160\nheight = 120\nfx = 131.25\nfy = 131.25\ncx = 79.5\ncy = 59.5\n\
                      units_per_metre = 5000.0\n";

/// Settings under which a short walk has loops and corrections before its end.
pub(crate) const EARLY_LOOPS: [&str; 6] = [
    "surface.step=2",
    "mapping.keyframe.translation_m=0.02",
    "mapping.keyframe.rotation_deg=1.5",
    "mapping.loop.min_frames=10",
    "experiment.mapping.loop.request_interval=3",
    "experiment.mapping.loop.delay_frames=5",
];

/// The outputs that must be the same bytes whatever happened.
const OUTPUTS: [&str; 4] = ["trajectory.txt", "trajectory_online.txt", "keyframes.txt", "map.ply"];

/// The command, of the newer build; `None`, with the reason printed, where there is none.
pub(crate) fn tessera() -> Option<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent()?;
    let places = ["debug", "release"].map(|profile| root.join("target").join(profile).join("tessera"));
    let age = |path: &PathBuf| path.metadata().and_then(|meta| meta.modified()).ok();
    let found = places.into_iter().filter(|path| path.is_file()).max_by_key(age);
    if found.is_none() {
        missing("tessera", "it is not built: cargo build");
    }
    found
}

/// A run of the simulated room.
pub(crate) struct Robot {
    tessera: PathBuf,
    pub(crate) out: PathBuf,
    arguments: Vec<String>,
}

impl Robot {
    /// A run in `folder/name` of so many frames behind the first `skip`, with the full camera.
    pub(crate) fn new(
        tessera: &Path,
        (folder, name): (&Path, &str),
        (skip, frames): (u64, u64),
        settings: &[&str],
    ) -> Self {
        let out = folder.join(name);
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let own = format!("{name}-{}-{}", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
        let mut arguments = vec!["run".into(), "room".into(), "--quiet".into(), "--name".into(), own];
        arguments.extend(["--skip".into(), skip.to_string(), "--frames".into(), frames.to_string()]);
        arguments.extend(["--out".into(), out.display().to_string()]);
        arguments.extend(settings.iter().flat_map(|set| ["--set".to_owned(), (*set).to_owned()]));
        Self { tessera: tessera.into(), out, arguments }
    }

    /// The same with the small camera.
    pub(crate) fn with_small_camera(mut self) -> Self {
        let path = self.out.with_extension("camera.toml");
        std::fs::write(&path, CAMERA).unwrap();
        self.arguments.extend(["--camera".into(), path.display().to_string()]);
        self
    }

    fn command(&self, arguments: &[String]) -> Command {
        let mut command = Command::new(&self.tessera);
        command.args(arguments).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::inherit());
        command
    }

    /// Runs to the end.
    pub(crate) fn finish(&self) {
        assert!(self.command(&self.arguments).status().unwrap().success(), "{}", self.log());
    }

    /// Begins the run and interrupts it, so that a base can be there before it goes on.
    pub(crate) fn begin(&self) {
        let mut child = self.command(&self.arguments).spawn().unwrap();
        wait_for("the run's folder", || self.out.join("run.json").is_file());
        let pid = rustix::process::Pid::from_child(&child);
        let _ = rustix::process::kill_process(pid, rustix::process::Signal::INT);
        child.wait().unwrap();
    }

    /// Waits until the uplink says that the base is in contact.
    pub(crate) fn wait_for_contact(&self) {
        wait_for("the base's contact", || self.out.join("base.contact").is_file());
    }

    /// Goes on with the run, under this plan of kills.
    pub(crate) fn resume(&self, kills: &str) -> Child {
        let words = ["resume", "--quiet", "--faults", kills].map(str::to_owned);
        let arguments: Vec<String> = words.into_iter().chain([self.out.display().to_string()]).collect();
        self.command(&arguments).spawn().unwrap()
    }

    pub(crate) fn log(&self) -> String {
        std::fs::read_to_string(self.out.join("log.txt")).unwrap_or_default()
    }

    /// Fails unless all outputs are the same bytes as those of `other`.
    pub(crate) fn assert_same_outputs(&self, other: &Self) {
        for name in OUTPUTS {
            let [a, b] = [self, other].map(|run| std::fs::read(run.out.join(name)).unwrap());
            assert!(a == b, "{name} of {} and {}", self.out.display(), other.out.display());
        }
    }

    /// `summary.json`.
    pub(crate) fn summary(&self) -> serde_json::Value {
        serde_json::from_str(&std::fs::read_to_string(self.out.join("summary.json")).unwrap()).unwrap()
    }

    /// Answers in the optimiser's journal, and those of them that came from a base.
    pub(crate) fn n_answers(&self) -> (usize, usize) {
        let path = self.out.join("optimise.journal");
        let mut journal = Follower::open(&path, OPTIMISE_JOURNAL).unwrap();
        let records: Vec<_> = std::iter::from_fn(|| journal.next().unwrap()).collect();
        let n_from_base = records.iter().filter(|record| record.is_from_base());
        (records.len(), n_from_base.count())
    }

    /// The largest step of `odom_from_camera` from one frame to the next, metres, and how far
    /// `world_from_odom` moved in all.
    pub(crate) fn odometry(&self) -> (f64, f64) {
        let path = self.out.join("align.journal");
        let mut journal = Follower::open(&path, ALIGN_JOURNAL).unwrap();
        let (mut before, mut largest, mut moved): (Option<(Pose, Pose)>, f64, f64) = (None, 0.0, 0.0);
        while let Some(record) = journal.next().unwrap() {
            let AlignRecord::Frame(frame) = record else { continue };
            let world_from_odom = Pose::from(&frame.pose.world_from_odom);
            let odom_from_camera = world_from_odom.inverse() * Pose::from(&frame.pose.world_from_camera);
            if let Some((world_before, camera_before)) = before {
                let step = camera_before.inverse() * odom_from_camera;
                largest = largest.max(translation_rotation_norms(&step).0);
                moved += translation_rotation_norms(&(world_before.inverse() * world_from_odom)).0;
            }
            before = Some((world_from_odom, odom_from_camera));
        }
        (largest, moved)
    }
}
