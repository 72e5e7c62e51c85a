//! `tessera clean`: removes what dead runs left in shared memory, and only that.

use crate::exit::{CommandError, Exit};
use crate::terminal::say;
use tessera_transport::{RunClaim, TransportError, registered_runs, remove_unnamed};

/// Cleans up after every run whose supervisor is gone; run folders stay as they are.
pub(crate) fn clean() -> Result<Exit, CommandError> {
    let runs = registered_runs()?;
    let (alive, dead): (Vec<_>, Vec<_>) = runs.into_iter().partition(|run| run.is_alive);
    let mut n_cleaned = 0;
    for run in dead {
        // Taking a name removes what its dead holder left; a run that began meanwhile keeps it.
        match RunClaim::take(&run.entry.name, &run.entry.run_dir) {
            Ok(claim) => {
                claim.release()?;
                n_cleaned += 1;
                say(&format!("cleaned up after {}", run.entry.name));
            }
            Err(TransportError::NameInUse { .. }) => {}
            Err(error) => return Err(error.into()),
        }
    }
    remove_unnamed()?;
    say(&format!("{n_cleaned} dead runs cleaned up, {} going on left alone", alive.len()));
    Ok(Exit::Done)
}
