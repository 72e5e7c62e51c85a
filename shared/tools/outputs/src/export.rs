//! All outputs of a run from its folder: journal, store, camera, configuration, ground truth.

use crate::ToolError;
use crate::facts::Beside;
use crate::files::write_file;
use crate::map::{self, MapInput};
use crate::ply::PlyVertex;
use crate::read_run::{ReadRun, read_run};
use crate::replay::Replay;
use crate::stored::map_keyframes;
use crate::summary::Summary;
use crate::voxels::VoxelCloud;
use crate::{states, trajectories};
use std::borrow::Cow;
use std::convert::Infallible;
use std::fs;
use std::path::Path;
use tessera_calibration::SurfaceWarp;
use tessera_evaluation::{Trajectory, read_tum, write_tum};
use tessera_geometry::Camera;
use tessera_journal::Follower;
use tessera_settings::Settings;
use tessera_slam::{AlignRecord, ColourModel, Context, OptimiseRecord};
use tessera_stage::{ALIGN_JOURNAL, BrokenFrames, OPTIMISE_JOURNAL, RunFile, RunFiles};
use tessera_surface::Vertex;

/// Name of the ground truth in the run directory.
const GROUNDTRUTH_FILE: &str = "groundtruth.txt";
/// Name of the refined camera beside the outputs.
const REFINED_CAMERA_FILE: &str = "camera_refined.toml";

/// Writes every output of the run in `run_folder` into `out_folder` and returns its summary.
///
/// # Errors
/// Names the file that cannot be read or written, and why.
pub fn export(run_folder: &Path, out_folder: &Path) -> Result<Summary, ToolError> {
    let run = read_run(run_folder)?;
    export_read(&run, out_folder)?;
    run.into_summary()
}

/// As [`export`], of a run that was read.
///
/// # Errors
/// As [`export`].
pub fn export_read(run: &ReadRun, out_folder: &Path) -> Result<(), ToolError> {
    let ReadRun { files, settings, replay, summary, .. } = run;
    fs::create_dir_all(out_folder).map_err(|error| ToolError::write(out_folder, error))?;
    trajectories::write(replay, out_folder)?;
    states::write(replay, out_folder)?;
    write_map(files, out_folder, replay, settings)?;
    if let Some(refined) = replay.refined() {
        write_camera(&refined.camera, &settings.run.source, out_folder)?;
    }
    summary.write(out_folder)
}

fn input_error(path: &Path, reason: impl std::fmt::Display) -> ToolError {
    ToolError::Input(format!("{}: {reason}", path.display()))
}

/// The settings that the run was made with.
pub fn read_settings(files: &RunFiles) -> Result<Settings, ToolError> {
    let path = files.config();
    let text = fs::read_to_string(&path).map_err(|error| {
        input_error(&path, format!("{error}: expected the folder of a run, which has a config.toml"))
    })?;
    Ok(Settings::from_run(&text, &path.display().to_string())?)
}

/// The journal of the aligner, folded; nothing where there is none yet.
pub fn read_journal(files: &RunFiles) -> Result<Replay, ToolError> {
    let path = files.align_journal();
    let mut replay = Replay::default();
    if !path.exists() {
        // The run ended before its first frame: there is nothing, and that is no error.
        return Ok(replay);
    }
    let mut follower = Follower::<AlignRecord>::open(&path, ALIGN_JOURNAL)?;
    while let Some(record) = follower.next()? {
        replay.apply(record);
    }
    Ok(replay)
}

/// What the run directory has for the verdict beside the journal; nothing where it has none.
pub(crate) fn read_beside(files: &RunFiles) -> Beside {
    let broken = BrokenFrames::new(files).read();
    match RunFile::read_recorded(files) {
        Ok(run) => Beside {
            broken,
            source_doubts: run.doubts,
            source_warnings: run.warnings,
            units_per_metre: run.camera.units_per_metre,
            focal_px: run.camera.fx,
            stated_colour: ColourModel::of_camera(&run.camera),
            seen_focal: None,
            lateral: None,
            n_from_base: None,
        },
        Err(_) => Beside { broken, ..Beside::default() },
    }
}

/// Corrections that the base of a fleet computed; `None` where the run asked no base.
pub(crate) fn n_from_base(files: &RunFiles, settings: &Settings) -> Result<Option<u64>, ToolError> {
    if settings.run.base_wait_s <= 0.0 {
        return Ok(None);
    }
    let (path, mut n) = (files.optimise_journal(), 0);
    if path.exists() {
        let mut follower = Follower::<OptimiseRecord>::open(&path, OPTIMISE_JOURNAL)?;
        while let Some(record) = follower.next()? {
            n = u64::saturating_add(n, record.is_from_base().into());
        }
    }
    Ok(Some(n))
}

/// Keeps the ground truth in the run folder, so that outputs need nothing from elsewhere.
pub fn write_groundtruth(run_folder: &Path, truth: Option<&Trajectory>) -> Result<(), ToolError> {
    let Some(truth) = truth else { return Ok(()) };
    write_file(&run_folder.join(GROUNDTRUTH_FILE), |mut writer| {
        let rows = truth.stamps_nanos.iter().copied().zip(&truth.poses);
        write_tum(&mut writer, "ground truth of the source\nmetres: timestamp tx ty tz qx qy qz qw", rows)
    })
}

/// The ground truth that the run kept, if it had one.
pub fn read_groundtruth(run_folder: &Path) -> Result<Option<Trajectory>, ToolError> {
    let path = run_folder.join(GROUNDTRUTH_FILE);
    if !path.exists() {
        return Ok(None);
    }
    Ok(Some(read_tum(&path)?))
}

/// The refined camera, as `--camera` reads it.
fn write_camera(camera: &Camera, source: &str, out_folder: &Path) -> Result<(), ToolError> {
    let text = toml::to_string(camera).map_err(|error| ToolError::Stage(error.to_string()))?;
    write_file(&out_folder.join(REFINED_CAMERA_FILE), |writer| {
        writeln!(writer, "# Refined by the final optimisation of a run of {source}.")?;
        writer.write_all(text.as_bytes())
    })
}

fn write_map(
    files: &RunFiles,
    out_folder: &Path,
    replay: &Replay,
    settings: &Settings,
) -> Result<(), ToolError> {
    clouds(files, replay, settings, &[replay.main_component()])?
        .iter()
        .try_for_each(|main| map::write(main, &out_folder.join("map.ply")))
}

/// The map of each of these components of submaps.
pub(crate) fn clouds(
    files: &RunFiles,
    replay: &Replay,
    settings: &Settings,
    components: &[u32],
) -> Result<Vec<VoxelCloud>, ToolError> {
    let run = RunFile::read_recorded(files)?;
    let keyframes = map_keyframes(files, &run, replay, settings)?;
    // One at a time: a map may have more surfaces than fit into memory.
    let surfaces = |id| -> Result<_, ToolError> {
        let vertices = keyframes.as_ref().map_or(Ok(Vec::new()), |stored| stored.load(id))?;
        Ok(Cow::Owned(vertices))
    };
    components.iter().map(|main| cloud(&run.camera, (replay, *main), settings, surfaces)).collect()
}

/// The points of `map.ply` of a run directory; `replay`: as the refined camera saw it, where there is one.
///
/// # Errors
/// Names the file that cannot be read, and why.
pub fn read_map(files: &RunFiles, replay: &Replay, settings: &Settings) -> Result<Vec<PlyVertex>, ToolError> {
    let clouds = clouds(files, replay, settings, &[replay.main_component()])?;
    Ok(clouds.iter().flat_map(map::ply_vertices).collect())
}

/// As [`read_map`], of a run without a directory, whose keyframes' surfaces `vertices` gives by id.
pub fn map_points<'s>(
    camera: &Camera,
    replay: &Replay,
    settings: &Settings,
    vertices: impl Fn(u32) -> &'s [Vertex],
) -> Vec<PlyVertex> {
    let surfaces = |id| Ok::<_, Infallible>(Cow::Borrowed(vertices(id)));
    let Ok(cloud) = cloud(camera, (replay, replay.main_component()), settings, surfaces);
    map::ply_vertices(&cloud).collect()
}

fn cloud<'s, E>(
    camera: &Camera,
    (replay, component): (&Replay, u32),
    settings: &Settings,
    vertices: impl Fn(u32) -> Result<Cow<'s, [Vertex]>, E>,
) -> Result<VoxelCloud, E> {
    let warp = refined_warp(camera, replay, settings);
    let refined = replay.refined().map_or(camera, |refined| &refined.camera);
    let step = settings.surface.step as usize;
    let input = MapInput { camera: refined, step, settings: &settings.output, warp: warp.as_ref() };
    map::gather((replay, component), &input, vertices)
}

/// From the surfaces of keyframes, as `camera` saw them, to those of the refined camera, where there is one.
pub fn refined_warp(camera: &Camera, replay: &Replay, settings: &Settings) -> Option<SurfaceWarp> {
    let context = Context::new(camera, &settings.surface, &settings.registration, &settings.mapping);
    let refined = replay.refined()?;
    Some(SurfaceWarp::new(camera, &refined.camera, context.grid, context.offset_px))
}
