//! Tessera in a Python process: the steps of the pipeline one after the other, and so the same bits.
//!
//! Arrays cross the border as bytes, which `tessera/__init__.py` makes and checks: no part of numpy is
//! needed to build this.
#![forbid(unsafe_code)]

use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::fmt::Display;
use std::sync::{Mutex, MutexGuard};
use tessera_geometry::{Camera, Pose};
use tessera_offline::{Method, RawFrame, Run, SavedMap, State};
use tessera_outputs::{MapInput, Replay, final_rows, map_points};
use tessera_settings::Settings;

/// Metres of the first four rows of a pose, row by row.
type Matrix = [f64; 16];

fn refuse(error: impl Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// A depth camera.
#[pyclass(name = "Camera", frozen, module = "tessera")]
struct PyCamera(Camera);

#[pymethods]
impl PyCamera {
    #[new]
    #[pyo3(signature = (width, height, fx, fy, cx, cy, units_per_metre=1000.0, distortion=[0.0; 5], readout_s=0.0, depth_offset_m=0.0))]
    #[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
    fn new(
        width: u32,
        height: u32,
        fx: f64,
        fy: f64,
        cx: f64,
        cy: f64,
        units_per_metre: f64,
        distortion: [f64; 5],
        readout_s: f64,
        depth_offset_m: f64,
    ) -> PyResult<Self> {
        let pinhole = Camera::pinhole((width, height), [fx, fy, cx, cy], units_per_metre);
        let camera = Camera { distortion, readout_s, depth_offset_m, ..pinhole };
        camera.check().map_err(refuse)?;
        Ok(Self(camera))
    }

    /// A built-in camera by its name, or a camera file.
    #[staticmethod]
    fn load(name_or_file: &str) -> PyResult<Self> {
        tessera_frames::named_camera(name_or_file).map(Self).map_err(refuse)
    }

    #[getter]
    fn width(&self) -> u32 {
        self.0.width
    }

    #[getter]
    fn height(&self) -> u32 {
        self.0.height
    }

    #[getter]
    fn units_per_metre(&self) -> f64 {
        self.0.units_per_metre
    }

    fn __repr__(&self) -> String {
        let Camera { width, height, fx, fy, cx, cy, units_per_metre, .. } = &self.0;
        format!(
            "Camera(width={width}, height={height}, fx={fx}, fy={fy}, cx={cx}, cy={cy}, units_per_metre={units_per_metre})"
        )
    }
}

/// A run in this process.
#[pyclass(name = "Slam", frozen, module = "tessera._tessera")]
struct PySlam {
    camera: Camera,
    settings: Settings,
    /// Pixels of an image.
    n_pixels: usize,
    inner: Mutex<Inner>,
}

struct Inner {
    /// `None`: it is finished.
    run: Option<Run>,
    replay: Replay,
    /// Records that are in `replay`.
    n_records: usize,
    last_nanos: Option<i64>,
    map: Option<SavedMap>,
}

impl Inner {
    /// Takes the records that have come since into the replay.
    fn follow(&mut self) {
        let Some(run) = &self.run else { return };
        for record in &run.records()[self.n_records..] {
            self.replay.apply(record.clone());
        }
        self.n_records = run.records().len();
    }
}

impl PySlam {
    fn lock(&self) -> PyResult<MutexGuard<'_, Inner>> {
        self.inner.lock().map_err(|_| PyRuntimeError::new_err("an earlier call failed within"))
    }
}

#[pymethods]
impl PySlam {
    #[new]
    fn new(camera: &PyCamera, config: Option<&str>, settings: Vec<String>) -> PyResult<Self> {
        let camera = camera.0.clone();
        let mut settings = Settings::load(config, &settings).map_err(refuse)?;
        settings.set_isa(settings.run.isa.resolve().map_err(refuse)?);
        let (surface, registration) = (settings.surface.clone(), settings.registration.clone());
        let method = Method { surface, registration, mapping: settings.mapping.clone() };
        let run = Some(Run::new(&camera, &method).map_err(refuse)?);
        let inner = Inner { run, replay: Replay::default(), n_records: 0, last_nanos: None, map: None };
        let n_pixels = camera.width as usize * camera.height as usize;
        Ok(Self { camera, settings, n_pixels, inner: Mutex::new(inner) })
    }

    /// Index, state, `world_from_camera` and the upper triangle of its covariance, of the next frame:
    /// depth in raw units (16 bits, little-endian), colour as red, green, blue.
    fn track(
        &self,
        py: Python<'_>,
        depth: &[u8],
        colour: Option<&[u8]>,
        stamp_nanos: i64,
    ) -> PyResult<(u64, &'static str, Matrix, Vec<f64>)> {
        for (what, found, expected) in [
            ("depth", depth.len(), 2 * self.n_pixels),
            ("colour", colour.map_or(3 * self.n_pixels, <[u8]>::len), 3 * self.n_pixels),
        ] {
            if found != expected {
                return Err(refuse(format!("{what} has {found} bytes, expected {expected}")));
            }
        }
        let raw = |pair: &[u8]| u16::from_le_bytes([pair[0], pair[1]]);
        let depth = depth.chunks_exact(2).map(raw).collect();
        let frame = RawFrame { stamp_nanos, rotation: None, depth, colour: colour.map(<[u8]>::to_vec) };
        let mut inner = self.lock()?;
        if let Some(last) = inner.last_nanos.filter(|last| stamp_nanos <= *last) {
            let (found, last) = (stamp_nanos as f64 * 1e-9, last as f64 * 1e-9);
            return Err(refuse(format!("t is {found} s, expected more than the {last} s of the frame before")));
        }
        let run = inner.run.as_mut().ok_or_else(|| refuse("the run is finished, expected no more frames"))?;
        let tracked = py.detach(|| run.push(&frame));
        inner.last_nanos = Some(stamp_nanos);
        let state = if tracked.state == State::Tracking { "tracking" } else { "lost" };
        Ok((tracked.index, state, matrix(&tracked.world_from_camera), tracked.covariance))
    }

    /// The final optimisation of all keyframes; a second call changes nothing.
    fn finish(&self, py: Python<'_>) -> PyResult<()> {
        let mut inner = self.lock()?;
        inner.follow();
        if let Some(run) = inner.run.take() {
            let (records, map) = py.detach(|| run.finish_with_map());
            for record in records.records.into_iter().skip(inner.n_records) {
                inner.replay.apply(record);
            }
            inner.map = Some(map);
        }
        Ok(())
    }

    /// Stamps (nanoseconds) and poses (4x4, row by row, 64-bit floats) of the frames so far with all
    /// corrections so far: the rows of `trajectory.txt`.
    fn trajectory<'py>(&self, py: Python<'py>) -> PyResult<(Vec<i64>, Bound<'py, PyBytes>)> {
        let mut inner = self.lock()?;
        inner.follow();
        let rows = final_rows(&inner.replay);
        let poses: Vec<u8> = rows.iter().flat_map(|(_, pose)| matrix(pose)).flat_map(f64::to_le_bytes).collect();
        Ok((rows.iter().map(|(stamp_nanos, _)| *stamp_nanos).collect(), PyBytes::new(py, &poses)))
    }

    /// Positions and normals (32-bit floats, three a point) and colours of the points of `map.ply`.
    fn map<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyBytes>, Bound<'py, PyBytes>, Bound<'py, PyBytes>)> {
        self.finish(py)?;
        let inner = self.lock()?;
        let map = inner.map.as_ref().ok_or_else(|| refuse("the run has no map"))?;
        let input = MapInput {
            camera: &self.camera,
            step: self.settings.surface.step as usize,
            settings: &self.settings.output,
            warp: None,
        };
        let surface = |id: u32| map.surfaces.get(id as usize).map_or(&[][..], Vec::as_slice);
        let points = map_points(&inner.replay, &input, surface);
        let floats = |of: fn(&tessera_outputs::PlyVertex) -> [f32; 3]| {
            let bytes: Vec<u8> = points.iter().flat_map(of).flat_map(f32::to_le_bytes).collect();
            PyBytes::new(py, &bytes)
        };
        let rgb: Vec<u8> = points.iter().flat_map(|point| point.rgb).collect();
        Ok((floats(|point| point.position), floats(|point| point.normal), PyBytes::new(py, &rgb)))
    }
}

fn matrix(pose: &Pose) -> Matrix {
    let matrix = pose.to_homogeneous();
    std::array::from_fn(|at| matrix[(at / 4, at % 4)])
}

#[pymodule]
fn _tessera(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyCamera>()?;
    module.add_class::<PySlam>()
}
