//! A mesh whose edges have at most two triangles.
//!
//! Surface nets have one vertex in a cube of voxels, also where two sheets of the surface pass through
//! it; there an edge has four triangles. Each sheet gets vertices of its own.

use crate::mesh::{Mesh, root};
use rayon::prelude::*;

/// One side of a triangle, as part of an undirected edge.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct HalfEdge {
    /// The vertices of the edge, the lower one first.
    ends: [u32; 2],
    triangle: u32,
    /// Corners of the triangle at these ends.
    corners: [u32; 2],
}

impl HalfEdge {
    /// The side of a triangle that begins at a corner; `vertex` names the vertex of a corner.
    fn new(triangle: usize, corner: usize, vertex: impl Fn(usize) -> u32) -> Self {
        let corners = [corner, (corner + 1) % 3];
        let ends = corners.map(vertex);
        let (ends, corners) =
            if ends[0] < ends[1] { (ends, corners) } else { ([ends[1], ends[0]], [corners[1], corners[0]]) };
        Self { ends, triangle: triangle as u32, corners: corners.map(|corner| corner as u32) }
    }

    /// The corner at which the side begins, in the order of the triangle.
    fn first_corner(&self) -> usize {
        self.corners[usize::from(!self.is_forward())] as usize
    }

    /// Whether the triangle runs from the lower vertex to the higher one.
    fn is_forward(&self) -> bool {
        (self.corners[0] + 1) % 3 == self.corners[1]
    }

    /// Numbers of its corners among those of all triangles.
    fn places(&self) -> [u32; 2] {
        self.corners.map(|corner| 3 * self.triangle + corner)
    }
}

impl Mesh {
    /// The same triangles with no edge in more than two of them, and no vertex in more than one fan:
    /// vertices at which sheets touch are there once for each sheet.
    pub(crate) fn manifold(self) -> Self {
        let edges = self.half_edges();
        let crowded: Vec<HalfEdge> =
            edges.chunk_by(is_same).filter(|edge| !is_plain(edge)).flatten().copied().collect();
        let fans = self.fans(&edges, &vec![false; self.triangles.len()]);
        let is_loose = self.too_many(&crowded, &fans);
        let fans = if is_loose.contains(&true) { self.fans(&edges, &is_loose) } else { fans };
        self.with_vertices(&fans)
    }

    /// The fan of each triangle's corners, named by one of them: triangles that go on into each other
    /// across an edge have a fan in common at either end. Loose triangles stand alone.
    fn fans(&self, edges: &[HalfEdge], is_loose: &[bool]) -> Vec<u32> {
        let mut parents: Vec<u32> = (0..3 * self.triangles.len() as u32).collect();
        let mut join = |pair: [&HalfEdge; 2]| {
            if pair.iter().any(|side| is_loose[side.triangle as usize]) {
                return;
            }
            let [a, b] = pair.map(HalfEdge::places);
            for end in 0..2 {
                let (a, b) = (root(&mut parents, a[end]), root(&mut parents, b[end]));
                parents[a.max(b) as usize] = a.min(b);
            }
        };
        for edge in edges.chunk_by(is_same) {
            match edge {
                [one, other] if is_plain(edge) => join([one, other]),
                _ => self.partners(edge).iter().for_each(|[one, other]| join([one, other])),
            }
        }
        (0..parents.len() as u32).map(|corner| root(&mut parents, corner)).collect()
    }

    /// All sides of all triangles, in order of edges.
    fn half_edges(&self) -> Vec<HalfEdge> {
        let mut edges: Vec<HalfEdge> = (0..3 * self.triangles.len())
            .into_par_iter()
            .map(|k| HalfEdge::new(k / 3, k % 3, |corner| self.triangles[k / 3][corner]))
            .collect();
        edges.par_sort_unstable();
        edges
    }

    /// The triangles of an edge in pairs that go on into each other: one each way, and of several those
    /// whose normals agree best.
    fn partners(&self, edge: &[HalfEdge]) -> Vec<[HalfEdge; 2]> {
        let (forward, mut backward): (Vec<HalfEdge>, Vec<HalfEdge>) =
            edge.iter().partition(|e| e.is_forward());
        let mut pairs = Vec::new();
        for one in forward {
            let agreement = |other: &HalfEdge| self.agreement(one.triangle, other.triangle);
            let best = (0..backward.len())
                .max_by(|&i, &j| agreement(&backward[i]).total_cmp(&agreement(&backward[j])).then(j.cmp(&i)));
            pairs.extend(best.map(|best| [one, backward.remove(best)]));
        }
        pairs
    }

    /// Cosine of the angle between two triangles.
    fn agreement(&self, a: u32, b: u32) -> f32 {
        let [a, b] = [a, b].map(|triangle| {
            let [p, q, r] = self.triangles[triangle as usize]
                .map(|k| nalgebra::Vector3::from(self.positions[k as usize]));
            (q - p).cross(&(r - p)).try_normalize(0.0).unwrap_or_default()
        });
        a.dot(&b)
    }

    /// Triangles that are still too many at an edge: sheets that touch along it and are one sheet round
    /// both of its ends. One triangle each way stays.
    /// `crowded`: the sides of all edges that more than one triangle runs along the same way.
    fn too_many(&self, crowded: &[HalfEdge], fans: &[u32]) -> Vec<bool> {
        let mut is_loose = vec![false; self.triangles.len()];
        let by_fans = |side: &HalfEdge| {
            let triangle = side.triangle as usize;
            HalfEdge::new(triangle, side.first_corner(), |corner| fans[3 * triangle + corner])
        };
        let mut edges: Vec<HalfEdge> = crowded.iter().map(by_fans).collect();
        edges.sort_unstable();
        for edge in edges.chunk_by(is_same) {
            for forward in [true, false] {
                let same_way = edge.iter().filter(|side| side.is_forward() == forward);
                same_way.skip(1).for_each(|side| is_loose[side.triangle as usize] = true);
            }
        }
        is_loose
    }

    /// The mesh with one vertex for each fan of corners, named by one of them.
    fn with_vertices(&self, fans: &[u32]) -> Self {
        let mut new = vec![u32::MAX; fans.len()];
        let mut mesh = Self::default();
        for (triangle, old) in self.triangles.iter().enumerate() {
            let own = [0, 1, 2].map(|corner| {
                let (fan, old) = (fans[3 * triangle + corner] as usize, old[corner] as usize);
                if new[fan] == u32::MAX {
                    new[fan] = mesh.push_vertex_of(self, old);
                }
                new[fan]
            });
            mesh.triangles.push(own);
        }
        mesh
    }
}

fn is_same(a: &HalfEdge, b: &HalfEdge) -> bool {
    a.ends == b.ends
}

/// Whether an edge has one triangle, or one each way.
fn is_plain(edge: &[HalfEdge]) -> bool {
    match edge {
        [_] => true,
        [one, other] => one.is_forward() != other.is_forward(),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    fn mesh(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Mesh {
        Mesh {
            positions: positions.to_vec(),
            normals: vec![[0.0, 0.0, 1.0]; positions.len()],
            colours: vec![[0; 3]; positions.len()],
            triangles: triangles.to_vec(),
        }
    }

    /// Two roofs whose ridges are the edge of the first two.
    const ROOFS: [[f32; 3]; 6] = [
        [0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [-1.0, 0.5, -0.3],
        [1.0, 0.5, -0.3],
        [-1.0, 0.5, 0.3],
        [1.0, 0.5, 0.3],
    ];
    const SLOPES: [[u32; 3]; 4] = [[0, 1, 2], [1, 0, 3], [1, 0, 4], [0, 1, 5]];

    /// Most triangles at an edge.
    fn most(mesh: &Mesh) -> usize {
        let mut n = BTreeMap::new();
        for t in &mesh.triangles {
            for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                *n.entry((a.min(b), a.max(b))).or_insert(0) += 1;
            }
        }
        n.into_values().max().unwrap()
    }

    #[test]
    fn two_sheets_that_touch_along_an_edge_come_apart() {
        // Two roofs back to back whose ridges are the same edge.
        let touching = mesh(&ROOFS, &SLOPES);
        assert_eq!(most(&touching), 4);
        let apart = touching.clone().manifold();
        assert_eq!(most(&apart), 2);
        assert_eq!((apart.triangles.len(), apart.positions.len()), (4, 8));
        for (new, old) in apart.triangles.iter().zip(&touching.triangles) {
            let at = |mesh: &Mesh, t: &[u32; 3]| t.map(|k| mesh.positions[k as usize]);
            assert_eq!(at(&apart, new), at(&touching, old));
        }
        // The upper roof's halves stay together, and so do the lower one's.
        let is_together =
            |a: usize, b: usize| apart.triangles[a].iter().any(|k| apart.triangles[b].contains(k));
        assert!(is_together(0, 1) && is_together(2, 3) && !is_together(0, 2) && !is_together(1, 3));
    }

    #[test]
    fn a_vertex_of_two_fans_is_there_twice_and_a_plain_mesh_stays() {
        let positions = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [-1.0, -1.0, 0.0]];
        let pinched = mesh(&positions, &[[0, 1, 2], [0, 3, 4]]);
        assert_eq!(pinched.manifold().positions.len(), 6);
        let plain = mesh(&positions[..4], &[[0, 1, 2], [0, 2, 3]]);
        assert_eq!(plain.clone().manifold(), plain);
    }

    #[test]
    fn sheets_that_are_one_round_both_ends_of_an_edge_come_apart_at_it() {
        // Two roofs on one ridge, whose gables are closed: at either end all four slopes are one fan.
        let gables = [[0, 2, 4], [0, 5, 3], [2, 1, 4], [5, 1, 3]];
        let touching = mesh(&ROOFS, &[&SLOPES[..], &gables[..]].concat());
        assert_eq!(most(&touching), 4);
        let apart = touching.manifold();
        assert_eq!((most(&apart), apart.triangles.len()), (2, 8));
    }

    #[test]
    fn what_cannot_be_paired_stands_alone() {
        let positions = [[0.0; 3], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
        let fins = mesh(&positions, &[[0, 1, 2], [0, 1, 3], [0, 1, 4]]);
        let apart = fins.manifold();
        assert_eq!((most(&apart), apart.triangles.len(), apart.positions.len()), (1, 3, 9));
    }
}
