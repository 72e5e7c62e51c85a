//! The verdict on a run: good, doubtful or failed, with the reasons and what to try.
//!
//! One pure function of plain facts; the summary, the report, the log and `--strict` say the same.

use crate::facts::{Facts, Span};
use crate::statistics::Ended;
use crate::wrong_camera::{lens, off_truth, units};
use serde::Serialize;
use std::fmt;

/// Spans of untracked frames shorter than this, seconds, are bridged by the prediction.
const SHORT_SPAN_S: f64 = 0.5;
/// Share of untracked frames above which a run is doubtful, and above which it failed.
const UNTRACKED_DOUBTFUL: f64 = 0.02;
const UNTRACKED_FAILED: f64 = 0.5;
/// Stated standard deviation of a position above which it is not to be relied on, metres.
pub(crate) const UNCERTAIN_M: f64 = 0.1;
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
        units(facts),
        lens(facts),
        off_truth(facts),
        untracked(facts),
        apart(facts),
        degenerate(facts),
        uncertain(facts),
        dropped(facts),
        broken(facts),
        rejected_loops(facts),
    ];
    let doubts = facts.source_doubts.iter().map(|doubt| {
        reason(
            Grade::Doubtful,
            doubt.clone(),
            "give the right camera: --camera NAME|FILE (docs/own_camera.md)",
        )
    });
    let mut reasons: Vec<Reason> = reasons.into_iter().flatten().chain(doubts).collect();
    // Stable: reasons of one grade keep their order.
    reasons.sort_by_key(|reason| std::cmp::Reverse(reason.grade));
    Verdict { grade: reasons.first().map_or(Grade::Good, |reason| reason.grade), reasons }
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
        Ended::Finished => return None,
    };
    Some(reason(grade, found, advice))
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
    longest.sort_by(|a, b| (b.last - b.first).cmp(&(a.last - a.first)).then(a.first.cmp(&b.first)));
    longest.truncate(MOST_SPANS);
    longest.sort_by_key(|span| span.first);
    let mut words: Vec<String> = longest.iter().map(ToString::to_string).collect();
    if all.len() > MOST_SPANS {
        words.push(format!("{} more", all.len() - MOST_SPANS));
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
    if n + missing == 0 {
        return None;
    }
    let grade = if missing > 0 { Grade::Doubtful } else { above(share(n, facts.n_read), DROPPED_DOUBTFUL) };
    let found = match missing {
        0 => format!("{n} of {} frames dropped, newer ones had come", facts.n_read),
        _ => format!("{n} of {} frames dropped, {missing} missing (they ended their stage)", facts.n_read),
    };
    Some(reason(grade, found, "a faster machine, --config fast, or without --live"))
}

fn broken(facts: &Facts) -> Option<Reason> {
    let n = facts.broken.len() as u64;
    let (index, problem) = facts.broken.iter().next()?;
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
mod tests {
    use super::*;
    use crate::facts::Truth;

    fn good() -> Facts {
        Facts {
            ended: Ended::Finished,
            n_read: 400,
            n_processed: 400,
            n_loops_closed: 5,
            units_per_metre: 1000.0,
            ..Facts::default()
        }
    }

    fn span(first: u64, last: u64) -> Span {
        Span { first, last, from_s: first as f64 / 30.0, to_s: last as f64 / 30.0 }
    }

    fn check(facts: &Facts, grade: Grade, words: &[&str]) {
        let verdict = verdict(facts);
        assert_eq!(verdict.grade, grade, "{verdict:?}");
        let text = verdict.for_people();
        for word in words {
            assert!(text.contains(word), "{text} lacks {word}");
        }
        for reason in &verdict.reasons {
            assert_eq!(reason.advice.is_empty(), reason.grade == Grade::Good, "{reason:?}");
        }
    }

    #[test]
    fn a_good_run_has_no_reasons_or_notes_alone() {
        assert_eq!(verdict(&good()), Verdict::default());
        assert_eq!(verdict(&good()).in_one_line(), "verdict good");
        let short = Facts { n_untracked: 3, untracked: vec![span(10, 12)], n_loops_rejected: 1, ..good() };
        check(
            &short,
            Grade::Good,
            &["3 of 400 frames not tracked", "frames 10 to 12 (0.3 to 0.4 s)", "1 verified loops"],
        );
    }

    #[test]
    fn frames_without_a_pose_make_it_doubtful_and_half_of_them_failed() {
        let lost = Facts { n_untracked: 85, untracked: vec![span(315, 399)], ends_untracked: true, ..good() };
        check(
            &lost,
            Grade::Doubtful,
            &["verdict     doubtful", "85 of 400", "frames 315 to 399", "to the end", "try:"],
        );
        check(
            &Facts { n_untracked: 200, untracked: vec![span(200, 399)], ..good() },
            Grade::Failed,
            &["200 of 400"],
        );
        let apart = |n| Facts { n_submaps: 2, apart: [(1, n)].into(), ..good() };
        check(
            &apart(150),
            Grade::Doubtful,
            &["1 submap was never joined: 150 frames are in files of their own (trajectory_submap_1.txt)"],
        );
        check(&apart(5), Grade::Good, &["5 frames are in files"]);
        let many: Vec<Span> = (0..5).map(|k| span(20 * k, 20 * k + k)).collect();
        check(
            &Facts { n_untracked: 15, untracked: many, ..good() },
            Grade::Doubtful,
            &["frames 80 to 84", "2 more"],
        );
    }

    #[test]
    fn deviations_drops_broken_images_and_rejected_loops_are_named() {
        let uncertain =
            Facts { n_uncertain: 100, first_uncertain: Some(246), worst_deviation_m: 4.6, ..good() };
        check(
            &uncertain,
            Grade::Doubtful,
            &["100 of 400 frames are uncertain by more than 0.1 m, 4.60 m", "frame 246"],
        );
        check(&Facts { n_dropped: 10, ..good() }, Grade::Good, &["10 of 400 frames dropped"]);
        check(&Facts { n_dropped: 100, ..good() }, Grade::Doubtful, &["without --live"]);
        check(&Facts { n_missing: 1, ..good() }, Grade::Doubtful, &["1 missing"]);
        let broken = |n: u64| (0..n).map(|k| (k, "d.png: gone".to_owned())).collect();
        check(&Facts { broken: broken(1), ..good() }, Grade::Good, &["1 of 400", "frame 0: d.png: gone"]);
        check(&Facts { broken: broken(9), ..good() }, Grade::Doubtful, &["again"]);
        check(
            &Facts { n_loops_rejected: 9, ..good() },
            Grade::Doubtful,
            &["9 verified loops rejected", "5 closed"],
        );
    }

    #[test]
    fn degenerate_for_long_is_a_reason_and_for_a_moment_a_note() {
        let with = |n, degenerate| Facts { n_degenerate: n, degenerate, ..good() };
        check(
            &with(2, vec![span(10, 11)]),
            Grade::Good,
            &["2 of 400 frames are degenerate", "frames 10 to 11"],
        );
        check(
            &with(16, vec![span(10, 25)]),
            Grade::Doubtful,
            &["frames 10 to 25 (0.3 to 0.8 s)", "try: record with colour"],
        );
        let spread = (0..25).map(|k| span(10 * k, 10 * k)).collect();
        check(&with(25, spread), Grade::Doubtful, &["25 of 400 frames are degenerate", "22 more"]);
    }

    #[test]
    fn how_a_run_ended_weighs_most() {
        check(&Facts { n_processed: 0, ..good() }, Grade::Failed, &["no frame was processed"]);
        check(&Facts { ended: Ended::Failed, ..good() }, Grade::Failed, &["a stage failed after 400 of 400"]);
        let interrupted = Facts { ended: Ended::Interrupted, n_processed: 9, ..good() };
        check(&interrupted, Grade::Doubtful, &["not finished: 9 of 400", "tessera resume"]);
        check(&Facts { is_nowhere: true, ..good() }, Grade::Failed, &["no frame was found in the map"]);
    }

    #[test]
    fn positions_far_from_the_ground_truth_are_doubtful() {
        let off = |ate_m, spread_m| {
            let truth = Some(Truth { scale: 1.0, is_telling: false, ate_m, spread_m });
            verdict(&Facts { truth, ..good() })
        };
        let room = off(0.3, 1.2);
        assert_eq!(room.grade, Grade::Doubtful);
        assert!(room.reasons[0].found.contains("off by 0.30 m"), "{room:?}");
        assert_eq!([off(0.09, 0.2).grade, off(0.3, 12.0).grade], [Grade::Good; 2], "a drift");
    }

    #[test]
    fn wrong_units_and_lenses_are_named_with_the_likely_value() {
        let against = |scale, is_telling| Facts {
            truth: Some(Truth { scale, is_telling, ate_m: 0.0, spread_m: 1.0 }),
            ..good()
        };
        check(
            &against(5.02, true),
            Grade::Failed,
            &["5.02 times too small", "units_per_metre = 1000 is wrong, about 199 is"],
        );
        check(&against(0.21, true), Grade::Failed, &["4.76 times too large", "5000 is likely"]);
        check(&against(5.0, false), Grade::Good, &[]);
        check(&against(1.2, true), Grade::Good, &[]);
        let refined = |to| Facts { refined_focal_px: Some([500.0, to]), ..good() };
        check(&refined(560.0), Grade::Doubtful, &["560 px better than the camera's 500 px (+12 %)"]);
        check(&refined(510.0), Grade::Good, &[]);
        let doubt = Facts { source_doubts: vec!["median depth is 5.5 m".to_owned()], ..good() };
        check(&doubt, Grade::Doubtful, &["median depth is 5.5 m", "--camera"]);
    }
}
