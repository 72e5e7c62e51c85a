//! Copies of robots' runs at the base, each byte of them checked before it is written down.

pub mod arrivals;
mod asked;
pub mod checked;
mod checked_record;
pub mod journal;
pub mod local;
pub mod replica;
pub mod store;
pub mod surfaces;

use crate::error::FleetError;
use std::fs::{File, OpenOptions};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

/// The file of a copy, opened or created, for its owner alone.
fn open_copy(path: &Path) -> Result<File, FleetError> {
    let mut options = OpenOptions::new();
    options.read(true).write(true).create(true).truncate(false).mode(0o600);
    options.open(path).map_err(FleetError::io("open", path))
}
