//! `tessera export`: its arguments.

use super::Speech;
use clap::Args;
use std::path::PathBuf;
use tessera_exchange::{parse_cell_m, parse_heights_m};

/// `tessera export`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "\
With any of --cloud to --grid only those files are written, else (or with --out) all
outputs.

Examples:
  tessera export room-1
  tessera export results/desk --out elsewhere
  tessera export room-1 --cloud room.pcd --mesh room.glb --voxel-mm 5
  tessera export room-1 --kitti poses.txt --euroc poses.csv
  tessera export desk --colmap desk_colmap --every 5
  tessera export desk --nerfstudio desk_nerf
  tessera export desk --grid map.yaml --camera-height 0.8")]
pub(crate) struct ExportArguments {
    /// Name of the run, or its folder; or that of a base, for the map of its robots
    pub(crate) run: String,
    /// Folder for the outputs [default: the run's own]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) files: ExportSelection,
    #[command(flatten)]
    pub(crate) speech: Speech,
}

/// What other programs read.
#[derive(Clone, Debug, Args)]
pub(crate) struct ExportSelection {
    /// The fused map as coloured points with normals: FILE.ply or FILE.pcd
    #[arg(long, value_name = "FILE")]
    pub(crate) cloud: Option<PathBuf>,
    /// The fused map as coloured triangles: FILE.ply or FILE.glb
    #[arg(long, value_name = "FILE")]
    pub(crate) mesh: Option<PathBuf>,
    /// Edge of the voxels of the fused map, millimetres
    #[arg(long, value_name = "MM", default_value_t = 10.0, value_parser = positive)]
    pub(crate) voxel_mm: f64,
    /// Points farther from their camera are not fused, metres
    #[arg(long, value_name = "M", default_value_t = 4.0, value_parser = positive)]
    pub(crate) max_depth_m: f64,
    /// Memory for voxels at most, megabytes
    #[arg(long, value_name = "MB", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) memory_mb: u32,
    /// The final trajectory as KITTI has it: rows of a 3x4 matrix, without times
    #[arg(long, value_name = "FILE")]
    pub(crate) kitti: Option<PathBuf>,
    /// The final trajectory as EuRoC has it: CSV, nanoseconds, quaternions w x y z
    #[arg(long, value_name = "FILE")]
    pub(crate) euroc: Option<PathBuf>,
    /// Poses, transforms, keyframes and the fused map as messages of ROS 2, for Foxglove too
    #[arg(long, value_name = "FILE")]
    pub(crate) mcap: Option<PathBuf>,
    /// A COLMAP model for Gaussian splatting: DIR/images and DIR/sparse/0, without distortion
    #[arg(long, value_name = "DIR")]
    pub(crate) colmap: Option<PathBuf>,
    /// The COLMAP model as text [default: binary]
    #[arg(long, requires = "colmap")]
    pub(crate) colmap_text: bool,
    /// A dataset of nerfstudio: DIR/transforms.json with images, depth and points
    #[arg(long, value_name = "DIR")]
    pub(crate) nerfstudio: Option<PathBuf>,
    /// Images of every Nth tracked frame [default: of the keyframes]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) every: Option<u64>,
    /// An occupancy grid for map_server: FILE.yaml, with FILE.pgm beside it
    #[arg(long, value_name = "FILE")]
    pub(crate) grid: Option<PathBuf>,
    /// Edge of the grid's cells, metres
    #[arg(long, value_name = "M", default_value_t = 0.05, value_parser = parse_cell_m)]
    pub(crate) grid_cell: f64,
    /// Heights of obstacles above the floor, metres
    #[arg(long, value_name = "LOW,HIGH", default_value = "0.1,1.0", value_parser = parse_heights_m, allow_hyphen_values = true)]
    pub(crate) grid_heights: (f64, f64),
    /// Height of the first camera, held level, above the floor, metres [default: the floor is found]
    #[arg(long, value_name = "M", value_parser = positive)]
    pub(crate) camera_height: Option<f64>,
}

impl From<&ExportSelection> for tessera_exchange::ExportFiles {
    fn from(files: &ExportSelection) -> Self {
        let ExportSelection { cloud, mesh, voxel_mm, max_depth_m, memory_mb, kitti, euroc, mcap, .. } =
            files.clone();
        let ExportSelection { colmap, colmap_text, nerfstudio, every, grid, .. } = files.clone();
        let grid_options = tessera_exchange::GridFile {
            cell_m: files.grid_cell,
            heights_m: files.grid_heights,
            camera_height_m: files.camera_height,
        };
        Self {
            cloud,
            mesh,
            voxel_mm,
            max_depth_m,
            memory_mb,
            kitti,
            euroc,
            mcap,
            colmap,
            colmap_text,
            nerfstudio,
            every,
            grid,
            grid_options,
        }
    }
}

/// A length that is more than nothing and less than a hundred thousand.
fn positive(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| format!("{text:?} is no number"))?;
    if value > 0.0 && value < 1e5 { Ok(value) } else { Err(format!("found {value}, expected more than 0")) }
}
