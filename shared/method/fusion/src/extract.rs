//! The zero of the field as triangles: block by block, joined where blocks meet.

use crate::block::{Block, SIDE, Voxel, place as voxel_place};
use crate::mesh::Mesh;
use crate::volume::Volume;
use fast_surface_nets::ndshape::{ConstShape, ConstShape3u32};
use fast_surface_nets::{SurfaceNetsBuffer, surface_nets};
use rayon::prelude::*;
use std::collections::HashMap;

/// A block with a border of one voxel.
type Padded = ConstShape3u32<10, 10, 10>;
const PADDED_SIDE: i32 = SIDE + 2;

/// A vertex, named by the cube of voxels that it lies in.
#[derive(Clone, Copy)]
struct VoxelCorner {
    cube: [i32; 3],
    position: [f32; 3],
    normal: [f32; 3],
    rgb: [u8; 3],
}

/// Triangles of one block.
#[derive(Default)]
struct MeshPiece {
    vertices: Vec<VoxelCorner>,
    triangles: Vec<[u32; 3]>,
}

/// The mesh of all blocks, manifold and without pieces of fewer than `min_triangles`.
pub(crate) fn mesh(volume: &Volume, min_triangles: usize) -> Mesh {
    let places = volume.in_order();
    let pieces: Vec<MeshPiece> = places
        .par_iter()
        .map_init(SurfaceNetsBuffer::default, |buffer, place| piece(volume, place, buffer))
        .collect();
    let mut mesh = Mesh::default();
    let mut known: HashMap<[i32; 3], u32> = HashMap::new();
    for piece in pieces {
        let ids: Vec<u32> = piece
            .vertices
            .iter()
            .map(|corner| {
                *known.entry(corner.cube).or_insert_with(|| {
                    mesh.positions.push(corner.position);
                    mesh.normals.push(corner.normal);
                    mesh.colours.push(corner.rgb);
                    mesh.positions.len() as u32 - 1
                })
            })
            .collect();
        mesh.triangles.extend(piece.triangles.iter().map(|t| t.map(|k| ids[k as usize])));
    }
    mesh.manifold().without_small_pieces(min_triangles)
}

fn piece(volume: &Volume, place: &[i32; 3], buffer: &mut SurfaceNetsBuffer) -> MeshPiece {
    let voxels = padded(&volume.neighbourhood(place));
    // What was never seen counts as in front, so that the net is closed; its vertices go again.
    let field: Vec<f32> = voxels.iter().map(|v| if v.weight > 0.0 { v.distance } else { 1.0 }).collect();
    surface_nets(&field, &Padded {}, [0; 3], [PADDED_SIDE as u32 - 1; 3], buffer);
    let voxel_m = volume.voxel_m();
    let vertices: Vec<VoxelCorner> = (0..buffer.positions.len())
        .map(|k| {
            let corner = buffer.surface_points[k].map(|c| c as i32);
            let cube: [i32; 3] = std::array::from_fn(|axis| place[axis] * SIDE + corner[axis] - 1);
            // The array begins one voxel before the block; centres of voxels are at halves.
            let position = std::array::from_fn(|axis| {
                let voxels = f64::from(buffer.positions[k][axis]) - 0.5 + f64::from(place[axis] * SIDE);
                (voxels * voxel_m) as f32
            });
            VoxelCorner { cube, position, normal: unit(buffer.normals[k]), rgb: colour(&voxels, corner) }
        })
        .collect();
    let is_seen: Vec<bool> = buffer
        .surface_points
        .iter()
        .map(|c| corners(&voxels, c.map(|c| c as i32)).all(|v| v.weight > 0.0))
        .collect();
    let mut piece = MeshPiece::default();
    let mut ids = vec![u32::MAX; vertices.len()];
    for triangle in buffer.indices.chunks_exact(3) {
        if triangle.iter().all(|&k| is_seen[k as usize]) {
            let own = [0, 1, 2].map(|corner| {
                let k = triangle[corner] as usize;
                if ids[k] == u32::MAX {
                    ids[k] = piece.vertices.len() as u32;
                    piece.vertices.push(vertices[k]);
                }
                ids[k]
            });
            piece.triangles.push(own);
        }
    }
    piece
}

/// A block with one voxel of its neighbours all around.
fn padded(blocks: &[Option<&Block>; 27]) -> Vec<Voxel> {
    let mut voxels = vec![Voxel::default(); Padded::SIZE as usize];
    for (k, voxel) in voxels.iter_mut().enumerate() {
        let at = Padded::delinearize(k as u32).map(|c| c as i32 - 1);
        let offset = at.map(|c| c.div_euclid(SIDE) + 1);
        let Some(block) = blocks[(offset[0] + 3 * offset[1] + 9 * offset[2]) as usize] else { continue };
        let [x, y, z] = at.map(|c| c.rem_euclid(SIDE));
        *voxel = block.voxel(voxel_place(x, y, z));
    }
    voxels
}

/// The eight corners of a cube.
fn corners(voxels: &[Voxel], at: [i32; 3]) -> impl Iterator<Item = &Voxel> {
    (0..8).map(move |k| {
        let corner = [at[0] + (k & 1), at[1] + (k >> 1 & 1), at[2] + (k >> 2)].map(|c| c as u32);
        &voxels[Padded::linearize(corner) as usize]
    })
}

fn colour(voxels: &[Voxel], at: [i32; 3]) -> [u8; 3] {
    let (mut sum, mut weight) = ([0.0; 3], 0.0);
    for voxel in corners(voxels, at) {
        weight += voxel.colour_weight;
        sum.iter_mut().zip(voxel.rgb).for_each(|(sum, c)| *sum += voxel.colour_weight * c);
    }
    // No colour was seen: grey.
    if weight > 0.0 { sum.map(|c| (c / weight + 0.5) as u8) } else { [128; 3] }
}

fn unit(v: [f32; 3]) -> [f32; 3] {
    let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    if length > 0.0 { v.map(|c| c / length) } else { [0.0; 3] }
}
