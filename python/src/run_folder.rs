//! The folder of a run, read as the command reads it: from its journal, also where the run crashed.

use crate::columns::{Points, PoseColumns};
use crate::detached::{detached, refuse};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use std::path::PathBuf;
use tessera_outputs::{read_journal, read_map, read_settings};
use tessera_stage::RunFiles;

/// Frames, keyframes, map and verified loops of the run in `folder`.
#[pyfunction]
pub(crate) fn read_run(py: Python<'_>, folder: PathBuf) -> PyResult<Bound<'_, PyTuple>> {
    let (frames, keyframes, points, loops) = detached(py, || {
        let files = RunFiles::new(&folder);
        let settings = read_settings(&files).map_err(refuse)?;
        let as_mapped = read_journal(&files).map_err(refuse)?;
        let replay = as_mapped.with_refined_camera().unwrap_or(as_mapped);
        let points = read_map(&files, &replay, &settings).map_err(refuse)?;
        let (frames, keyframes) = (PoseColumns::of_frames(&replay), PoseColumns::of_keyframes(&replay));
        Ok((frames, keyframes, Points::new(&points), replay.verified_loops()))
    })?;
    (frames.into_python(py)?, keyframes.into_python(py)?, points.into_python(py)?, loops).into_pyobject(py)
}
