//! The stored surfaces of a run's keyframes.

use crate::ToolError;
use crate::replay::Replay;
use tessera_settings::Settings;
use tessera_stage::{RunFile, RunFiles, StoredKeyframes};

/// The surfaces of all keyframes; `None` where there is no keyframe.
pub fn map_keyframes(
    files: &RunFiles,
    run: &RunFile,
    replay: &Replay,
    settings: &Settings,
) -> Result<Option<StoredKeyframes>, ToolError> {
    if replay.keyframes.is_empty() {
        return Ok(None);
    }
    let grid = run.layout(settings).grid;
    let mut mapped = StoredKeyframes::open(&files.store(), grid)?;
    for keyframe in &replay.keyframes {
        mapped.add(keyframe.id, &keyframe.slot)?;
    }
    Ok(Some(mapped))
}
