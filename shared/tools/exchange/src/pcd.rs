//! Clouds as binary PCD 0.7, as the Point Cloud Library reads them.

use std::io::{self, Write};
use tessera_fusion::Mesh;

/// The vertices with normals and colours.
pub(crate) fn cloud(mesh: &Mesh, writer: &mut dyn Write) -> io::Result<()> {
    let n = mesh.positions.len();
    write!(
        writer,
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z normal_x normal_y normal_z rgb\n\
         SIZE 4 4 4 4 4 4 4\nTYPE F F F F F F F\nCOUNT 1 1 1 1 1 1 1\nWIDTH {n}\nHEIGHT 1\n\
         VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {n}\nDATA binary\n"
    )?;
    for ((position, normal), [r, g, b]) in mesh.positions.iter().zip(&mesh.normals).zip(&mesh.colours) {
        for value in position.iter().chain(normal) {
            writer.write_all(&value.to_le_bytes())?;
        }
        // A number whose bits are the colour.
        writer.write_all(&[*b, *g, *r, 0])?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_mesh::triangle;

    #[test]
    fn a_point_has_28_bytes() {
        let mut bytes = Vec::new();
        cloud(&triangle(), &mut bytes).unwrap();
        let end = bytes.windows(12).position(|window| window == b"DATA binary\n").unwrap() + 12;
        assert_eq!(bytes.len() - end, 3 * 28);
        assert_eq!(bytes[end + 24..end + 28], [10, 0, 255, 0]);
        assert!(String::from_utf8_lossy(&bytes[..end]).contains("\nPOINTS 3\n"));
    }
}
