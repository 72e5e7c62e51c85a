//! The reconstruct stage: a frame comes in, its surface goes out.
//!
//! It keeps nothing: a surface is a pure function of its frame, so a restart loses nothing but
//! time, and an index is never left out because it was seen in an earlier epoch.
#![forbid(unsafe_code)]

mod feed;

use feed::Feed;
use std::process::ExitCode;
use tessera_messages::{
    FrameHeader, Kind, Phase, Stage, SurfaceHeader, WaitingOn, vertices_of_features, write_features,
};
use tessera_numerics::Step;
use tessera_stage::{
    Delivery, IDLE, Outcome, Probe, Pulse, StageArgs, StageContext, StageError, monotonic_nanos, stage_main,
};
use tessera_surface::{Reconstructor, Vertex, WorkloadLevel};
use tessera_transport::{Loan, Received};

/// Runs the stage as a process.
pub fn main(args: &StageArgs) -> ExitCode {
    stage_main(Stage::Reconstruct, || run(args))
}

/// Runs the stage until the run is finished or it is told to stop.
///
/// # Errors
/// Where the run directory, the settings or the shared memory cannot be used.
pub fn run(args: &StageArgs) -> Result<Outcome, StageError> {
    let context = StageContext::open(Stage::Reconstruct, args)?;
    let [mut filtered, mut unfiltered] = reconstructors(&context)?;
    let steps = context.stopwatch.steps();
    let mut extractor = context.feature_extractor();
    let link = context.link(Stage::Reconstruct)?;
    let listener = link.listener(Stage::Reconstruct)?;
    let mut feed = Feed::open(&link, &context)?;
    let surfaces = link.surface_publisher()?;
    let align = link.notifier(Stage::Align)?;
    let mut pulse = Pulse::start(&link, Stage::Reconstruct, &context)?;
    context.kill_points.pass("opened", 0);
    pulse.ready(None);
    loop {
        if context.lifeline.is_cut() {
            pulse.finish();
            return Ok(Outcome::Stopped);
        }
        if feed.is_finished()? {
            pulse.finish();
            return Ok(Outcome::Finished);
        }
        let Some((header, kind, frame)) = feed.next(&mut pulse)? else {
            surfaces.update()?;
            pulse.waiting(WaitingOn::Frames);
            listener.wait(IDLE)?;
            continue;
        };
        pulse.working(header.index);
        context.kill_points.pass("received", header.index);
        let began = monotonic_nanos();
        pulse.phase(Phase::Transport, began.saturating_sub(header.times.frame_sent));
        let features = match (kind, header.payload(feed.shape, frame.payload())) {
            (Kind::Frame, Ok(payload)) => {
                steps.enter(Step::Features);
                extractor.extract(payload.colour)
            }
            _ => Vec::new(),
        };
        context.kill_points.pass("extracted", header.index);
        let n_vertices = context.layout.grid.len();
        let mut loan = surfaces.loan(n_vertices + vertices_of_features(features.len()))?;
        write_features(&mut loan.payload_mut()[n_vertices..], &features);
        let workload = feed.workload();
        let is_least = workload == WorkloadLevel::Least;
        let reconstructor = if is_least { &mut unfiltered } else { &mut filtered };
        *loan.header_mut() = surface_header(&header, reconstructor, workload, began);
        loan.header_mut().n_features = features.len() as u32;
        if kind == Kind::Frame
            && let Err(refusal) = fill(&mut loan, &header, &frame, reconstructor, &feed, context.probe)
        {
            tracing::warn!(frame = header.index, "refused: {refusal}");
            pulse.beat.refused += 1;
            continue;
        }
        context.kill_points.pass("computed", header.index);
        let computed = monotonic_nanos();
        pulse.phase(Phase::Computing, computed.saturating_sub(began));
        loan.header_mut().times.surface_sent = computed;
        if is_delivered(&mut loan, context.kill_points.deliver("computed", header.index)) {
            loan.send()?;
            align.notify();
        }
        context.kill_points.pass("sent", header.index);
        pulse.output(header.index);
        let now = monotonic_nanos();
        pulse.phase(Phase::Publishing, now.saturating_sub(computed));
        if kind == Kind::Frame { pulse.done(began, now) } else { pulse.progress() }
    }
}

/// What makes surfaces, and what makes them at the least workload.
fn reconstructors(context: &StageContext) -> Result<[Reconstructor; 2], StageError> {
    let settings = &context.settings.surface;
    let mut least = settings.clone();
    least.filter_rings = WorkloadLevel::Least.filter_rings(least.filter_rings);
    let of = |settings| {
        let mut reconstructor = Reconstructor::new(&context.run.camera, settings)
            .map_err(|e| StageError::Settings(e.to_string()))?;
        reconstructor.steps = context.stopwatch.steps();
        Ok::<_, StageError>(reconstructor)
    };
    Ok([of(settings)?, of(&least)?])
}

/// Whether a surface is sent; a fault on purpose changes it first.
fn is_delivered(loan: &mut Loan<SurfaceHeader, Vertex>, delivery: Delivery) -> bool {
    match delivery {
        Delivery::Corrupt => {
            loan.header_mut().kind = Kind::Frame.to_wire();
            loan.payload_mut()[0].position[0] = f32::NAN;
        }
        Delivery::Jumped => {
            let header = loan.header_mut();
            header.index = header.index.saturating_add(1 << 40);
        }
        _ => {}
    }
    delivery != Delivery::Dropped
}

fn surface_header(
    frame: &FrameHeader,
    reconstructor: &Reconstructor,
    workload: WorkloadLevel,
    began: u64,
) -> SurfaceHeader {
    let grid = reconstructor.grid();
    let mut times = frame.times;
    times.surface_began = began;
    SurfaceHeader {
        index: frame.index,
        epoch: frame.epoch,
        stamp_nanos: frame.stamp_nanos,
        dropped_before: frame.dropped_before,
        relocalise_from: frame.relocalise_from,
        width: grid.width as u32,
        height: grid.height as u32,
        step: grid.step as u32,
        kind: frame.kind,
        workload: workload.level() as u32,
        rotation: frame.rotation,
        up: frame.up,
        times,
        ..SurfaceHeader::default()
    }
}

/// The pure step, from shared memory into shared memory.
fn fill(
    loan: &mut Loan<SurfaceHeader, Vertex>,
    header: &FrameHeader,
    frame: &Received<FrameHeader, u16>,
    reconstructor: &mut Reconstructor,
    feed: &Feed,
    probe: Probe,
) -> Result<(), tessera_messages::Refusal> {
    let payload = header.payload(feed.shape, frame.payload())?;
    probe.log_place("depth", header.index, payload.depth);
    probe.log_place("colour", header.index, payload.colour.unwrap_or_default());
    let n_vertices = reconstructor.grid().len();
    let vertices = &mut loan.payload_mut()[..n_vertices];
    probe.log_place("the surface made", header.index, vertices);
    let stats = reconstructor.reconstruct(payload.depth, payload.colour, vertices);
    loan.header_mut().n_valid = stats.n_valid as u32;
    Ok(())
}
