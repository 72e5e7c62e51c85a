//! Clouds and meshes as binary PLY.

use std::io::{self, Write};
use tessera_fusion::Mesh;
use tessera_outputs::{PlyVertex, write_ply};

/// The vertices alone.
pub(crate) fn cloud(mesh: &Mesh, writer: &mut dyn Write) -> io::Result<()> {
    write_ply(mesh.positions.len(), vertices(mesh), &[], writer)
}

/// Vertices and triangles.
pub(crate) fn mesh(mesh: &Mesh, writer: &mut dyn Write) -> io::Result<()> {
    write_ply(mesh.positions.len(), vertices(mesh), &mesh.triangles, writer)
}

fn vertices(mesh: &Mesh) -> impl Iterator<Item = PlyVertex> {
    let rows = mesh.positions.iter().zip(&mesh.normals).zip(&mesh.colours);
    rows.map(|((&position, &normal), &rgb)| PlyVertex { position, normal, rgb })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_mesh::triangle;

    #[test]
    fn a_mesh_has_its_triangles_and_a_cloud_has_none() {
        let (mut with, mut without) = (Vec::new(), Vec::new());
        mesh(&triangle(), &mut with).unwrap();
        cloud(&triangle(), &mut without).unwrap();
        assert!(String::from_utf8_lossy(&with).contains("element face 1"));
        assert!(!String::from_utf8_lossy(&without).contains("element face"));
    }
}
