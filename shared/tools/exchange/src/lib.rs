//! Export for other programs: the fused map as a cloud or a mesh, the trajectory in their formats.
#![forbid(unsafe_code)]

mod base;
mod fuse;
mod glb;
mod mcap;
mod pcd;
mod ply;
mod poses;

pub use base::write_base;
use poses::{euroc, kitti};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use tessera_fusion::Mesh;
use tessera_outputs::ToolError;
use tessera_outputs::{self as outputs, write_file};
use tessera_stage::RunFiles;

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
}

type Writer = fn(&Mesh, &mut dyn Write) -> io::Result<()>;

/// Writes the files that were asked for; says a line for each. `progress` is told how many keyframes of how
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
    let trajectories = [(&wanted.kitti, kitti as poses::PoseForm), (&wanted.euroc, euroc)];
    let mut written = Vec::new();
    let maps = [&wanted.cloud, &wanted.mesh, &wanted.mcap];
    if maps.iter().all(|path| path.is_none()) && wanted.kitti.is_none() && wanted.euroc.is_none() {
        return Ok(written);
    }
    let files = RunFiles::new(run_folder);
    let replay = outputs::read_journal(&files)?;
    let rows = outputs::final_rows(&replay);
    for (path, form) in trajectories {
        let Some(path) = path else { continue };
        write_file(path, |writer| form(&rows, writer))?;
        written.push(format!("{}: {} poses", path.display(), rows.len()));
    }
    if maps.iter().any(|path| path.is_some()) {
        let mesh = fuse::fuse(&files, &replay, wanted, progress)?;
        for (path, form) in cloud.iter().chain(&mesh_file) {
            write_file(path, |writer| form(&mesh, writer))?;
        }
        if let Some((path, _)) = cloud {
            written.push(format!("{}: {} points", path.display(), mesh.positions.len()));
        }
        if let Some((path, _)) = mesh_file {
            written.push(format!("{}: {} triangles", path.display(), mesh.triangles.len()));
        }
        if let Some(path) = &wanted.mcap {
            let keyframes = outputs::keyframe_rows(&replay);
            let contents = mcap::Contents { frames: &rows, keyframes: &keyframes, map: &mesh };
            write_file(path, |writer| mcap::write(&contents, writer))?;
            let (n, points) = (rows.len(), mesh.positions.len());
            written.push(format!(
                "{}: {n} poses, {} keyframes, {points} points",
                path.display(),
                keyframes.len()
            ));
        }
    }
    Ok(written)
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
    }
}
