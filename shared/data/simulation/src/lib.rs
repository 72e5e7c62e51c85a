//! Simulated scenes: analytic solids, ray-cast, seen by a hand-held camera with the noise of
//! its sensor.
//!
//! The frame at an index is a pure function of the scene, its options and the index: any frame
//! can be rendered at any time, by any thread, with the same bytes.
#![forbid(unsafe_code)]

mod building;
mod fields;
mod furniture;
mod imu;
mod material;
mod options;
mod path;
mod person;
mod random;
mod render;
mod scenes;
mod sensor;
mod solid;
mod time_of_flight;
mod track;
mod triangulation;
mod upsampled;

pub use options::SimulationOptions;
pub use sensor::DepthSensor;

use building::Proportions;
use path::Walk;
use render::Scratch;
use scenes::Scene;
use serde::{Deserialize, Serialize};
use std::sync::{Mutex, OnceLock, PoisonError};
use tessera_evaluation::Trajectory;
use tessera_frames::SourceError;
use tessera_frames::cameras::named_camera;
use tessera_frames::imu::ImuRecording;
use tessera_frames::{FrameBuffers, FrameInfo, Pairing, Source};
use tessera_geometry::{Camera, InertialRotation, RayTable, UpDirection};

/// Frames per second.
pub(crate) const RATE_HZ: f64 = 30.0;

/// The scenes there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SceneName {
    /// A furnished room; the camera turns once round and comes back to its start.
    Room,
    /// Two walls, floor and ceiling without an end: motion along it cannot be seen in depth.
    Corridor,
    /// One flat wall: only distance and two tilts can be seen in depth.
    Wall,
    /// Six rooms; a loop of more than 25 m through all of them, back to its start.
    House,
    /// Three storeys of rooms that look alike, bare corridors, glass and people; a way of more than 500 m
    /// through all of them, joined by a lift, back to its start.
    Building,
}

impl SceneName {
    /// All scenes.
    pub const ALL: [Self; 5] = [Self::Room, Self::Corridor, Self::Wall, Self::House, Self::Building];

    /// Reads a name.
    pub fn parse(text: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|scene| scene.name() == text)
    }

    /// The name as users write it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Room => "room",
            Self::Corridor => "corridor",
            Self::Wall => "wall",
            Self::House => "house",
            Self::Building => "building",
        }
    }

    /// Frames of one way round.
    pub fn default_frames(self) -> u64 {
        match self {
            Self::Room => 360,
            Self::Corridor | Self::Wall => 300,
            Self::House => 1800,
            Self::Building => 20_400,
        }
    }
}

/// A simulated scene as a source.
#[derive(Debug)]
pub struct SimulatedSource {
    camera: Camera,
    rays: RayTable,
    scene: Scene,
    walk: Walk,
    options: SimulationOptions,
    n_frames: u64,
    /// Made when it is asked for: a restarted sensor has no use for it.
    ground_truth: OnceLock<Trajectory>,
    /// With an IMU: what it measured, and the rotation of each frame; made with the first frame that is read.
    inertial: OnceLock<(ImuRecording, Vec<InertialRotation>)>,
    /// Buffers of earlier frames: as many as frames were ever rendered at once.
    scratch: Mutex<Vec<Scratch>>,
}

impl SimulatedSource {
    /// Builds a scene. `camera` replaces the scene's own (640x480, f = 525 px, no distortion);
    /// `frames` may exceed [`SceneName::default_frames`]: the camera then goes round again.
    ///
    /// # Errors
    /// An option is out of range, or the camera cannot be had.
    pub fn open(
        name: SceneName,
        camera: Option<&str>,
        frames: Option<u64>,
        options: &SimulationOptions,
    ) -> Result<Self, SourceError> {
        options.check()?;
        let mut camera = match camera {
            Some(camera) => named_camera(camera)?,
            None => options::default_camera(),
        };
        options.apply_to(&mut camera)?;
        let n_frames = frames.unwrap_or_else(|| name.default_frames());
        if !(1..=1_000_000).contains(&n_frames) {
            return Err(SourceError::Option {
                name: "frames",
                value: n_frames.to_string(),
                rule: "1 to 1000000 frames",
            });
        }
        let proportions = Proportions::drawn(options.proportions);
        let walk = Walk::new(name, options.seed, proportions).at_speed(options.speed);
        Ok(Self {
            inertial: OnceLock::new(),
            rays: RayTable::new(&camera, 1),
            camera,
            scene: Scene::new(name, options.seed, options.person, proportions),
            walk,
            options: options.clone(),
            n_frames,
            ground_truth: OnceLock::new(),
            scratch: Mutex::new(Vec::new()),
        })
    }

    fn make_ground_truth(&self) -> Trajectory {
        let stamps_nanos: Vec<i64> = (0..self.n_frames).map(stamp_nanos).collect();
        let pose = |stamp: &i64| self.walk.world_from_camera(*stamp as f64 * 1e-9);
        let poses = stamps_nanos.iter().map(pose).collect();
        Trajectory { stamps_nanos, poses }
    }

    /// What the IMU measured, and the camera's rotation at each frame by it, where there is one.
    fn inertial(&self) -> Option<&(ImuRecording, Vec<InertialRotation>)> {
        let model = self.options.imu_model()?;
        Some(self.inertial.get_or_init(|| {
            let stamps: Vec<i64> = (0..self.n_frames).map(stamp_nanos).collect();
            let last = stamps.last().copied().unwrap_or(0);
            let recording = imu::measure(&self.walk, &model, self.options.seed, last);
            let rotations = recording.rotations(&stamps);
            (recording, rotations)
        }))
    }

    /// The camera's rotation up to a frame.
    fn rotation(&self, index: u64) -> Option<InertialRotation> {
        self.inertial()?.1.get(usize::try_from(index).ok()?).copied()
    }

    /// Up at a frame.
    fn up(&self, index: u64) -> Option<UpDirection> {
        self.inertial()?.0.up_at(stamp_nanos(index))
    }

    fn take_scratch(&self) -> Scratch {
        self.scratch.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default()
    }

    fn give_back(&self, scratch: Scratch) {
        self.scratch.lock().unwrap_or_else(PoisonError::into_inner).push(scratch);
    }
}

/// Whole microseconds, so that files with six digits hold them exactly.
fn stamp_nanos(index: u64) -> i64 {
    libm::round(index as f64 * 1e6 / RATE_HZ) as i64 * 1000
}

impl Source for SimulatedSource {
    fn camera(&self) -> &Camera {
        &self.camera
    }

    fn n_frames(&self) -> Option<u64> {
        Some(self.n_frames)
    }

    fn stamp_nanos(&self, index: u64) -> Option<i64> {
        (index < self.n_frames).then(|| stamp_nanos(index))
    }

    fn read(&self, index: u64, buffers: &mut FrameBuffers<'_>) -> Result<FrameInfo, SourceError> {
        buffers.check(&self.camera)?;
        if index >= self.n_frames {
            return Err(SourceError::NoFrame { frame: index, last: self.n_frames - 1 });
        }
        let stamp_nanos = stamp_nanos(index);
        let exposure = render::Exposure {
            camera: &self.camera,
            rays: &self.rays,
            scene: &self.scene,
            walk: &self.walk,
            stamp_s: stamp_nanos as f64 * 1e-9,
        };
        let mut scratch = self.take_scratch();
        if self.options.colour_lag_s == 0.0 {
            exposure.cast(&mut scratch, Some(buffers.colour));
        } else {
            let late = render::Exposure { stamp_s: exposure.stamp_s - self.options.colour_lag_s, ..exposure };
            late.cast(&mut scratch, Some(buffers.colour));
            exposure.cast(&mut scratch, None);
        }
        let key = random::frame_key(self.options.seed, index);
        if self.options.sensor != DepthSensor::Exact {
            sensor::add_colour_noise(key, buffers.colour);
        }
        sensor::measure(self.options.sensor, (&self.camera, &self.rays), key, &mut scratch, buffers.depth);
        self.give_back(scratch);
        Ok(FrameInfo { stamp_nanos, has_colour: true, rotation: self.rotation(index), up: self.up(index) })
    }

    fn ground_truth(&self) -> Option<&Trajectory> {
        Some(self.ground_truth.get_or_init(|| self.make_ground_truth()))
    }

    fn pairing(&self) -> Pairing {
        let n = self.n_frames as usize;
        Pairing { n_depth: n, n_colour: n, n_pairs: n, ..Pairing::default() }
    }

    fn description(&self) -> Vec<(&'static str, String)> {
        let words = self.inertial().and_then(|(recording, _)| recording.words());
        words.map(|words| ("imu", words.to_owned())).into_iter().collect()
    }
}

#[cfg(test)]
mod tests;
