//! The keyframes of a run, fused along its final trajectory.

use crate::{ExportFiles, RecordedRun};
use rayon::prelude::*;
use tessera_fusion::{FusionSettings, Mesh, VIEWS_AT_ONCE, View, Volume};
use tessera_geometry::{Camera, Twist, Vector6};
use tessera_outputs::ToolError;
use tessera_outputs::{self as outputs, Replay};
use tessera_stage::RunFile;
use tessera_surface::{SurfaceView, Vertex};

/// The camera of an earlier run whose keyframe that is, where it was another one.
pub(crate) fn earlier_camera<'a>(run: &'a RunFile, replay: &Replay, keyframe: u32) -> Option<&'a Camera> {
    run.map_cameras.get(replay.earlier_run(keyframe)?)
}

/// Fuses all keyframes, those of a map that the run started in among them; tells `progress` how many of
/// how many are done.
pub(crate) fn fuse(
    recorded: &RecordedRun<'_>,
    wanted: &ExportFiles,
    progress: &dyn Fn(usize, usize),
) -> Result<Mesh, ToolError> {
    let RecordedRun { files, replay, settings, run } = recorded;
    let mut volume = Volume::new(&FusionSettings {
        voxel_m: 1e-3 * wanted.voxel_mm,
        max_depth_m: wanted.max_depth_m,
        max_bytes: wanted.memory_mb as usize * 1_000_000,
        ..FusionSettings::default()
    });
    let Some(surfaces) = outputs::map_keyframes(files, run, replay, settings)? else {
        return Ok(Mesh::default());
    };
    let grid = run.layout(settings).grid;
    let warp = outputs::refined_warp(&run.camera, replay, settings);
    let camera = replay.refined().map_or(&run.camera, |refined| &refined.camera);
    let keyframes: Vec<_> = replay.main_keyframes().collect();
    for (part, keyframes_at_once) in keyframes.chunks(VIEWS_AT_ONCE).enumerate() {
        progress(part * VIEWS_AT_ONCE, keyframes.len());
        let loaded: Vec<Result<Vec<Vertex>, ToolError>> = keyframes_at_once
            .par_iter()
            .map(|(keyframe, _)| {
                let stored = surfaces.load(keyframe.id)?;
                Ok(warp.as_ref().map(|warp| warp.apply(&stored)).unwrap_or(stored))
            })
            .collect();
        let loaded = loaded.into_iter().collect::<Result<Vec<Vec<Vertex>>, ToolError>>()?;
        let views: Vec<View<'_>> = keyframes_at_once
            .iter()
            .zip(&loaded)
            .map(|((keyframe, world_from_camera), vertices)| View {
                // Of a map that other cameras made, that of its run.
                camera: earlier_camera(run, replay, keyframe.id).unwrap_or(camera),
                surface: SurfaceView { grid, vertices },
                world_from_camera: *world_from_camera,
                velocity: Twist::from_vector(&Vector6::from(keyframe.velocity)),
            })
            .collect();
        volume
            .integrate(&views)
            .map_err(|error| ToolError::Arguments(format!("{error}: --voxel-mm, --memory-mb")))?;
    }
    Ok(volume.mesh())
}
