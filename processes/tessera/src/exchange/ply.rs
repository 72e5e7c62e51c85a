//! Clouds and meshes as binary PLY.

use std::io::{self, Write};
use tessera_fusion::Mesh;

/// The vertices alone.
pub(super) fn cloud(mesh: &Mesh, writer: &mut dyn Write) -> io::Result<()> {
    header(mesh, 0, writer)?;
    vertices(mesh, writer)
}

/// Vertices and triangles.
pub(super) fn mesh(mesh: &Mesh, writer: &mut dyn Write) -> io::Result<()> {
    header(mesh, mesh.triangles.len(), writer)?;
    vertices(mesh, writer)?;
    for triangle in &mesh.triangles {
        writer.write_all(&[3])?;
        for corner in triangle {
            writer.write_all(&(*corner as i32).to_le_bytes())?;
        }
    }
    Ok(())
}

fn header(mesh: &Mesh, n_triangles: usize, writer: &mut dyn Write) -> io::Result<()> {
    writeln!(writer, "ply\nformat binary_little_endian 1.0\nelement vertex {}", mesh.positions.len())?;
    for name in ["x", "y", "z", "nx", "ny", "nz"] {
        writeln!(writer, "property float {name}")?;
    }
    for name in ["red", "green", "blue"] {
        writeln!(writer, "property uchar {name}")?;
    }
    if n_triangles > 0 {
        writeln!(writer, "element face {n_triangles}\nproperty list uchar int vertex_indices")?;
    }
    writeln!(writer, "end_header")
}

fn vertices(mesh: &Mesh, writer: &mut dyn Write) -> io::Result<()> {
    for ((position, normal), rgb) in mesh.positions.iter().zip(&mesh.normals).zip(&mesh.colours) {
        for value in position.iter().chain(normal) {
            writer.write_all(&value.to_le_bytes())?;
        }
        writer.write_all(rgb)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::test_mesh::triangle;
    use super::*;

    #[test]
    fn vertices_have_27_bytes_and_triangles_13() {
        let mut bytes = Vec::new();
        mesh(&triangle(), &mut bytes).unwrap();
        let end = bytes.windows(11).position(|window| window == b"end_header\n").unwrap() + 11;
        assert_eq!(bytes.len() - end, 3 * 27 + 13);
        assert_eq!(bytes[bytes.len() - 4..], 2i32.to_le_bytes());
        let mut bytes = Vec::new();
        cloud(&triangle(), &mut bytes).unwrap();
        assert!(!String::from_utf8_lossy(&bytes).contains("element face"));
    }
}
