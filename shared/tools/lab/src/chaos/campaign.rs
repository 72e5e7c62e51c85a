//! Run after run under faults, until there were enough of them.

use super::camera::CameraView;
use super::disturb::{Disturbance, Disturber};
use super::report::ChaosReport;
use super::schedule::{FaultKind, FaultSchedule, FaultTarget, Random};
use super::trial::{Pipeline, Trial};
use super::verdict::{Judge, judge};
use super::{journal, plan_file};
use std::path::{Path, PathBuf};
use std::time::Duration;
use tessera_outputs::ToolError;
use tessera_stage::RunFiles;
use tessera_transport::living_runs;

/// Planned faults of each kind in one run.
const PLANNED_EACH: u64 = 5;

/// What is run, and under which faults.
#[derive(Clone, Debug)]
pub struct Campaign {
    /// A folder, a recording or a simulated world; `room` where absent.
    pub source: Option<String>,
    /// Faults in all, over as many runs as it takes.
    pub kills: u64,
    /// Seed of the schedule.
    pub seed: u64,
    /// Mean time between two faults, milliseconds.
    pub interval_ms: u64,
    /// A file with exactly these faults, for one run.
    pub plan: Option<PathBuf>,
    /// A camera file or the name of a built-in camera.
    pub camera: Option<String>,
    /// A preset or a settings file.
    pub config: Option<String>,
    /// `KEY=VALUE` settings.
    pub overrides: Vec<String>,
    /// Frames of each run at most.
    pub frames: Option<u64>,
    /// Whether the runs are live.
    pub live: bool,
    /// Whether the frames come from a camera's own program, which sends those of the source.
    pub external: bool,
    /// Folder for the runs; a temporary one where absent.
    pub out: Option<PathBuf>,
    /// Longest time for one run, seconds.
    pub patience_s: u64,
}

/// How far a campaign is: the number of the run that begins, and the faults so far.
pub type OnRun<'a> = &'a mut dyn FnMut(u64, u64);

/// Runs the source undisturbed, then under faults, and compares.
///
/// # Errors
/// Where a run cannot be started, or the undisturbed one fails; a broken promise is in the report.
pub fn campaign(
    arguments: &Campaign,
    targets: &[FaultTarget],
    kinds: &[FaultKind],
    on_run: OnRun<'_>,
) -> Result<ChaosReport, ToolError> {
    let plan = arguments.plan.as_deref().map(plan_file::read).transpose()?;
    let mut pipeline = pipeline(arguments)?;
    if kinds.contains(&FaultKind::SyncFails) {
        // A run that never syncs has none that could fail.
        pipeline.arguments.extend(["--set", "flow.fsync=keyframe"].map(str::to_owned));
    }
    let id = std::process::id();
    let base = made_folder(arguments.out.as_deref())?;
    let patience = Duration::from_secs(arguments.patience_s);
    let mut reference =
        Trial::new(&pipeline, format!("chaos-{id}-0"), base.join("undisturbed"), String::new());
    let quiet = FaultSchedule::new(0, targets, &[], 1);
    let undisturbed = Disturber { schedule: quiet, most: 0, patience }.run(&mut reference, Random::new(0))?;
    if !undisturbed.has_finished {
        return Err(ToolError::Stage(format!("the undisturbed run failed: {}", reference.errors())));
    }
    let n_frames = journal::count(&reference.dir)?.n_frames;
    let mut report = ChaosReport::new(pipeline.arguments[0].clone(), arguments.seed, !arguments.live);
    let enough = plan.as_ref().map_or(arguments.kills, |(_, n)| *n);
    let mut number = 0;
    while report.n_faults() < enough && report.broken().is_empty() {
        number += 1;
        on_run(number, report.n_faults());
        let seed = arguments.seed.wrapping_mul(1_000_003).wrapping_add(number);
        let mut random = Random::new(seed ^ 0x5eed);
        let (kill_plan, most) = match &plan {
            Some((words, _)) => (words.clone(), 0),
            None => (planned(kinds, n_frames, &mut random), enough - report.n_faults()),
        };
        let name = format!("chaos-{id}-{number}");
        let mut trial = Trial::new(&pipeline, name, base.join(format!("run-{number}")), kill_plan);
        let schedule = FaultSchedule::new(seed, targets, kinds, arguments.interval_ms);
        let disturbance = Disturber { schedule, most, patience }.run(&mut trial, random)?;
        let judge_by = Judge { number, reference: &reference, is_live: arguments.live };
        report.add(judge(&judge_by, &trial, &disturbance)?);
        if !report.broken().is_empty() {
            report.keep(&trial.dir);
            break;
        }
        if let Some((_, n)) = &plan {
            let struck = report.n_faults();
            trial.remove();
            if struck < *n {
                clear(&reference, &base);
                return Err(ToolError::Arguments(format!(
                    "{struck} of {n} planned faults struck; the others name a point that no frame passed"
                )));
            }
            break;
        }
        if report.n_faults_of_last_run() == 0 {
            return Err(ToolError::Stage(
                "a run was over before a fault struck; expected a longer run or a shorter --interval-ms"
                    .into(),
            ));
        }
        trial.remove();
    }
    if report.broken().is_empty() {
        clear(&reference, &base);
    }
    Ok(report)
}

/// The folder of all runs, made where it is missing.
fn made_folder(out: Option<&Path>) -> Result<PathBuf, ToolError> {
    let base = match out {
        Some(out) => std::path::absolute(out).map_err(|error| ToolError::write(out, error))?,
        None => std::env::temp_dir().join(format!("tessera-chaos-{}", std::process::id())),
    };
    std::fs::create_dir_all(&base).map_err(|error| ToolError::write(&base, error))?;
    Ok(base)
}

/// Nothing is left to look at.
fn clear(reference: &Trial, base: &Path) {
    reference.remove();
    // Only where it is empty: the folder may be the user's.
    let _ = std::fs::remove_dir(base);
}

/// What comes behind `tessera run`.
fn pipeline(arguments: &Campaign) -> Result<Pipeline, ToolError> {
    let source = arguments.source.clone().unwrap_or_else(|| "room".to_owned());
    let camera = arguments.external.then(|| CameraView {
        source: source.clone(),
        camera: arguments.camera.clone(),
        frames: arguments.frames,
        is_live: arguments.live,
    });
    let mut words = vec![if arguments.external { "external".to_owned() } else { source }];
    let options = [
        // A camera's own program states its camera.
        ("--camera", arguments.camera.clone().filter(|_| !arguments.external)),
        ("--config", arguments.config.clone()),
        ("--frames", arguments.frames.map(|n| n.to_string())),
    ];
    for (name, value) in options {
        words.extend(value.into_iter().flat_map(|value| [name.to_owned(), value]));
    }
    for setting in &arguments.overrides {
        words.extend(["--set".to_owned(), setting.clone()]);
    }
    if arguments.live {
        words.push("--live".to_owned());
    }
    let executable = std::env::current_exe()
        .map_err(|error| ToolError::Stage(format!("cannot find the own program: {error}")))?;
    Ok(Pipeline { executable, arguments: words, camera })
}

/// Messages to lose and to corrupt, at frames drawn from the seed.
fn planned(kinds: &[FaultKind], n_frames: u64, random: &mut Random) -> String {
    let mut words = Vec::new();
    for kind in kinds.iter().filter(|kind| kind.is_planned()) {
        for _ in 0..PLANNED_EACH {
            let place = match (kind, random.below(2)) {
                (FaultKind::SyncFails, _) => "align=computed",
                (FaultKind::IndexJump, _) | (_, 0) => "sensor=read",
                _ => "reconstruct=computed",
            };
            words.push(format!("{place}:{}:{}+", random.below(n_frames), kind.name()));
        }
    }
    words.join(";")
}

/// Disturbs a run that is going on, until there were enough faults or it is over.
///
/// # Errors
/// Where there is no such run, or a fault was asked for that needs a run of our own.
pub fn attach(
    arguments: &Campaign,
    name: &str,
    targets: &[FaultTarget],
    kinds: &[FaultKind],
) -> Result<ChaosReport, ToolError> {
    let needs_own = kinds.iter().any(|kind| kind.is_planned() || kind.is_damage())
        || targets.iter().any(|target| !matches!(target, FaultTarget::Stage(_)));
    if needs_own {
        return Err(ToolError::Arguments(
            "--attach cannot drop, corrupt, jump, fail syncs or damage files, nor strike supervisor or group: expected kill, stop, slow, sleep, segv, abort, memory or full, and stages".into(),
        ));
    }
    let Some(run) = living_runs()?.into_iter().find(|run| run.name == name) else {
        return Err(ToolError::Arguments(format!("no run {name:?} is going on; see tessera status")));
    };
    let schedule = FaultSchedule::new(arguments.seed, targets, kinds, arguments.interval_ms);
    let patience = Duration::from_secs(arguments.patience_s);
    let mut disturber = Disturber { schedule, most: arguments.kills, patience };
    let disturbance = disturber.disturb_running(run.pid, &run.run_dir, Random::new(arguments.seed));
    let log = std::fs::read_to_string(RunFiles::new(&run.run_dir).log()).unwrap_or_default();
    let mut report = ChaosReport::new(name.to_owned(), arguments.seed, false);
    report.add_faults(1, &disturbance, &log);
    Ok(report)
}

impl Disturbance {
    /// Faults from outside.
    pub(super) fn n_strikes(&self) -> u64 {
        self.strikes.len() as u64
    }
}
