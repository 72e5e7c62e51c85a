//! `tessera status`: the processes of a run, read without disturbing it.

use crate::arguments::StatusArguments;
use crate::exit::{CommandError, Exit};
use crate::run_folder;
use crate::terminal::{json, say, say_report, say_to_people};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::PathBuf;
use std::time::{Duration, Instant};
use tessera_messages::{Beat, BeatState, Stage, WaitingOn};
use tessera_outputs::{LatencyMs, RunStatistics};
use tessera_stage::{RunFile, RunFiles};
use tessera_transport::{Link, RunEntry, living_nodes, living_runs};

/// How long to listen for the beats of all stages; each beats some ten times a second, unless one
/// step of its work takes longer or it is frozen.
const LISTEN: Duration = Duration::from_millis(500);

/// One process of a run.
#[derive(Clone, Debug, Serialize)]
struct StageStatus {
    stage: String,
    /// Absent where it does not live.
    pid: Option<u32>,
    /// What it says that it does, `alive, silent` where it lives and says nothing, `not running`.
    state: String,
    restarts: u64,
    frames: u64,
    latency_ms: LatencyMs,
    queue: u64,
}

/// One run.
#[derive(Clone, Debug, Serialize)]
struct RunStatus {
    name: String,
    folder: PathBuf,
    running: bool,
    stages: Vec<StageStatus>,
    /// Why nothing can be said of it, such as another version of Tessera.
    #[serde(skip_serializing_if = "Option::is_none")]
    problem: Option<String>,
}

/// Prints the status of one run, or of all that are going on.
pub(crate) fn status(arguments: &StatusArguments) -> Result<Exit, CommandError> {
    let runs = living_runs()?;
    let Some(wanted) = &arguments.run else {
        // One that cannot be read, or that has just ended, hides none of the others.
        let of_any = |run: &RunEntry| of_running(run).unwrap_or_else(|e| of_unread(run, &e));
        let alive: Vec<RunStatus> = runs.iter().map(of_any).collect();
        if arguments.json {
            say(&json(&alive)?);
        } else if alive.is_empty() {
            say("no run is going on");
        } else {
            alive.iter().for_each(|run| say_to_people(&for_people(run)));
        }
        return Ok(Exit::Done);
    };
    let status = match runs.iter().find(|run| run_folder::is_of(run, wanted)) {
        Some(run) => of_running(run)?,
        None => of_ended(wanted)?,
    };
    say_report(arguments.json, &status, || for_people(&status))
}

fn of_running(run: &RunEntry) -> Result<RunStatus, CommandError> {
    let beats = listen(run)?;
    let statistics = tessera_outputs::read_statistics(&run.run_dir)?;
    let living = living_nodes(&run.identity)?;
    let pid = |stage: Stage| living.iter().find(|node| node.name == stage.name()).map(|node| node.pid);
    let stages = Stage::ALL.map(|stage| of_stage(stage, pid(stage), beats.get(&stage), &statistics)).to_vec();
    Ok(RunStatus {
        name: run.name.clone(),
        folder: run.run_dir.clone(),
        running: true,
        stages,
        problem: None,
    })
}

fn of_unread(run: &RunEntry, error: &CommandError) -> RunStatus {
    let (name, folder, problem) = (run.name.clone(), run.run_dir.clone(), Some(error.to_string()));
    RunStatus { name, folder, running: true, stages: Vec::new(), problem }
}

/// A run that is over: what its supervisor wrote last.
fn of_ended(name_or_folder: &str) -> Result<RunStatus, CommandError> {
    let folder = run_folder::find(name_or_folder)?;
    let statistics = tessera_outputs::read_statistics(&folder)?;
    let stages = Stage::ALL.map(|stage| of_stage(stage, None, None, &statistics)).to_vec();
    let name = RunFile::read(&RunFiles::new(&folder))?.name;
    Ok(RunStatus { name, folder, running: false, stages, problem: None })
}

fn of_stage(
    stage: Stage,
    living: Option<u32>,
    beat: Option<&Beat>,
    statistics: &RunStatistics,
) -> StageStatus {
    let kept = statistics.stages.get(stage.name()).copied().unwrap_or_default();
    let state = match (beat, living) {
        (Some(_), _) => "unknown",
        (None, Some(_)) => "alive, silent",
        (None, None) => "not running",
    };
    let mut status = StageStatus {
        stage: stage.name().to_owned(),
        pid: living,
        state: state.to_owned(),
        restarts: kept.restarts,
        frames: kept.frames,
        latency_ms: kept.latency_ms,
        queue: 0,
    };
    if let Some(beat) = beat {
        status.pid = Some(beat.pid);
        status.latency_ms = LatencyMs::from(beat.latency);
        status.frames = beat.frames;
        status.queue = beat.queue;
        if let Ok((_, state, on)) = beat.validate() {
            status.state = match (state, on) {
                (BeatState::Waiting, WaitingOn::Nothing) => "waiting".to_owned(),
                (BeatState::Waiting, on) => format!("waiting for {}", on.name()),
                (state, _) => state.name().to_owned(),
            };
        }
    }
    status
}

/// The newest beat of each stage.
fn listen(run: &RunEntry) -> Result<BTreeMap<Stage, Beat>, CommandError> {
    let files = RunFiles::new(&run.run_dir);
    let settings = run_folder::settings_of_living(&files)?;
    let layout = RunFile::read(&files)?.layout(&settings);
    let link = Link::open(&run.identity, &layout, "status")?;
    let subscriber = link.beat_subscriber()?;
    let (began, mut beats) = (Instant::now(), BTreeMap::new());
    while began.elapsed() < LISTEN && beats.len() < Stage::ALL.len() {
        while let Some(beat) = subscriber.receive()? {
            if let Ok((stage, ..)) = beat.validate() {
                beats.insert(stage, beat);
            }
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    Ok(beats)
}

fn for_people(run: &RunStatus) -> String {
    let state = if run.running { "going on" } else { "over" };
    let mut text = format!("{}: {state}, {}\n", run.name, run.folder.display());
    if let Some(problem) = &run.problem {
        return format!("{text}  warning: {problem}\n");
    }
    // Writing to a String cannot fail.
    let _ = writeln!(
        text,
        "  {:<12}{:>8}  {:<22}{:>8}{:>8}{:>8}{:>9}",
        "stage", "pid", "state", "restarts", "frames", "queue", "p50 ms"
    );
    for stage in &run.stages {
        let StageStatus { stage, pid, state, restarts, frames, queue, latency_ms } = stage;
        let pid = pid.map_or("-".to_owned(), |pid| pid.to_string());
        let _ = writeln!(
            text,
            "  {stage:<12}{pid:>8}  {state:<22}{restarts:>8}{frames:>8}{queue:>8}{:>9.2}",
            latency_ms.p50
        );
    }
    text
}
