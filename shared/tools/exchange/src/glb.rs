//! Meshes as binary glTF 2.0, which browsers and Blender open.

use serde_json::json;
use std::io::{self, Write};
use tessera_fusion::Mesh;

/// `FLOAT`, `UNSIGNED_SHORT`, `UNSIGNED_INT` of the format.
const TYPES: [u32; 3] = [5126, 5123, 5125];

/// Vertices with normals and colours, and triangles.
pub(crate) fn mesh(mesh: &Mesh, writer: &mut dyn Write) -> io::Result<()> {
    let n = mesh.positions.len();
    // Positions, normals, colours (linear, four numbers of two bytes), indices.
    let lengths = [12 * n, 12 * n, 8 * n, 12 * mesh.triangles.len()];
    let mut head = description(mesh, lengths).to_string().into_bytes();
    head.resize(head.len().next_multiple_of(4), b' ');
    let n_bytes: usize = lengths.iter().sum();
    let total = u32::try_from(12 + 8 + head.len() + 8 + n_bytes)
        .map_err(|_| io::Error::other("the mesh is larger than the 4 GB of a GLB: expected larger voxels"))?;
    for number in [0x4654_6c67, 2, total, head.len() as u32, 0x4e4f_534a] {
        writer.write_all(&number.to_le_bytes())?;
    }
    writer.write_all(&head)?;
    for number in [n_bytes as u32, 0x004e_4942] {
        writer.write_all(&number.to_le_bytes())?;
    }
    for value in mesh.positions.iter().chain(&mesh.normals).flatten() {
        writer.write_all(&value.to_le_bytes())?;
    }
    let linear: Vec<u16> = (0..=255).map(linear).collect();
    for rgb in &mesh.colours {
        for value in rgb.iter().map(|&c| linear[c as usize]).chain([u16::MAX]) {
            writer.write_all(&value.to_le_bytes())?;
        }
    }
    for corner in mesh.triangles.iter().flatten() {
        writer.write_all(&corner.to_le_bytes())?;
    }
    Ok(())
}

fn description(mesh: &Mesh, lengths: [usize; 4]) -> serde_json::Value {
    if mesh.triangles.is_empty() {
        // The format has no mesh of nothing.
        return json!({ "asset": { "version": "2.0", "generator": "Tessera" } });
    }
    let n = mesh.positions.len();
    let bound = |start: f32, pick: fn(f32, f32) -> f32| -> Vec<f32> {
        (0..3).map(|axis| mesh.positions.iter().fold(start, |most, p| pick(most, p[axis]))).collect()
    };
    let (low, high) = (bound(f32::INFINITY, f32::min), bound(f32::NEG_INFINITY, f32::max));
    let begin = |k: usize| lengths[..k].iter().sum::<usize>();
    let views: Vec<_> = (0..4)
        .map(|k| {
            let target = if k == 3 { 34963 } else { 34962 };
            json!({ "buffer": 0, "byteOffset": begin(k), "byteLength": lengths[k], "target": target })
        })
        .collect();
    json!({
        "asset": { "version": "2.0", "generator": "Tessera" },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        // The first camera's axes, y down, become the format's, y up: half a turn about x.
        "nodes": [{ "mesh": 0, "name": "map", "rotation": [1.0, 0.0, 0.0, 0.0] }],
        "meshes": [{ "primitives": [{
            "attributes": { "POSITION": 0, "NORMAL": 1, "COLOR_0": 2 }, "indices": 3, "material": 0
        }] }],
        "materials": [{
            // White is the default, and what trimesh asks for.
            "pbrMetallicRoughness": { "baseColorFactor": [1.0, 1.0, 1.0, 1.0], "metallicFactor": 0.0, "roughnessFactor": 1.0 }, "doubleSided": true
        }],
        "accessors": [
            { "bufferView": 0, "componentType": TYPES[0], "count": n, "type": "VEC3", "min": low, "max": high },
            { "bufferView": 1, "componentType": TYPES[0], "count": n, "type": "VEC3" },
            { "bufferView": 2, "componentType": TYPES[1], "count": n, "type": "VEC4", "normalized": true },
            { "bufferView": 3, "componentType": TYPES[2], "count": 3 * mesh.triangles.len(), "type": "SCALAR" },
        ],
        "bufferViews": views,
        "buffers": [{ "byteLength": lengths.iter().sum::<usize>() }],
    })
}

/// A byte of an image as light: the inverse of the sRGB curve.
fn linear(value: u32) -> u16 {
    let v = f64::from(value) / 255.0;
    let light = if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) };
    (light * f64::from(u16::MAX) + 0.5) as u16
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_mesh::triangle;

    #[test]
    fn lengths_are_what_the_head_says() {
        let mut bytes = Vec::new();
        mesh(&triangle(), &mut bytes).unwrap();
        let number = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        assert_eq!((&bytes[..4], number(8)), (&b"glTF"[..], bytes.len()));
        let head: serde_json::Value = serde_json::from_slice(&bytes[20..20 + number(12)]).unwrap();
        assert_eq!(number(12) % 4, 0);
        assert_eq!(head["buffers"][0]["byteLength"], number(20 + number(12)));
        assert_eq!(head["accessors"][0]["max"], json!([1.0, 1.0, 1.5]));
        assert_eq!((linear(0), linear(255)), (0, u16::MAX));
        mesh(&Mesh::default(), &mut Vec::new()).unwrap();
    }
}
