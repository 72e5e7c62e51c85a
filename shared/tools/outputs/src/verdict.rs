//! The verdict on a run: good, doubtful or failed, with the reasons and what to try.
//!
//! One pure function of plain facts; the summary, the report, the log and `--strict` say the same.

use crate::facts::{Facts, Span, UNCERTAIN_M};
use crate::statistics::Ended;
use crate::wrong_camera::{lens, off_truth, turned_truth, units};
use serde::Serialize;
use std::cmp::Reverse;
use std::fmt;
use tessera_stage::BrokenFrames;

/// Spans of untracked frames shorter than this, seconds, are bridged by the prediction.
const SHORT_SPAN_S: f64 = 0.5;
/// Share of untracked frames above which a run is doubtful, and above which it failed.
const UNTRACKED_DOUBTFUL: f64 = 0.02;
const UNTRACKED_FAILED: f64 = 0.5;
/// Share of frames with a degenerate direction above which a run is doubtful.
const DEGENERATE_DOUBTFUL: f64 = 0.05;
/// Span of such frames, seconds, from which on the prediction is no help: it is doubtful.
const DEGENERATE_LONG_S: f64 = 0.5;
/// Share of frames in submaps of their own above which a run is doubtful.
const APART_DOUBTFUL: f64 = 0.02;
/// Share of uncertain frames above which a run is doubtful.
const UNCERTAIN_DOUBTFUL: f64 = 0.02;
/// Share of frames that a live run may leave out.
const DROPPED_DOUBTFUL: f64 = 0.05;
/// Share of frames with a broken image above which a run is doubtful.
const BROKEN_DOUBTFUL: f64 = 0.01;
/// Rejected loops from which on they are a reason, where they outnumber the closed ones.
const MANY_REJECTED: u64 = 3;
/// Spans of frames that are listed.
const MOST_SPANS: usize = 3;

/// Whether a run's outputs can be relied on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Grade {
    /// Nothing speaks against them.
    #[default]
    Good,
    /// Parts of them may be wrong: the reasons say which.
    Doubtful,
    /// They are not to be used.
    Failed,
}

impl fmt::Display for Grade {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Good => "good",
            Self::Doubtful => "doubtful",
            Self::Failed => "failed",
        })
    }
}

/// One thing that was found.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Reason {
    /// How much it weighs; [`Grade::Good`]: a note.
    pub grade: Grade,
    /// What was found, in plain words and numbers.
    pub found: String,
    /// What to try; empty for a note.
    pub advice: String,
}

/// Grade and reasons, the weightiest first.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Verdict {
    /// That of the weightiest reason.
    pub grade: Grade,
    /// Why; may hold notes where the grade is good.
    pub reasons: Vec<Reason>,
}

impl Verdict {
    /// The verdict as lines: the grade, then each reason with its advice.
    pub fn for_people(&self) -> String {
        let mut text = format!("  verdict     {}\n", self.grade);
        for Reason { found, advice, .. } in &self.reasons {
            text.push_str(&format!("              {found}\n"));
            if !advice.is_empty() {
                text.push_str(&format!("              try: {advice}\n"));
            }
        }
        text
    }

    /// Grade and reasons in one line, as for a log.
    pub fn in_one_line(&self) -> String {
        let found: Vec<&str> = self.reasons.iter().map(|reason| reason.found.as_str()).collect();
        match found.is_empty() {
            true => format!("verdict {}", self.grade),
            false => format!("verdict {}: {}", self.grade, found.join("; ")),
        }
    }
}

/// Judges a run.
pub fn verdict(facts: &Facts) -> Verdict {
    let reasons = [
        ended(facts),
        one_frame(facts),
        units(facts),
        lens(facts),
        off_truth(facts),
        untracked(facts),
        apart(facts),
        degenerate(facts),
        uncertain(facts),
        dropped(facts),
        broken(facts),
        without_colour(facts),
        rejected_loops(facts),
        unbelieved_colour(facts),
        turned_truth(facts),
    ];
    let doubts = facts.source_doubts.iter().map(|doubt| {
        reason(
            Grade::Doubtful,
            doubt.clone(),
            "tessera check SOURCE; mend the images, or give the right camera: --camera NAME|FILE (docs/own_camera.md)",
        )
    });
    let notes = facts.source_warnings.iter().map(|warning| reason(Grade::Good, warning.clone(), ""));
    let mut reasons: Vec<Reason> = reasons.into_iter().flatten().chain(doubts).chain(notes).collect();
    // Stable: reasons of one grade keep their order.
    reasons.sort_by_key(|reason| std::cmp::Reverse(reason.grade));
    Verdict { grade: reasons.first().map_or(Grade::Good, |reason| reason.grade), reasons }
}

/// A note: what colour says is left out, and depth alone is judged by the others.
fn unbelieved_colour(facts: &Facts) -> Option<Reason> {
    facts.unbelieved_colour.map(|own_nats| {
        let found = format!(
            "colour was not used at the end: it moves otherwise than depth (log odds {own_nats:.1} that it is of the same time and place, above 0 is believed); it may be of another time, camera or scene"
        );
        reason(Grade::Good, found, "")
    })
}

pub(crate) fn reason(grade: Grade, found: String, advice: &str) -> Reason {
    let advice = if grade == Grade::Good { String::new() } else { advice.to_owned() };
    Reason { grade, found, advice }
}

/// Doubtful above a limit, else a note.
fn above(share: f64, limit: f64) -> Grade {
    if share > limit { Grade::Doubtful } else { Grade::Good }
}

fn share(part: u64, whole: u64) -> f64 {
    part as f64 / whole.max(1) as f64
}

fn ended(facts: &Facts) -> Option<Reason> {
    let n = facts.n_processed;
    let (grade, found, advice) = match facts.ended {
        Ended::GoingOn if n == 0 => return None,
        _ if n == 0 => (Grade::Failed, "no frame was processed".to_owned(), "tessera check SOURCE"),
        _ if facts.is_nowhere => (
            Grade::Failed,
            "no frame was found in the map".to_owned(),
            "begin where the map was seen well, or give --at (docs/maps.md)",
        ),
        Ended::Failed => (
            Grade::Failed,
            format!("a stage failed after {n} of {} frames", facts.n_read),
            "the last lines of log.txt say why; then tessera resume",
        ),
        Ended::Interrupted | Ended::Unfinished => (
            Grade::Doubtful,
            format!("the run was not finished: {n} of {} frames", facts.n_read),
            "tessera resume",
        ),
        Ended::Finished | Ended::GoingOn => return None,
    };
    Some(reason(grade, found, advice))
}

/// A single frame: no motion was estimated.
fn one_frame(facts: &Facts) -> Option<Reason> {
    let is_alone = facts.n_processed == 1 && matches!(facts.ended, Ended::Finished);
    is_alone.then(|| {
        let found = "one frame alone was processed: no motion was estimated".to_owned();
        reason(Grade::Doubtful, found, "tessera check SOURCE shows which images were found")
    })
}

fn untracked(facts: &Facts) -> Option<Reason> {
    let (n, of) = (facts.n_untracked, facts.n_processed);
    if n == 0 {
        return None;
    }
    let is_long = facts.untracked.iter().any(|span| span.duration_s() >= SHORT_SPAN_S);
    let grade = match share(n, of) {
        share if share >= UNTRACKED_FAILED => Grade::Failed,
        share if share > UNTRACKED_DOUBTFUL || is_long || facts.ends_untracked => Grade::Doubtful,
        _ => Grade::Good,
    };
    let to_the_end = if facts.ends_untracked { ", to the end" } else { "" };
    let found = format!(
        "{n} of {of} frames not tracked, their poses are predictions: {}{to_the_end}",
        spans(&facts.untracked)
    );
    if facts.n_without_depth > n / 2 {
        let found = format!("{found}; {} of them hold too little depth to be aligned", facts.n_without_depth);
        let advice = "tessera check SOURCE: its depth images hold no or few measurements; is it the right stream, and units_per_metre right?";
        return Some(reason(grade, found, advice));
    }
    let advice =
        "move more slowly or record at a higher rate; keep structure within 4 m in view (docs/tuning.md)";
    Some(reason(grade, found, advice))
}

/// Submaps that were never joined to that of `trajectory.txt`.
fn apart(facts: &Facts) -> Option<Reason> {
    let n: u64 = facts.apart.values().sum();
    let (what, verb) = match facts.apart.len() {
        0 => return None,
        1 => ("submap", "was"),
        _ => ("submaps", "were"),
    };
    let files: Vec<String> =
        facts.apart.keys().take(MOST_SPANS).map(|submap| format!("trajectory_submap_{submap}.txt")).collect();
    let found = format!(
        "{} {what} {verb} never joined: {n} frames are in files of their own ({}{})",
        facts.apart.len(),
        files.join(", "),
        if facts.apart.len() > MOST_SPANS { ", ..." } else { "" }
    );
    let advice = "lead the camera back to a place that it has seen; in one take, without cuts";
    Some(reason(above(share(n, facts.n_processed), APART_DOUBTFUL), found, advice))
}

/// The longest spans, in the order of time.
fn spans(all: &[Span]) -> String {
    let mut longest: Vec<&Span> = all.iter().collect();
    longest.sort_by_key(|span| (Reverse(span.last.saturating_sub(span.first)), span.first));
    longest.truncate(MOST_SPANS);
    longest.sort_by_key(|span| span.first);
    let mut words: Vec<String> = longest.iter().map(ToString::to_string).collect();
    if all.len() > MOST_SPANS {
        words.push(format!("{} more", all.len().saturating_sub(MOST_SPANS)));
    }
    words.join(", ")
}

/// Frames that see too little shape for some direction of motion.
fn degenerate(facts: &Facts) -> Option<Reason> {
    let (n, of) = (facts.n_degenerate, facts.n_processed);
    if n == 0 {
        return None;
    }
    let is_long = facts.degenerate.iter().any(|span| span.duration_s() >= DEGENERATE_LONG_S);
    let grade = if is_long { Grade::Doubtful } else { above(share(n, of), DEGENERATE_DOUBTFUL) };
    let found = format!(
        "{n} of {of} frames are degenerate, they see too little shape and a direction of their motion is a prediction: {}",
        spans(&facts.degenerate)
    );
    let advice = "record with colour, or keep surfaces that face three ways in view (docs/tuning.md)";
    Some(reason(grade, found, advice))
}

fn uncertain(facts: &Facts) -> Option<Reason> {
    let (n, of) = (facts.n_uncertain, facts.n_processed);
    let (first, worst_m) = (facts.first_uncertain?, facts.worst_deviation_m);
    let grade = above(share(n, of), UNCERTAIN_DOUBTFUL);
    let found = format!(
        "{n} of {of} frames are uncertain by more than {UNCERTAIN_M} m, {worst_m:.2} m at worst, from frame {first} on"
    );
    let advice = "show the camera more than one wall; a loop back to the start helps (docs/tuning.md)";
    Some(reason(grade, found, advice))
}

fn dropped(facts: &Facts) -> Option<Reason> {
    let (n, missing) = (facts.n_dropped, facts.n_missing);
    if (n, missing) == (0, 0) {
        return None;
    }
    let grade = if missing > 0 { Grade::Doubtful } else { above(share(n, facts.n_read), DROPPED_DOUBTFUL) };
    let found = match missing {
        0 => format!("{n} of {} frames dropped, newer ones had come", facts.n_read),
        _ => format!("{n} of {} frames dropped, {missing} missing (they ended their stage)", facts.n_read),
    };
    Some(reason(grade, found, "a faster machine, --config fast, or without --live"))
}

/// A note: frames that went on with their depth alone.
fn without_colour(facts: &Facts) -> Option<Reason> {
    let of_colour = facts
        .broken
        .iter()
        .filter_map(|(index, problem)| Some((index, problem.strip_prefix(BrokenFrames::COLOUR)?)));
    let n = of_colour.clone().count();
    let (index, problem) = of_colour.clone().next()?;
    let found = format!(
        "{n} of {} frames went without their colour image, the first is frame {index}: {problem}",
        facts.n_read
    );
    Some(reason(Grade::Good, found, ""))
}

fn broken(facts: &Facts) -> Option<Reason> {
    let broken = facts.broken.iter().filter(|(_, problem)| !problem.starts_with(BrokenFrames::COLOUR));
    let n = broken.clone().count() as u64;
    let (index, problem) = broken.clone().next()?;
    let grade = above(share(n, facts.n_read), BROKEN_DOUBTFUL);
    let found = format!(
        "{n} of {} frames have a missing or broken image, the first is frame {index}: {problem}",
        facts.n_read
    );
    Some(reason(grade, found, "copy or download the recording again"))
}

fn rejected_loops(facts: &Facts) -> Option<Reason> {
    let (closed, rejected) = (facts.n_loops_closed, facts.n_loops_rejected);
    if rejected == 0 {
        return None;
    }
    let is_many = rejected >= MANY_REJECTED && rejected > closed;
    let grade = if is_many { Grade::Doubtful } else { Grade::Good };
    let found = format!("{rejected} verified loops rejected by the optimisation, {closed} closed");
    Some(reason(grade, found, "tessera report: its table of loops says which places contradict each other"))
}

#[cfg(test)]
mod tests;
