//! The table of all services: how many may connect, how much is queued, what a late reader gets.
#![cfg_attr(
    not(test),
    expect(
        clippy::arithmetic_side_effects,
        reason = "sizes of checked settings and of a checked camera, 32 bits each"
    )
)]

use tessera_messages::{
    CameraFrame, Element, FrameHeader, FrameShape, MAX_FEATURES, Message, Stage, SurfaceHeader,
    vertices_of_features,
};
use tessera_surface::{Grid, Vertex};

/// Bytes that iceoryx2 puts before each payload, rounded up.
const CHUNK_OVERHEAD: u64 = 256;

/// What the sizes of the services follow from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Image size.
    pub frame: FrameShape,
    /// Shape of the surfaces.
    pub grid: Grid,
    /// Frames under way at most, W.
    pub window: u32,
    /// Surfaces of past frames that the aligner reads besides the new one.
    pub recent: u32,
    /// Frames that the sensor prepares ahead of the window.
    pub ahead: u32,
    /// Newest wins: short queues, nothing comes again.
    pub live: bool,
    /// Frames come from a program that is none of ours.
    pub external: bool,
}

/// One row of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Service {
    /// Name of the service.
    pub name: &'static str,
    /// Processes that may write: one, its dead twin, and one more where the table says so.
    pub publishers: usize,
    /// Processes that may read.
    pub subscribers: usize,
    /// Messages queued for each reader; the oldest gives way.
    pub buffer: usize,
    /// Messages that a reader may hold.
    pub borrowed: usize,
    /// Messages that a late reader gets from a living writer.
    pub history: usize,
    /// Messages that a writer prepares at a time.
    pub loans: usize,
    /// For observers: the run goes on where one of them cannot be reached.
    pub is_observed: bool,
}

impl Layout {
    /// Frames: sensor to reconstruct.
    pub fn frames(&self) -> Service {
        let queue = self.queue();
        let history = if self.live { 1 } else { queue };
        let loans = self.ahead as usize + 1;
        Service { name: "frames", subscribers: 2, buffer: queue, history, loans, ..Service::NEWEST }
    }

    /// Surfaces: reconstruct to align. Live, a late reader gets that of the frame whose pose its predecessor had
    /// sent, the one before it and a newer one.
    pub fn surfaces(&self) -> Service {
        let (buffer, history) = if self.live { (4, 3) } else { (self.queue(), self.queue()) };
        let borrowed = self.recent as usize + self.window as usize + 2;
        Service { name: "surfaces", subscribers: 2, buffer, borrowed, history, ..Service::NEWEST }
    }

    /// Poses: align to any viewer.
    pub fn poses(&self) -> Service {
        Service { name: "poses", buffer: 16, ..Service::OBSERVED }
    }

    /// Flow: align to sensor and reconstruct; only the newest counts.
    pub fn flow(&self) -> Service {
        Service { name: "flow", borrowed: 1, ..Service::NEWEST }
    }

    /// Beats: all stages to the supervisor and to `status`.
    pub fn beats(&self) -> Service {
        Service { name: "beats", publishers: 12, buffer: 16, ..Service::OBSERVED }
    }

    /// Times of the steps of each stage, to any viewer.
    pub fn stage_times(&self) -> Service {
        Service { name: "stage_times", publishers: 12, buffer: 8, ..Service::OBSERVED }
    }

    /// Images of a camera's own program: from it to the sensor. Two epochs may be under way; places
    /// for the publisher, two dead ones and the next, and for the sensor, its dead twin and the
    /// command that waits for the first image.
    pub fn camera(&self) -> Service {
        let buffer = 2 * self.window as usize;
        let newest = Service::NEWEST;
        Service { name: "camera", publishers: 4, subscribers: 3, buffer, history: 0, loans: 2, ..newest }
    }

    /// What a camera's own program is told; only the newest counts. A program may hold what it has
    /// while it takes the next.
    pub fn camera_flow(&self) -> Service {
        Service { name: "camera_flow", publishers: 3, ..Service::NEWEST }
    }

    /// Vertices of a surface message at most: the grid, and room for features.
    pub fn surface_len(&self) -> usize {
        self.grid.len() + vertices_of_features(MAX_FEATURES)
    }

    /// Name of the event that wakes a stage.
    pub(crate) fn event_name(stage: Stage) -> String {
        format!("wake/{}", stage.name())
    }

    /// Lossless: what two epochs may have under way; the window of each is W.
    fn queue(&self) -> usize {
        if self.live { 2 } else { 2 * self.window as usize }
    }

    /// Bytes of shared memory that the data segments take when every chunk is in use.
    pub fn shared_memory_bytes(&self) -> u64 {
        let frame = size_of::<FrameHeader>() + self.frame.payload_len() * size_of::<u16>();
        let surface = size_of::<SurfaceHeader>() + self.surface_len() * size_of::<Vertex>();
        // Poses, flow, beats, times, events and the administration of all services.
        const SMALL: u64 = 2 << 20;
        let image = size_of::<CameraFrame>() + self.frame.payload_len() * size_of::<u16>();
        let camera = if self.external { self.camera().segment_bytes(image) } else { 0 };
        camera + self.frames().segment_bytes(frame) + self.surfaces().segment_bytes(surface) + SMALL
    }
}

impl Service {
    /// From one process to a few, of whom each has the newest message.
    const NEWEST: Self = Self {
        name: "",
        publishers: 2,
        subscribers: 6,
        buffer: 1,
        borrowed: 2,
        history: 1,
        loans: 1,
        is_observed: false,
    };
    /// To anyone.
    const OBSERVED: Self = Self { subscribers: 8, is_observed: true, ..Self::NEWEST };

    /// Bytes of one writer's data segment: a chunk for everything that can be held at once.
    fn segment_bytes(&self, payload_bytes: usize) -> u64 {
        let chunks = self.subscribers * (self.buffer + self.borrowed) + self.history + self.loans + 1;
        chunks as u64 * (payload_bytes as u64 + CHUNK_OVERHEAD)
    }
}

/// Full type of a slice service, for error messages.
pub(crate) fn slice_type<H: Message, E: Element>() -> String {
    format!("[{}] with {}", E::NAME, H::NAME)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_window_sets_the_memory() {
        let layout = |window| Layout {
            frame: FrameShape { width: 640, height: 480 },
            grid: Grid { width: 160, height: 120, step: 4 },
            window,
            recent: 10,
            ahead: 3,
            live: false,
            external: false,
        };
        let mb = |window| layout(window).shared_memory_bytes() >> 20;
        assert!(mb(4) < 110 && mb(1) < 64, "{} {}", mb(4), mb(1));
        assert!(mb(1) < mb(2) && mb(2) < mb(8));
        let external = Layout { external: true, ..layout(4) }.shared_memory_bytes() >> 20;
        assert!(external > mb(4) + 30, "{external}");
    }
}
