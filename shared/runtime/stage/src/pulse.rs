//! Signs of life: what a stage is doing and has done, for the supervisor and for `status`.
#![cfg_attr(
    not(test),
    expect(clippy::arithmetic_side_effects, reason = "counts of 64 bits, each of one process")
)]

use crate::clock::{cpu_nanos, monotonic_nanos};
use crate::context::StageContext;
use crate::notify::SystemdNotifier;
use crate::stopwatch::{Distributions, Stopwatch};
use crate::tracer::{TraceEvent, Tracer};
use hdrhistogram::Histogram;
use std::io::Write;
use std::sync::Arc;
use tessera_messages::{Beat, BeatState, Latency, Phase, Stage, StageTimes, WaitingOn};
use tessera_numerics::{Step, Steps};
use tessera_transport::{Link, Publisher, TransportError};

/// Time between beats, nanoseconds, unless the state changes for good.
const INTERVAL_NANOS: u64 = 100_000_000;
/// Beats between two words on where the time goes.
const TIMES_EVERY: u64 = 5;
/// Beats between two looks at the memory in use.
const MEMORY_EVERY: u64 = 10;

/// Log line of a stage that can work.
pub const READY: &str = "ready";
/// Log line of the first new frame, surface or pose that a stage has sent in its life.
pub const FIRST_OUTPUT: &str = "first output";

/// Counts, and sends a beat now and then.
#[derive(Debug)]
pub struct Pulse {
    publisher: Publisher<Beat>,
    times_publisher: Publisher<StageTimes>,
    stopwatch: Arc<Stopwatch>,
    distributions: Distributions,
    waiting_since: Option<u64>,
    /// Counters to raise; the rest is filled in when a beat is sent.
    pub beat: Beat,
    latency: Histogram<u64>,
    end_to_end: Histogram<u64>,
    last_sent: u64,
    n_sent: u64,
    notifier: SystemdNotifier,
    has_output: bool,
    tracer: Option<Tracer>,
    /// Whether standard output is a pipe to the supervisor, for the last beat alone.
    is_supervised: bool,
}

impl Pulse {
    /// Opens the service of beats and sends the first one.
    ///
    /// # Errors
    /// Where the service cannot be opened.
    pub fn start(link: &Link, stage: Stage, context: &StageContext) -> Result<Self, TransportError> {
        let mut beat = Beat {
            stage: stage.number(),
            pid: std::process::id(),
            state: BeatState::Starting as u32,
            ..Beat::default()
        };
        let version = env!("CARGO_PKG_VERSION").as_bytes();
        beat.version.iter_mut().zip(version).for_each(|(to, from)| *to = *from);
        let histogram = || {
            // Up to 1000 s, which is more than anything may take; two digits.
            Histogram::new_with_bounds(1, 1_000_000_000_000, 2)
                .map_err(|e| TransportError::Open { what: "a histogram".into(), reason: e.to_string() })
        };
        let mut pulse = Self {
            publisher: link.beat_publisher()?,
            times_publisher: link.stage_times_publisher()?,
            stopwatch: context.stopwatch.clone(),
            distributions: Distributions::default(),
            waiting_since: None,
            beat,
            latency: histogram()?,
            end_to_end: histogram()?,
            last_sent: 0,
            n_sent: 0,
            notifier: SystemdNotifier::from_environment(),
            has_output: false,
            tracer: Tracer::from_environment(stage.name()),
            is_supervised: context.is_supervised,
        };
        pulse.notifier.ready();
        pulse.send();
        Ok(pulse)
    }

    /// Everything is open and read back: work can come. `next` is the frame that is expected.
    pub fn ready(&mut self, next: Option<u64>) {
        tracing::info!(at_nanos = monotonic_nanos(), frame = next, "{READY}");
    }

    /// Something new went out; the first of this life is told to the log.
    pub fn output(&mut self, index: u64) {
        if !std::mem::replace(&mut self.has_output, true) {
            tracing::info!(at_nanos = monotonic_nanos(), frame = index, "{FIRST_OUTPUT}");
        }
    }

    /// Nothing to do until something comes.
    pub fn waiting(&mut self, on: WaitingOn) {
        self.beat.state = BeatState::Waiting as u32;
        self.beat.waiting_on = on as u32;
        self.waiting_since.get_or_insert_with(monotonic_nanos);
        self.send_if_due();
    }

    /// Work on this frame (or request) begins.
    pub fn working(&mut self, index: u64) {
        self.beat.state = BeatState::Working as u32;
        self.beat.waiting_on = WaitingOn::Nothing as u32;
        self.beat.index = index;
        if let Some(since) = self.waiting_since.take() {
            self.distributions.phase(Phase::Waiting, monotonic_nanos().saturating_sub(since));
        }
        // Sent each time, so that a frame that kills its stage is known by name.
        self.beat.sequence += 1;
        let _ = self.publisher.send(self.beat);
        self.notifier.alive();
        if let Some(tracer) = &mut self.tracer {
            tracer.note(&TraceEvent::Begun { index, at: monotonic_nanos() });
            tracer.flush();
        }
    }

    /// Work goes on: an inner iteration is done.
    pub fn progress(&mut self) {
        self.beat.progress += 1;
        self.send_if_due();
    }

    /// A frame (or request) that was taken up at `began` was done at `ended`, times of the
    /// monotonic clock.
    pub fn done(&mut self, began: u64, ended: u64) {
        let nanos = ended.saturating_sub(began);
        self.beat.frames += 1;
        self.beat.progress += 1;
        // Recording resizes; saturating would clip to the first, tiny range.
        let _ = self.latency.record(nanos.max(1));
        self.distributions.frame(&self.stopwatch);
        self.beat.latency_counts.add(nanos);
        self.trace_done(began, ended);
        self.send_if_due();
    }

    /// A phase of the frame in hand took so long.
    pub fn phase(&mut self, phase: Phase, nanos: u64) {
        self.distributions.phase(phase, nanos);
        if matches!(phase, Phase::Computing | Phase::Publishing | Phase::Mapping) {
            let to = monotonic_nanos();
            self.trace_part(phase.name(), to.saturating_sub(nanos), to);
        }
    }

    /// A step of the frame in hand took so long from `began` on, measured elsewhere than by the
    /// stopwatch.
    pub fn step(&mut self, step: Step, began: u64, nanos: u64) {
        self.distributions.step(step, nanos);
        self.trace_part(step.name(), began, began.saturating_add(nanos));
    }

    fn trace_part(&mut self, name: &str, from: u64, to: u64) {
        if let Some(tracer) = &mut self.tracer {
            tracer.note(&TraceEvent::Part { index: self.beat.index, name: name.to_owned(), from, to });
        }
    }

    fn trace_done(&mut self, from: u64, to: u64) {
        if self.tracer.is_none() {
            return;
        }
        for span in self.stopwatch.take_spans() {
            self.trace_part(span.step.name(), span.began, span.ended);
        }
        let index = self.beat.index;
        if let Some(tracer) = &mut self.tracer {
            tracer.note(&TraceEvent::Done { index, from, to });
            tracer.flush();
        }
    }

    /// What the steps of the stage itself are announced to.
    pub fn steps(&self) -> Steps {
        self.stopwatch.steps()
    }

    /// A pose was published, `nanos` after its frame was in shared memory.
    pub fn published(&mut self, nanos: u64) {
        let _ = self.end_to_end.record(nanos.max(1));
        self.beat.end_to_end_counts.add(nanos);
    }

    /// The last beat: all counters final. It goes through the pipe too, for a life may be over before the supervisor
    /// has connected with its publisher.
    pub fn finish(&mut self) {
        self.beat.state = BeatState::Finished as u32;
        self.beat.waiting_on = WaitingOn::Nothing as u32;
        self.beat.peak_rss_bytes = peak_rss_bytes();
        self.send();
        if self.is_supervised {
            let mut pipe = std::io::stdout().lock();
            // Where it is closed there is no supervisor that could miss it.
            let _ = pipe.write_all(self.beat.as_bytes()).and_then(|()| pipe.flush());
        }
        self.notifier.stopping();
    }

    fn send_if_due(&mut self) {
        if monotonic_nanos().saturating_sub(self.last_sent) >= INTERVAL_NANOS {
            self.send();
        }
    }

    fn send(&mut self) {
        self.last_sent = monotonic_nanos();
        if self.n_sent.is_multiple_of(MEMORY_EVERY) {
            self.beat.peak_rss_bytes = peak_rss_bytes();
        }
        let is_last = self.beat.state == BeatState::Finished as u32;
        if is_last || self.n_sent % TIMES_EVERY == 1 {
            let rows = self.distributions.rows();
            let _ =
                self.times_publisher.send(StageTimes { stage: self.beat.stage, pid: self.beat.pid, rows });
        }
        self.n_sent += 1;
        self.beat.sequence += 1;
        self.beat.cpu_nanos = cpu_nanos();
        self.beat.latency = summary(&self.latency);
        self.beat.end_to_end = summary(&self.end_to_end);
        // A beat that cannot be sent is a beat that is missed: the supervisor sees to that.
        let _ = self.publisher.send(self.beat);
        self.notifier.alive();
    }
}

fn summary(histogram: &Histogram<u64>) -> Latency {
    Latency {
        p50: histogram.value_at_quantile(0.5),
        p99: histogram.value_at_quantile(0.99),
        max: histogram.max(),
    }
}

/// Highest resident set of this process so far.
fn peak_rss_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kilobytes = line.and_then(|rest| rest.trim().trim_end_matches("kB").trim().parse::<u64>().ok());
    kilobytes.unwrap_or(0) << 10
}
