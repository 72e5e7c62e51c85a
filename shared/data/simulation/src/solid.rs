//! The solids that scenes are built of, and where a ray meets them.

use crate::material::Material;

/// Rays begin this far before the camera, metres.
const NEAREST_M: f32 = 0.05;

/// A solid's form about its own centre, z up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Shape {
    /// A box.
    Box,
    /// An upright cylinder: `half[0]` is its radius, `half[2]` half its height.
    Cylinder,
    /// A sphere: `half[0]` is its radius.
    Sphere,
    /// The inside of a box: a room seen from within.
    Shell,
}

/// A solid with its place, turned about the vertical.
#[derive(Clone, Copy, Debug)]
pub(super) struct Solid {
    pub(super) shape: Shape,
    /// World, metres.
    pub(super) centre: [f32; 3],
    /// Half sides, metres.
    pub(super) half: [f32; 3],
    /// Cosine and sine of the turn about z.
    pub(super) turn: [f32; 2],
    pub(super) material: Material,
    pub(super) carrier: Carrier,
}

/// What a solid moves with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Carrier {
    /// Nothing: it stands still.
    World,
    /// The person who walks about before the camera.
    Companion,
    /// The lift's cabin.
    Cabin,
    /// The lift's door.
    Leaf,
    /// A person who walks to and fro, by number.
    Passer(usize),
}

/// People who walk to and fro.
pub(super) const N_PASSERS: usize = 6;

/// Where all that moves is at a moment: displacements, world, metres.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Carried {
    pub(super) companion: [f32; 3],
    pub(super) cabin: [f32; 3],
    pub(super) leaf: [f32; 3],
    pub(super) passers: [[f32; 3]; N_PASSERS],
}

impl Carried {
    fn by(&self, carrier: Carrier) -> [f32; 3] {
        match carrier {
            Carrier::World => [0.0; 3],
            Carrier::Companion => self.companion,
            Carrier::Cabin => self.cabin,
            Carrier::Leaf => self.leaf,
            Carrier::Passer(who) => self.passers[who],
        }
    }
}

/// Rays of one camera pose in a solid's own axes: `origin + t * axes * (x, y, 1)`.
///
/// `t` is then depth along the camera's z axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct LocalRays {
    pub(super) origin: [f32; 3],
    /// Rows of the matrix `local_from_camera`.
    pub(super) axes: [[f32; 3]; 3],
}

/// Rays that are cast together.
pub(super) const LINE: usize = 32;

/// Neighbouring rays of one row, and what they met so far.
#[derive(Clone, Copy, Debug)]
pub(super) struct RayLine {
    pub(super) x: [f32; LINE],
    pub(super) y: [f32; LINE],
    /// Depth of the nearest hit, metres; `f32::MAX`: none.
    pub(super) depth_m: [f32; LINE],
    /// Number of the solid that was hit; `u32::MAX`: none.
    pub(super) seen: [u32; LINE],
}

impl RayLine {
    /// Up to [`LINE`] rays that have met nothing yet; the rest of a short line repeats its last ray.
    pub(super) fn new(x: &[f32], y: &[f32]) -> Self {
        let pick = |values: &[f32], k: usize| values.get(k).or(values.last()).copied().unwrap_or(0.0);
        let mut line =
            Self { x: [0.0; LINE], y: [0.0; LINE], depth_m: [f32::MAX; LINE], seen: [u32::MAX; LINE] };
        for k in 0..LINE {
            line.x[k] = pick(x, k);
            line.y[k] = pick(y, k);
        }
        line
    }

    /// The same rays before they met anything.
    pub(super) fn unmet(&self) -> Self {
        Self { depth_m: [f32::MAX; LINE], seen: [u32::MAX; LINE], ..*self }
    }

    /// Depth beyond which nothing can be seen any more.
    pub(super) fn farthest_m(&self) -> f32 {
        self.depth_m.iter().fold(0.0, |most, &depth_m| if depth_m > most { depth_m } else { most })
    }
}

/// A camera's pose as the renderer uses it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Viewpoint {
    /// World, metres.
    pub(super) position: [f32; 3],
    /// Rows of `world_from_camera`.
    pub(super) rotation: [[f32; 3]; 3],
    pub(super) carried: Carried,
}

impl LocalRays {
    /// The camera's rays in the world's axes about a point.
    pub(super) fn upright(view: &Viewpoint, centre: &[f32; 3]) -> Self {
        Self { origin: std::array::from_fn(|k| view.position[k] - centre[k]), axes: view.rotation }
    }

    #[inline]
    pub(super) fn direction(&self, x: f32, y: f32) -> [f32; 3] {
        self.axes.map(|row| row[0] * x + row[1] * y + row[2])
    }
}

impl Solid {
    /// The camera's rays in this solid's axes.
    pub(super) fn local_rays(&self, view: &Viewpoint) -> LocalRays {
        let [c, s] = self.turn;
        let to_local = |v: [f32; 3]| [c * v[0] + s * v[1], c * v[1] - s * v[0], v[2]];
        let moved = view.carried.by(self.carrier);
        let from_centre = std::array::from_fn(|k| view.position[k] - (self.centre[k] + moved[k]));
        let column = |k: usize| to_local([view.rotation[0][k], view.rotation[1][k], view.rotation[2][k]]);
        let (x, y, z) = (column(0), column(1), column(2));
        LocalRays { origin: to_local(from_centre), axes: std::array::from_fn(|k| [x[k], y[k], z[k]]) }
    }

    /// Where rays of one row enter the solid (leave it, for a shell): lowers `depth_m` and names
    /// the solid in `seen` for each ray that meets it before anything else.
    ///
    /// A loop without branches over a fixed number of rays, which compilers turn into vectors.
    #[inline]
    pub(super) fn cast(&self, rays: &LocalRays, line: &mut RayLine, name: u32) {
        let RayLine { x, y, depth_m, seen } = line;
        for k in 0..LINE {
            let d = rays.direction(x[k], y[k]);
            let t = match self.shape {
                Shape::Box => {
                    let (enter, leave) = slabs(&rays.origin, &d, &self.half);
                    if enter <= leave { enter } else { f32::MAX }
                }
                Shape::Shell => slabs(&rays.origin, &d, &self.half).1,
                Shape::Sphere => hit_sphere(&rays.origin, &d, self.half[0]),
                Shape::Cylinder => hit_cylinder(&rays.origin, &d, &self.half),
            };
            let is_nearer = (t > NEAREST_M) & (t < depth_m[k]);
            depth_m[k] = if is_nearer { t } else { depth_m[k] };
            seen[k] = if is_nearer { name } else { seen[k] };
        }
    }

    /// Outward normal (inward, for a shell) at a point on the surface, in the solid's axes.
    #[inline]
    pub(super) fn normal(&self, point: &[f32; 3]) -> [f32; 3] {
        let h = &self.half;
        match self.shape {
            Shape::Sphere => point.map(|v| v / h[0]),
            Shape::Cylinder if point[2].abs() < h[2] - 1e-4 => [point[0] / h[0], point[1] / h[0], 0.0],
            Shape::Cylinder => [0.0, 0.0, sign(point[2])],
            Shape::Box | Shape::Shell => {
                // The face is the one whose slab the point fills most.
                let fill = [point[0].abs() - h[0], point[1].abs() - h[1], point[2].abs() - h[2]];
                let axis = if fill[0] >= fill[1] && fill[0] >= fill[2] {
                    0
                } else if fill[1] >= fill[2] {
                    1
                } else {
                    2
                };
                let mut normal = [0.0; 3];
                normal[axis] =
                    if self.shape == Shape::Shell { -sign(point[axis]) } else { sign(point[axis]) };
                normal
            }
        }
    }

    /// A vector from the solid's axes to the world's.
    #[inline]
    pub(super) fn to_world(self, v: [f32; 3]) -> [f32; 3] {
        let [c, s] = self.turn;
        [c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]]
    }
}

#[inline]
fn sign(value: f32) -> f32 {
    if value < 0.0 { -1.0 } else { 1.0 }
}

/// Depths at which a ray enters and leaves a box.
#[inline]
fn slabs(o: &[f32; 3], d: &[f32; 3], h: &[f32; 3]) -> (f32, f32) {
    let (mut enter, mut leave) = (f32::MIN, f32::MAX);
    for k in 0..3 {
        let inverse = 1.0 / d[k];
        let (a, b) = ((-h[k] - o[k]) * inverse, (h[k] - o[k]) * inverse);
        let (near, far) = if a < b { (a, b) } else { (b, a) };
        // Comparisons in this order let NaN (a ray inside a face) leave the bounds alone.
        enter = if near > enter { near } else { enter };
        leave = if far < leave { far } else { leave };
    }
    (enter, leave)
}

/// Depth at which a ray enters a sphere; NaN, for which no comparison holds, where it does not.
#[inline]
fn hit_sphere(o: &[f32; 3], d: &[f32; 3], radius: f32) -> f32 {
    let a = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
    let b = o[0] * d[0] + o[1] * d[1] + o[2] * d[2];
    let c = o[0] * o[0] + o[1] * o[1] + o[2] * o[2] - radius * radius;
    (-b - (b * b - a * c).sqrt()) / a
}

/// Depth at which a ray enters a cylinder; NaN or `f32::MAX` where it does not.
#[inline]
fn hit_cylinder(o: &[f32; 3], d: &[f32; 3], h: &[f32; 3]) -> f32 {
    let a = d[0] * d[0] + d[1] * d[1];
    let b = o[0] * d[0] + o[1] * d[1];
    let c = o[0] * o[0] + o[1] * o[1] - h[0] * h[0];
    let side = (-b - (b * b - a * c).sqrt()) / a;
    // The cap on the ray's side.
    let cap = (-sign(d[2]) * h[2] - o[2]) / d[2];
    let (x, y) = (o[0] + cap * d[0], o[1] + cap * d[1]);
    let cap = if x * x + y * y <= h[0] * h[0] { cap } else { f32::MAX };
    if (o[2] + side * d[2]).abs() <= h[2] { side } else { cap }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn solid(shape: Shape, half: [f32; 3]) -> Solid {
        Solid {
            shape,
            centre: [0.0; 3],
            half,
            turn: [1.0, 0.0],
            material: Material::plain([0.5; 3]),
            carrier: Carrier::World,
        }
    }

    /// A ray from `o` along `d`: the camera's z axis.
    fn hit(solid: &Solid, o: [f32; 3], d: [f32; 3]) -> Option<f32> {
        let rays = LocalRays { origin: o, axes: d.map(|v| [0.0, 0.0, v]) };
        let mut line = RayLine::new(&[0.0], &[0.0]);
        solid.cast(&rays, &mut line, 5);
        (line.seen[0] == 5).then_some(line.depth_m[0])
    }

    #[test]
    fn rays_meet_solids_where_they_should() {
        let cuboid = solid(Shape::Box, [1.0, 2.0, 3.0]);
        assert_eq!(hit(&cuboid, [-5.0, 0.0, 0.0], [1.0, 0.0, 0.0]), Some(4.0));
        assert_eq!(hit(&cuboid, [-5.0, 2.5, 0.0], [1.0, 0.0, 0.0]), None);
        assert_eq!(hit(&cuboid, [5.0, 0.0, 0.0], [1.0, 0.0, 0.0]), None);
        let shell = solid(Shape::Shell, [1.0, 2.0, 3.0]);
        assert_eq!(hit(&shell, [0.0, 0.0, 0.0], [0.0, 1.0, 0.0]), Some(2.0));
        let ball = solid(Shape::Sphere, [1.0; 3]);
        assert_eq!(hit(&ball, [0.0, 0.0, 4.0], [0.0, 0.0, -1.0]), Some(3.0));
        let column = solid(Shape::Cylinder, [1.0, 1.0, 2.0]);
        assert_eq!(hit(&column, [-3.0, 0.0, 1.0], [1.0, 0.0, 0.0]), Some(2.0));
        assert_eq!(hit(&column, [0.5, 0.0, 5.0], [0.0, 0.0, -1.0]), Some(3.0));
        assert_eq!(hit(&column, [-3.0, 0.0, 2.5], [1.0, 0.0, 0.0]), None);
        assert_eq!(hit(&column, [-3.0, 0.0, 3.5], [1.0, 0.0, -0.5]), Some(3.0));
    }

    #[test]
    fn normals_point_out_and_into_a_room() {
        let cuboid = solid(Shape::Box, [1.0, 2.0, 3.0]);
        assert_eq!(cuboid.normal(&[0.2, -2.0, 1.0]), [0.0, -1.0, 0.0]);
        assert_eq!(solid(Shape::Shell, [1.0, 2.0, 3.0]).normal(&[0.0, 0.0, -3.0]), [0.0, 0.0, 1.0]);
        let column = solid(Shape::Cylinder, [1.0, 1.0, 2.0]);
        assert_eq!(column.normal(&[0.0, 1.0, 0.3]), [0.0, 1.0, 0.0]);
        assert_eq!(column.normal(&[0.2, 0.1, -2.0]), [0.0, 0.0, -1.0]);
    }
}
