//! Context of a stage: run directory, settings, layout and life line.

use crate::error::StageError;
use crate::kill_point::KillPoints;
use crate::lifeline::Lifeline;
use crate::log::start_log;
use crate::memory::limit_memory;
use crate::names::RunFiles;
use crate::priority::step_back;
use crate::probe::Probe;
use crate::run_file::RunFile;
use crate::stopwatch::Stopwatch;
use crate::tracer::TRACE_VARIABLE;
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;
use tessera_features::Extractor;
use tessera_messages::Stage;
use tessera_settings::Settings;
use tessera_transport::{Layout, Link};

/// Longest sleep of a stage: the safety net under the events, and how late it notices a signal.
pub const IDLE: Duration = Duration::from_millis(10);

/// Environment variable with the frames that a stage leaves out, `9,12`.
pub const POISON_VARIABLE: &str = "TESSERA_POISON";

/// Arguments of a stage process.
#[derive(Clone, Debug)]
pub struct StageArgs {
    /// The run directory.
    pub run_dir: PathBuf,
    /// Whether standard input is the supervisor's life line (not so for a stage started by hand).
    pub watch_stdin: bool,
}

/// How a stage ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Its part of the run is done.
    Finished,
    /// It was told to stop; `resume` goes on.
    Stopped,
}

impl Outcome {
    /// Exit code of a stage that was told to stop before its part was done.
    pub const STOPPED: u8 = 75;

    fn exit_code(self) -> u8 {
        match self {
            Outcome::Finished => 0,
            Outcome::Stopped => Self::STOPPED,
        }
    }
}

/// The run as one stage sees it.
#[derive(Debug)]
pub struct StageContext {
    /// Files of the run directory.
    pub files: RunFiles,
    /// What all processes agree on.
    pub run: RunFile,
    /// Every setting.
    pub settings: Settings,
    /// Sizes of the services.
    pub layout: Layout,
    /// When to stop.
    pub lifeline: Lifeline,
    /// Where to die, in tests.
    pub kill_points: KillPoints,
    /// Frames that ended this stage again and again: it leaves them out (live mode).
    pub poison: BTreeSet<u64>,
    /// Says where in memory its inputs lie, in tests.
    pub probe: Probe,
    /// How long its steps take.
    pub stopwatch: Arc<Stopwatch>,
    /// Whether a supervisor starts this stage and cleans up after its death.
    pub(crate) is_supervised: bool,
}

impl StageContext {
    /// Starts the log and reads what the supervisor wrote.
    ///
    /// # Errors
    /// Names the file that cannot be used.
    pub fn open(stage: Stage, args: &StageArgs) -> Result<Self, StageError> {
        let files = RunFiles::new(&args.run_dir);
        let wrong = |path: PathBuf, error: &dyn std::fmt::Display| StageError::RunFile {
            path,
            problem: error.to_string(),
        };
        if stage == Stage::Optimise {
            // Before the threads that inherit it.
            step_back();
        }
        start_log(&files.log(), stage.name()).map_err(|e| wrong(files.log(), &e))?;
        let run = RunFile::read(&files)?;
        let config = files.config();
        let text = std::fs::read_to_string(&config).map_err(|e| wrong(config.clone(), &e))?;
        let settings = Settings::from_toml(&text, &config.display().to_string())
            .map_err(|e| StageError::Settings(e.to_string()))?;
        use_threads(settings.stages.threads)?;
        let megabytes = settings.stages.memory_mb;
        limit_memory(megabytes)
            .map_err(|e| StageError::Settings(format!("cannot limit memory to {megabytes} MB: {e}")))?;
        let layout = run.layout(&settings);
        let lifeline = Lifeline::hold(args.watch_stdin)
            .map_err(|e| StageError::Inconsistent(format!("cannot listen to signals: {e}")))?;
        let kill_points = KillPoints::of_run(run.faults);
        let poison = poison_from_environment();
        let is_supervised = args.watch_stdin;
        let stopwatch = Stopwatch::new(std::env::var_os(TRACE_VARIABLE).is_some());
        Ok(Self {
            files,
            run,
            settings,
            layout,
            lifeline,
            kill_points,
            poison,
            probe: Probe::from_environment(),
            stopwatch,
            is_supervised,
        })
    }

    /// What the algorithms of mapping share.
    pub fn mapping_context(&self) -> tessera_slam::Context {
        let settings = &self.settings;
        let mut context = tessera_slam::Context::new(
            &self.run.camera,
            &settings.surface,
            &settings.registration,
            &settings.mapping,
        )
        .in_map_of(&self.run.map_cameras);
        context.stamp_sigma_s = self.run.stamp_sigma_s;
        context.steps = self.stopwatch.steps();
        context
    }

    /// Extracts the features of the run's colour images.
    pub fn feature_extractor(&self) -> Extractor {
        self.settings.mapping.features.extractor(&self.run.camera, self.settings.registration.isa)
    }

    /// Joins the run's shared memory; a stage without a supervisor cleans up after its predecessors.
    ///
    /// # Errors
    /// Where the run's configuration is gone or no node can be made.
    pub fn link(&self, stage: Stage) -> Result<Link, StageError> {
        let link = Link::open(&self.run.identity, &self.layout, stage.name())?;
        if !self.is_supervised {
            // No supervisor cleans up after a dead predecessor, whose places this one needs.
            link.clean_dead_nodes();
        }
        Ok(link)
    }
}

fn poison_from_environment() -> BTreeSet<u64> {
    let text = std::env::var(POISON_VARIABLE).unwrap_or_default();
    text.split(',').filter_map(|index| index.parse().ok()).collect()
}

/// Runs a stage as a process: logs its error once and turns its outcome into an exit code.
pub fn stage_main(stage: Stage, run: impl FnOnce() -> Result<Outcome, StageError>) -> ExitCode {
    match run() {
        Ok(outcome) => outcome.exit_code().into(),
        Err(error) => {
            tracing::error!("{error}");
            eprintln!("{stage}: {error}");
            error.exit_code().into()
        }
    }
}

/// Makes the pool of threads that work on one frame or request; 0: as many as there are cores.
fn use_threads(threads: u32) -> Result<(), StageError> {
    if threads == 0 {
        return Ok(());
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads as usize);
    pool.build_global().map_err(|e| StageError::Settings(format!("cannot start {threads} threads: {e}")))
}
