//! The rays to which vertices are slid, so that their depth gives their position.

use super::kept::KeptVertices;
use crate::vertex::Vertex;

/// A vertex whose depth would change by more than this part on its way along the tangent plane keeps it.
const MOST_SLIDE: f32 = 0.03;

/// The rays of a grid's places: column coordinate over depth as a line over the columns, row coordinate as one
/// over the rows.
#[derive(Clone, Copy)]
pub(super) struct Rays(pub(super) [f32; 4]);

impl Rays {
    /// The least squares fit to the valid ones of the kept vertices: which ray a vertex is slid to does not matter
    /// much.
    pub(super) fn of(kept: &KeptVertices) -> Self {
        let (mut columns, mut rows) = (LineFit::default(), LineFit::default());
        for row in 0..kept.height() {
            for column in 0..kept.width() {
                let vertex = kept.at(row, column);
                if vertex.is_valid() && vertex.position[2] > 0.0 {
                    let [x, y, z] = vertex.position.map(f64::from);
                    columns.add((column * kept.step()) as f64, x / z);
                    rows.add((row * kept.step()) as f64, y / z);
                }
            }
        }
        let ([a, b], [c, d]) = (columns.line(), rows.line());
        Self([a, b, c, d])
    }

    pub(super) fn read(bytes: &[u8]) -> Option<(Self, &[u8])> {
        let (head, rest) = bytes.split_first_chunk::<16>()?;
        let number = |at: usize| f32::from_le_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]);
        let numbers = [0, 4, 8, 12].map(number);
        // Beyond the view of any camera; a number that is none is beyond too.
        numbers.iter().all(|number| number.abs() < 1e3).then_some((Self(numbers), rest))
    }

    pub(super) fn at(self, row: usize, column: usize) -> [f32; 3] {
        let [a, b, c, d] = self.0;
        [a * column as f32 + b, c * row as f32 + d, 1.0]
    }

    /// Where a ray meets the tangent plane of a vertex.
    pub(super) fn depth_m(self, vertex: &Vertex, ray: [f32; 3]) -> f32 {
        let dot = |v: [f32; 3]| (0..3).map(|k| vertex.normal[k] * v[k]).sum::<f32>();
        let (depth_m, met_m) = (vertex.position[2], dot(vertex.position) / dot(ray));
        // Written so that a ray along the plane changes nothing.
        if (met_m - depth_m).abs() <= MOST_SLIDE * depth_m { met_m } else { depth_m }
    }
}

/// A line through points.
#[derive(Default)]
struct LineFit {
    n: f64,
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
}

impl LineFit {
    fn add(&mut self, x: f64, y: f64) {
        self.n += 1.0;
        self.x += x;
        self.y += y;
        self.xx += x * x;
        self.xy += x * y;
    }

    /// Slope and height at zero; level where the points do not determine them.
    fn line(&self) -> [f32; 2] {
        let n = self.n.max(1.0);
        let spread = self.xx - self.x * self.x / n;
        let slope = if spread > 0.5 { (self.xy - self.x * self.y / n) / spread } else { 0.0 };
        [slope as f32, ((self.y - slope * self.x) / n) as f32]
    }
}
