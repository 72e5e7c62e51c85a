//! Durations of each phase and each named step of a stage's work: always on, nearly free.
//!
//! The method announces its steps and the stopwatch looks at the clock: some 35 ns each, a
//! hundred times a frame. A histogram takes in one figure for each step and frame.

use crate::clock::monotonic_nanos;
use hdrhistogram::Histogram;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use tessera_messages::{Phase, StageTimes, TimeRow};
use tessera_numerics::{Observer, Step, Steps};

const N_STEPS: usize = Step::ALL.len();
const NO_STEP: usize = N_STEPS;
/// Longest time that is told apart, nanoseconds.
const LONGEST_NANOS: u64 = 100_000_000_000;

/// A named step that was under way from one time of the monotonic clock to another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StepSpan {
    /// The step.
    pub step: Step,
    /// Its beginning, nanoseconds.
    pub began: u64,
    /// Its end, nanoseconds.
    pub ended: u64,
}

/// Time spent in each step since it was last asked; one thread at a time announces steps.
#[derive(Debug)]
pub struct Stopwatch {
    current: AtomicUsize,
    since: AtomicU64,
    nanos: [AtomicU64; N_STEPS],
    /// Each span by itself, for a trace.
    spans: Option<Mutex<Vec<StepSpan>>>,
}

impl Stopwatch {
    /// A stopwatch at rest; it keeps each span where `with_spans`.
    pub fn new(with_spans: bool) -> Arc<Self> {
        Arc::new(Self {
            current: AtomicUsize::new(NO_STEP),
            since: AtomicU64::new(0),
            nanos: std::array::from_fn(|_| AtomicU64::new(0)),
            spans: with_spans.then(Mutex::default),
        })
    }

    /// What the method announces its steps to.
    pub fn steps(self: &Arc<Self>) -> Steps {
        Steps::heard_by(self.clone())
    }

    /// Nanoseconds in each step, by [`Step::number`], since this was last asked.
    pub fn take(&self) -> [u64; N_STEPS] {
        self.nanos.each_ref().map(|nanos| nanos.swap(0, Ordering::Relaxed))
    }

    /// The spans since this was last asked.
    pub fn take_spans(&self) -> Vec<StepSpan> {
        let Some(spans) = &self.spans else { return Vec::new() };
        std::mem::take(&mut *spans.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Observer for Stopwatch {
    fn enters(&self, step: Option<Step>) {
        let now = monotonic_nanos();
        // One thread at a time announces: loads and stores will do, where exchanging would lock a bus.
        let before = self.current.load(Ordering::Relaxed);
        self.current.store(step.map_or(NO_STEP, Step::number), Ordering::Relaxed);
        let began = self.since.load(Ordering::Relaxed);
        self.since.store(now, Ordering::Relaxed);
        let Some(nanos) = self.nanos.get(before) else { return };
        let sum = nanos.load(Ordering::Relaxed).saturating_add(now.saturating_sub(began));
        nanos.store(sum, Ordering::Relaxed);
        if let (Some(spans), Some(step)) = (&self.spans, Step::from_number(before)) {
            let span = StepSpan { step, began, ended: now };
            spans.lock().unwrap_or_else(PoisonError::into_inner).push(span);
        }
    }
}

/// A histogram up to [`LONGEST_NANOS`] with two digits.
fn histogram() -> Result<Histogram<u32>, hdrhistogram::CreationError> {
    Histogram::new_with_bounds(1, LONGEST_NANOS, 2)
}

/// One distribution with its sum.
#[derive(Clone, Debug)]
struct Distribution {
    histogram: Histogram<u32>,
    sum: u64,
}

/// Distributions of all phases and steps; those that never happen take no memory.
#[derive(Clone, Debug, Default)]
pub struct Distributions {
    rows: [Option<Box<Distribution>>; tessera_messages::TIME_ROWS],
}

impl Distributions {
    /// A phase of a frame took so long.
    pub fn phase(&mut self, phase: Phase, nanos: u64) {
        self.record(StageTimes::phase_row(phase), nanos);
    }

    /// A step of a frame took so long.
    pub fn step(&mut self, step: Step, nanos: u64) {
        self.record(StageTimes::step_row(step), nanos);
    }

    /// Takes in what a stopwatch has measured in one frame.
    pub fn frame(&mut self, stopwatch: &Stopwatch) {
        for (step, nanos) in Step::ALL.into_iter().zip(stopwatch.take()) {
            if nanos > 0 {
                self.step(step, nanos);
            }
        }
    }

    fn record(&mut self, row: usize, nanos: u64) {
        let Some(row) = self.rows.get_mut(row) else { return };
        if row.is_none() {
            *row = histogram().ok().map(|histogram| Box::new(Distribution { histogram, sum: 0 }));
        }
        if let Some(row) = row {
            row.histogram.saturating_record(nanos.clamp(1, LONGEST_NANOS));
            row.sum = row.sum.saturating_add(nanos);
        }
    }

    /// The rows as they are published.
    pub fn rows(&self) -> [TimeRow; tessera_messages::TIME_ROWS] {
        self.rows.each_ref().map(|row| row.as_ref().map_or(TimeRow::default(), |row| row.summary()))
    }
}

impl Distribution {
    fn summary(&self) -> TimeRow {
        let at = |quantile| self.histogram.value_at_quantile(quantile);
        let (n, max) = (self.histogram.len(), self.histogram.max());
        TimeRow { n, sum: self.sum, p50: at(0.5), p90: at(0.9), p99: at(0.99), max }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_goes_to_the_step_that_was_announced() {
        let stopwatch = Stopwatch::new(true);
        let steps = stopwatch.steps();
        steps.enter(Step::Search);
        let from = monotonic_nanos();
        while monotonic_nanos() < from + 2_000_000 {}
        steps.enter(Step::Solve);
        steps.leave();
        let taken = stopwatch.take();
        assert!(taken[Step::Search.number()] >= 2_000_000, "{taken:?}");
        assert!(taken[Step::Solve.number()] < taken[Step::Search.number()]);
        assert_eq!(taken.iter().filter(|nanos| **nanos > 0).count(), 2);
        let spans = stopwatch.take_spans();
        assert_eq!(spans.iter().map(|span| span.step).collect::<Vec<_>>(), [Step::Search, Step::Solve]);
        assert_eq!(spans[0].ended, spans[1].began);
        assert_eq!(stopwatch.take(), [0; N_STEPS]);
    }

    #[test]
    fn a_row_tells_its_distribution() {
        let mut distributions = Distributions::default();
        for k in 1..=100 {
            distributions.phase(Phase::Computing, k * 1_000_000);
        }
        distributions.step(Step::Mesh, 7);
        distributions.step(Step::Mesh, u64::MAX);
        let rows = distributions.rows();
        let row = rows[StageTimes::phase_row(Phase::Computing)];
        let near = |found: u64, ms: u64| found.abs_diff(ms * 1_000_000) <= ms * 10_000;
        assert!(near(row.p50, 50) && near(row.p90, 90) && near(row.p99, 99) && near(row.max, 100), "{row:?}");
        assert_eq!((row.n, row.sum), (100, 5_050_000_000));
        let mesh = rows[StageTimes::step_row(Step::Mesh)];
        assert_eq!((mesh.n, mesh.p50), (2, 7));
        assert_eq!(rows.iter().filter(|row| row.n > 0).count(), 2);
    }
}
