//! A run whose stages are started from outside: by systemd, or by hand in a debugger.
//!
//! What the supervisor does beside starting stages is done here: the name is taken, the run
//! directory prepared, all services held so that they outlive any stage, and the end noticed.
//! Stages that start without a supervisor clean up after their dead predecessors themselves.

use crate::failure::SupervisorError;
use crate::outcome::{MapCounts, Progress, RunOutcome, Supervised};
use crate::plan::Plan;
use crate::signals::Signals;
use crate::tally::{Counters, Tally};
use crate::watch::FOREIGN_INTERVAL;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};
use tessera_journal::Follower;
use tessera_messages::{Beat, BeatState, Stage};
use tessera_slam::AlignRecord;
use tessera_stage::{ALIGN_JOURNAL, AwakeDeadline, RunFiles, StageError, SystemdNotifier};
use tessera_transport::{Link, RunClaim, Subscriber, remove_everything, shared_memory_in_use};

/// Time between two looks at beats and journal.
const LOOK: Duration = Duration::from_millis(100);
/// How long stages may take to end after the last record.
const GRACE: Duration = Duration::from_millis(1500);

/// Prepares a run, holds it until its last record is written or the run is interrupted, and
/// removes its shared memory; `tell` hears of its progress some ten times a second.
///
/// # Errors
/// Where the run cannot be prepared.
pub fn hold(
    plan: &Plan,
    claim: Option<RunClaim>,
    tell: &mut dyn FnMut(&Progress),
) -> Result<Supervised, SupervisorError> {
    let began = Instant::now();
    let mut signals = Signals::listen()?;
    let prepared = plan.prepare(claim)?;
    let identity = &prepared.claim.entry.identity;
    let link = Link::open(identity, &prepared.layout, "supervisor")?;
    let services = link.hold_services()?;
    let beats = link.beat_subscriber()?;
    let mut end = HoldEnd::follow(&prepared.files)?;
    let mut heard = Heard::default();
    let mut shared_memory_bytes = 0;
    let mut grace = None;
    let mut cleaned_at = began;
    let mut notifier = SystemdNotifier::from_environment();
    notifier.ready();
    tracing::info!("run {} in {} waits for its stages", plan.name, prepared.files.dir.display());
    let outcome = loop {
        signals.wait(LOOK);
        heard.take(&beats)?;
        if prepared.layout.external && cleaned_at.elapsed() >= FOREIGN_INTERVAL {
            link.clean_dead_nodes();
            cleaned_at = Instant::now();
        }
        shared_memory_bytes = shared_memory_bytes.max(shared_memory_in_use(identity));
        tell(&heard.progress(plan, began));
        if end.has_come()? {
            // The stages see it too and end by themselves.
            let grace = grace.get_or_insert_with(|| AwakeDeadline::after(GRACE));
            if heard.have_all_finished() || grace.is_over() {
                break RunOutcome::Finished;
            }
        }
        if signals.wants_stop() {
            break RunOutcome::Interrupted;
        }
        notifier.alive();
    };
    notifier.stopping();
    tracing::info!("{}", if outcome == RunOutcome::Finished { "the run is done" } else { "told to stop" });
    let stages = heard.counters();
    drop((beats, services, link));
    remove_everything(identity)?;
    Ok(Supervised { outcome, stages, shared_memory_bytes, duration: began.elapsed(), claim: prepared.claim })
}

/// Looks for the run's last record: the end of the source, and the final correction if there is one.
struct HoldEnd {
    records: Follower<AlignRecord>,
    /// The final request, once the source has ended.
    last_request: Option<Option<u64>>,
    last_applied: Option<u64>,
}

impl HoldEnd {
    fn follow(files: &RunFiles) -> Result<Self, SupervisorError> {
        let records = Follower::open(&files.align_journal(), ALIGN_JOURNAL).map_err(StageError::from)?;
        Ok(Self { records, last_request: None, last_applied: None })
    }

    fn has_come(&mut self) -> Result<bool, SupervisorError> {
        while let Some(record) = self.records.next().map_err(StageError::from)? {
            match record {
                AlignRecord::End { request, .. } => self.last_request = Some(request.map(|r| r.request)),
                AlignRecord::Correction(applied) => self.last_applied = Some(applied.correction.request),
                _ => {}
            }
        }
        Ok(match self.last_request {
            None => false,
            Some(None) => true,
            Some(request) => self.last_applied >= request,
        })
    }
}

/// What the stages said.
#[derive(Default)]
struct Heard {
    tallies: BTreeMap<Stage, Tally>,
    map: MapCounts,
}

impl Heard {
    fn take(&mut self, beats: &Subscriber<Beat>) -> Result<(), SupervisorError> {
        while let Some(beat) = beats.receive()? {
            let Ok((stage, ..)) = beat.validate() else { continue };
            let tally = self.tallies.entry(stage).or_default();
            if tally.beat.pid != beat.pid && tally.beat.pid != 0 {
                tracing::warn!(frame = tally.beat.index, "{stage} has been started again");
                tally.close_life();
                tally.count_restart();
            }
            if beat.keyframes > 0 {
                self.map = MapCounts::from(&beat);
            }
            tally.take(&beat);
        }
        Ok(())
    }

    fn have_all_finished(&self) -> bool {
        self.tallies.values().all(|tally| tally.beat.state == BeatState::Finished as u32)
    }

    fn counters(&self) -> BTreeMap<Stage, Counters> {
        self.tallies.iter().map(|(stage, tally)| (*stage, tally.total())).collect()
    }

    fn progress(&self, plan: &Plan, began: Instant) -> Progress {
        let align = self.tallies.get(&Stage::Align).filter(|align| align.total().frames > 0);
        let reached = align.map_or(0, |align| align.beat.index.saturating_add(1));
        Progress {
            frames: plan.n_frames.map_or(reached, |n| reached.min(n)),
            n_frames: plan.n_frames,
            map: self.map,
            stages: self.counters(),
            elapsed: began.elapsed(),
        }
    }
}
