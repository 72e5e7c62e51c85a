//! Points and meshes as binary PLY.

use std::io::{self, Write};

/// A vertex: position in metres, unit normal, red, green, blue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlyVertex {
    /// Position, metres.
    pub position: [f32; 3],
    /// Unit normal.
    pub normal: [f32; 3],
    /// Red, green, blue.
    pub rgb: [u8; 3],
}

/// Writes `n_vertices` vertices, and triangles of their indices where there are any. Nothing in the
/// file depends on when or where it is written.
///
/// # Errors
/// As the writer's.
pub fn write_ply(
    n_vertices: usize,
    vertices: impl Iterator<Item = PlyVertex>,
    triangles: &[[u32; 3]],
    writer: &mut dyn Write,
) -> io::Result<()> {
    writeln!(writer, "ply\nformat binary_little_endian 1.0\nelement vertex {n_vertices}")?;
    for name in ["x", "y", "z", "nx", "ny", "nz"] {
        writeln!(writer, "property float {name}")?;
    }
    for name in ["red", "green", "blue"] {
        writeln!(writer, "property uchar {name}")?;
    }
    if !triangles.is_empty() {
        writeln!(writer, "element face {}\nproperty list uchar int vertex_indices", triangles.len())?;
    }
    writeln!(writer, "end_header")?;
    for vertex in vertices {
        for value in vertex.position.iter().chain(&vertex.normal) {
            writer.write_all(&value.to_le_bytes())?;
        }
        writer.write_all(&vertex.rgb)?;
    }
    for triangle in triangles {
        writer.write_all(&[3])?;
        for corner in triangle {
            writer.write_all(&(*corner as i32).to_le_bytes())?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vertices_have_27_bytes_and_triangles_13() {
        let vertex = |x| PlyVertex { position: [x, 0.0, 2.0], normal: [0.0, 0.0, -1.0], rgb: [1, 2, 3] };
        let write = |triangles: &[[u32; 3]]| {
            let mut bytes = Vec::new();
            write_ply(3, [0.0, 1.0, 2.0].map(vertex).into_iter(), triangles, &mut bytes).unwrap();
            let end = bytes.windows(11).position(|window| window == b"end_header\n").unwrap() + 11;
            assert!(bytes.starts_with(b"ply\nformat binary_little_endian 1.0\nelement vertex 3\n"));
            assert_eq!(
                String::from_utf8_lossy(&bytes[..end]).contains("element face"),
                !triangles.is_empty()
            );
            bytes.split_off(end)
        };
        let cloud = write(&[]);
        assert_eq!(cloud.len(), 3 * 27);
        assert_eq!(&cloud[27..31], 1.0f32.to_le_bytes());
        assert_eq!(&cloud[24..27], [1, 2, 3]);
        let mesh = write(&[[0, 1, 2]]);
        assert_eq!(mesh.len(), 3 * 27 + 13);
        assert_eq!(mesh[mesh.len() - 4..], 2i32.to_le_bytes());
    }
}
