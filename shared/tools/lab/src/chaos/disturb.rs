//! One run under the faults of a schedule, from its start to its end.

use super::damage::{FileDamage, damage, forget_overwritten};
use super::journaled::Journaled;
use super::process::{n_open_files, rss_bytes, stage_pid, stage_pids, stages_in};
use super::recovery::Hit;
use super::schedule::{FaultKind, FaultSchedule, FaultTarget, Random, Strike};
use super::strike::{sleep, strike};
use super::trial::Trial;
use std::path::Path;
use std::process::Child;
use std::time::{Duration, Instant};
use tessera_messages::Stage;
use tessera_outputs::ToolError;
use tessera_settings::Settings;
use tessera_stage::{RunFiles, monotonic_nanos};

/// Time between two looks whether a run is over.
const LOOK: Duration = Duration::from_millis(5);
/// How long stages may live on without their supervisor: they notice within a second.
const ORPHANS: Duration = Duration::from_millis(1500);
/// Deaths that count as a stage's own, for one stage in one run: a third on one frame would
/// rightly end the run.
const OWN_DEATHS: usize = 2;

/// A fault that was carried out.
#[derive(Clone, Debug)]
pub(super) struct Struck {
    pub(super) target: FaultTarget,
    pub(super) kind: FaultKind,
    pub(super) at_nanos: u64,
    /// The stages that it should end.
    pub(super) hits: Vec<Hit>,
}

/// What the supervisor looked like after a fault.
#[derive(Clone, Copy, Debug)]
pub(super) struct MemorySample {
    /// Its process: a resumed run has another one.
    pub(super) pid: u32,
    /// Faults before it.
    pub(super) n_strikes: u64,
    pub(super) rss_bytes: u64,
    pub(super) n_open_files: u64,
}

/// What a run says that ended for that.
const NOT_SYNCED: &str = "was not forced to disk";

/// What was done to a run and how it ended.
#[derive(Debug, Default)]
pub(super) struct Disturbance {
    pub(super) strikes: Vec<Struck>,
    pub(super) samples: Vec<MemorySample>,
    pub(super) has_finished: bool,
    pub(super) wall_s: f64,
    /// Damaged files that `resume` refused by name, with nothing written to them.
    pub(super) n_refused_files: u64,
    /// Runs that ended because the disk took nothing more.
    pub(super) n_failed_syncs: u64,
    pub(super) journaled: Journaled,
    pub(super) problems: Vec<String>,
}

impl Disturbance {
    /// Looks whether all that was journaled is there still.
    fn look(&mut self, trial: &Trial) {
        let lost = self.journaled.look(&RunFiles::new(&trial.dir));
        self.problems.extend(lost);
    }

    /// Damages a file of a run without processes, where the fault is of that kind.
    fn damage(&mut self, trial: &Trial, kind: FaultKind, random: &mut Random) -> Option<FileDamage> {
        let files = RunFiles::new(&trial.dir);
        let damaged = kind.is_damage().then(|| damage(&files, kind, random)).flatten()?;
        self.journaled.allow_torn_ends(&files);
        Some(damaged)
    }
}

/// How a process of the run ended by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum RunEnding {
    Finished,
    /// A damaged file was refused by name.
    Refused,
    NotSynced,
    Failed,
}

impl RunEnding {
    fn of(is_success: bool, error: &str, damages: &[FileDamage]) -> Self {
        let is_named = |damage: &FileDamage| error.contains(&damage.path.display().to_string());
        if is_success {
            RunEnding::Finished
        } else if error.contains(NOT_SYNCED) {
            // Before the names: it names a file too, and no damaged one.
            RunEnding::NotSynced
        } else if damages.iter().any(is_named) {
            RunEnding::Refused
        } else {
            RunEnding::Failed
        }
    }
}

/// Strikes by a schedule.
pub(super) struct Disturber {
    pub(super) schedule: FaultSchedule,
    /// Faults at most.
    pub(super) most: u64,
    /// Longest time for the run.
    pub(super) patience: Duration,
}

impl Disturber {
    /// Starts the run, strikes until it is over, resumes it where its supervisor was struck.
    pub(super) fn run(&mut self, trial: &mut Trial, mut random: Random) -> Result<Disturbance, ToolError> {
        let began = Instant::now();
        let mut done = Disturbance::default();
        let mut child = trial.start()?;
        // Those of which it is not known yet whether `resume` can do with them.
        let mut damages: Vec<FileDamage> = Vec::new();
        loop {
            let next = (done.n_strikes() < self.most).then(|| self.schedule.next_strike()).flatten();
            let until = next.as_ref().map_or(self.patience, |strike| strike.after);
            if let Some(is_success) =
                wait(&mut child, until.min(self.patience.saturating_sub(began.elapsed())))?
            {
                trial.remember();
                let error = trial.errors();
                match RunEnding::of(is_success, &error, &damages) {
                    RunEnding::Refused => {
                        // Told by name, and nothing is cut; put back, the run goes on.
                        mend(&mut damages, &mut done)?;
                        done.look(trial);
                        child = trial.start()?;
                        continue;
                    }
                    RunEnding::NotSynced => {
                        // Its stages ran: where they wrote to a damaged file, it was a torn end.
                        forget_overwritten(&mut damages);
                        done.n_failed_syncs += 1;
                        child = trial.start()?;
                        continue;
                    }
                    RunEnding::Failed => done.problems.push(format!("the run failed: {}", error.trim())),
                    RunEnding::Finished => done.has_finished = true,
                }
                break;
            }
            if began.elapsed() >= self.patience {
                done.problems.push(format!("the run did not end within {} s", self.patience.as_secs()));
                end_all(&mut child, trial);
                break;
            }
            let Some(strike) = next else { continue };
            if strike.kind == FaultKind::Sleep {
                sleep_all(child.id(), &trial.dir, &mut random, &mut done);
            } else if matches!(strike.targets[..], [FaultTarget::Group | FaultTarget::Supervisor]) {
                if stage_pids(child.id()).is_empty() {
                    // At its beginning, or at an end that was not seen yet.
                    forget_overwritten(&mut damages);
                } else {
                    // The run goes on: what was damaged before was a torn end, or nothing that is needed.
                    damages.clear();
                }
                kill_supervisor(&mut child, &strike, trial, &mut random, &mut done)?;
                if damages.is_empty() {
                    done.look(trial);
                }
                damages.extend(done.damage(trial, strike.kind, &mut random));
                child = trial.start()?;
            } else {
                if damages.is_empty() {
                    done.look(trial);
                }
                strike_stages(child.id(), &strike, &mut random, &mut done);
            }
            sample(child.id(), &mut done);
        }
        trial.end_camera();
        done.look(trial);
        done.wall_s = began.elapsed().as_secs_f64();
        Ok(done)
    }

    /// Disturbs the stages of a supervisor that was started elsewhere.
    pub(super) fn disturb_running(
        &mut self,
        supervisor: u32,
        run_dir: &Path,
        mut random: Random,
    ) -> Disturbance {
        let mut done = Disturbance::default();
        while done.n_strikes() < self.most && rss_bytes(supervisor).is_some() {
            let Some(strike) = self.schedule.next_strike() else { break };
            std::thread::sleep(strike.after);
            match strike.kind {
                FaultKind::Sleep => sleep_all(supervisor, run_dir, &mut random, &mut done),
                _ => strike_stages(supervisor, &strike, &mut random, &mut done),
            }
        }
        // The last one gets time to come back.
        std::thread::sleep(Duration::from_secs(2));
        done
    }
}

/// Waits for the end of a process; answers whether it was a success, or `None` when time is over.
fn wait(child: &mut Child, at_most: Duration) -> Result<Option<bool>, ToolError> {
    let deadline = Instant::now() + at_most;
    loop {
        let ended = child.try_wait().map_err(|error| ToolError::Stage(error.to_string()))?;
        if let Some(status) = ended {
            return Ok(Some(status.success()));
        }
        let left = deadline.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Ok(None);
        }
        std::thread::sleep(left.min(LOOK));
    }
}

fn strike_stages(supervisor: u32, planned: &Strike, random: &mut Random, done: &mut Disturbance) {
    for &target in &planned.targets {
        let FaultTarget::Stage(stage) = target else { continue };
        let Some(pid) = stage_pid(supervisor, stage) else { continue };
        let own = done.strikes.iter().filter(|s| s.target == target && s.kind.is_own_death()).count();
        let kind =
            if planned.kind.is_own_death() && own >= OWN_DEATHS { FaultKind::Kill } else { planned.kind };
        let Some(at_nanos) = strike(pid, kind, random) else { continue };
        let is_deadly = !matches!(kind, FaultKind::Stop | FaultKind::Slow);
        let hits = if is_deadly { vec![Hit { at_nanos, stage, pid }] } else { Vec::new() };
        done.strikes.push(Struck { target, kind, at_nanos, hits });
    }
}

/// Lets all processes sleep for longer than a stage may be silent; not before the run has its settings.
fn sleep_all(supervisor: u32, run_dir: &Path, random: &mut Random, done: &mut Disturbance) {
    let config = std::fs::read_to_string(RunFiles::new(run_dir).config()).unwrap_or_default();
    let Ok(settings) = Settings::from_run(&config, "config.toml") else { return };
    let asleep = settings.flow.hang_s + random.below(1000) as f64 * 1e-3;
    let at = sleep(supervisor, Duration::from_secs_f64(asleep), random);
    let (target, kind) = (FaultTarget::Group, FaultKind::Sleep);
    done.strikes.extend(at.map(|at_nanos| Struck { target, kind, at_nanos, hits: Vec::new() }));
}

/// Kills the supervisor, alone or with all stages, and waits until none of them is left.
fn kill_supervisor(
    child: &mut Child,
    planned: &Strike,
    trial: &mut Trial,
    random: &mut Random,
    done: &mut Disturbance,
) -> Result<(), ToolError> {
    trial.remember();
    let is_group = planned.targets == [FaultTarget::Group];
    let stages = stage_pids(child.id());
    let at_nanos = monotonic_nanos();
    let _ = child.kill();
    let mut victims = stages.clone();
    if is_group {
        // The supervisor is gone, and no other is started.
        victims.iter().for_each(|(_, pid)| {
            let _ = strike(*pid, FaultKind::Kill, random);
        });
    } else {
        victims.clear();
    }
    child.wait().map_err(|error| ToolError::Stage(error.to_string()))?;
    let deadline = Instant::now() + ORPHANS;
    while !stages_in(&trial.dir).is_empty() && Instant::now() < deadline {
        std::thread::sleep(LOOK);
    }
    let left = stages_in(&trial.dir);
    if !left.is_empty() {
        done.problems.push(format!("stages lived on without their supervisor: {left:?}"));
    }
    let hits = stages.iter().filter(|(stage, _)| *stage == Stage::Align);
    let hits = hits.map(|&(stage, pid)| Hit { at_nanos, stage, pid }).collect();
    done.strikes.push(Struck { target: planned.targets[0], kind: planned.kind, at_nanos, hits });
    Ok(())
}

/// Puts damaged files back, the last damage first.
fn mend(damages: &mut Vec<FileDamage>, done: &mut Disturbance) -> Result<(), ToolError> {
    done.n_refused_files += 1;
    if let Some(last) = damages.last().filter(|last| !last.is_untouched()) {
        done.problems.push(format!("{} was refused, and written to", last.path.display()));
    }
    while let Some(damage) = damages.pop() {
        damage.mend()?;
    }
    Ok(())
}

/// Looks at the supervisor while its stages live: at its end it gives everything back.
fn sample(pid: u32, done: &mut Disturbance) {
    if stage_pids(pid).len() < 3 {
        return;
    }
    if let (Some(rss_bytes), Some(n_open_files)) = (rss_bytes(pid), n_open_files(pid)) {
        done.samples.push(MemorySample { pid, n_strikes: done.n_strikes(), rss_bytes, n_open_files });
    }
}

/// Ends a run that does not end.
fn end_all(child: &mut Child, trial: &Trial) {
    let _ = child.kill();
    let _ = child.wait();
    for (_, pid) in stages_in(&trial.dir) {
        let _ = strike(pid, FaultKind::Kill, &mut Random::new(0));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The store was cut at its end, the run went on and wrote to it, and then the disk failed: that it was refused
    /// was concluded from its name, and the bytes from before the cut were put back into a longer run.
    #[test]
    fn a_store_that_could_not_be_forced_to_disk_was_not_refused() {
        let dir = tempfile::tempdir().unwrap();
        let files = RunFiles::new(dir.path());
        std::fs::write(files.store(), [7; 9000]).unwrap();
        let store = files.store().display().to_string();
        let damages = [damage(&files, FaultKind::StoreCut, &mut Random::new(1)).unwrap()];
        let ending = |error: &str| RunEnding::of(false, error, &damages);
        assert_eq!(
            ending(&format!("{store} was not forced to disk: Input/output error")),
            RunEnding::NotSynced
        );
        assert_eq!(ending(&format!("align.journal is damaged: {store}: ends early")), RunEnding::Refused);
        assert_eq!(ending("no space left"), RunEnding::Failed);
        assert_eq!(RunEnding::of(true, "", &damages), RunEnding::Finished);
        assert!(damages[0].is_untouched());
        std::fs::write(files.store(), [8; 9000]).unwrap();
        assert!(!damages[0].is_untouched());
    }
}
