//! A dataset of nerfstudio: `transforms.json` with images, depth in millimetres and points.

use crate::ply;
use crate::views::{DEPTH, IMAGES, ImageView, ImageViews};
use serde_json::{Value, json};
use std::path::Path;
use tessera_fusion::Mesh;
use tessera_geometry::Pose;
use tessera_outputs::{ToolError, write_file};

const FILE: &str = "transforms.json";
const POINTS: &str = "points.ply";

/// Writes `transforms.json` and the points beside the images.
pub(crate) fn write(folder: &Path, views: &ImageViews, points: &Mesh) -> Result<(), ToolError> {
    write_file(&folder.join(POINTS), |writer| ply::cloud(points, writer))?;
    write_file(&folder.join(FILE), |writer| {
        serde_json::to_writer_pretty(&mut *writer, &description(views))?;
        writer.write_all(b"\n")
    })
}

fn description(views: &ImageViews) -> Value {
    let camera = &views.camera;
    let mut description = json!({
        "camera_model": "OPENCV",
        "w": camera.width, "h": camera.height,
        // There the middle of the first pixel is at 0.5.
        "fl_x": camera.fx, "fl_y": camera.fy, "cx": camera.cx + 0.5, "cy": camera.cy + 0.5,
        "k1": 0.0, "k2": 0.0, "p1": 0.0, "p2": 0.0,
        "ply_file_path": POINTS,
        "frames": views.views.iter().map(frame).collect::<Vec<Value>>(),
    });
    if views.views.iter().any(|view| view.depth_name.is_some()) {
        // Metres of a unit of the depth images.
        description["depth_unit_scale_factor"] = json!(0.001);
    }
    description
}

fn frame(view: &ImageView) -> Value {
    let mut frame = json!({
        "file_path": format!("{IMAGES}/{}", view.name),
        "timestamp": view.stamp_nanos as f64 * 1e-9,
        "transform_matrix": in_opengl_axes(&view.world_from_camera),
    });
    if let Some(name) = &view.depth_name {
        frame["depth_file_path"] = json!(format!("{DEPTH}/{name}"));
    }
    frame
}

/// Rows of `world_from_camera` of a camera with x right, y up and z backward.
fn in_opengl_axes(world_from_camera: &Pose) -> [[f64; 4]; 4] {
    let matrix = world_from_camera.to_homogeneous();
    let sign = [1.0, -1.0, -1.0, 1.0];
    std::array::from_fn(|row| std::array::from_fn(|column| sign[column] * matrix[(row, column)]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_camera_looks_along_minus_z() {
        let rows = in_opengl_axes(&Pose::translation(1.0, 2.0, 3.0));
        assert_eq!(
            rows,
            [[1.0, 0.0, 0.0, 1.0], [0.0, -1.0, 0.0, 2.0], [0.0, 0.0, -1.0, 3.0], [0.0, 0.0, 0.0, 1.0]]
        );
    }
}
