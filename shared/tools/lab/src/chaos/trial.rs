//! One run of the pipeline as chaos starts it, goes on with it, and looks at what it left.

use super::camera::{CameraProgram, CameraView};
use super::leftovers;
use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use tessera_outputs::ToolError;
use tessera_stage::{RunFile, RunFiles};
use tessera_transport::RunIdentity;

/// The outputs that must be the same bytes whatever happened.
const OUTPUTS: [&str; 4] = ["trajectory.txt", "trajectory_online.txt", "keyframes.txt", "map.ply"];

/// What all runs of a campaign have in common.
#[derive(Clone, Debug)]
pub(super) struct Pipeline {
    /// This program.
    pub(super) executable: PathBuf,
    /// Arguments behind `tessera run`, without name and folder.
    pub(super) arguments: Vec<String>,
    /// What a camera's own program sees, where the frames come from one.
    pub(super) camera: Option<CameraView>,
}

/// One run.
#[derive(Debug)]
pub(super) struct Trial {
    pipeline: Pipeline,
    pub(super) name: String,
    pub(super) dir: PathBuf,
    /// For `--faults`.
    kill_plan: String,
    /// Shared memory that the run has had, over all its supervisors.
    identities: Vec<RunIdentity>,
    camera: Option<CameraProgram>,
}

impl Trial {
    pub(super) fn new(pipeline: &Pipeline, name: String, dir: PathBuf, kill_plan: String) -> Self {
        Self { pipeline: pipeline.clone(), name, dir, kill_plan, identities: Vec::new(), camera: None }
    }

    /// Starts the run, or goes on with it where it has begun.
    pub(super) fn start(&mut self) -> Result<Child, ToolError> {
        self.remember();
        if let (Some(view), None) = (&self.pipeline.camera, &self.camera) {
            self.camera = Some(CameraProgram::start(view, &self.name)?);
        }
        let mut command = Command::new(&self.pipeline.executable);
        if RunFiles::new(&self.dir).run_file().exists() {
            command.args(["resume", "--quiet"]).arg(&self.dir);
        } else {
            command.args(["run", "--quiet", "--name", &self.name, "--out"]).arg(&self.dir);
            command.args(&self.pipeline.arguments);
            // It has no reader, and its growing timeline would pass for a leak.
            command.args(["--set", "output.report=false"]);
        }
        let errors =
            File::create(self.errors_path()).map_err(|error| ToolError::write(&self.errors_path(), error))?;
        command
            .args(["--faults", &self.kill_plan])
            // The stamps of the recovery times are lines of this level.
            .env("TESSERA_LOG", "info")
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(errors)
            .spawn()
            .map_err(|error| ToolError::Stage(format!("cannot start the pipeline: {error}")))
    }

    /// Ends the camera's program, which has no run any more.
    pub(super) fn end_camera(&mut self) {
        self.camera = None;
    }

    fn errors_path(&self) -> PathBuf {
        self.dir.with_extension("stderr")
    }

    /// What the command last said on standard error.
    pub(super) fn errors(&self) -> String {
        std::fs::read_to_string(self.errors_path()).unwrap_or_default()
    }

    /// Keeps in mind which shared memory the run has now.
    pub(super) fn remember(&mut self) {
        if let Ok(run) = RunFile::read(&RunFiles::new(&self.dir))
            && !self.identities.contains(&run.identity)
        {
            self.identities.push(run.identity);
        }
    }

    /// The log of all processes.
    pub(super) fn log(&self) -> String {
        let bytes = std::fs::read(RunFiles::new(&self.dir).log()).unwrap_or_default();
        String::from_utf8_lossy(&bytes).into_owned()
    }

    /// What is left in shared memory and private folders.
    pub(super) fn leftovers(&self) -> BTreeMap<PathBuf, u64> {
        self.identities.iter().flat_map(|identity| leftovers::of_identity(identity, &self.name)).collect()
    }

    /// Outputs whose bytes differ from those of `reference`, missing ones among them.
    pub(super) fn differing(&self, reference: &Path) -> Vec<&'static str> {
        let read = |dir: &Path, name: &str| std::fs::read(dir.join(name)).ok();
        let differs = |name: &&str| {
            let (ours, theirs) = (read(&self.dir, name), read(reference, name));
            ours.is_none() || ours != theirs
        };
        OUTPUTS.into_iter().filter(differs).collect()
    }

    /// Removes the run's folder.
    pub(super) fn remove(&self) {
        let _ = std::fs::remove_dir_all(&self.dir);
        let _ = std::fs::remove_file(self.errors_path());
    }
}
