//! Frames whose images are exported: which, where they were taken, and their images as files.

use crate::seen_from_colour::SeenFromColour;
use crate::straight::Straightened;
use rayon::prelude::*;
use std::path::Path;
use tessera_geometry::{Camera, Pose, exp, log};
use tessera_outputs::{Replay, ToolError, write_file};
use tessera_settings::Settings;
use tessera_slam::{ColourModel, State};
use tessera_sources::{FrameBuffers, Source, SourceError, TakenColour, open};
use tessera_stage::RunFile;

/// Folder of colour images, and that of depth images.
pub(crate) const IMAGES: &str = "images";
pub(crate) const DEPTH: &str = "depth";

/// Images that were written, all of one pinhole.
pub(crate) struct ImageViews {
    /// Its middle of the first pixel is at 0.
    pub camera: Camera,
    pub views: Vec<ImageView>,
    /// Frames that were left out, since an image is missing or broken.
    pub n_left_out: usize,
}

/// One image.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ImageView {
    pub stamp_nanos: i64,
    /// In the folder of colour images.
    pub name: String,
    /// In the folder of depth images.
    pub depth_name: Option<String>,
    pub world_from_camera: Pose,
}

/// A frame to be exported.
#[derive(Clone, Copy, Debug, PartialEq)]
struct ChosenFrame {
    index: u64,
    stamp_nanos: i64,
}

/// Keyframes of this run in the main component, or each `every`-th of its tracked frames.
fn choose(replay: &Replay, every: Option<u64>) -> Vec<ChosenFrame> {
    let main = replay.main_component();
    match every {
        None => {
            let own = replay.keyframes_of(main).filter(|(k, _)| k.id as usize >= replay.n_map_keyframes);
            own.map(|(k, _)| ChosenFrame { index: k.frame_index, stamp_nanos: k.stamp_nanos }).collect()
        }
        Some(every) => {
            let frames = replay.frames.iter();
            let tracked = frames.filter(|f| f.state == State::Tracking && replay.component(f) == main);
            let chosen = tracked.filter(|f| f.index % every.max(1) == 0);
            chosen.map(|f| ChosenFrame { index: f.index, stamp_nanos: f.stamp_nanos }).collect()
        }
    }
}

/// The pose at a time, between the rows before and after it.
fn pose_at(rows: &[(i64, Pose)], stamp_nanos: i64) -> Option<Pose> {
    let next = rows.partition_point(|(stamp, _)| *stamp < stamp_nanos).clamp(1, rows.len().max(2) - 1);
    let ((before, from), (after, to)) = (rows.get(next - 1)?, rows.get(next).or(rows.last())?);
    let span = after.saturating_sub(*before) as f64;
    let share =
        if span > 0.0 { (stamp_nanos.saturating_sub(*before) as f64 / span).clamp(0.0, 1.0) } else { 0.0 };
    Some(from * exp(&log(&(from.inverse() * to)).scaled(share)))
}

/// What images are made of.
struct ViewMaker<'a> {
    source: Box<dyn Source>,
    /// The camera of the frames, as the run refined it.
    camera: Camera,
    colour: ColourModel,
    rows: &'a [(i64, Pose)],
    folder: &'a Path,
    wants_depth: bool,
}

/// Writes the images of a run into a folder.
///
/// # Errors
/// The recording is not there, has no colour, or a file cannot be written.
pub(crate) fn write(
    folder: &Path,
    (replay, settings, run): (&Replay, &Settings, &RunFile),
    every: Option<u64>,
    wants_depth: bool,
) -> Result<ImageViews, ToolError> {
    let (spec, options) = settings.source();
    if settings.is_external() {
        return Err(ToolError::Input(format!(
            "{}: a camera's own program sent its frames, which a run does not keep: expected a run of a recording",
            run.name
        )));
    }
    let options = tessera_sources::SourceOptions { fps: run.fps, ..options };
    let source = open(&spec, &options)?;
    let camera = replay.refined().map_or(&run.camera, |refined| &refined.camera).clone();
    let colour = replay.colour(ColourModel::of_camera(&run.camera)).model;
    let rows = tessera_outputs::final_rows(replay);
    let maker = ViewMaker { source, camera, colour, rows: &rows, folder, wants_depth };
    let chosen = choose(replay, every);
    let Some(straight) = maker.straightened(&chosen)? else {
        return Err(ToolError::Input(format!(
            "{spec}: none of {} frames has a colour image: expected a recording with colour",
            chosen.len()
        )));
    };
    for sub in [IMAGES].into_iter().chain(wants_depth.then_some(DEPTH)) {
        let sub = folder.join(sub);
        std::fs::create_dir_all(&sub).map_err(|error| ToolError::write(&sub, error))?;
    }
    let views: Vec<Option<ImageView>> =
        chosen.par_iter().map(|frame| maker.view(frame, &straight)).collect::<Result<_, ToolError>>()?;
    let n_chosen = views.len();
    let views: Vec<ImageView> = views.into_iter().flatten().collect();
    Ok(ImageViews { camera: straight.colour.camera.clone(), n_left_out: n_chosen - views.len(), views })
}

/// The ways of colour and of depth to one pinhole.
struct StraightPair {
    colour: Straightened,
    depth: DepthWay,
    /// From the depth camera to the camera of colour.
    colour_from_depth: Pose,
}

/// How depth comes to what the camera of colour sees.
enum DepthWay {
    /// Pixel by pixel.
    OneCamera(Straightened),
    /// Point by point.
    TwoCameras(SeenFromColour),
}

/// A frame as it was read.
struct TakenFrame {
    depth_raw: Vec<u16>,
    colour: TakenColour,
}

impl ViewMaker<'_> {
    /// A frame with colour; `None` where an image is missing or broken.
    fn take(&self, frame: &ChosenFrame) -> Result<Option<TakenFrame>, ToolError> {
        let n = self.camera.width as usize * self.camera.height as usize;
        let (mut depth, mut rgb) = (vec![0; n], vec![0; 3 * n]);
        let mut buffers = FrameBuffers { depth: &mut depth, colour: &mut rgb };
        let (info, _) = self.source.read_what_is_there(frame.index, &mut buffers)?;
        if !info.has_colour {
            return Ok(None);
        }
        let colour = match self.source.colour_as_taken(frame.index) {
            Ok(Some(taken)) => taken,
            Ok(None) => {
                let camera = self.camera.clone();
                let camera = tessera_sources::ColourCamera { camera, colour_from_depth: Pose::identity() };
                TakenColour { camera, rgb, file: None }
            }
            Err(SourceError::Colour(_)) => return Ok(None),
            Err(error) => return Err(error.into()),
        };
        Ok(Some(TakenFrame { depth_raw: depth, colour }))
    }

    /// By the first frame with colour: all have the same camera.
    fn straightened(&self, chosen: &[ChosenFrame]) -> Result<Option<StraightPair>, ToolError> {
        for frame in chosen {
            let Some(taken) = self.take(frame)? else { continue };
            let tessera_sources::ColourCamera { camera, colour_from_depth } = taken.colour.camera;
            let ratio = self.colour.focal_ratio;
            let seen = Camera { fx: ratio * camera.fx, fy: ratio * camera.fy, ..camera };
            let colour = Straightened::of(&seen);
            let depth = match taken.colour.file.is_some() || colour_from_depth != Pose::identity() {
                true => {
                    let depth = SeenFromColour::new(&self.camera, &colour.camera, colour_from_depth);
                    DepthWay::TwoCameras(depth)
                }
                false => DepthWay::OneCamera(Straightened::to(&colour.camera, &self.camera)),
            };
            return Ok(Some(StraightPair { colour, depth, colour_from_depth }));
        }
        Ok(None)
    }

    /// Writes the images of a frame.
    fn view(&self, frame: &ChosenFrame, straight: &StraightPair) -> Result<Option<ImageView>, ToolError> {
        let Some(TakenFrame { depth_raw, colour }) = self.take(frame)? else { return Ok(None) };
        let stamp_nanos = frame.stamp_nanos.saturating_add((1e9 * self.colour.lag_s) as i64);
        let Some(world_from_depth) = pose_at(self.rows, stamp_nanos) else { return Ok(None) };
        let name = self.write_colour(frame.index, colour, &straight.colour)?;
        let depth_name = match self.wants_depth {
            true => Some(self.write_depth(frame.index, depth_raw, &straight.depth)?),
            false => None,
        };
        let world_from_camera = world_from_depth * straight.colour_from_depth.inverse();
        Ok(Some(ImageView { stamp_nanos: frame.stamp_nanos, name, depth_name, world_from_camera }))
    }

    /// A file that is as it should be is copied.
    fn write_colour(
        &self,
        index: u64,
        colour: TakenColour,
        straight: &Straightened,
    ) -> Result<String, ToolError> {
        let images = self.folder.join(IMAGES);
        let end = |file: &Path| Some(file.extension()?.to_str()?.to_lowercase());
        let copied =
            colour.file.filter(|_| straight.is_as_taken()).and_then(|file| Some((end(&file)?, file)));
        if let Some((end, file)) = copied.filter(|(end, _)| ["png", "jpg", "jpeg"].contains(&end.as_str())) {
            let name = format!("{index:06}.{end}");
            let to = images.join(&name);
            std::fs::copy(&file, &to).map_err(|error| ToolError::write(&to, error))?;
            return Ok(name);
        }
        let name = format!("{index:06}.png");
        let rgb = straight.colour(colour.rgb);
        write_png(&images.join(&name), &straight.camera, (png::ColorType::Rgb, png::BitDepth::Eight), &rgb)?;
        Ok(name)
    }

    /// Millimetres along the optical axis, 0 where nothing was measured.
    fn write_depth(&self, index: u64, depth_raw: Vec<u16>, way: &DepthWay) -> Result<String, ToolError> {
        let millimetres = |raw: &u16| {
            let depth_m = f64::from(*raw) / self.camera.units_per_metre + self.camera.depth_offset_m;
            if *raw == 0 || *raw == u16::MAX { 0 } else { (1000.0 * depth_m + 0.5) as u16 }
        };
        let (camera, depth_raw) = match way {
            DepthWay::OneCamera(straight) => (&straight.camera, straight.depth(depth_raw)),
            DepthWay::TwoCameras(seen) => (&seen.camera, seen.depth(&depth_raw)),
        };
        let depth_mm: Vec<u16> = depth_raw.iter().map(millimetres).collect();
        let bytes: Vec<u8> = depth_mm.iter().flat_map(|mm| mm.to_be_bytes()).collect();
        let name = format!("{index:06}.png");
        let kind = (png::ColorType::Grayscale, png::BitDepth::Sixteen);
        write_png(&self.folder.join(DEPTH).join(&name), camera, kind, &bytes)?;
        Ok(name)
    }
}

fn write_png(
    path: &Path,
    camera: &Camera,
    (colour, bits): (png::ColorType, png::BitDepth),
    bytes: &[u8],
) -> Result<(), ToolError> {
    write_file(path, |writer| {
        let mut encoder = png::Encoder::new(writer, camera.width, camera.height);
        encoder.set_color(colour);
        encoder.set_depth(bits);
        encoder.set_compression(png::Compression::Fast);
        encoder.write_header()?.write_image_data(bytes)?;
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_between_two_frames_is_that_of_steady_motion() {
        let rows = [(0, Pose::translation(0.0, 0.0, 0.0)), (100, Pose::translation(1.0, 0.0, 0.0))];
        let x = |stamp| pose_at(&rows, stamp).unwrap().translation.x;
        assert_eq!((x(-5), x(0), x(100), x(200)), (0.0, 0.0, 1.0, 1.0));
        assert!((x(25) - 0.25).abs() < 1e-12);
        assert_eq!(pose_at(&rows[..1], 7), Some(rows[0].1));
        assert_eq!(pose_at(&[], 7), None);
    }
}
