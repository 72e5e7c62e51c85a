//! Work without the interpreter's lock, and errors as exceptions.

use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use std::any::Any;
use std::fmt::Display;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Bad input as a `ValueError`.
pub(crate) fn refuse(error: impl Display) -> PyErr {
    // The command's word for what is an argument here.
    PyValueError::new_err(
        error.to_string().replace("--set ", "settings: ").replace("--camera guess", "a camera"),
    )
}

/// Does `work` while other threads of Python go on.
///
/// # Errors
/// Those of `work`; a panic is a `RuntimeError`, so that a bug of ours ends a call and not the process.
pub(crate) fn detached<T: Send>(py: Python<'_>, work: impl FnOnce() -> PyResult<T> + Send) -> PyResult<T> {
    py.detach(|| catch_unwind(AssertUnwindSafe(work))).unwrap_or_else(|payload| {
        Err(PyRuntimeError::new_err(format!("a bug of tessera: {}", words(&*payload))))
    })
}

fn words(payload: &(dyn Any + Send)) -> &str {
    let text = payload.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| payload.downcast_ref::<&str>().copied()).unwrap_or("a panic without words")
}
