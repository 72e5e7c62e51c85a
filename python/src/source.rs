//! Recordings and simulated worlds as the command reads them.

use crate::camera::PyCamera;
use crate::detached::{detached, refuse};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyTuple};
use tessera_geometry::{InertialRotation, UpDirection};
use tessera_settings::Settings;
use tessera_sources::{FrameBuffers, Source};

/// A source of frames: each is a function of its index.
#[pyclass(name = "Source", frozen, module = "tessera._tessera")]
pub(crate) struct PySource(Box<dyn Source>);

#[pymethods]
impl PySource {
    #[new]
    fn new(py: Python<'_>, config: Option<&str>, overrides: Vec<String>) -> PyResult<Self> {
        detached(py, || {
            let settings = Settings::load(config, &overrides).map_err(refuse)?;
            let (spec, options) = settings.source();
            tessera_sources::open(&spec, &options).map(Self).map_err(refuse)
        })
    }

    /// Camera of the depth images.
    fn camera(&self) -> PyCamera {
        PyCamera(self.0.camera().clone())
    }

    /// Number of frames.
    fn n_frames(&self) -> PyResult<u64> {
        self.0.n_frames().ok_or_else(|| refuse("the source has no end, expected run.frames to be set"))
    }

    /// A frame: stamp in nanoseconds, depth (16 bits, little-endian), colour, the gyroscope's rotation, up, and
    /// what is wrong with an image of it: depth is then empty, or colour left out, as in the pipeline.
    fn read<'py>(&self, py: Python<'py>, index: u64) -> PyResult<Bound<'py, PyTuple>> {
        if self.0.n_frames().is_some_and(|n_frames| index >= n_frames) {
            return Err(PyIndexError::new_err(format!("frame {index} is beyond the end of the source")));
        }
        let (info, error, depth, colour) = detached(py, || {
            let camera = self.0.camera();
            let n_pixels = camera.width as usize * camera.height as usize;
            let (mut depth, mut colour) = (vec![0_u16; n_pixels], vec![0; 3 * n_pixels]);
            let mut buffers = FrameBuffers { depth: &mut depth, colour: &mut colour };
            let (info, error) = self.0.read_what_is_there(index, &mut buffers).map_err(refuse)?;
            let depth: Vec<u8> = depth.into_iter().flat_map(u16::to_le_bytes).collect();
            Ok((info, error.map(|error| error.to_string()), depth, colour))
        })?;
        let colour = info.has_colour.then(|| PyBytes::new(py, &colour));
        let rotation = info.rotation.map(|rotation| {
            let InertialRotation { start_from_camera_xyzw: [x, y, z, w], .. } = rotation;
            [x, y, z, w, rotation.variance_rad2, rotation.bias_sigma_rad_per_s]
        });
        let up = info.up.map(|UpDirection { in_camera: [x, y, z], sigma_rad }| [x, y, z, sigma_rad]);
        (info.stamp_nanos, PyBytes::new(py, &depth), colour, rotation, up, error).into_pyobject(py)
    }
}
