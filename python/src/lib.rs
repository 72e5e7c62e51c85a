//! Tessera in a Python process: the steps of the pipeline one after the other, and so the same bits.
//!
//! Arrays cross the border as bytes, which `tessera/_arrays.py` makes and checks: numpy is needed by the
//! users of this package and not by its build. What takes long runs without the interpreter's lock.
#![forbid(unsafe_code)]

mod camera;
mod columns;
mod detached;
mod results;
mod run_folder;
mod slam;
mod source;

use pyo3::prelude::*;

#[pymodule]
fn _tessera(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<camera::PyCamera>()?;
    module.add_class::<slam::PySlam>()?;
    module.add_class::<source::PySource>()?;
    module.add_function(wrap_pyfunction!(run_folder::read_run, module)?)
}
