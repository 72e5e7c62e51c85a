//! What the features of a run's keyframes say of the camera's focal length.

use crate::ToolError;
use crate::facts::Beside;
use crate::replay::Replay;
use crate::stored::map_keyframes;
use tessera_features::FocalRatio;
use tessera_geometry::{Twist, Vector6};
use tessera_settings::Settings;
use tessera_slam::{Context, FocalView, KeyframeSurfaces, seen_focal_ratio};
use tessera_stage::{RunFile, RunFiles};

/// The focal length over the stated one that the features of the keyframes of the main component fit.
///
/// # Errors
/// Names the file that cannot be read, and why.
pub(crate) fn seen_focal(
    files: &RunFiles,
    replay: &Replay,
    settings: &Settings,
    beside: &Beside,
) -> Result<Option<FocalRatio>, ToolError> {
    let run = RunFile::read_recorded(files)?;
    let Some(stored) = map_keyframes(files, &run, replay, settings)? else { return Ok(None) };
    let colour = replay.colour(beside.stated_colour).model;
    let context = Context::new(&run.camera, &settings.surface, &settings.registration, &settings.mapping)
        .with_colour_model(colour);
    // Those of the camera in question: a map may have been made by others before.
    let is_own = |id: u32| run.map_cameras.is_empty() || replay.earlier_run(id).is_none();
    let (keyframes, poses): (Vec<_>, Vec<_>) =
        replay.main_keyframes().filter(|(keyframe, _)| is_own(keyframe.id)).unzip();
    seen_focal_ratio(&context, &poses, |place| {
        #[expect(clippy::indexing_slicing, reason = "as many keyframes as poses")]
        let keyframe = keyframes[place];
        let velocity = Twist::from_vector(&Vector6::from(keyframe.velocity));
        let features = stored.features_once(keyframe.id).into_owned();
        Ok(FocalView::new(&context, features, &stored.load(keyframe.id)?, &velocity))
    })
}
