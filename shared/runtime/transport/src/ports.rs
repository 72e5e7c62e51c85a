//! The ports of a run by name: who writes and who reads what.

use crate::error::TransportError;
use crate::link::Link;
use crate::messages::{Publisher, Subscriber};
use crate::slices::{SlicePublisher, SliceSubscriber};
use tessera_messages::{
    Beat, CameraFlow, CameraFrame, Flow, FrameHeader, PoseMessage, StageTimes, SurfaceHeader,
};
use tessera_surface::Vertex;

impl Link {
    /// Writes frames.
    ///
    /// # Errors
    /// Where the service cannot be opened; the same for all functions below.
    pub fn frame_publisher(&self) -> Result<SlicePublisher<FrameHeader, u16>, TransportError> {
        self.slice_publisher(&self.layout.frames(), self.layout.frame.payload_len())
    }

    /// Reads frames.
    ///
    /// # Errors
    /// As above.
    pub fn frame_subscriber(&self) -> Result<SliceSubscriber<FrameHeader, u16>, TransportError> {
        self.slice_subscriber(&self.layout.frames())
    }

    /// Writes surfaces.
    ///
    /// # Errors
    /// As above.
    pub fn surface_publisher(&self) -> Result<SlicePublisher<SurfaceHeader, Vertex>, TransportError> {
        self.slice_publisher(&self.layout.surfaces(), self.layout.surface_len())
    }

    /// Reads surfaces.
    ///
    /// # Errors
    /// As above.
    pub fn surface_subscriber(&self) -> Result<SliceSubscriber<SurfaceHeader, Vertex>, TransportError> {
        self.slice_subscriber(&self.layout.surfaces())
    }

    /// Writes poses.
    ///
    /// # Errors
    /// As above.
    pub fn pose_publisher(&self) -> Result<Publisher<PoseMessage>, TransportError> {
        self.publisher(&self.layout.poses())
    }

    /// Reads poses.
    ///
    /// # Errors
    /// As above.
    pub fn pose_subscriber(&self) -> Result<Subscriber<PoseMessage>, TransportError> {
        self.subscriber(&self.layout.poses())
    }

    /// Writes the flow.
    ///
    /// # Errors
    /// As above.
    pub fn flow_publisher(&self) -> Result<Publisher<Flow>, TransportError> {
        self.publisher(&self.layout.flow())
    }

    /// Reads the flow.
    ///
    /// # Errors
    /// As above.
    pub fn flow_subscriber(&self) -> Result<Subscriber<Flow>, TransportError> {
        self.subscriber(&self.layout.flow())
    }

    /// Reads the images of a camera's own program.
    ///
    /// # Errors
    /// As above.
    pub fn camera_subscriber(&self) -> Result<SliceSubscriber<CameraFrame, u16>, TransportError> {
        self.slice_subscriber(&self.layout.camera())
    }

    /// Tells a camera's own program what is needed.
    ///
    /// # Errors
    /// As above.
    pub fn camera_flow_publisher(&self) -> Result<Publisher<CameraFlow>, TransportError> {
        self.publisher(&self.layout.camera_flow())
    }

    /// Writes images as a camera's own program does.
    ///
    /// # Errors
    /// As above.
    pub fn camera_publisher(&self) -> Result<SlicePublisher<CameraFrame, u16>, TransportError> {
        self.slice_publisher(&self.layout.camera(), self.layout.frame.payload_len())
    }

    /// Reads what a camera's own program is told.
    ///
    /// # Errors
    /// As above.
    pub fn camera_flow_subscriber(&self) -> Result<Subscriber<CameraFlow>, TransportError> {
        self.subscriber(&self.layout.camera_flow())
    }

    /// Writes beats.
    ///
    /// # Errors
    /// As above.
    pub fn beat_publisher(&self) -> Result<Publisher<Beat>, TransportError> {
        self.publisher(&self.layout.beats())
    }

    /// Reads beats.
    ///
    /// # Errors
    /// As above.
    pub fn beat_subscriber(&self) -> Result<Subscriber<Beat>, TransportError> {
        self.subscriber(&self.layout.beats())
    }

    /// Writes where a stage's time goes.
    ///
    /// # Errors
    /// As above.
    pub fn stage_times_publisher(&self) -> Result<Publisher<StageTimes>, TransportError> {
        self.publisher(&self.layout.stage_times())
    }

    /// Reads where the stages' time goes.
    ///
    /// # Errors
    /// As above.
    pub fn stage_times_subscriber(&self) -> Result<Subscriber<StageTimes>, TransportError> {
        self.subscriber(&self.layout.stage_times())
    }
}
