//! The camera of the newest frame: its pose and frustum, its image, its surface.
//!
//! Image and surface come from the recording itself, by the frame's index: a run has no part in it.

use crate::error::ViewError;
use crate::scene::{log, points, transform};
use re_sdk::RecordingStream;
use re_sdk_types::archetypes::{EncodedImage, Pinhole, Points3D, ViewCoordinates};
use re_sdk_types::components::MediaType;
use std::time::{Duration, Instant};
use tessera_geometry::{Camera, Pose};
use tessera_settings::Settings;
use tessera_slam::FrameRecord;
use tessera_sources::{FrameBuffers, Source};
use tessera_surface::{Reconstructor, Vertex};

/// Quality of the JPEG images, 1 to 100.
const QUALITY: u8 = 80;
/// Points of the surface, at most.
const MOST_POINTS: usize = 20_000;
/// Radius of its points, metres.
const POINT_M: f32 = 0.003;
/// Distance from the camera to its image in the map, metres.
const FRUSTUM_M: f32 = 0.25;

/// Where images come from, or why there are none.
pub(crate) struct Pictures {
    source: Box<dyn Source>,
    reconstructor: Reconstructor,
    depth: Vec<u16>,
    colour: Vec<u8>,
    vertices: Vec<Vertex>,
    /// Least time between two images, by the frames' stamps and by the clock.
    interval: Duration,
    last: Option<(i64, Instant)>,
}

impl Pictures {
    /// Opens the recording of a run; an error says in words why there will be no images.
    pub(crate) fn open(settings: &Settings, images_per_s: f64) -> Result<Self, String> {
        if images_per_s <= 0.0 {
            return Err("none were asked for".to_owned());
        }
        let (spec, options) = settings.source();
        let source = tessera_sources::open(&spec, &options).map_err(|error| error.to_string())?;
        let reconstructor =
            Reconstructor::new(source.camera(), &settings.surface).map_err(|error| error.to_string())?;
        let n_pixels = source.camera().width as usize * source.camera().height as usize;
        Ok(Self {
            vertices: vec![Vertex::default(); reconstructor.grid().len()],
            reconstructor,
            depth: vec![0; n_pixels],
            colour: vec![0; 3 * n_pixels],
            interval: Duration::from_secs_f64(1.0 / images_per_s),
            last: None,
            source,
        })
    }

    /// Logs image and surface of a frame, unless it is too soon. Of a run that goes on the clock
    /// counts too: looking on must not take the processor from it.
    pub(crate) fn log(
        &mut self,
        recording: &RecordingStream,
        frame: &FrameRecord,
        is_going_on: bool,
    ) -> Result<(), ViewError> {
        if let Some((stamp_nanos, at)) = self.last {
            let sensor_time = frame.stamp_nanos.saturating_sub(stamp_nanos);
            let is_soon = i128::from(sensor_time) < self.interval.as_nanos() as i128;
            if is_soon || (is_going_on && at.elapsed() < self.interval) {
                return Ok(());
            }
        }
        // A recording that has changed is another one.
        if self.source.stamp_nanos(frame.index) != Some(frame.stamp_nanos) {
            return Ok(());
        }
        self.last = Some((frame.stamp_nanos, Instant::now()));
        let mut buffers = FrameBuffers { depth: &mut self.depth, colour: &mut self.colour };
        let info = self.source.read(frame.index, &mut buffers).map_err(ViewError::output)?;
        let colour = info.has_colour.then_some(self.colour.as_slice());
        if let Some(colour) = colour {
            let image = jpeg(self.source.camera(), colour)?;
            log(recording, "world/camera/image", &image)?;
        }
        self.reconstructor.reconstruct(&self.depth, colour, &mut self.vertices);
        let (positions, colours) = points(&self.vertices, MOST_POINTS);
        let surface = Points3D::new(positions).with_colors(colours).with_radii([POINT_M]);
        log(recording, "world/camera/surface", &surface)
    }
}

/// Logs what does not change: axes and frustum.
pub(crate) fn log_static(recording: &RecordingStream, camera: &Camera) -> Result<(), ViewError> {
    let axes = ViewCoordinates::RDF();
    recording.log_static("world", &axes).map_err(ViewError::output)?;
    let pinhole = Pinhole::from_focal_length_and_resolution(
        [camera.fx as f32, camera.fy as f32],
        [camera.width as f32, camera.height as f32],
    )
    .with_principal_point([camera.cx as f32, camera.cy as f32])
    .with_image_plane_distance(FRUSTUM_M);
    recording.log_static("world/camera/image", &pinhole).map_err(ViewError::output)
}

/// Logs where the camera is.
pub(crate) fn log_pose(recording: &RecordingStream, frame: &FrameRecord) -> Result<(), ViewError> {
    log(recording, "world/camera", &transform(&Pose::from(&frame.pose.world_from_camera)))
}

fn jpeg(camera: &Camera, colour: &[u8]) -> Result<EncodedImage, ViewError> {
    let mut bytes = Vec::new();
    let encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, QUALITY);
    image::ImageEncoder::write_image(
        encoder,
        colour,
        camera.width,
        camera.height,
        image::ColorType::Rgb8.into(),
    )
    .map_err(ViewError::output)?;
    Ok(EncodedImage::from_file_contents(bytes).with_media_type(MediaType::jpeg()))
}
