//! The map as an occupancy grid, which map_server reads.

use crate::fuse::earlier_camera;
use crate::{ExportFiles, GridFile, RecordedRun};
use std::path::Path;
use tessera_geometry::Pose;
use tessera_occupancy::{
    CellLattice, CellVotes, ColouredPoint, Floor, FloorFinder, KeyframeView, OccupancyCells, RayScan,
    thinned_surface,
};
use tessera_outputs::{self as outputs, ToolError};

/// A keyframe: `world_from_camera`, and points in its camera's axes.
type PlacedPoints = (Pose, Vec<ColouredPoint>);

/// Writes the grid of all keyframes; returns what is to be told of it.
pub(crate) fn write(
    path: &Path,
    recorded: &RecordedRun<'_>,
    wanted: &ExportFiles,
) -> Result<String, ToolError> {
    let options = &wanted.grid_options;
    let (keyframes, found) = gather(recorded, options, wanted.max_depth_m)?;
    let floor = match options.camera_height_m {
        Some(height_m) => Floor::below_level_camera(height_m),
        None => found.ok_or_else(|| {
            ToolError::Input(format!(
                "{}: no floor was seen: --camera-height M tells how high the first camera is above it, held level",
                recorded.run.name
            ))
        })?,
    };
    let lattice = CellLattice::new(options.cell_m, options.heights_m);
    let mut votes = CellVotes::new(&lattice);
    for (world_from_camera, points) in &keyframes {
        votes.add(&RayScan::of_keyframe(
            &lattice,
            &(floor.grid_from_world * world_from_camera),
            points.iter(),
        ));
    }
    let grid = votes.grid().ok_or_else(|| {
        ToolError::Input(format!("{}: no keyframe has a point in the grid", recorded.run.name))
    })?;
    tessera_occupancy::write_map(&grid, options.cell_m, path)
        .map_err(|error| ToolError::write(path, error))?;
    Ok(told(path, &grid, &floor, options))
}

fn told(path: &Path, grid: &OccupancyCells, floor: &Floor, options: &GridFile) -> String {
    let how = match options.camera_height_m {
        Some(_) => "as told".to_owned(),
        None => format!("found, {:.0} degrees from the image's top", floor.tilt_deg),
    };
    format!(
        "{}: {}x{} cells of {} m; floor {:.2} m below the first camera ({how})",
        path.display(),
        grid.width,
        grid.height,
        options.cell_m,
        floor.camera_height_m
    )
}

/// The keyframes with their points, and the floor where there is one.
fn gather(
    recorded: &RecordedRun<'_>,
    options: &GridFile,
    max_depth_m: f64,
) -> Result<(Vec<PlacedPoints>, Option<Floor>), ToolError> {
    let RecordedRun { files, replay, settings, run } = recorded;
    let (mut keyframes, mut finder) = (Vec::new(), FloorFinder::default());
    let Some(surfaces) = outputs::map_keyframes(files, run, replay, settings)? else {
        return Ok((keyframes, None));
    };
    let warp = outputs::refined_warp(&run.camera, replay, settings);
    let camera = replay.refined().map_or(&run.camera, |refined| &refined.camera);
    for (keyframe, world_from_camera) in replay.main_keyframes() {
        let stored = surfaces.load(keyframe.id)?;
        let vertices = warp.as_ref().map(|warp| warp.apply(&stored)).unwrap_or(stored);
        let seen = KeyframeView {
            camera: earlier_camera(run, replay, keyframe.id).unwrap_or(camera),
            step: settings.surface.step as usize,
            velocity: keyframe.velocity,
        };
        finder.add(&vertices, &world_from_camera, max_depth_m);
        // Half a cell: of a closed surface no cell is left without a point.
        keyframes
            .push((world_from_camera, thinned_surface(&vertices, &seen, max_depth_m, 0.5 * options.cell_m)));
    }
    let floor = finder.find();
    Ok((keyframes, floor))
}
