//! Check of the system's limits before anything of a run is made.

use crate::failure::SupervisorError;
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

/// Files that one process of a run may have open, sockets and shared memory among them: some 60
/// are needed, and a few for each dead predecessor that is being cleaned up.
const OPEN_FILES: u64 = 128;

/// Raises the limit on open files as far as is needed and allowed; the stages inherit it.
///
/// # Errors
/// [`SupervisorError::OpenFiles`] where fewer are allowed: iceoryx2 would tell of it as an
/// internal failure.
pub(crate) fn ensure_open_files() -> Result<(), SupervisorError> {
    let Rlimit { current, maximum } = getrlimit(Resource::Nofile);
    let has_enough = |limit: Option<u64>| limit.is_none_or(|limit| limit >= OPEN_FILES);
    if has_enough(current) {
        return Ok(());
    }
    let raised = Rlimit { current: Some(OPEN_FILES), maximum };
    if has_enough(maximum) && setrlimit(Resource::Nofile, raised).is_ok() {
        return Ok(());
    }
    Err(SupervisorError::OpenFiles { allowed: maximum.unwrap_or_default(), needed: OPEN_FILES })
}
