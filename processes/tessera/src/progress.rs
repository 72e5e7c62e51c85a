//! Progress of a run: one bar on a terminal, plain lines elsewhere.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::{IsTerminal, Write};
use std::time::Duration;
use tessera_supervisor::{MapCounts, Progress};

/// Time between two plain lines.
const LINE_INTERVAL: Duration = Duration::from_secs(2);

/// Shows how far a run is, on standard error.
pub(crate) enum ProgressView {
    /// Nothing is shown.
    Quiet,
    /// One line that is drawn again and again.
    Bar(ProgressBar),
    /// A line now and then.
    Lines {
        /// When the next is due, since the start.
        due: Duration,
    },
}

impl ProgressView {
    /// The view that fits: nothing if asked for, a bar on a terminal, lines elsewhere.
    pub(crate) fn new(is_quiet: bool) -> Self {
        if is_quiet {
            return Self::Quiet;
        }
        if !std::io::stderr().is_terminal() {
            return Self::Lines { due: LINE_INTERVAL };
        }
        Self::Bar(work_bar(false, None, "{bar:20} {wide_msg}"))
    }

    /// Shows the present state.
    pub(crate) fn tell(&mut self, progress: &Progress) {
        match self {
            Self::Quiet => {}
            Self::Bar(bar) => {
                if let Some(n_frames) = progress.n_frames {
                    bar.set_length(n_frames);
                }
                bar.set_position(progress.frames);
                bar.set_message(words(progress));
            }
            Self::Lines { due } => {
                if progress.elapsed >= *due {
                    *due = progress.elapsed + LINE_INTERVAL;
                    // A reader that went away is no failure.
                    let _ = writeln!(std::io::stderr().lock(), "{}", words(progress));
                }
            }
        }
    }

    /// Takes the bar away: the summary says the rest.
    pub(crate) fn end(self) {
        if let Self::Bar(bar) = self {
            bar.finish_and_clear();
        }
    }
}

/// A bar for work that a command does itself, on standard error; hidden where nothing is to be
/// said, and where no person looks. It has no colours: nothing to switch off for `NO_COLOR`.
pub(crate) fn work_bar(is_quiet: bool, total: Option<u64>, template: &str) -> ProgressBar {
    if is_quiet || !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::with_draw_target(total, ProgressDrawTarget::stderr_with_hz(10));
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style.progress_chars("=> "));
    }
    bar
}

/// The state in a few words, short enough for 80 columns beside the bar.
fn words(progress: &Progress) -> String {
    let Progress { frames, map, .. } = progress;
    let MapCounts { keyframes, loops, left_out } = map;
    let of = progress.n_frames.map_or(String::new(), |n| format!("/{n}"));
    let seconds = progress.elapsed.as_secs_f64();
    let rate = if seconds > 0.0 { *frames as f64 / seconds } else { 0.0 };
    let mut text = format!("{frames}{of} at {rate:.0}/s, {keyframes} keyframes, {loops} loops");
    // As the journal has them, and so the summary: what each stage counts by itself overlaps.
    if *left_out > 0 {
        text.push_str(&format!(", {left_out} drops"));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_messages::Stage;
    use tessera_supervisor::Counters;

    #[test]
    fn the_words_fit_beside_the_bar() {
        let dropped = Counters { dropped: 1234, ..Counters::default() };
        let progress = Progress {
            frames: 1200,
            n_frames: Some(13600),
            // What each stage counts overlaps: the journal's count is told.
            map: MapCounts { keyframes: 120, loops: 11, left_out: 2467 },
            stages: [(Stage::Align, dropped), (Stage::Reconstruct, dropped)].into(),
            elapsed: Duration::from_millis(1500),
        };
        let text = words(&progress);
        assert_eq!(text, "1200/13600 at 800/s, 120 keyframes, 11 loops, 2467 drops");
        assert!(text.len() + 21 <= 80);
    }
}
