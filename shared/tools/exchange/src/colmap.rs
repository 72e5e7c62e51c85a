//! A COLMAP model, which Gaussian splatting begins with: `images`, and in `sparse/0` cameras, poses and points.

use crate::views::{ImageView, ImageViews};
use std::io::{self, Write};
use std::path::Path;
use tessera_fusion::Mesh;
use tessera_geometry::Camera;
use tessera_outputs::{ToolError, write_file};

/// Number of COLMAP's model `PINHOLE`.
const PINHOLE: i32 = 1;
/// The only camera.
const CAMERA_ID: u32 = 1;
/// Reprojection error of a point that no feature gave, as COLMAP has it.
const NO_ERROR: f64 = -1.0;
/// There the middle of the first pixel is at 0.5.
const HALF_PX: f64 = 0.5;

/// Whether the model is written as text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ModelForm {
    Binary,
    Text,
}

type ModelFile = (&'static str, fn(&ImageViews, &Mesh, &mut dyn Write) -> io::Result<()>);

const BINARY: [ModelFile; 3] =
    [("cameras.bin", cameras_bin), ("images.bin", images_bin), ("points3D.bin", points_bin)];
const TEXT: [ModelFile; 3] =
    [("cameras.txt", cameras_txt), ("images.txt", images_txt), ("points3D.txt", points_txt)];

/// Writes the model beside its images; one of the other form, of an earlier export, is removed: it would be read
/// first.
pub(crate) fn write(
    folder: &Path,
    views: &ImageViews,
    points: &Mesh,
    form: ModelForm,
) -> Result<(), ToolError> {
    let sparse = folder.join("sparse").join("0");
    std::fs::create_dir_all(&sparse).map_err(|error| ToolError::write(&sparse, error))?;
    let (own, other) = if form == ModelForm::Binary { (BINARY, TEXT) } else { (TEXT, BINARY) };
    for (name, _) in other {
        let old = sparse.join(name);
        if old.exists() {
            std::fs::remove_file(&old).map_err(|error| ToolError::write(&old, error))?;
        }
    }
    own.iter()
        .try_for_each(|(name, part)| write_file(&sparse.join(name), |writer| part(views, points, writer)))
}

fn params(camera: &Camera) -> [f64; 4] {
    [camera.fx, camera.fy, camera.cx + HALF_PX, camera.cy + HALF_PX]
}

/// Quaternion with w first and translation of `camera_from_world`.
fn placed(view: &ImageView) -> [f64; 7] {
    let camera_from_world = view.world_from_camera.inverse();
    let (t, q) = (camera_from_world.translation.vector, camera_from_world.rotation.quaternion());
    [q.w, q.i, q.j, q.k, t.x, t.y, t.z]
}

fn cameras_txt(views: &ImageViews, _: &Mesh, writer: &mut dyn Write) -> io::Result<()> {
    let (camera, [fx, fy, cx, cy]) = (&views.camera, params(&views.camera));
    writeln!(writer, "# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n# Number of cameras: 1")?;
    writeln!(writer, "{CAMERA_ID} PINHOLE {} {} {fx} {fy} {cx} {cy}", camera.width, camera.height)
}

fn images_txt(views: &ImageViews, _: &Mesh, writer: &mut dyn Write) -> io::Result<()> {
    writeln!(writer, "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n# POINTS2D[], none")?;
    for (id, view) in (1..).zip(&views.views) {
        let numbers = placed(view).map(|number| number.to_string()).join(" ");
        writeln!(writer, "{id} {numbers} {CAMERA_ID} {}\n", view.name)?;
    }
    Ok(())
}

fn points_txt(_: &ImageViews, points: &Mesh, writer: &mut dyn Write) -> io::Result<()> {
    writeln!(writer, "# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[], none")?;
    for (id, ([x, y, z], [r, g, b])) in (1..).zip(points.positions.iter().zip(&points.colours)) {
        writeln!(writer, "{id} {x} {y} {z} {r} {g} {b} {NO_ERROR}")?;
    }
    Ok(())
}

fn cameras_bin(views: &ImageViews, _: &Mesh, writer: &mut dyn Write) -> io::Result<()> {
    writer.write_all(&1u64.to_le_bytes())?;
    writer.write_all(&CAMERA_ID.to_le_bytes())?;
    writer.write_all(&PINHOLE.to_le_bytes())?;
    for side in [views.camera.width, views.camera.height] {
        writer.write_all(&u64::from(side).to_le_bytes())?;
    }
    params(&views.camera).iter().try_for_each(|value| writer.write_all(&value.to_le_bytes()))
}

fn images_bin(views: &ImageViews, _: &Mesh, writer: &mut dyn Write) -> io::Result<()> {
    writer.write_all(&(views.views.len() as u64).to_le_bytes())?;
    for (id, view) in (1u32..).zip(&views.views) {
        writer.write_all(&id.to_le_bytes())?;
        placed(view).iter().try_for_each(|value| writer.write_all(&value.to_le_bytes()))?;
        writer.write_all(&CAMERA_ID.to_le_bytes())?;
        writer.write_all(view.name.as_bytes())?;
        // The end of the name, and no points in the image.
        writer.write_all(&[0; 9])?;
    }
    Ok(())
}

fn points_bin(_: &ImageViews, points: &Mesh, writer: &mut dyn Write) -> io::Result<()> {
    writer.write_all(&(points.positions.len() as u64).to_le_bytes())?;
    for (id, (position, rgb)) in (1u64..).zip(points.positions.iter().zip(&points.colours)) {
        writer.write_all(&id.to_le_bytes())?;
        for metres in position {
            writer.write_all(&f64::from(*metres).to_le_bytes())?;
        }
        writer.write_all(rgb)?;
        writer.write_all(&NO_ERROR.to_le_bytes())?;
        writer.write_all(&0u64.to_le_bytes())?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_mesh::triangle;
    use tessera_geometry::Pose;

    fn views() -> ImageViews {
        let view = ImageView {
            stamp_nanos: 0,
            name: "000007.png".to_owned(),
            depth_name: None,
            world_from_camera: Pose::translation(1.0, 2.0, 3.0),
        };
        let camera = Camera::pinhole((640, 480), [500.0, 501.0, 319.5, 239.5], 1000.0);
        ImageViews { camera, views: vec![view], n_left_out: 0 }
    }

    fn text(part: fn(&ImageViews, &Mesh, &mut dyn Write) -> io::Result<()>) -> String {
        let mut bytes = Vec::new();
        part(&views(), &triangle(), &mut bytes).unwrap();
        String::from_utf8(bytes)
            .unwrap()
            .lines()
            .filter(|line| !line.starts_with('#'))
            .collect::<Vec<_>>()
            .join("\n")
    }

    #[test]
    fn text_is_camera_from_world_and_pixels_from_the_edge() {
        assert_eq!(text(cameras_txt), "1 PINHOLE 640 480 500 501 320 240");
        assert_eq!(text(images_txt), "1 1 -0 -0 -0 -1 -2 -3 1 000007.png\n");
        assert_eq!(text(points_txt).lines().next(), Some("1 0 0 1 255 0 10 -1"));
    }

    #[test]
    fn binary_files_have_the_lengths_of_the_format() {
        let length = |part: fn(&ImageViews, &Mesh, &mut dyn Write) -> io::Result<()>| {
            let mut bytes = Vec::new();
            part(&views(), &triangle(), &mut bytes).unwrap();
            bytes.len()
        };
        assert_eq!(length(cameras_bin), 8 + 4 + 4 + 16 + 32);
        assert_eq!(length(images_bin), 8 + 4 + 56 + 4 + 11 + 8);
        assert_eq!(length(points_bin), 8 + 3 * (8 + 24 + 3 + 8 + 8));
    }

    #[test]
    fn a_model_of_the_other_form_is_not_left_beside() {
        let dir = tempfile::tempdir().unwrap();
        for (form, expected) in [(ModelForm::Binary, "cameras.bin"), (ModelForm::Text, "cameras.txt")] {
            write(dir.path(), &views(), &triangle(), form).unwrap();
            let files = std::fs::read_dir(dir.path().join("sparse/0")).unwrap();
            let names: Vec<String> = files.map(|f| f.unwrap().file_name().into_string().unwrap()).collect();
            assert!(names.len() == 3 && names.iter().any(|name| name == expected), "{names:?}");
        }
    }
}
