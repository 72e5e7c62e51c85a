//! Memory limit of a stage.

use crate::log::tail;
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use std::path::Path;

/// Limits the private memory of this process. What does not fit is refused by the kernel, and the
/// process says so and aborts.
///
/// # Errors
/// Where the system refuses the limit itself.
pub(crate) fn limit_memory(megabytes: u64) -> std::io::Result<()> {
    if megabytes == 0 {
        return Ok(());
    }
    let Rlimit { maximum, .. } = getrlimit(Resource::Data);
    let wanted = megabytes.saturating_mul(1_000_000);
    let current = Some(maximum.map_or(wanted, |maximum| maximum.min(wanted)));
    Ok(setrlimit(Resource::Data, Rlimit { current, maximum })?)
}

/// Whether the last thing in the log is that memory could not be had: what Rust's runtime says
/// before it aborts.
pub fn ran_out_of_memory(log: &Path) -> bool {
    let text = tail(log, 4096).unwrap_or_default();
    text.lines().rev().take(5).any(|line| line.starts_with("memory allocation of "))
}
