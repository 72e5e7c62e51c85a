//! A run in this process.

use crate::camera::PyCamera;
use crate::columns::{Points, PoseColumns, matrix, state_name};
use crate::detached::{detached, refuse};
use crate::results;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use std::sync::{Mutex, MutexGuard};
use tessera_geometry::{Camera, InertialRotation, Pose, UpDirection};
use tessera_offline::{Method, RawFrame, Run, SavedMap};
use tessera_outputs::{Replay, map_points};
use tessera_settings::Settings;
use tessera_slam::MapRecord;
use tessera_supervisor::{LoadedMap, load_map};

/// Seconds of the latest stamp: the difference of two stamps must fit 64 bits of nanoseconds.
const LATEST_S: i64 = 9_000_000_000;

/// Index, state, reason, `world_from_camera` row by row, and the upper triangle of its covariance.
type TrackedTuple = (u64, &'static str, String, [f64; 16], Vec<f64>);

/// A run in this process.
#[pyclass(name = "Slam", frozen, module = "tessera._tessera")]
pub(crate) struct PySlam {
    camera: Camera,
    settings: Settings,
    /// Those of the runs that made the map that this one begins in.
    map_cameras: Vec<Camera>,
    progress: Mutex<SlamProgress>,
}

struct SlamProgress {
    state: SlamPhase,
    /// What the records so far amount to.
    replay: Replay,
    /// Records that are in `replay`.
    n_records: usize,
    last_nanos: Option<i64>,
}

enum SlamPhase {
    Going(Box<Run>),
    Finished(SavedMap),
    /// The final optimisation did not come to its end.
    Failed,
}

impl SlamProgress {
    /// Takes the records that have come since into the replay.
    fn follow(&mut self) -> &Replay {
        if let SlamPhase::Going(run) = &self.state {
            for record in &run.records()[self.n_records..] {
                self.replay.apply(record.clone());
            }
            self.n_records = run.records().len();
        }
        &self.replay
    }

    fn track(&mut self, frame: &RawFrame) -> PyResult<TrackedTuple> {
        let SlamPhase::Going(run) = &mut self.state else {
            return Err(refuse("the run is finished, expected no more frames"));
        };
        let (found, seconds) = (frame.stamp_nanos, |nanos: i64| nanos as f64 * 1e-9);
        if !(0..=LATEST_S * 1_000_000_000).contains(&found) {
            return Err(refuse(format!("t is {} s, expected 0 to {LATEST_S} s", seconds(found))));
        }
        if let Some(last) = self.last_nanos.filter(|last| found <= *last) {
            let (found, last) = (seconds(found), seconds(last));
            return Err(refuse(format!(
                "t is {found} s, expected more than the {last} s of the frame before"
            )));
        }
        let tracked = run.push(frame);
        self.last_nanos = Some(found);
        let state = state_name(tracked.state, tracked.is_degenerate);
        let pose = matrix(&tracked.world_from_camera);
        Ok((tracked.index, state, tracked.reason, pose, tracked.covariance))
    }

    fn finish(&mut self) {
        self.follow();
        match std::mem::replace(&mut self.state, SlamPhase::Failed) {
            SlamPhase::Going(run) => {
                let (records, map) = run.finish_with_map();
                for record in records.records.into_iter().skip(self.n_records) {
                    self.replay.apply(record);
                }
                if let Some(refined) = self.replay.with_refined_camera() {
                    self.replay = refined;
                }
                self.state = SlamPhase::Finished(map);
            }
            other => self.state = other,
        }
    }
}

impl PySlam {
    fn lock(&self) -> PyResult<MutexGuard<'_, SlamProgress>> {
        self.progress.lock().map_err(|_| PyRuntimeError::new_err("an earlier call met a bug of tessera"))
    }

    fn check_size(&self, depth: &[u8], colour: Option<&[u8]>) -> PyResult<()> {
        let n_pixels = self.camera.width as usize * self.camera.height as usize;
        let expected_colour = 3 * n_pixels;
        for (what, found, expected) in [
            ("depth", depth.len(), 2 * n_pixels),
            ("colour", colour.map_or(expected_colour, <[u8]>::len), expected_colour),
        ] {
            if found != expected {
                return Err(refuse(format!("{what} has {found} bytes, expected {expected}")));
            }
        }
        Ok(())
    }
}

/// The rotation of a gyroscope: quaternion `x y z w`, variance and bias of [`InertialRotation`].
fn checked_rotation(numbers: [f64; 6]) -> PyResult<InertialRotation> {
    let [x, y, z, w, variance_rad2, bias_sigma_rad_per_s] = numbers;
    let rotation =
        InertialRotation { start_from_camera_xyzw: [x, y, z, w], variance_rad2, bias_sigma_rad_per_s };
    if !rotation.is_valid() {
        let expected = "a unit quaternion x y z w, then a variance and a standard deviation of the bias";
        return Err(refuse(format!("rotation is {numbers:?}, expected {expected}")));
    }
    Ok(rotation)
}

/// The direction against gravity: unit vector in the camera's axes and standard deviation of [`UpDirection`].
fn checked_up(numbers: [f64; 4]) -> PyResult<UpDirection> {
    let [x, y, z, sigma_rad] = numbers;
    let up = UpDirection { in_camera: [x, y, z], sigma_rad };
    if !up.is_valid() {
        let expected = "a unit vector in the camera's axes, then a positive standard deviation in radians";
        return Err(refuse(format!("up is {numbers:?}, expected {expected}")));
    }
    Ok(up)
}

// The lock of `progress` is taken only where the interpreter's is not held: a thread that waits for it
// with the other one in hand would stop the thread that has it.
#[pymethods]
impl PySlam {
    #[new]
    fn new(
        py: Python<'_>,
        camera: &PyCamera,
        config: Option<&str>,
        overrides: Vec<String>,
    ) -> PyResult<Self> {
        let camera = camera.0.clone();
        let mut settings = Settings::load(config, &overrides).map_err(refuse)?;
        settings.set_isa(settings.run.isa.resolve().map_err(refuse)?);
        let map = detached(py, || load_map(&camera, &settings).map_err(refuse))?;
        let map_cameras = map.as_ref().map_or(Vec::new(), |map| map.cameras.clone());
        if let Some(map) = &map {
            settings.mapping.world_up = map.world_up;
        }
        let method = Method {
            surface: settings.surface.clone(),
            registration: settings.registration.clone(),
            mapping: settings.mapping.clone(),
        };
        let run = match map {
            None => Run::new(&camera, &method),
            Some(LoadedMap { record, surfaces, features, cameras, .. }) => {
                let start = record.start.as_ref().map(Pose::from);
                let MapRecord { keyframes, submaps, .. } = record;
                let map = SavedMap { keyframes, submaps, surfaces, features, cameras };
                Run::in_map_with_features(&camera, &method, map, start)
            }
        };
        let state = SlamPhase::Going(Box::new(run.map_err(refuse)?));
        let progress = SlamProgress { state, replay: Replay::default(), n_records: 0, last_nanos: None };
        Ok(Self { camera, settings, map_cameras, progress: Mutex::new(progress) })
    }

    /// Processes the next frame: depth in raw units (16 bits, little-endian), colour as red, green, blue.
    fn track(
        &self,
        py: Python<'_>,
        depth: &[u8],
        colour: Option<&[u8]>,
        stamp_nanos: i64,
        rotation: Option<[f64; 6]>,
        up: Option<[f64; 4]>,
    ) -> PyResult<TrackedTuple> {
        self.check_size(depth, colour)?;
        let rotation = rotation.map(checked_rotation).transpose()?;
        let up = up.map(checked_up).transpose()?;
        detached(py, || {
            let depth = depth.chunks_exact(2).map(|raw| u16::from_le_bytes([raw[0], raw[1]])).collect();
            let colour = colour.map(<[u8]>::to_vec);
            let frame = RawFrame { stamp_nanos, rotation, up, depth, colour };
            self.lock()?.track(&frame)
        })
    }

    /// Has the next frame drop the pose that was tracked so far.
    fn relocalise(&self, py: Python<'_>) -> PyResult<()> {
        detached(py, || match &mut self.lock()?.state {
            SlamPhase::Going(run) => {
                run.relocalise();
                Ok(())
            }
            _ => Err(refuse("the run is finished, expected no more frames")),
        })
    }

    /// The final optimisation of all keyframes; a second call changes nothing.
    fn finish(&self, py: Python<'_>) -> PyResult<()> {
        detached(py, || {
            self.lock()?.finish();
            Ok(())
        })
    }

    /// All frames so far with the corrections so far.
    fn trajectory<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        detached(py, || Ok(PoseColumns::of_frames(self.lock()?.follow())))?.into_python(py)
    }

    /// All keyframes so far with the corrections so far.
    fn keyframes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        detached(py, || Ok(PoseColumns::of_keyframes(self.lock()?.follow())))?.into_python(py)
    }

    /// The keyframes fused into one mesh: positions, normals, colours, triangles.
    fn mesh<'py>(&self, py: Python<'py>, voxel_m: f64, max_depth_m: f64) -> PyResult<Bound<'py, PyTuple>> {
        let mesh = detached(py, || {
            let mut progress = self.lock()?;
            progress.follow();
            let surface = |keyframe: u32| match &progress.state {
                SlamPhase::Going(run) => run.keyframe_surface(keyframe),
                SlamPhase::Finished(map) => {
                    map.surfaces.get(keyframe as usize).map_or(&[][..], Vec::as_slice)
                }
                SlamPhase::Failed => &[],
            };
            let cameras = (&self.camera, &self.map_cameras[..]);
            results::mesh(cameras, &self.settings, &progress.replay, [voxel_m, max_depth_m], surface)
        })?;
        mesh.into_python(py)
    }

    /// Grade of the run so far, and for each reason its grade, what was found and what to try.
    fn verdict(&self, py: Python<'_>) -> PyResult<results::VerdictColumns> {
        detached(py, || {
            let mut progress = self.lock()?;
            progress.follow();
            Ok(results::verdict(&self.camera, &progress.replay))
        })
    }

    /// Loops closed and rejected, submaps, and processed frames of each submap that is apart.
    fn counts(&self, py: Python<'_>) -> PyResult<results::CountsTuple> {
        detached(py, || {
            let mut progress = self.lock()?;
            progress.follow();
            Ok(results::counts(&progress.replay))
        })
    }

    /// Verified loops so far: newer and older keyframe, and whether the loop was closed.
    fn loops(&self, py: Python<'_>) -> PyResult<Vec<(u32, u32, bool)>> {
        detached(py, || Ok(self.lock()?.follow().verified_loops()))
    }

    /// The map so far, with the corrections so far.
    fn map<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let points = detached(py, || {
            let mut progress = self.lock()?;
            progress.follow();
            let surface = |keyframe: u32| match &progress.state {
                SlamPhase::Going(run) => run.keyframe_surface(keyframe),
                SlamPhase::Finished(map) => {
                    map.surfaces.get(keyframe as usize).map_or(&[][..], Vec::as_slice)
                }
                SlamPhase::Failed => &[],
            };
            Ok(Points::new(&map_points(&self.camera, &progress.replay, &self.settings, surface)))
        })?;
        points.into_python(py)
    }
}
