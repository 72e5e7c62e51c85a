//! What the aligner says, checked before anybody goes by it.

use crate::Ports;
use tessera_messages::Flow;
use tessera_stage::StageError;

/// The aligner's newest word since the last look; one that breaks a rule is counted and told.
pub(crate) fn hear(ports: &mut Ports) -> Result<Option<Flow>, StageError> {
    let Some(newest) = ports.flow.newest()? else { return Ok(None) };
    match newest.validate() {
        Ok(()) => Ok(Some(newest)),
        Err(refusal) => {
            tracing::warn!("refused: {refusal}");
            ports.pulse.beat.refused += 1;
            Ok(None)
        }
    }
}
