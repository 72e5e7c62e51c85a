//! The exact nearest vertex, as in the paper (method 10.2): a balanced tree over a surface's points.

use crate::association::target::ShutterTable;
use tessera_surface::SurfaceView;

/// Points in a leaf: fewer cost more steps than they save.
const LEAF: usize = 8;

/// A tree over the valid vertices of a surface, in its camera frame at its stamp.
///
/// The points stand in one list; the middle of each run divides it along the axis in which the
/// run is widest.
#[derive(Clone, Debug, Default)]
pub struct KdTree {
    points: Vec<([f32; 3], u32)>,
    /// Axis of the division at each middle.
    axes: Vec<u8>,
}

impl KdTree {
    /// Builds the tree; the readout motion is taken out of the points.
    pub fn new(surface: &SurfaceView<'_>, shutter: &ShutterTable) -> Self {
        let width = surface.grid.width;
        let mut points: Vec<([f32; 3], u32)> = surface
            .vertices
            .iter()
            .enumerate()
            .filter(|(_, v)| v.is_valid())
            .map(|(i, v)| {
                let seconds = shutter.row_time_s((i / width) as f32);
                (shutter.move_point(v.position, seconds), i as u32)
            })
            .collect();
        let mut axes = vec![0; points.len()];
        divide(&mut points, &mut axes);
        Self { points, axes }
    }

    /// The vertex nearest to `q` and its squared distance, unless all are `limit_m` away or more;
    /// the lowest index among equals.
    pub fn nearest(&self, q: [f32; 3], limit_m: f32) -> Option<(usize, f32)> {
        let mut best = (limit_m * limit_m, u32::MAX);
        self.visit(q, 0, self.points.len(), &mut best);
        (best.1 != u32::MAX).then_some((best.1 as usize, best.0))
    }

    fn visit(&self, q: [f32; 3], from: usize, to: usize, best: &mut (f32, u32)) {
        if to - from <= LEAF {
            self.points[from..to].iter().for_each(|point| consider(q, point, best));
            return;
        }
        let middle = from + (to - from) / 2;
        let axis = usize::from(self.axes[middle]);
        let across = q[axis] - self.points[middle].0[axis];
        let (near, far) = if across < 0.0 {
            ((from, middle), (middle + 1, to))
        } else {
            ((middle + 1, to), (from, middle))
        };
        self.visit(q, near.0, near.1, best);
        consider(q, &self.points[middle], best);
        if across * across <= best.0 {
            self.visit(q, far.0, far.1, best);
        }
    }
}

#[inline(always)]
fn consider(q: [f32; 3], &(p, vertex): &([f32; 3], u32), best: &mut (f32, u32)) {
    let d = [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
    let distance_sq = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
    if distance_sq < best.0 || (distance_sq == best.0 && vertex < best.1) {
        *best = (distance_sq, vertex);
    }
}

fn divide(points: &mut [([f32; 3], u32)], axes: &mut [u8]) {
    if points.len() <= LEAF {
        return;
    }
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for (p, _) in points.iter() {
        for c in 0..3 {
            (low[c], high[c]) = (low[c].min(p[c]), high[c].max(p[c]));
        }
    }
    let wide = |c: usize| high[c] - low[c];
    let axis = (1..3).fold(0, |best, c| if wide(c) > wide(best) { c } else { best });
    let middle = points.len() / 2;
    points.select_nth_unstable_by(middle, |a, b| a.0[axis].total_cmp(&b.0[axis]).then(a.1.cmp(&b.1)));
    axes[middle] = axis as u8;
    let (left, right) = points.split_at_mut(middle);
    let (left_axes, right_axes) = axes.split_at_mut(middle);
    divide(left, left_axes);
    divide(&mut right[1..], &mut right_axes[1..]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_geometry::{Camera, Twist};
    use tessera_numerics::SplitMix64;
    use tessera_surface::{Grid, Vertex};

    #[test]
    fn it_finds_what_trying_all_finds() {
        let grid = Grid { width: 40, height: 30, step: 4 };
        let mut random = SplitMix64::for_frame(7, 1);
        let mut number = || random.below(1000) as f32 * 1e-3;
        let vertices: Vec<Vertex> = (0..grid.len())
            .map(|i| Vertex {
                // Steps of a millimetre in a cube of a metre: equal distances do occur.
                position: [number(), number(), number()],
                flags_rgb: Vertex::pack(if i % 7 == 0 { 0 } else { Vertex::VALID }, 0, [0; 3]),
                ..Vertex::default()
            })
            .collect();
        let camera = Camera::pinhole((160, 120), [131.0, 131.0, 79.5, 59.5], 5000.0);
        let shutter = ShutterTable::new(&camera, &Twist::default(), 30, 4, 0.0);
        let tree = KdTree::new(&SurfaceView { grid, vertices: &vertices }, &shutter);
        for _ in 0..300 {
            let q = [number(), number(), number()];
            let all = vertices.iter().enumerate().filter(|(_, v)| v.is_valid()).map(|(i, v)| {
                let d = [v.position[0] - q[0], v.position[1] - q[1], v.position[2] - q[2]];
                (i, d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
            });
            let expected = all.min_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
            assert_eq!(tree.nearest(q, 10.0), expected);
            let limit_m = expected.map_or(0.0, |e| e.1.sqrt() * 0.5);
            assert_eq!(tree.nearest(q, limit_m), None);
        }
        assert_eq!(KdTree::default().nearest([0.0; 3], 1.0), None);
    }
}
