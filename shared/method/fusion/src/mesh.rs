//! Triangles with normals and colours.

/// A mesh in the world, metres. Seen from in front its triangles run counter-clockwise.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Vertices.
    pub positions: Vec<[f32; 3]>,
    /// Unit normals of the vertices, towards where the camera was.
    pub normals: Vec<[f32; 3]>,
    /// Red, green, blue of the vertices.
    pub colours: Vec<[u8; 3]>,
    /// Vertices of each triangle.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// Adds a vertex of another mesh; its number here.
    pub(crate) fn push_vertex_of(&mut self, other: &Self, vertex: usize) -> u32 {
        self.positions.push(other.positions[vertex]);
        self.normals.push(other.normals[vertex]);
        self.colours.push(other.colours[vertex]);
        self.positions.len() as u32 - 1
    }

    /// Without connected pieces of fewer triangles, and without vertices that no triangle has.
    pub(crate) fn without_small_pieces(self, min_triangles: usize) -> Self {
        let mut parents: Vec<u32> = (0..self.positions.len() as u32).collect();
        for t in &self.triangles {
            for corner in [t[1], t[2]] {
                let (a, b) = (root(&mut parents, t[0]), root(&mut parents, corner));
                parents[a.max(b) as usize] = a.min(b);
            }
        }
        let mut sizes = vec![0usize; parents.len()];
        for t in &self.triangles {
            sizes[root(&mut parents, t[0]) as usize] += 1;
        }
        let mut new = vec![u32::MAX; parents.len()];
        let mut mesh = Self::default();
        for t in &self.triangles {
            if sizes[root(&mut parents, t[0]) as usize] < min_triangles {
                continue;
            }
            let triangle = t.map(|old| {
                let old = old as usize;
                if new[old] == u32::MAX {
                    new[old] = mesh.push_vertex_of(&self, old);
                }
                new[old]
            });
            mesh.triangles.push(triangle);
        }
        mesh
    }
}

/// The representative of a set of joined items.
pub(crate) fn root(parents: &mut [u32], mut k: u32) -> u32 {
    while parents[k as usize] != k {
        // Every second link is cut short on the way.
        parents[k as usize] = parents[parents[k as usize] as usize];
        k = parents[k as usize];
    }
    k
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_pieces_and_lonely_vertices_go() {
        let mesh = Mesh {
            positions: vec![[0.0; 3]; 8],
            normals: vec![[0.0; 3]; 8],
            colours: (0..8).map(|k| [k; 3]).collect(),
            triangles: vec![[5, 6, 7], [0, 1, 2], [2, 1, 3]],
        };
        let kept = mesh.without_small_pieces(2);
        assert_eq!(kept.triangles, [[0, 1, 2], [2, 1, 3]]);
        assert_eq!(kept.colours, [[0; 3], [1; 3], [2; 3], [3; 3]]);
    }
}
