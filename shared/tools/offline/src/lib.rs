//! A whole sequence in one process: the pipeline's steps without the pipeline.
//!
//! The same pure steps as the processes, called one after the other, so the same bits come out.
//! For experiments (`tessera ablate`), examples and tests of the method.
#![forbid(unsafe_code)]

mod calibrate;
mod focal_of_features;
mod motion;
mod records;
mod smooth_surfaces;

pub use calibrate::{CalibrateError, CalibrateOptions, Calibrated, Pass, calibrate};
pub use focal_of_features::focal_of_features;
pub use records::Records;
pub use tessera_calibration::{Calibration, Estimate, HeldDirection, Parameter};

pub use tessera_evaluation::Trajectory;
use tessera_features::Extractor;
pub use tessera_features::Feature;
use tessera_geometry::PoseBits;
pub use tessera_geometry::{Camera, InertialRotation, Pose, UpDirection};
pub use tessera_numerics::SettingError;
pub use tessera_registration::RegistrationSettings;
pub use tessera_slam::{
    AlignRecord, ColourState, Correction, FrameRecord, KeyframeState, MappingSettings, RefinedCamera, State,
    Submaps,
};
use tessera_slam::{Context, FrameSurface, KeyframeSurfaces, MapRecord, Optimiser, Tracker, TrackerState};
use tessera_sources::{FrameBuffers, FrameInfo};
pub use tessera_sources::{Source, SourceError};
pub use tessera_surface::{Grid, SurfaceSettings, Vertex};
use tessera_surface::{Reconstructor, SurfaceView, WorkloadLevel, packed};

/// One frame as the sensor delivers it.
#[derive(Clone, Debug)]
pub struct RawFrame {
    /// Sensor time.
    pub stamp_nanos: i64,
    /// The camera's rotation since the first frame, where a gyroscope measured it.
    pub rotation: Option<InertialRotation>,
    /// The direction against gravity, where an accelerometer measured it.
    pub up: Option<UpDirection>,
    /// Raw depth, row by row.
    pub depth: Vec<u16>,
    /// Red, green, blue, registered to depth.
    pub colour: Option<Vec<u8>>,
}

impl RawFrame {
    /// Reads a frame of a source.
    ///
    /// # Errors
    /// Those of [`Source::read`].
    pub fn read(source: &dyn Source, index: u64) -> Result<Self, SourceError> {
        let n_pixels = source.camera().width as usize * source.camera().height as usize;
        let (mut depth, mut colour) = (vec![0; n_pixels], vec![0; 3 * n_pixels]);
        let info = source.read(index, &mut FrameBuffers { depth: &mut depth, colour: &mut colour })?;
        let colour = info.has_colour.then_some(colour);
        let FrameInfo { stamp_nanos, rotation, up, .. } = info;
        Ok(Self { stamp_nanos, rotation, up, depth, colour })
    }
}

/// What became of a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Tracked {
    /// Index of the frame, counted from 0.
    pub index: u64,
    /// Whether the pose was measured or only predicted.
    pub state: State,
    /// Whether it was measured but for a degenerate direction, along which it is predicted.
    pub is_degenerate: bool,
    /// Why the pose is not wholly measured, in words and numbers; empty while tracking normally.
    pub reason: String,
    /// Pose in the map's frame as first published; later corrections are in [`Records::last`].
    pub world_from_camera: Pose,
    /// 6x6 covariance (upper triangle, row by row, translation first), m and rad; empty where lost.
    pub covariance: Vec<f64>,
}

/// What is published of a frame.
#[derive(PartialEq)]
struct PublishedPose(State, u32, [PoseBits; 2], Vec<f64>);

impl PublishedPose {
    fn of(record: &FrameRecord) -> Self {
        let poses = [record.pose.world_from_camera, record.pose.world_from_odom];
        Self(record.state, record.pose.n_correspondences, poses, record.pose.covariance.clone())
    }
}

/// The settings of the algorithms.
#[derive(Clone, Debug, Default)]
pub struct Method {
    /// Reconstruction.
    pub surface: SurfaceSettings,
    /// Registration.
    pub registration: RegistrationSettings,
    /// Tracking and mapping.
    pub mapping: MappingSettings,
}

/// Surfaces of keyframes, copied.
#[derive(Default)]
struct RunKeyframes(Vec<Vec<Vertex>>, Vec<Vec<Feature>>);

impl KeyframeSurfaces for RunKeyframes {
    fn vertices(&self, keyframe: u32) -> &[Vertex] {
        &self.0[keyframe as usize]
    }

    fn features(&self, keyframe: u32) -> &[Feature] {
        self.1.get(keyframe as usize).map_or(&[], Vec::as_slice)
    }
}

/// The map that a run leaves, in which another one can start.
pub struct SavedMap {
    /// Keyframes as finally corrected, by id.
    pub keyframes: Vec<KeyframeState>,
    /// Which of its submaps are joined.
    pub submaps: Submaps,
    /// Their surfaces, row by row.
    pub surfaces: Vec<Vec<Vertex>>,
    /// Features of their colour images; none where they are not kept.
    pub features: Vec<Vec<Feature>>,
    /// Cameras of the runs that made it, one after the other.
    pub cameras: Vec<Camera>,
}

/// A run in progress: push frames, then finish.
pub struct Run {
    reconstructor: Reconstructor,
    tracker: Tracker,
    optimiser: Optimiser,
    keyframes: RunKeyframes,
    previous: Option<(u64, i64, Vec<Vertex>, Vec<Feature>)>,
    extractor: Extractor,
    correction: Option<Correction>,
    /// First frame for which relocalisation was asked for last.
    relocalise_from: u64,
    records: Vec<AlignRecord>,
    /// Of the runs whose map it began in, and its own.
    cameras: Vec<Camera>,
    camera: Camera,
}

impl Run {
    /// A run that has seen nothing.
    ///
    /// # Errors
    /// A setting out of range.
    pub fn new(camera: &Camera, method: &Method) -> Result<Self, SettingError> {
        Self::stamped(camera, method, 0.0)
    }

    /// As [`Self::new`], of frames whose times have this standard deviation, seconds ([`Pairing::stamp_sigma_s`]).
    ///
    /// # Errors
    /// A setting out of range.
    ///
    /// [`Pairing::stamp_sigma_s`]: tessera_sources::Pairing::stamp_sigma_s
    pub fn stamped(camera: &Camera, method: &Method, stamp_sigma_s: f64) -> Result<Self, SettingError> {
        method.registration.check()?;
        method.mapping.check()?;
        let mut context = Context::new(camera, &method.surface, &method.registration, &method.mapping);
        context.stamp_sigma_s = stamp_sigma_s;
        Ok(Self {
            reconstructor: Reconstructor::new(camera, &method.surface)?,
            tracker: Tracker::new(context.clone()),
            optimiser: Optimiser::new(context),
            keyframes: RunKeyframes::default(),
            previous: None,
            extractor: method.mapping.features.extractor(camera, method.registration.isa),
            correction: None,
            relocalise_from: 0,
            records: Vec::new(),
            cameras: Vec::new(),
            camera: camera.clone(),
        })
    }

    /// A run that starts in the map of an earlier one with the same grid; `start`:
    /// where its first frame stands in that map, if that is known.
    ///
    /// # Errors
    /// A setting out of range.
    pub fn in_map(
        camera: &Camera,
        method: &Method,
        map: SavedMap,
        start: Option<Pose>,
    ) -> Result<Self, SettingError> {
        let features = vec![Vec::new(); map.keyframes.len()];
        Self::in_map_with_features(camera, method, SavedMap { features, ..map }, start)
    }

    /// As [`Self::in_map`], with the features of the map's keyframes, as the processes of a run have them.
    ///
    /// # Errors
    /// A setting out of range.
    pub fn in_map_with_features(
        camera: &Camera,
        method: &Method,
        map: SavedMap,
        start: Option<Pose>,
    ) -> Result<Self, SettingError> {
        let mut run = Self::new(camera, method)?;
        let context = Context::new(camera, &method.surface, &method.registration, &method.mapping)
            .in_map_of(&map.cameras);
        (run.tracker, run.optimiser) = (Tracker::new(context.clone()), Optimiser::new(context));
        run.cameras = map.cameras;
        run.keyframes = RunKeyframes(map.surfaces, map.features);
        let start = start.as_ref().map(PoseBits::from);
        let record = MapRecord { keyframes: map.keyframes, submaps: map.submaps, start };
        run.take(AlignRecord::Map(Box::new(record)));
        Ok(run)
    }

    /// Asks for relocalisation: the next frame drops the pose that was tracked so far, and its place is
    /// looked for in the whole map, as that of a lost camera. Before the first frame it means nothing.
    pub fn relocalise(&mut self) {
        self.relocalise_from = self.tracker.next_index();
    }

    /// Processes the next frame and says where the camera is.
    pub fn push(&mut self, frame: &RawFrame) -> Tracked {
        let grid = self.reconstructor.grid();
        let mut vertices = vec![Vertex::default(); grid.len()];
        self.reconstructor.reconstruct(&frame.depth, frame.colour.as_deref(), &mut vertices);
        let index = self.tracker.next_index();
        if self.tracker.correction_due(index).is_some() {
            self.apply_correction(index);
        }
        let features = self.extractor.extract(frame.colour.as_deref());
        let view = |index, stamp_nanos, vertices, features| FrameSurface {
            features,
            index,
            stamp_nanos,
            rotation: None,
            up: None,
            surface: SurfaceView { grid, vertices },
            workload: WorkloadLevel::Full,
            relocalise_from: 0,
        };
        let current = FrameSurface {
            rotation: frame.rotation,
            up: frame.up,
            relocalise_from: self.relocalise_from,
            ..view(index, frame.stamp_nanos, vertices.as_slice(), features.as_slice())
        };
        let recent: Vec<FrameSurface<'_>> = self
            .previous
            .iter()
            .map(|(index, stamp, vertices, features)| {
                view(*index, *stamp, vertices.as_slice(), features.as_slice())
            })
            .collect();
        let mut posed = None;
        let record = self.tracker.align_pose_first(&current, &recent, &self.keyframes, &mut |record| {
            posed = Some(PublishedPose::of(record));
        });
        debug_assert!(posed.is_none_or(|posed| posed == PublishedPose::of(&record)), "frame {index}");
        if let Some(keyframe) = &record.change.new_keyframe {
            let is_current = keyframe.frame_index == index;
            let source = if is_current { Some(&vertices) } else { self.previous.as_ref().map(|p| &p.2) };
            self.keyframes.0.extend(source.map(|vertices| packed::rounded(vertices)));
            let seen = if is_current { Some(&features) } else { self.previous.as_ref().map(|p| &p.3) };
            self.keyframes.1.extend(seen.cloned());
        }
        self.previous = Some((index, frame.stamp_nanos, vertices, features));
        let tracked = Tracked {
            index,
            state: record.state,
            is_degenerate: record.is_degenerate(),
            reason: record.reason(),
            world_from_camera: Pose::from(&record.pose.world_from_camera),
            covariance: record.pose.covariance.clone(),
        };
        self.take(AlignRecord::Frame(Box::new(record)));
        self.solve();
        tracked
    }

    /// Ends the sequence with the final optimisation and returns all records.
    pub fn finish(self) -> Records {
        self.finish_with_map().0
    }

    /// As [`Self::finish`], with the map as finally corrected.
    pub fn finish_with_map(mut self) -> (Records, SavedMap) {
        let next = self.tracker.next_index();
        // As in the pipeline: a correction that is due where the frames end takes effect; one that is due
        // later does not, for the final request takes its place.
        if self.tracker.correction_due(next).is_some() {
            self.apply_correction(next);
        }
        let request = self.tracker.final_request();
        self.take(AlignRecord::End { n_frames: next, request });
        self.solve();
        if request.is_some() {
            self.apply_correction(next);
        }
        let TrackerState { keyframes, submaps, .. } = self.tracker.state().clone();
        let RunKeyframes(surfaces, features) = self.keyframes;
        let cameras = self.cameras.into_iter().chain([self.camera]).collect();
        (Records { records: self.records }, SavedMap { keyframes, submaps, surfaces, features, cameras })
    }

    /// Ends the sequence where it is, without the final optimisation, and returns all records.
    pub fn stop(self) -> Records {
        Records { records: self.records }
    }

    /// What all frames so far say of colour against depth.
    pub fn colour(&self) -> ColourState {
        self.tracker.state().colour
    }

    /// Shape of every surface.
    pub fn grid(&self) -> Grid {
        self.reconstructor.grid()
    }

    /// All records so far.
    pub fn records(&self) -> &[AlignRecord] {
        &self.records
    }

    /// The surface of the last frame, row by row; empty before the first.
    pub fn last_surface(&self) -> &[Vertex] {
        self.previous.as_ref().map_or(&[], |(_, _, vertices, _)| vertices)
    }

    /// Features of the last frame's colour image; none before the first.
    pub fn last_features(&self) -> &[Feature] {
        self.previous.as_ref().map_or(&[], |(.., features)| features)
    }

    /// The surface of a keyframe by its id, row by row; empty where there is none of this id.
    pub fn keyframe_surface(&self, keyframe: u32) -> &[Vertex] {
        self.keyframes.0.get(keyframe as usize).map_or(&[], Vec::as_slice)
    }

    /// The correction of the last request that has no effect yet.
    pub fn correction(&self) -> Option<&Correction> {
        self.correction.as_ref()
    }

    fn take(&mut self, record: AlignRecord) {
        self.tracker.apply(&record);
        self.optimiser.apply(&record);
        self.records.push(record);
    }

    fn solve(&mut self) {
        if let Some(request) = self.optimiser.next_request()
            && let Some(record) =
                self.optimiser.solve(&request, &self.keyframes, &self.records.as_slice(), &mut || ())
        {
            self.optimiser.apply_own(&record);
            self.correction = Some(record.into_correction());
        }
    }

    fn apply_correction(&mut self, before_frame: u64) {
        if let Some(correction) = self.correction.take()
            && let Some(record) = self.tracker.correction_record(correction, before_frame)
        {
            self.take(record);
        }
    }
}
