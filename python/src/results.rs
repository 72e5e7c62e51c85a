//! What a run amounts to beside its poses: the fused mesh, the verdict, and counts.

use crate::detached::refuse;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyTuple};
use tessera_fusion::{FusionSettings, Mesh, VIEWS_AT_ONCE, View, Volume};
use tessera_geometry::{Camera, Twist, Vector6};
use tessera_outputs::facts::{Beside, Facts};
use tessera_outputs::verdict::verdict as judge;
use tessera_outputs::{Ended, Replay, RunStatistics, refined_warp};
use tessera_settings::Settings;
use tessera_surface::{Grid, SurfaceView, Vertex};

/// Grade, and grade, finding and advice of each reason.
pub(crate) type VerdictColumns = (String, Vec<(String, String, String)>);
/// Loops closed and rejected, submaps, frames of each submap that is apart.
pub(crate) type CountsTuple = (u64, u64, u32, Vec<(u32, u64)>);

/// The columns of a mesh.
pub(crate) struct MeshColumns(Mesh);

impl MeshColumns {
    /// Positions, normals, colours, triangles.
    pub(crate) fn into_python(self, py: Python<'_>) -> PyResult<Bound<'_, PyTuple>> {
        let Mesh { positions, normals, colours, triangles } = self.0;
        let floats =
            |values: &[[f32; 3]]| values.iter().flatten().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
        let triangles: Vec<u8> = triangles.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        let colours: Vec<u8> = colours.into_iter().flatten().collect();
        let of = |column: &[u8]| PyBytes::new(py, column);
        (of(&floats(&positions)), of(&floats(&normals)), of(&colours), of(&triangles)).into_pyobject(py)
    }
}

/// Fuses the keyframes; voxels of so many metres, points at most so far from their camera.
pub(crate) fn mesh<'s>(
    (camera, map_cameras): (&Camera, &[Camera]),
    settings: &Settings,
    replay: &Replay,
    [voxel_m, max_depth_m]: [f64; 2],
    vertices: impl Fn(u32) -> &'s [Vertex],
) -> PyResult<MeshColumns> {
    for (name, value, most) in [("voxel_m", voxel_m, 1.0), ("max_depth_m", max_depth_m, 100.0)] {
        if !(1e-3..=most).contains(&value) {
            return Err(refuse(format!("{name} is {value}, expected 0.001 to {most} metres")));
        }
    }
    let mut volume = Volume::new(&FusionSettings { voxel_m, max_depth_m, ..FusionSettings::default() });
    let step = settings.surface.step as usize;
    let (width, height) = (camera.width as usize, camera.height as usize);
    let grid = Grid { width: width.div_ceil(step), height: height.div_ceil(step), step };
    let warp = refined_warp(camera, replay, settings);
    let camera = replay.refined().map_or(camera, |refined| &refined.camera);
    let keyframes: Vec<_> = replay.main_keyframes().collect();
    for at_once in keyframes.chunks(VIEWS_AT_ONCE) {
        let load = |id: u32| {
            let stored = vertices(id).to_vec();
            warp.as_ref().map(|warp| warp.apply(&stored)).unwrap_or(stored)
        };
        let loaded: Vec<Vec<Vertex>> = at_once.iter().map(|(keyframe, _)| load(keyframe.id)).collect();
        let there = at_once.iter().zip(&loaded).filter(|(_, vertices)| vertices.len() == grid.len());
        let views: Vec<View<'_>> = there
            .map(|((keyframe, world_from_camera), vertices)| View {
                // Of a map that other cameras made, that of its run.
                camera: replay
                    .earlier_run(keyframe.id)
                    .and_then(|run| map_cameras.get(run))
                    .unwrap_or(camera),
                surface: SurfaceView { grid, vertices },
                world_from_camera: *world_from_camera,
                velocity: Twist::from_vector(&Vector6::from(keyframe.velocity)),
            })
            .collect();
        volume.integrate(&views).map_err(|error| refuse(format!("{error}: give a larger voxel_m")))?;
    }
    Ok(MeshColumns(volume.mesh()))
}

/// The verdict on what was given so far, as on a run that ended here.
pub(crate) fn verdict(camera: &Camera, replay: &Replay) -> VerdictColumns {
    let statistics = RunStatistics { ended: Ended::Finished, ..RunStatistics::default() };
    let beside = Beside { units_per_metre: camera.units_per_metre, focal_px: camera.fx, ..Beside::default() };
    let verdict = judge(&Facts::new(replay, &statistics, None, &beside));
    let reason =
        |reason: tessera_outputs::verdict::Reason| (reason.grade.to_string(), reason.found, reason.advice);
    (verdict.grade.to_string(), verdict.reasons.into_iter().map(reason).collect())
}

/// Counts of loops and submaps.
pub(crate) fn counts(replay: &Replay) -> CountsTuple {
    let apart = replay.apart().into_iter().collect();
    (replay.n_loops_closed(), replay.n_loops_rejected(), replay.submaps().n(), apart)
}
