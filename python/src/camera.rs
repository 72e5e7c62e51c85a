//! The camera of the depth images.

use crate::detached::refuse;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyInt, PyString};
use tessera_geometry::Camera;
use toml::{Table, Value};

/// A depth camera.
#[pyclass(name = "Camera", frozen, eq, module = "tessera")]
#[derive(PartialEq)]
pub(crate) struct PyCamera(pub(crate) Camera);

impl PyCamera {
    fn checked(camera: Camera) -> PyResult<Self> {
        camera.check().map_err(|error| refuse(format!("camera: {error}")))?;
        Ok(Self(camera))
    }
}

#[pymethods]
impl PyCamera {
    #[new]
    #[pyo3(signature = (width, height, fx, fy, cx, cy, units_per_metre=1000.0))]
    fn new(
        width: u32,
        height: u32,
        fx: f64,
        fy: f64,
        cx: f64,
        cy: f64,
        units_per_metre: f64,
    ) -> PyResult<Self> {
        Self::checked(Camera::pinhole((width, height), [fx, fy, cx, cy], units_per_metre))
    }

    /// A built-in camera by its name, or a camera file.
    #[staticmethod]
    fn load(name_or_file: &str) -> PyResult<Self> {
        tessera_sources::named_camera(name_or_file).map(Self).map_err(refuse)
    }

    /// A camera from the keys of a camera file.
    #[staticmethod]
    fn from_dict(values: &Bound<'_, PyDict>) -> PyResult<Self> {
        let mut table = Table::new();
        for (key, value) in values {
            let key: String = key.extract()?;
            let value = toml_value(&value).map_err(|_| {
                refuse(format!("camera: {key} is {value}, expected a number or five of them"))
            })?;
            table.insert(key, value);
        }
        let camera = table.try_into().map_err(|error| refuse(format!("camera: {error}").trim_end()))?;
        Self::checked(camera)
    }

    /// From the 3x3 matrix of a pinhole, pixels, and its distortion `k1 k2 p1 p2 k3`.
    #[staticmethod]
    #[pyo3(signature = (matrix, width, height, units_per_metre=1000.0, distortion=None))]
    fn from_matrix(
        matrix: &Bound<'_, PyAny>,
        width: u32,
        height: u32,
        units_per_metre: f64,
        distortion: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let expected = "[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]";
        let wrong = |_| refuse(format!("camera: the matrix is {matrix}, expected {expected}"));
        let rows = matrix.try_iter().and_then(|rows| rows.map(|row| numbers::<3>(&row?)).collect());
        let rows: Vec<[f64; 3]> = rows.map_err(wrong)?;
        let [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]] = rows[..] else { return Err(wrong(refuse(""))) };
        let distortion = distortion.map_or(Ok([0.0; 5]), |given| {
            numbers(given).map_err(|_| {
                refuse(format!("camera: distortion is {given}, expected five numbers k1 k2 p1 p2 k3"))
            })
        })?;
        let pinhole = Camera::pinhole((width, height), [fx, fy, cx, cy], units_per_metre);
        Self::checked(Camera { distortion, ..pinhole })
    }

    /// The keys of a camera file with their values.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let camera = &self.0;
        let values = PyDict::new(py);
        values.set_item("width", camera.width)?;
        values.set_item("height", camera.height)?;
        values.set_item("fx", camera.fx)?;
        values.set_item("fy", camera.fy)?;
        values.set_item("cx", camera.cx)?;
        values.set_item("cy", camera.cy)?;
        values.set_item("units_per_metre", camera.units_per_metre)?;
        values.set_item("distortion", camera.distortion)?;
        values.set_item("readout_s", camera.readout_s)?;
        values.set_item("depth_offset_m", camera.depth_offset_m)?;
        values.set_item("colour_registered", camera.colour_registered)?;
        values.set_item("colour_lag_s", camera.colour_lag_s)?;
        values.set_item("colour_focal_ratio", camera.colour_focal_ratio)?;
        Ok(values)
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

    #[getter]
    fn fx(&self) -> f64 {
        self.0.fx
    }

    #[getter]
    fn fy(&self) -> f64 {
        self.0.fy
    }

    #[getter]
    fn cx(&self) -> f64 {
        self.0.cx
    }

    #[getter]
    fn cy(&self) -> f64 {
        self.0.cy
    }

    /// `k1 k2 p1 p2 k3`.
    #[getter]
    fn distortion(&self) -> (f64, f64, f64, f64, f64) {
        let [k1, k2, p1, p2, k3] = self.0.distortion;
        (k1, k2, p1, p2, k3)
    }

    #[getter]
    fn readout_s(&self) -> f64 {
        self.0.readout_s
    }

    #[getter]
    fn depth_offset_m(&self) -> f64 {
        self.0.depth_offset_m
    }

    #[getter]
    fn colour_registered(&self) -> bool {
        self.0.colour_registered
    }

    #[getter]
    fn colour_lag_s(&self) -> f64 {
        self.0.colour_lag_s
    }

    #[getter]
    fn colour_focal_ratio(&self) -> f64 {
        self.0.colour_focal_ratio
    }

    /// The 3x3 matrix, as `from_matrix` takes it.
    #[getter]
    fn matrix(&self) -> [[f64; 3]; 3] {
        let Camera { fx, fy, cx, cy, .. } = self.0;
        [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]
    }

    /// For pickle and copy: a process that is spawned gets its camera so.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyDict>,))> {
        let make = py.import("tessera._types")?.getattr("camera_from_dict")?;
        Ok((make, (self.to_dict(py)?,)))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let Camera { width, height, fx, fy, cx, cy, units_per_metre, .. } = self.0;
        match self.0 == Camera::pinhole((width, height), [fx, fy, cx, cy], units_per_metre) {
            true => Ok(format!(
                "Camera({width}, {height}, fx={fx:?}, fy={fy:?}, cx={cx:?}, cy={cy:?}, units_per_metre={units_per_metre:?})"
            )),
            false => Ok(format!("Camera.from_dict({})", self.to_dict(py)?.repr()?)),
        }
    }
}

/// So many numbers of anything that can be gone through: a list, a tuple, an array of numpy.
fn numbers<const N: usize>(values: &Bound<'_, PyAny>) -> PyResult<[f64; N]> {
    let found: Vec<f64> = values.try_iter()?.map(|value| value?.extract()).collect::<PyResult<_>>()?;
    <[f64; N]>::try_from(found).map_err(|found| refuse(format!("{} numbers, expected {N}", found.len())))
}

/// A number, a truth value or a list of numbers; what has none of these forms is an error.
fn toml_value(value: &Bound<'_, PyAny>) -> PyResult<Value> {
    if value.is_instance_of::<PyString>() {
        return Ok(Value::String(value.extract()?));
    }
    if value.is_instance_of::<PyBool>() {
        return Ok(Value::Boolean(value.extract()?));
    }
    if value.is_instance_of::<PyInt>() {
        return Ok(Value::Integer(value.extract()?));
    }
    if let Ok(items) = value.try_iter() {
        let items: PyResult<Vec<Value>> = items.map(|item| Ok(Value::Float(item?.extract()?))).collect();
        return Ok(Value::Array(items?));
    }
    // Integers of numpy are no floats, and are wanted as integers.
    let number: f64 = value.extract()?;
    let is_index = value.hasattr("__index__")?;
    Ok(if is_index { Value::Integer(value.extract()?) } else { Value::Float(number) })
}
