//! The services of a camera's own program; each image is checked before it is used.

use tessera_messages::{CameraFlow, CameraFrame, FrameShape, Kind};
use tessera_stage::{Pulse, StageContext, StageError, Standstill, monotonic_nanos};
use tessera_transport::{Link, Publisher, Received, SliceSubscriber};

/// Time between two lines of the log about what is refused.
const LOG_INTERVAL_NANOS: u64 = 1_000_000_000;

/// A checked image: a copy of its header, what it stands for, and the image in place.
pub(super) struct ExternalImage {
    pub(super) header: CameraFrame,
    pub(super) kind: Kind,
    pub(super) received: Received<CameraFrame, u16>,
}

/// The sensor's side of the public services.
pub(super) struct ExternalCamera {
    images: SliceSubscriber<CameraFrame, u16>,
    flow: Publisher<CameraFlow>,
    published: Option<CameraFlow>,
    shape: FrameShape,
    /// What a publisher that describes its camera must say; `None` where `--camera` decides.
    expected: Option<tessera_geometry::Camera>,
    timeout_nanos: u64,
    /// When the last usable image came, or the sensor began to wait.
    heard_at: u64,
    standstill: Standstill,
    refused: Refused,
}

/// What was refused since the last line of the log.
#[derive(Default)]
struct Refused {
    last: Option<String>,
    n: u64,
    logged_at: u64,
}

impl ExternalCamera {
    #[expect(clippy::cast_possible_truncation, reason = "the cast saturates")]
    pub(super) fn open(context: &StageContext, link: &Link) -> Result<Self, StageError> {
        let run = &context.settings.run;
        Ok(Self {
            images: link.camera_subscriber()?,
            flow: link.camera_flow_publisher()?,
            published: None,
            shape: context.layout.frame,
            expected: run.camera.is_empty().then(|| context.run.camera.clone()),
            timeout_nanos: (run.camera_timeout_s * 1e9) as u64,
            heard_at: monotonic_nanos(),
            standstill: Standstill::new(),
            refused: Refused::default(),
        })
    }

    /// The next image that can be used; others are counted and logged.
    pub(super) fn receive(&mut self, pulse: &mut Pulse) -> Result<Option<ExternalImage>, StageError> {
        while let Some(received) = self.images.receive()? {
            let header = received.header();
            match self.check(&header, received.payload().len()) {
                Ok(kind) => return Ok(Some(ExternalImage { header, kind, received })),
                Err(reason) => self.refuse(reason, pulse),
            }
        }
        Ok(None)
    }

    fn check(&self, header: &CameraFrame, len: usize) -> Result<Kind, String> {
        let kind = header.validate(self.shape).map_err(|refusal| refusal.to_string())?;
        if kind == Kind::End {
            return Ok(kind);
        }
        header.check_payload(self.shape, len).map_err(|refusal| refusal.to_string())?;
        let described = header.camera().map_err(|e| format!("frame {}: {e}", header.index))?;
        match (&self.expected, &described) {
            (Some(expected), Some(camera)) if expected != camera => Err(format!(
                "frame {}: the camera is {camera:?}, expected {expected:?} as the run began with",
                header.index
            )),
            _ => Ok(kind),
        }
    }

    /// Counts an image that cannot be used, and logs it at most once a second.
    pub(super) fn refuse(&mut self, reason: String, pulse: &mut Pulse) {
        pulse.beat.refused = pulse.beat.refused.saturating_add(1);
        let now = monotonic_nanos();
        let refused = &mut self.refused;
        refused.n = refused.n.saturating_add(1);
        if now.saturating_sub(refused.logged_at) >= LOG_INTERVAL_NANOS {
            tracing::warn!("refused {} of the camera's images, the last: {reason}", refused.n);
            (refused.n, refused.logged_at) = (0, now);
        }
        refused.last = Some(reason);
    }

    /// Notes that a usable image came.
    pub(super) fn note_usable(&mut self) {
        self.heard_at = monotonic_nanos();
        self.refused.last = None;
    }

    /// Ends the run where nothing usable came for too long while `awaited` was wanted; time in
    /// which nothing was wanted does not count, nor does time in which this machine slept.
    pub(super) fn check_silence(&mut self, awaited: u64, is_wanted: bool) -> Result<(), StageError> {
        let now = monotonic_nanos();
        self.heard_at = self.heard_at.saturating_add(self.standstill.look());
        if !is_wanted {
            self.heard_at = now;
        }
        if now.saturating_sub(self.heard_at) < self.timeout_nanos {
            return Ok(());
        }
        let why = self.refused.last.as_ref().map_or_else(
            || "its program is not there or sends nothing".to_owned(),
            |reason| format!("what it sends is refused: {reason}"),
        );
        Err(StageError::Input(format!(
            "the camera sent nothing usable for {} s (run.camera_timeout_s), frame {awaited} is awaited: {why}",
            self.timeout_nanos as f64 * 1e-9
        )))
    }

    /// Publishes what is needed to the camera's program, where that has changed; late subscribers
    /// get it too.
    pub(super) fn publish_flow(&mut self, flow: CameraFlow) -> Result<(), StageError> {
        if self.published != Some(flow) {
            self.flow.send(flow)?;
            self.published = Some(flow);
        } else {
            self.flow.update()?;
        }
        Ok(())
    }

    /// Publishes that the run is done.
    pub(super) fn publish_finished(&mut self) -> Result<(), StageError> {
        let flow = self.published.unwrap_or_default();
        self.publish_flow(CameraFlow { finished: 1, ..flow })
    }
}
