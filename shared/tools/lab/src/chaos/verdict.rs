//! Verdict on a run under faults.

use super::disturb::{Disturbance, MemorySample};
use super::recovery::{ChaosEvent, Hit, Recovery, Sign, events, recovery};
use super::report::{FaultReport, RunReport};
use super::schedule::FaultTarget;
use super::trial::Trial;
use super::{journal, leftovers};
use std::path::PathBuf;
use tessera_messages::Stage;
use tessera_outputs::{ToolError, read_statistics};

/// Faults that the supervisor's memory may take to settle before its growth counts.
const SETTLE: u64 = 5;

/// What a run is measured by.
pub(super) struct Judge<'a> {
    pub(super) number: u64,
    pub(super) reference: &'a Trial,
    pub(super) is_live: bool,
}

/// Looks at everything that a run left.
pub(super) fn judge(
    by: &Judge<'_>,
    trial: &Trial,
    done: &Disturbance,
) -> Result<(RunReport, Vec<FaultReport>), ToolError> {
    let log = trial.log();
    let faults = faults(by.number, done, &log);
    let mut broken = done.problems.clone();
    let mut check = |holds: bool, reason: String| {
        if !holds {
            broken.push(reason);
        }
    };
    let frames = journal::count(&trial.dir)?;
    check(frames.lost == 0, format!("{} frames are not in the journal", frames.lost));
    check(frames.duplicated == 0, format!("{} frames are in the journal again", frames.duplicated));
    let differing = trial.differing(&by.reference.dir);
    check(by.is_live || differing.is_empty(), format!("outputs differ: {}", differing.join(", ")));
    let left = trial.leftovers();
    let left_paths: Vec<_> = left.keys().cloned().collect();
    check(left.is_empty(), format!("left behind: {}", shown(&left_paths)));
    let undocumented = leftovers::undocumented(&trial.dir);
    check(undocumented.is_empty(), format!("files that no documentation names: {}", shown(&undocumented)));
    for stage in Stage::ALL {
        let died = format!("] {stage} died: ");
        let n_deaths =
            log.lines().filter(|line| line.contains(" supervisor[") && line.contains(&died)).count();
        let target = FaultTarget::Stage(stage).name();
        let n_hits = faults.iter().filter(|fault| fault.target == target && fault.is_deadly).count();
        check(
            n_deaths <= n_hits,
            format!("{stage} died {n_deaths} times, but was struck only {n_hits} times"),
        );
    }
    let (peak, usual) = (peak_rss_mb(trial)?, peak_rss_mb(by.reference)?);
    let (growth, files, settled) = growth(&done.samples);
    let report = RunReport {
        run: by.number,
        faults: faults.len() as u64,
        wall_s: done.wall_s,
        finished: done.has_finished,
        identical: (!by.is_live).then_some(differing.is_empty()),
        frames: frames.n_frames,
        frames_lost: frames.lost,
        frames_duplicated: frames.duplicated,
        frames_skipped: frames.skipped,
        messages_refused: log.matches(" refused: ").count() as u64,
        records_dropped: log.matches(" are dropped: ").count() as u64,
        files_refused: done.n_refused_files,
        left_files: left.len() as u64,
        left_bytes: left.values().sum(),
        undocumented_files: undocumented.len() as u64,
        supervisor_growth_bytes: growth,
        supervisor_files_growth: files,
        growth_over_faults: settled,
        stages_peak_mb: peak,
        stages_peak_undisturbed_mb: usual,
        broken,
    };
    Ok((report, faults))
}

/// Each fault with what became of it.
pub(super) fn faults(run: u64, done: &Disturbance, log: &str) -> Vec<FaultReport> {
    let events = events(log);
    let planned: Vec<&ChaosEvent> = events.iter().filter(|e| matches!(e.sign, Sign::Struck(_))).collect();
    let of_plan = |word: &str| !["slow", "drop", "corrupt"].contains(&word);
    let name_of = |sign: &Sign| match sign {
        Sign::Struck(word) => word.rsplit(':').next().unwrap_or_default().to_owned(),
        _ => String::new(),
    };
    let mut hits: Vec<Hit> = done.strikes.iter().flat_map(|strike| strike.hits.clone()).collect();
    let deadly = planned.iter().filter(|event| of_plan(&name_of(&event.sign)));
    hits.extend(deadly.map(|event| Hit { at_nanos: event.at_nanos, stage: event.stage, pid: event.pid }));
    let report =
        |target: FaultTarget, fault: String, at_nanos: u64, hit: Option<&Hit>, place: Option<String>| {
            let outcome = hit.map(|hit| recovery(hit, &hits, &events));
            FaultReport {
                run,
                target: target.name(),
                fault,
                at_nanos,
                place,
                is_deadly: hit.is_some(),
                recovery_ms: match outcome {
                    Some(Recovery::After(ms)) => Some(ms),
                    _ => None,
                },
                outcome: match outcome {
                    None => "no death",
                    Some(Recovery::After(_)) => "back",
                    Some(Recovery::Overtaken) => "overtaken by another",
                    Some(Recovery::Over) => "nothing more to do",
                },
            }
        };
    let mut reports: Vec<FaultReport> = done
        .strikes
        .iter()
        .map(|s| report(s.target, s.kind.name().to_owned(), s.at_nanos, s.hits.first(), None))
        .collect();
    for event in &planned {
        let Sign::Struck(place) = &event.sign else { continue };
        let name = name_of(&event.sign);
        let hit = hits.iter().find(|hit| hit.at_nanos == event.at_nanos && hit.pid == event.pid);
        reports.push(report(FaultTarget::Stage(event.stage), name, event.at_nanos, hit, Some(place.clone())));
    }
    reports.sort_by_key(|report| report.at_nanos);
    reports
}

/// How much a supervisor's memory and open files grew once it had settled, and over how many faults.
fn growth(samples: &[MemorySample]) -> (i64, i64, u64) {
    let (mut bytes, mut files, mut over) = (0, 0, 0);
    let mut rest = samples;
    while let Some(first) = rest.first() {
        let (life, later) = rest.split_at(rest.iter().take_while(|s| s.pid == first.pid).count());
        rest = later;
        let settled = life.iter().find(|s| s.n_strikes >= first.n_strikes + SETTLE);
        if let (Some(from), Some(to)) = (settled, life.last()) {
            bytes += to.rss_bytes as i64 - from.rss_bytes as i64;
            files += to.n_open_files as i64 - from.n_open_files as i64;
            over += to.n_strikes - from.n_strikes;
        }
    }
    (bytes, files, over)
}

/// Highest resident set of any stage, MB.
fn peak_rss_mb(trial: &Trial) -> Result<f64, ToolError> {
    let statistics = read_statistics(&trial.dir)?;
    Ok(statistics.stages.values().map(|stage| stage.peak_rss_mb).fold(0.0, f64::max))
}

/// Folder and file names in messages.
fn shown(paths: &[PathBuf]) -> String {
    paths.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn growth_counts_within_one_life_once_it_has_settled() {
        let sample = |pid, n_strikes, rss_bytes| MemorySample { pid, n_strikes, rss_bytes, n_open_files: 30 };
        let samples = [sample(1, 1, 100), sample(1, 6, 140), sample(1, 9, 150), sample(2, 10, 90)];
        assert_eq!(growth(&samples), (10, 0, 3));
        assert_eq!(growth(&samples[3..]), (0, 0, 0));
    }
}
