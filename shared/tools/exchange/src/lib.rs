//! Export for other programs: the fused map as a cloud or a mesh, the trajectory in their formats.
#![forbid(unsafe_code)]

mod base;
mod colmap;
mod fuse;
mod glb;
mod grid;
mod mcap;
mod nerfstudio;
mod pcd;
mod ply;
mod poses;
mod seen_from_colour;
mod straight;
mod views;

pub use base::write_base;
use colmap::ModelForm;
use poses::{euroc, kitti};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use tessera_fusion::Mesh;
pub use tessera_occupancy::{parse_cell_m, parse_heights_m};
use tessera_outputs::{self as outputs, Replay, ToolError, write_file};
use tessera_settings::Settings;
use tessera_stage::{RunFile, RunFiles};
use views::ImageViews;

/// The files that are wanted, and how the map in them is fused.
#[derive(Clone, Debug)]
pub struct ExportFiles {
    /// The fused map as coloured points with normals, `.ply` or `.pcd`.
    pub cloud: Option<PathBuf>,
    /// The fused map as coloured triangles, `.ply` or `.glb`.
    pub mesh: Option<PathBuf>,
    /// Edge of the voxels of the fused map, millimetres.
    pub voxel_mm: f64,
    /// Points farther from their camera are not fused, metres.
    pub max_depth_m: f64,
    /// Memory for voxels at most, megabytes.
    pub memory_mb: u32,
    /// The final trajectory in KITTI's form.
    pub kitti: Option<PathBuf>,
    /// The final trajectory in EuRoC's form.
    pub euroc: Option<PathBuf>,
    /// Poses, keyframes and the fused map as messages of ROS 2.
    pub mcap: Option<PathBuf>,
    /// Folder of a COLMAP model: images, poses and points.
    pub colmap: Option<PathBuf>,
    /// Whether that model is text.
    pub colmap_text: bool,
    /// Folder of a dataset of nerfstudio.
    pub nerfstudio: Option<PathBuf>,
    /// Of tracked frames each so many has its images in them; keyframes where it is absent.
    pub every: Option<u64>,
    /// An occupancy grid for map_server, `.yaml`, with its image beside it.
    pub grid: Option<PathBuf>,
    /// How the grid is made.
    pub grid_options: GridFile,
}

/// How an occupancy grid is made.
#[derive(Clone, Copy, Debug)]
pub struct GridFile {
    /// Edge of its cells, metres.
    pub cell_m: f64,
    /// Heights of what is an obstacle, metres above the floor.
    pub heights_m: (f64, f64),
    /// Height of the first camera, held level, above the floor, metres; where it is absent the floor is found.
    pub camera_height_m: Option<f64>,
}

impl ExportFiles {
    fn needs_mesh(&self) -> bool {
        [&self.cloud, &self.mesh, &self.mcap, &self.colmap, &self.nerfstudio]
            .iter()
            .any(|path| path.is_some())
    }
}

/// A run as it was recorded.
pub(crate) struct RecordedRun<'a> {
    files: &'a RunFiles,
    replay: &'a Replay,
    settings: &'a Settings,
    run: &'a RunFile,
}

type Writer = fn(&Mesh, &mut dyn Write) -> io::Result<()>;

/// Writes the files that were asked for; returns a line for each. `progress` is told how many keyframes of how
/// many are fused.
///
/// # Errors
/// A name whose end is no known form, a run that cannot be read, a file that cannot be written.
pub fn write(
    run_folder: &Path,
    wanted: &ExportFiles,
    progress: &dyn Fn(usize, usize),
) -> Result<Vec<String>, ToolError> {
    // All names first: fusing takes a while.
    let cloud = wanted.cloud.as_deref().map(|path| cloud_form(path).map(|form| (path, form))).transpose()?;
    let mesh_file =
        wanted.mesh.as_deref().map(|path| mesh_form(path).map(|form| (path, form))).transpose()?;
    wanted.grid.as_deref().map_or(Ok(()), check_grid)?;
    let mut written = Vec::new();
    let is_asked = wanted.needs_mesh() || wanted.grid.is_some();
    if !is_asked && wanted.kitti.is_none() && wanted.euroc.is_none() {
        return Ok(written);
    }
    let files = RunFiles::new(run_folder);
    let replay = outputs::read_journal(&files)?;
    write_poses(&replay, wanted, &mut written)?;
    if !is_asked {
        return Ok(written);
    }
    let (settings, run) = (outputs::read_settings(&files)?, RunFile::read_recorded(&files)?);
    let recorded = RecordedRun { files: &files, replay: &replay, settings: &settings, run: &run };
    if let Some(path) = &wanted.grid {
        written.push(grid::write(path, &recorded, wanted)?);
    }
    // What needs the recording first: it may not be there.
    let views = views_of(&recorded, wanted)?;
    if !wanted.needs_mesh() {
        return Ok(written);
    }
    let mesh = fuse::fuse(&recorded, wanted, progress)?;
    for (path, form) in cloud.iter().chain(&mesh_file) {
        write_file(path, |writer| form(&mesh, writer))?;
    }
    let shown = |path: &Path, what: String| format!("{}: {what}", path.display());
    written.extend(cloud.map(|(path, _)| shown(path, format!("{} points", mesh.positions.len()))));
    written.extend(mesh_file.map(|(path, _)| shown(path, format!("{} triangles", mesh.triangles.len()))));
    if let Some(path) = &wanted.mcap {
        written.push(write_mcap(path, &replay, &mesh)?);
    }
    for (folder, form, views) in views {
        match form {
            Some(form) => colmap::write(folder, &views, &mesh, form)?,
            None => nerfstudio::write(folder, &views, &mesh)?,
        }
        let (n, points) = (views.views.len(), mesh.positions.len());
        let left_out = match views.n_left_out {
            0 => String::new(),
            n => format!("; {n} frames without a whole colour image are left out"),
        };
        written.push(shown(folder, format!("{n} images, {points} points{left_out}")));
    }
    Ok(written)
}

fn write_poses(replay: &Replay, wanted: &ExportFiles, written: &mut Vec<String>) -> Result<(), ToolError> {
    let rows = outputs::final_rows(replay);
    for (path, form) in [(&wanted.kitti, poses::kitti as poses::PoseForm), (&wanted.euroc, poses::euroc)] {
        let Some(path) = path else { continue };
        write_file(path, |writer| form(&rows, writer))?;
        written.push(format!("{}: {} poses", path.display(), rows.len()));
    }
    Ok(())
}

/// The images of each folder that is asked for, and the form of its model: COLMAP's, or that of nerfstudio.
type WrittenViews<'a> = Vec<(&'a Path, Option<ModelForm>, ImageViews)>;

fn views_of<'a>(recorded: &RecordedRun<'_>, wanted: &'a ExportFiles) -> Result<WrittenViews<'a>, ToolError> {
    let run = (recorded.replay, recorded.settings, recorded.run);
    let mut all = Vec::new();
    if let Some(folder) = &wanted.colmap {
        let form = if wanted.colmap_text { ModelForm::Text } else { ModelForm::Binary };
        all.push((folder.as_path(), Some(form), views::write(folder, run, wanted.every, false)?));
    }
    if let Some(folder) = &wanted.nerfstudio {
        all.push((folder.as_path(), None, views::write(folder, run, wanted.every, true)?));
    }
    Ok(all)
}

fn write_mcap(path: &Path, replay: &Replay, map: &Mesh) -> Result<String, ToolError> {
    let (rows, keyframes) = (outputs::final_rows(replay), outputs::keyframe_rows(replay));
    let contents = mcap::Contents { frames: &rows, keyframes: &keyframes, map };
    write_file(path, |writer| mcap::write(&contents, writer))?;
    let (n, points) = (rows.len(), map.positions.len());
    Ok(format!("{}: {n} poses, {} keyframes, {points} points", path.display(), keyframes.len()))
}

fn extension(path: &Path) -> String {
    path.extension().map_or(String::new(), |end| end.to_string_lossy().to_lowercase())
}

fn cloud_form(path: &Path) -> Result<Writer, ToolError> {
    match extension(path).as_str() {
        "ply" => Ok(ply::cloud),
        "pcd" => Ok(pcd::cloud),
        _ => Err(unknown("--cloud", path, ".ply or .pcd")),
    }
}

fn mesh_form(path: &Path) -> Result<Writer, ToolError> {
    match extension(path).as_str() {
        "ply" => Ok(ply::mesh),
        "glb" => Ok(glb::mesh),
        _ => Err(unknown("--mesh", path, ".ply or .glb")),
    }
}

fn check_grid(path: &Path) -> Result<(), ToolError> {
    match extension(path).as_str() {
        "yaml" | "yml" => Ok(()),
        _ => Err(unknown("--grid", path, ".yaml")),
    }
}

fn unknown(option: &str, path: &Path, expected: &str) -> ToolError {
    ToolError::Arguments(format!("{option} is {}, expected a name that ends in {expected}", path.display()))
}

#[cfg(test)]
mod test_mesh {
    use tessera_fusion::Mesh;

    /// One triangle.
    pub(crate) fn triangle() -> Mesh {
        Mesh {
            positions: vec![[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.5]],
            normals: vec![[0.0, 0.0, -1.0]; 3],
            colours: vec![[255, 0, 10]; 3],
            triangles: vec![[0, 1, 2]],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_says_the_form() {
        assert!(cloud_form(Path::new("a.PCD")).is_ok() && mesh_form(Path::new("b.glb")).is_ok());
        let error = mesh_form(Path::new("b.obj")).err().unwrap().to_string();
        assert_eq!(error, "--mesh is b.obj, expected a name that ends in .ply or .glb");
        let error = check_grid(Path::new("map.png")).unwrap_err().to_string();
        assert_eq!(error, "--grid is map.png, expected a name that ends in .yaml");
    }
}
