//! The map of a base of a fleet for other programs, from the files in its folder.

use crate::{ExportFiles, cloud_form, euroc, extension, kitti};
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use tessera_evaluation::read_tum;
use tessera_fusion::Mesh;
use tessera_outputs::{ToolError, write_file};

/// The folder of the map in that of a base.
const MAP: &str = "map";
/// The cloud of the largest map.
const CLOUD: &str = "map.ply";
/// Ends of the files that are the outputs of a base.
const OUTPUTS: [&str; 3] = ["ply", "txt", "json"];
/// Bytes of a point: position, normal, colour.
const POINT_BYTES: usize = 27;

/// Writes the files that were asked for from a base's map, and all its outputs into `out`; says a line for each.
///
/// # Errors
/// Where the base has no map, what is asked for needs whole surfaces, or a file cannot be read or written.
pub fn write_base(base: &Path, wanted: &ExportFiles, out: Option<&Path>) -> Result<Vec<String>, ToolError> {
    let folder = base.join(MAP);
    let needs_surfaces = [
        ("--mesh", &wanted.mesh),
        ("--mcap", &wanted.mcap),
        ("--colmap", &wanted.colmap),
        ("--nerfstudio", &wanted.nerfstudio),
        ("--grid", &wanted.grid),
    ];
    if let Some((option, _)) = needs_surfaces.iter().find(|(_, path)| path.is_some()) {
        return Err(ToolError::Arguments(format!(
            "{option} needs whole surfaces, and the map of a base has none: it is made of the folder of a run (with tessera base --whole those in {} too), or take --cloud",
            base.display()
        )));
    }
    let names = outputs(&folder)?;
    if names.is_empty() {
        return Err(ToolError::Input(format!("{} has no map yet", base.display())));
    }
    let mut written = Vec::new();
    if let Some(path) = &wanted.cloud {
        let form = cloud_form(path)?;
        let cloud = read_cloud(&folder.join(CLOUD))?;
        write_file(path, |writer| form(&cloud, writer))?;
        written.push(format!("{}: {} points", path.display(), cloud.positions.len()));
    }
    for (path, form) in [(&wanted.kitti, kitti as crate::poses::PoseForm), (&wanted.euroc, euroc)] {
        let Some(path) = path else { continue };
        for (label, name) in names.iter().filter_map(|name| Some((label(name)?, name))) {
            let from = folder.join(name);
            let read =
                read_tum(&from).map_err(|error| ToolError::Input(format!("{}: {error}", from.display())))?;
            let rows: Vec<_> = read.stamps_nanos.into_iter().zip(read.poses).collect();
            let path = labelled(path, label);
            write_file(&path, |writer| form(&rows, writer))?;
            written.push(format!("{}: {} poses", path.display(), rows.len()));
        }
    }
    if let Some(out) = out {
        let cannot = |error: io::Error| ToolError::Input(format!("{}: {error}", out.display()));
        std::fs::create_dir_all(out).map_err(cannot)?;
        for name in &names {
            std::fs::copy(folder.join(name), out.join(name)).map_err(cannot)?;
            written.push(out.join(name).display().to_string());
        }
    } else if written.is_empty() {
        written.extend(names.iter().map(|name| folder.join(name).display().to_string()));
    }
    Ok(written)
}

/// Names of the outputs in a map's folder, in order; none where there is no map.
fn outputs(folder: &Path) -> Result<Vec<String>, ToolError> {
    let entries = match std::fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(ToolError::Input(format!("{}: {error}", folder.display()))),
    };
    let names = entries.flatten().filter_map(|entry| entry.file_name().into_string().ok());
    let is_output = |name: &String| OUTPUTS.contains(&extension(Path::new(name)).as_str());
    let mut names: Vec<String> = names.filter(is_output).collect();
    names.sort();
    Ok(names)
}

/// The run and component of a trajectory by the name of its file.
fn label(name: &str) -> Option<&str> {
    name.strip_prefix("trajectory_")?.strip_suffix(".txt")
}

/// `poses.txt` of a run is `poses_RUN.txt`.
fn labelled(path: &Path, label: &str) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let end = path.extension().map_or(String::new(), |end| format!(".{}", end.to_string_lossy()));
    path.with_file_name(format!("{stem}_{label}{end}"))
}

/// The points of a `map.ply` as `tessera_outputs::write_ply` writes it.
fn read_cloud(path: &Path) -> Result<Mesh, ToolError> {
    let wrong = |what: &str| ToolError::Input(format!("{}: {what}", path.display()));
    let file = std::fs::File::open(path).map_err(|error| wrong(&error.to_string()))?;
    let mut reader = BufReader::new(file);
    let mut n_points = None;
    loop {
        let mut line = String::new();
        let n = reader.read_line(&mut line).map_err(|error| wrong(&error.to_string()))?;
        if let Some(count) = line.trim().strip_prefix("element vertex ") {
            n_points = count.parse::<usize>().ok();
        }
        match line.trim() {
            "end_header" => break,
            _ if n == 0 => return Err(wrong("it has no end of its head, expected a cloud of Tessera")),
            _ => {}
        }
    }
    let mut bytes = Vec::new();
    reader.read_to_end(&mut bytes).map_err(|error| wrong(&error.to_string()))?;
    let n_points = n_points.ok_or_else(|| wrong("its head names no number of points"))?;
    if n_points.checked_mul(POINT_BYTES) != Some(bytes.len()) {
        return Err(wrong(&format!(
            "{} bytes behind its head, expected 27 for each of {n_points} points",
            bytes.len()
        )));
    }
    let mut cloud = Mesh::default();
    for point in bytes.as_chunks::<POINT_BYTES>().0 {
        let number = |at: usize| f32::from_le_bytes([point[at], point[at + 1], point[at + 2], point[at + 3]]);
        cloud.positions.push([number(0), number(4), number(8)]);
        cloud.normals.push([number(12), number(16), number(20)]);
        cloud.colours.push([point[24], point[25], point[26]]);
    }
    Ok(cloud)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ply;
    use crate::test_mesh::triangle;

    fn wanted() -> ExportFiles {
        ExportFiles {
            cloud: None,
            mesh: None,
            voxel_mm: 10.0,
            max_depth_m: 4.0,
            memory_mb: 100,
            kitti: None,
            euroc: None,
            mcap: None,
            colmap: None,
            colmap_text: false,
            nerfstudio: None,
            every: None,
            grid: None,
            grid_options: crate::GridFile { cell_m: 0.05, heights_m: (0.1, 1.0), camera_height_m: None },
        }
    }

    fn base() -> tempfile::TempDir {
        let base = tempfile::tempdir().unwrap();
        let map = base.path().join(MAP);
        std::fs::create_dir(&map).unwrap();
        write_file(&map.join(CLOUD), |writer| ply::cloud(&triangle(), writer)).unwrap();
        std::fs::write(map.join("trajectory_a_one.txt"), "1.0 1 2 3 0 0 0 1\n1.1 1 2 4 0 0 0 1\n").unwrap();
        std::fs::write(map.join("trajectory_b_two.txt"), "2.0 0 0 0 0 0 0 1\n").unwrap();
        std::fs::write(map.join("scene.html"), "").unwrap();
        base
    }

    #[test]
    fn cloud_and_trajectories_of_all_robots_are_written() {
        let base = base();
        let file = |name: &str| base.path().join(name);
        let (cloud, kitti, euroc) = (Some(file("x.ply")), Some(file("k.txt")), Some(file("e.csv")));
        let written =
            write_base(base.path(), &ExportFiles { cloud, kitti, euroc, ..wanted() }, None).unwrap();
        assert_eq!(written.len(), 5, "{written:?}");
        assert_eq!(read_cloud(&file("x.ply")).unwrap().positions, triangle().positions);
        assert_eq!(read_cloud(&file("x.ply")).unwrap().colours, triangle().colours);
        assert_eq!(std::fs::read_to_string(file("k_a_one.txt")).unwrap().lines().count(), 2);
        assert!(std::fs::read_to_string(file("e_b_two.csv")).unwrap().contains("2000000000,"));
        let out = file("out");
        let written = write_base(base.path(), &wanted(), Some(&out)).unwrap();
        assert_eq!(written.len(), 3, "{written:?}");
        assert!(out.join(CLOUD).is_file() && !out.join("scene.html").exists());
        assert_eq!(write_base(base.path(), &wanted(), None).unwrap().len(), 3);
    }

    #[test]
    fn what_a_base_has_not_is_named() {
        let base = base();
        let words = |wanted: &ExportFiles| write_base(base.path(), wanted, None).unwrap_err().to_string();
        let mesh = ExportFiles { mesh: Some("m.glb".into()), ..wanted() };
        assert!(words(&mesh).contains("--mesh needs whole surfaces"), "{}", words(&mesh));
        let cloud = ExportFiles { cloud: Some("m.xyz".into()), ..wanted() };
        assert!(words(&cloud).contains("--cloud is m.xyz"), "{}", words(&cloud));
        let path = base.path().join("map/map.ply");
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() - 1]).unwrap();
        let cloud = ExportFiles { cloud: Some(base.path().join("x.ply")), ..wanted() };
        assert!(words(&cloud).contains("expected 27 for each of 3 points"), "{}", words(&cloud));
        std::fs::remove_dir_all(base.path().join(MAP)).unwrap();
        assert!(words(&wanted()).contains("has no map yet"));
    }
}
