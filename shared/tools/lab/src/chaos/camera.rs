//! A camera's own program beside a run under faults: a guest of the public services, in a thread, which goes
//! on whatever becomes of the run.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tessera_geometry::Camera;
use tessera_messages::{CameraFlow, CameraFrame, FrameShape};
use tessera_outputs::ToolError;
use tessera_sources::{FrameBuffers, Source, SourceOptions, SourceSpec};
use tessera_transport::{Guest, RunIdentity, SlicePublisher, Subscriber, living_runs};

/// Time between two looks for the run, and between two messages that the camera has ended.
const LOOK: Duration = Duration::from_millis(10);
/// Time between two looks whether the run has other services.
const LOOK_AGAIN: Duration = Duration::from_millis(100);

/// What the camera sees.
#[derive(Clone, Debug)]
pub(super) struct CameraView {
    /// A recording or a simulated world.
    pub(super) source: String,
    /// As `--camera` has it.
    pub(super) camera: Option<String>,
    /// Images at most.
    pub(super) frames: Option<u64>,
    /// Each image is sent once, at its time; else all are kept and sent again on request.
    pub(super) is_live: bool,
}

impl CameraView {
    fn open(&self) -> Result<Box<dyn Source>, ToolError> {
        let (camera, frames) = (self.camera.clone(), self.frames);
        let options = SourceOptions { camera, frames, ..SourceOptions::default() };
        tessera_sources::open(&SourceSpec::parse(&self.source), &options)
            .map_err(|error| ToolError::Input(error.to_string()))
    }
}

/// A camera that sends until it is dropped.
#[derive(Debug)]
pub(super) struct CameraProgram {
    is_over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl CameraProgram {
    /// Starts the camera of the run with this name, which may begin later.
    ///
    /// # Errors
    /// Where the source cannot be opened.
    pub(super) fn start(view: &CameraView, run: &str) -> Result<Self, ToolError> {
        let source = view.open()?;
        let is_over = Arc::new(AtomicBool::new(false));
        let mut program = Program {
            source,
            run: run.into(),
            is_live: view.is_live,
            is_over: Arc::clone(&is_over),
            began: None,
            looked: None,
        };
        let thread = std::thread::spawn(move || program.run_on());
        Ok(Self { is_over, thread: Some(thread) })
    }
}

impl Drop for CameraProgram {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // A camera that has failed sends nothing, which the run's journal shows.
            let _ = thread.join();
        }
    }
}

struct Program {
    source: Box<dyn Source>,
    run: String,
    is_live: bool,
    is_over: Arc<AtomicBool>,
    /// When the first image was due.
    began: Option<Instant>,
    /// When the registry was looked at.
    looked: Option<Instant>,
}

/// Services of the run as it is now.
struct Services {
    identity: RunIdentity,
    frames: SlicePublisher<CameraFrame, u16>,
    flows: Subscriber<CameraFlow>,
    /// Held as long as the ports are.
    _guest: Guest,
}

impl Program {
    /// Sends until it is over; where the run has new services, by those.
    fn run_on(&mut self) {
        let (mut services, mut next, mut flow) = (None, 0, CameraFlow::default());
        while !self.is_over.load(Ordering::Relaxed) {
            let held = self.services(services.take());
            let Some(held) = held else {
                std::thread::sleep(LOOK);
                continue;
            };
            let before = flow;
            flow = held.flows.newest().ok().flatten().unwrap_or(flow);
            if !self.is_live && flow.epoch != before.epoch {
                next = flow.send_from;
            }
            next = self.send(&held, &flow, next);
            services = Some(held);
        }
    }

    /// Sends the next image where it is due, or that there is none; answers which one comes then.
    fn send(&mut self, services: &Services, flow: &CameraFlow, next: u64) -> u64 {
        let n = self.source.n_frames().unwrap_or(u64::MAX);
        if next >= n {
            let is_wanted = self.is_live || flow.send_below > n;
            if is_wanted {
                // A message that does not arrive comes again.
                let _ = self.publish(&services.frames, n, 1);
            }
            std::thread::sleep(LOOK);
            return n;
        }
        let is_due = if self.is_live { self.is_due(next) } else { next < flow.send_below };
        if is_due && self.publish(&services.frames, next, 0).is_some() {
            return next.saturating_add(1);
        }
        std::thread::sleep(Duration::from_millis(1));
        next
    }

    fn is_due(&mut self, index: u64) -> bool {
        let stamp = |index| self.source.stamp_nanos(index).unwrap_or_default();
        let after = stamp(index).saturating_sub(stamp(0));
        let began = *self.began.get_or_insert_with(Instant::now);
        began.elapsed() >= Duration::from_nanos(u64::try_from(after).unwrap_or_default())
    }

    fn publish(&self, to: &SlicePublisher<CameraFrame, u16>, index: u64, kind: u32) -> Option<()> {
        let camera = self.source.camera();
        let shape = FrameShape { width: camera.width, height: camera.height };
        let mut header = CameraFrame {
            session: std::process::id().into(),
            index,
            kind,
            ring_frames: if self.is_live { 0 } else { u32::MAX },
            ..CameraFrame::of_camera(camera)
        };
        let len = if kind == 1 { 1 } else { shape.payload_len() };
        let mut loan = to.loan(len).ok()?;
        if kind == 0 {
            let (depth, colour) = shape.split_mut(loan.payload_mut())?;
            let info = self.source.read(index, &mut FrameBuffers { depth, colour }).ok()?;
            (header.stamp_nanos, header.has_colour) = (info.stamp_nanos, info.has_colour.into());
        }
        *loan.header_mut() = header;
        loan.send().ok()
    }

    /// The services of the run, where it is there; those held, where they are still its.
    fn services(&mut self, held: Option<Services>) -> Option<Services> {
        if held.is_some() && self.looked.is_some_and(|looked| looked.elapsed() < LOOK_AGAIN) {
            return held;
        }
        self.looked = Some(Instant::now());
        let run = living_runs().ok()?.into_iter().find(|run| run.name == self.run)?;
        if let Some(held) = held.filter(|held| held.identity == run.identity) {
            return Some(held);
        }
        let guest = Guest::open(&run.identity, "camera").ok()?;
        let Camera { width, height, .. } = *self.source.camera();
        let frames = guest.camera_publisher(FrameShape { width, height }).ok()??;
        let flows = guest.camera_flow_subscriber().ok()??;
        Some(Services { identity: run.identity, frames, flows, _guest: guest })
    }
}
