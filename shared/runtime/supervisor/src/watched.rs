//! One stage as the supervisor sees it, and what becomes of it after a death.

use crate::failure::StageFailure;
use crate::outcome::MapCounts;
use crate::policy::{Death, History, RestartDecision};
use crate::stage_process::{Meaning, describe, is_abort, last_beat, meaning};
use crate::tally::Tally;
use std::path::Path;
use std::process::{Child, ExitStatus};
use std::time::Instant;
use tessera_messages::{Beat, BeatState, Stage};
use tessera_settings::Settings;
use tessera_stage::{last_lines, ran_out_of_memory};

/// One stage as the supervisor sees it.
pub(crate) struct Watched {
    pub stage: Stage,
    pub child: Option<Child>,
    pub heard_at: Instant,
    /// Waiting to be started (again).
    pub start_at: Option<Instant>,
    pub n_lives: u64,
    pub is_finished: bool,
    pub was_hung: bool,
    /// Whether its present life has done anything, or has found nothing to do.
    pub had_progress: bool,
    /// Keyframes and loops as it last said (align).
    pub map: MapCounts,
    pub tally: Tally,
    pub history: History,
    /// Frames that ended it again and again: it leaves them out (live mode).
    pub poison: Vec<u64>,
}

impl Watched {
    pub(crate) fn new(stage: Stage, now: Instant) -> Self {
        Self {
            stage,
            child: None,
            heard_at: now,
            start_at: Some(now),
            n_lives: 0,
            is_finished: false,
            was_hung: false,
            had_progress: false,
            map: MapCounts::default(),
            tally: Tally::default(),
            history: History::default(),
            poison: Vec::new(),
        }
    }

    /// Takes a beat of the present life, unless a newer one came first.
    pub(crate) fn hear(&mut self, beat: &Beat) {
        let is_own = self.child.as_ref().is_some_and(|child| child.id() == beat.pid);
        let Ok((_, state, _)) = beat.validate() else { return };
        if !is_own || beat.sequence <= self.tally.beat.sequence {
            return;
        }
        self.heard_at = Instant::now();
        // To have come as far as waiting for work is progress too: there may be none.
        self.had_progress |= beat.progress > 0 || state == BeatState::Waiting;
        if beat.keyframes > 0 {
            self.map = MapCounts::from(beat);
        }
        self.tally.take(beat);
    }

    /// The present life is over: its process has been waited for.
    pub(crate) fn close_life(&mut self) {
        if let Some(beat) = self.child.as_mut().and_then(last_beat) {
            self.hear(&beat);
        }
        self.child = None;
        self.tally.close_life();
    }

    /// Decides what becomes of it after a death; a failure ends the run.
    pub(crate) fn judge(
        &mut self,
        status: ExitStatus,
        settings: &Settings,
        log: &Path,
    ) -> Option<StageFailure> {
        let is_live = settings.run.live;
        let settings = &settings.stages;
        let is_memory = settings.memory_mb > 0 && is_abort(status) && ran_out_of_memory(log);
        let words = match (self.was_hung, is_memory) {
            (true, _) => format!("no sign of life ({})", describe(status)),
            (false, true) => format!(
                "{}: it needs more memory than stages.memory_mb = {}",
                describe(status),
                settings.memory_mb
            ),
            (false, false) => describe(status),
        };
        let index = self.tally.beat.index;
        let death = Death {
            at: Instant::now(),
            is_own: self.was_hung || meaning(status) == Meaning::Failed,
            is_memory,
            had_progress: self.had_progress,
            index,
        };
        self.had_progress = false;
        let verdict = self.history.judge(&death, settings);
        if meaning(status) != Meaning::Unusable
            && let RestartDecision::Again(pause) = verdict
        {
            let last = last_lines(log, self.stage.name(), 1).pop();
            tracing::warn!(
                frame = index,
                last_line = last.as_deref().unwrap_or("none"),
                "{} died: {words}; it is started again",
                self.stage
            );
            self.start_at = death.at.checked_add(pause).or(Some(death.at));
            return None;
        }
        // A camera does not stop for one frame, nor for a request: its answer then corrects nothing.
        if is_live && self.history.is_poisoned() && !self.poison.contains(&index) {
            tracing::warn!(frame = index, "{} died: {words}; {} is left out", self.stage, of(self.stage));
            self.poison.push(index);
            self.start_at = Some(death.at);
            return None;
        }
        tracing::error!(frame = index, "{} died: {words}; the run ends", self.stage);
        Some(StageFailure {
            stage: self.stage,
            status: words,
            exit_code: status.code(),
            index,
            n_deaths: self.history.n_own_deaths(),
            last_lines: last_lines(log, self.stage.name(), 5),
        })
    }
}

/// What the index of a stage's work counts.
fn of(stage: Stage) -> &'static str {
    if stage == Stage::Optimise { "the request" } else { "the frame" }
}
