//! Keeping four processes going until the run is done.

use crate::failure::{StageFailure, SupervisorError};
use crate::limits::ensure_open_files;
use crate::marks::SharedMemoryMarks;
use crate::outcome::{Progress, RunOutcome, Supervised};
use crate::plan::{Plan, PreparedRun};
use crate::signals::Signals;
use crate::stage_process::{Meaning, describe, meaning, spawn};
use crate::tally::Counters;
use crate::watched::Watched;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};
use tessera_messages::{Beat, Stage};
use tessera_stage::{AwakeDeadline, Standstill, SystemdNotifier};
use tessera_transport::{Link, RunClaim, Subscriber, Sweeper, remove_everything, shared_memory_in_use};

/// Time between two looks at the beats.
const LOOK: Duration = Duration::from_millis(100);
/// Time between two looks for a dead camera's program.
pub(crate) const FOREIGN_INTERVAL: Duration = Duration::from_secs(1);
/// How long stages may take to end when told to; then they are killed.
const GRACE: Duration = Duration::from_millis(1500);

/// Runs a plan to its end, under a name that is taken already or by `claim`; `tell` hears of its
/// progress some ten times a second.
///
/// # Errors
/// Where the run cannot be started at all; a stage that fails later is an [`RunOutcome`].
pub fn supervise(
    plan: &Plan,
    claim: Option<RunClaim>,
    tell: &mut dyn FnMut(&Progress),
) -> Result<Supervised, SupervisorError> {
    let began = Instant::now();
    ensure_open_files()?;
    let signals = Signals::listen()?;
    let prepared = plan.prepare(claim)?;
    let sweeper = Sweeper::start(&prepared.claim.entry.identity)?;
    // The first node: it closes the door to shared memory before a stage starts.
    let link = Link::open(&prepared.claim.entry.identity, &prepared.layout, "supervisor")?;
    let services = link.hold_services()?;
    let beats = link.beat_subscriber()?;
    tracing::info!(
        "run {} in {}, up to {} bytes of shared memory",
        plan.name,
        prepared.files.dir.display(),
        prepared.need_bytes
    );
    let mut supervisor = Supervisor {
        plan,
        prepared: &prepared,
        link: &link,
        beats: &beats,
        signals,
        stages: Stage::ALL.map(|stage| Watched::new(stage, began)),
        shared_memory_bytes: 0,
        has_dead: false,
        cleaned_at: began,
        standstill: Standstill::new(),
        began,
        marks: SharedMemoryMarks::of(plan),
    };
    let outcome = supervisor.run(tell);
    // However it ended: no process is left behind.
    supervisor.end_all();
    let outcome = outcome?;
    let stages = supervisor.counters();
    let shared_memory_bytes = supervisor.shared_memory_bytes;
    drop(supervisor);
    drop((beats, services, link, sweeper));
    remove_everything(&prepared.claim.entry.identity)?;
    Ok(Supervised { outcome, stages, shared_memory_bytes, duration: began.elapsed(), claim: prepared.claim })
}

struct Supervisor<'a> {
    plan: &'a Plan,
    prepared: &'a PreparedRun,
    link: &'a Link,
    beats: &'a Subscriber<Beat>,
    signals: Signals,
    stages: [Watched; 4],
    shared_memory_bytes: u64,
    /// Whether a stage died and left things in shared memory.
    has_dead: bool,
    /// When a camera's own program was last looked after: only this notices its death.
    cleaned_at: Instant,
    standstill: Standstill,
    began: Instant,
    marks: SharedMemoryMarks,
}

impl Supervisor<'_> {
    fn run(&mut self, tell: &mut dyn FnMut(&Progress)) -> Result<RunOutcome, SupervisorError> {
        let mut told_at: Option<Instant> = None;
        let mut notifier = SystemdNotifier::from_environment();
        notifier.ready();
        loop {
            notifier.alive();
            self.start_due()?;
            // Clean up only after respawning: each service has a spare slot, so the successor need not wait.
            let is_foreign_due =
                self.prepared.layout.external && self.cleaned_at.elapsed() >= FOREIGN_INTERVAL;
            if std::mem::take(&mut self.has_dead) || is_foreign_due {
                self.link.clean_dead_nodes();
                self.cleaned_at = Instant::now();
            }
            self.signals.wait(self.next_wait());
            self.forgive_standstill();
            self.hear()?;
            if let Some(failure) = self.reap()? {
                return Ok(RunOutcome::Failed(Box::new(failure)));
            }
            self.kill_hung();
            if told_at.is_none_or(|at| at.elapsed() >= LOOK) {
                told_at = Some(Instant::now());
                let in_use = shared_memory_in_use(&self.prepared.claim.entry.identity);
                self.shared_memory_bytes = self.shared_memory_bytes.max(in_use);
                tell(&self.progress());
            }
            // What is done is done: this comes before a signal that came with the end.
            let [.., align, optimise] = &self.stages;
            if align.is_finished && optimise.is_finished {
                tell(&self.progress());
                return Ok(RunOutcome::Finished);
            }
            if self.signals.wants_stop() {
                tracing::info!("told to stop");
                return Ok(RunOutcome::Interrupted);
            }
        }
    }

    /// Starts the stages whose time has come.
    fn start_due(&mut self) -> Result<(), SupervisorError> {
        let now = Instant::now();
        for watched in &mut self.stages {
            if watched.start_at.is_none_or(|at| at > now) {
                continue;
            }
            let is_first = watched.n_lives == 0;
            let files = &self.prepared.files;
            watched.child = Some(spawn(self.plan, files, watched.stage, is_first, &watched.poison)?);
            watched.start_at = None;
            watched.n_lives = watched.n_lives.saturating_add(1);
            watched.heard_at = now;
            watched.was_hung = false;
            let word = if is_first { "starts" } else { "starts again" };
            self.marks.note(watched.stage, || format!("{} {word}", watched.stage));
            if !is_first {
                watched.tally.count_restart();
            }
        }
        Ok(())
    }

    fn next_wait(&self) -> Duration {
        let now = Instant::now();
        let starts = self.stages.iter().filter_map(|watched| watched.start_at);
        starts.map(|at| at.saturating_duration_since(now)).min().unwrap_or(LOOK).min(LOOK)
    }

    /// Takes in all beats; those of the dead say nothing new.
    fn hear(&mut self) -> Result<(), SupervisorError> {
        while let Some(beat) = self.beats.receive()? {
            if let Some(stage) = Stage::from_number(beat.stage) {
                self.watched(stage).hear(&beat);
            }
        }
        Ok(())
    }

    #[expect(clippy::indexing_slicing, reason = "four stages, by their numbers")]
    fn watched(&mut self, stage: Stage) -> &mut Watched {
        &mut self.stages[stage as usize]
    }

    /// Looks who has died, cleans up after them and decides what becomes of them.
    fn reap(&mut self) -> Result<Option<StageFailure>, SupervisorError> {
        for stage in Stage::ALL {
            let Some(child) = &mut self.watched(stage).child else { continue };
            let Ok(Some(status)) = child.try_wait() else { continue };
            // Its last beats are still in the queue.
            self.hear()?;
            self.watched(stage).close_life();
            if meaning(status) == Meaning::Finished {
                self.watched(stage).is_finished = true;
                continue;
            }
            self.has_dead = true;
            self.marks.note(stage, || format!("{stage} died: {}", describe(status)));
            let (settings, log) = (&self.plan.settings, self.prepared.files.log());
            if let Some(failure) = self.watched(stage).judge(status, settings, &log) {
                return Ok(Some(failure));
            }
        }
        Ok(None)
    }

    /// While the machine slept, or all of the run was paused, no stage could give a sign of life.
    fn forgive_standstill(&mut self) {
        let nanos = self.standstill.look();
        if nanos == 0 {
            return;
        }
        // Less is what a busy machine does.
        if nanos >= 1_000_000_000 {
            tracing::info!("stood still for {:.1} s, as where a machine sleeps", nanos as f64 * 1e-9);
        }
        for watched in &mut self.stages {
            let later = watched.heard_at.checked_add(Duration::from_nanos(nanos));
            watched.heard_at = later.unwrap_or(watched.heard_at);
        }
    }

    /// Kills what gives no sign of life; a stage that waits does.
    fn kill_hung(&mut self) {
        let patience = Duration::from_secs_f64(self.plan.settings.flow.hang_s);
        for watched in &mut self.stages {
            let Some(child) = &mut watched.child else { continue };
            let patience = patience.saturating_mul(1 << watched.history.n_without_progress().min(6));
            if !watched.was_hung && watched.heard_at.elapsed() > patience {
                tracing::warn!(
                    frame = watched.tally.beat.index,
                    "{} gave no sign of life for {:.1} s and is killed",
                    watched.stage,
                    patience.as_secs_f64()
                );
                watched.was_hung = true;
                let _ = child.kill();
            }
        }
    }

    /// Tells all stages to end, and kills those that do not within the grace.
    fn end_all(&mut self) {
        for watched in &mut self.stages {
            watched.start_at = None;
            if let Some(child) = &mut watched.child {
                drop(child.stdin.take());
            }
        }
        let mut grace = AwakeDeadline::after(GRACE);
        while self.stages.iter().any(|watched| watched.child.is_some()) {
            let _ = self.hear();
            let is_over = grace.is_over();
            for watched in &mut self.stages {
                let Some(child) = &mut watched.child else { continue };
                if is_over {
                    let _ = child.kill();
                }
                if matches!(child.try_wait(), Ok(Some(_)) | Err(_)) {
                    watched.close_life();
                }
            }
            self.signals.wait(Duration::from_millis(20));
        }
    }

    fn counters(&self) -> BTreeMap<Stage, Counters> {
        self.stages.iter().map(|watched| (watched.stage, watched.tally.total())).collect()
    }

    fn progress(&self) -> Progress {
        let [_, _, align, _] = &self.stages;
        let n_frames = self.plan.n_frames;
        let reached = if align.is_finished || align.tally.total().frames > 0 {
            align.tally.beat.index.saturating_add(1)
        } else {
            0
        };
        Progress {
            frames: n_frames.map_or(reached, |n| reached.min(n)),
            n_frames,
            map: align.map,
            stages: self.counters(),
            elapsed: self.began.elapsed(),
        }
    }
}
