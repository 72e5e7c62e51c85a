//! Corrections of the optimiser: when they take effect.

use crate::durable_state::JournaledAligner;
use crate::journal_fold::End;
use crate::ports::Ports;
use tessera_messages::WaitingOn;
use tessera_stage::StageError;

/// Applies the correction of `request` before frame `before`, if it has been journaled.
pub(crate) fn apply_correction(
    state: &mut JournaledAligner,
    ports: &mut Ports,
    request: u64,
    before: u64,
) -> Result<bool, StageError> {
    let Some(correction) = state.take_correction(request)? else { return Ok(false) };
    ports.pulse.working(before);
    let Some(record) = state.fold.tracker.correction_record(correction, before) else {
        return Err(StageError::Inconsistent(format!(
            "correction {request} was computed from other keyframes than those of the journal"
        )));
    };
    state.commit(record)?;
    tracing::info!(frame = before, "correction {request} takes effect");
    ports.pulse.progress();
    Ok(true)
}

/// Applies the oldest correction that is pending before frame `before`, if there is one; in live
/// mode no frame is fixed for it.
pub(crate) fn apply_oldest_correction(
    state: &mut JournaledAligner,
    ports: &mut Ports,
    before: u64,
) -> Result<bool, StageError> {
    let Some(correction) = state.take_oldest_correction()? else { return Ok(false) };
    let request = correction.request;
    match state.fold.tracker.correction_record(correction, before) {
        Some(record) => state.commit(record)?,
        None => tracing::warn!(request, "a correction of other keyframes is dropped"),
    }
    ports.pulse.progress();
    Ok(true)
}

/// After the end: whether the final correction has taken effect.
pub(crate) fn finish(state: &mut JournaledAligner, ports: &mut Ports, end: End) -> Result<bool, StageError> {
    ports.control.finish();
    ports.notify_sensor()?;
    match end.request {
        Some(request) if !state.is_applied(request.request) => {
            if !apply_correction(state, ports, request.request, end.n_frames)? {
                ports.wait(WaitingOn::Correction)?;
            }
            Ok(false)
        }
        _ => Ok(true),
    }
}
