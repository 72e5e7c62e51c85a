//! Ray casting: which surface each pixel sees, and its colour.
//!
//! What is kept of a surface is its tangent plane in inverse depth: `1 / z` is linear in the ray
//! `(x, y, 1)`, so a sensor that looks a little beside its pixel needs no second cast.

use crate::building::CellBounds;
use crate::path::Walk;
use crate::person;
use crate::scenes::Scene;
use crate::solid::{Carried, LINE, LocalRays, RayLine, Shape, Solid, Viewpoint};
use tessera_geometry::{Camera, Pose, RayTable};

const TILE_ROWS: usize = 16;
const TILE_COLUMNS: usize = LINE;
/// Slack of the image's bounds for lenses and for what moves while a rolling shutter reads it.
const VIEW_SLACK: f32 = 0.15;
/// Slack of the tiles' bounds for what moves within sixteen rows of a rolling shutter.
const SLACK: f32 = 0.01;

/// Buffers that are used again from frame to frame.
#[derive(Clone, Debug, Default)]
pub(super) struct Scratch {
    /// For each pixel `m` with `1 / z = m . (x, y, 1)`; 0: no depth, as behind glass.
    pub(super) planes: Vec<[f32; 3]>,
    pub(super) fields: [Vec<f32>; 3],
    pub(super) work: Vec<f32>,
    /// Numbers of the solids that may be in the image; what follows counts in this list.
    pub(super) visible: Vec<u32>,
    local: Vec<LocalRays>,
    tiles: Vec<Vec<(f32, u32)>>,
}

/// One image to be taken.
#[derive(Clone, Copy)]
pub(super) struct Exposure<'a> {
    pub(super) camera: &'a Camera,
    pub(super) rays: &'a RayTable,
    pub(super) scene: &'a Scene,
    pub(super) walk: &'a Walk,
    /// Time of the middle row, seconds.
    pub(super) stamp_s: f64,
}

impl Exposure<'_> {
    /// Casts a ray through each pixel; fills `scratch.planes`, and `rgb` if there is one.
    pub(super) fn cast(&self, scratch: &mut Scratch, mut rgb: Option<&mut [u8]>) {
        let (width, height) = (self.rays.width, self.rays.height);
        scratch.planes.clear();
        scratch.planes.resize(width * height, [0.0; 3]);
        // Where no ray meets anything the image is black, whatever was in the buffer.
        if let Some(rgb) = rgb.as_deref_mut() {
            rgb.fill(0);
        }
        let is_rolling = self.camera.readout_s != 0.0;
        let global = self.viewpoint(self.stamp_s);
        self.fill_visible(&global, &mut scratch.visible);
        if !is_rolling {
            self.localise(&global, &scratch.visible, &mut scratch.local);
        }
        for first_row in (0..height).step_by(TILE_ROWS) {
            let rows = first_row..(first_row + TILE_ROWS).min(height);
            let middle = 0.5 * (rows.start + rows.end - 1) as f64;
            let view = if is_rolling { self.viewpoint(self.row_time_s(middle)) } else { global };
            self.fill_tiles(rows.clone(), &view, &scratch.visible, &mut scratch.tiles);
            for row in rows {
                if is_rolling {
                    let view = self.viewpoint(self.row_time_s(row as f64));
                    self.localise(&view, &scratch.visible, &mut scratch.local);
                }
                let Scratch { planes, visible, local, tiles, .. } = &mut *scratch;
                let planes = &mut planes[row * width..(row + 1) * width];
                let rgb = rgb.as_deref_mut().map(|rgb| &mut rgb[3 * row * width..3 * (row + 1) * width]);
                self.cast_row(row, (&*visible, &*local), tiles, planes, rgb);
            }
        }
    }

    fn row_time_s(&self, row: f64) -> f64 {
        self.stamp_s + self.camera.row_time_s(row)
    }

    pub(super) fn viewpoint(&self, time_s: f64) -> Viewpoint {
        let pose: Pose = self.walk.world_from_camera(time_s);
        let r = pose.rotation.to_rotation_matrix();
        let t = pose.translation.vector;
        Viewpoint {
            position: [t.x as f32, t.y as f32, t.z as f32],
            rotation: std::array::from_fn(|i| std::array::from_fn(|j| r[(i, j)] as f32)),
            carried: Carried {
                companion: if self.scene.has_person { person::place(self.walk, time_s) } else { [0.0; 3] },
                ..self.walk.carried(time_s)
            },
        }
    }

    /// Chooses the solids that may be seen in the image.
    pub(super) fn fill_visible(&self, view: &Viewpoint, visible: &mut Vec<u32>) {
        let mut bounds = self.ray_bounds(0..self.rays.height, 0..self.rays.width);
        for (bound, more) in bounds.iter_mut().zip([-1.0, 1.0, -1.0, 1.0]) {
            *bound += more * VIEW_SLACK;
        }
        let is_in_view = |[middle, half]: &CellBounds| {
            let rays = LocalRays::upright(view, middle);
            CameraBox::new(&rays, half).may_be_seen(&bounds)
        };
        self.scene.fill_visible(&view.position, is_in_view, visible);
    }

    fn visible<'s>(&'s self, visible: &'s [u32]) -> impl Iterator<Item = &'s Solid> {
        visible.iter().map(|&at| &self.scene.solids[at as usize])
    }

    fn localise(&self, view: &Viewpoint, visible: &[u32], local: &mut Vec<LocalRays>) {
        local.clear();
        local.extend(self.visible(visible).map(|solid| solid.local_rays(view)));
    }

    /// For each tile of a band of rows the solids that may be seen in it, nearest first.
    fn fill_tiles(
        &self,
        rows: std::ops::Range<usize>,
        view: &Viewpoint,
        visible: &[u32],
        tiles: &mut Vec<Vec<(f32, u32)>>,
    ) {
        let width = self.rays.width;
        let solids: Vec<&Solid> = self.visible(visible).collect();
        let boxed = |solid: &&Solid| CameraBox::new(&solid.local_rays(view), &solid.half);
        let boxes: Vec<CameraBox> = solids.iter().map(boxed).collect();
        tiles.resize(width.div_ceil(TILE_COLUMNS), Vec::new());
        for (tile, seen) in tiles.iter_mut().enumerate() {
            let columns = tile * TILE_COLUMNS..((tile + 1) * TILE_COLUMNS).min(width);
            let bounds = self.ray_bounds(rows.clone(), columns);
            seen.clear();
            for (at, solid) in solids.iter().enumerate() {
                if solid.shape == Shape::Shell {
                    // A closed space lies behind everything in it.
                    seen.push((f32::MAX, at as u32));
                } else if boxes[at].may_be_seen(&bounds) {
                    seen.push((boxes[at].nearest_m, at as u32));
                }
            }
            seen.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        }
    }

    /// Lowest and highest `x` and `y` of a tile's rays. Lenses bend lines, but so little that the
    /// border of a small tile still holds the extremes, within the slack.
    fn ray_bounds(&self, rows: std::ops::Range<usize>, columns: std::ops::Range<usize>) -> [f32; 4] {
        let mut bounds = [f32::MAX, f32::MIN, f32::MAX, f32::MIN];
        let (top, bottom, left, right) = (rows.start, rows.end - 1, columns.start, columns.end - 1);
        for (row, column) in [(top, left), (top, right), (bottom, left), (bottom, right)] {
            let at = row * self.rays.width + column;
            let (x, y) = (self.rays.x[at], self.rays.y[at]);
            bounds = [bounds[0].min(x), bounds[1].max(x), bounds[2].min(y), bounds[3].max(y)];
        }
        [bounds[0] - SLACK, bounds[1] + SLACK, bounds[2] - SLACK, bounds[3] + SLACK]
    }

    fn cast_row(
        &self,
        row: usize,
        (visible, local): (&[u32], &[LocalRays]),
        tiles: &[Vec<(f32, u32)>],
        planes: &mut [[f32; 3]],
        mut rgb: Option<&mut [u8]>,
    ) {
        let width = self.rays.width;
        let solid = |at: u32| &self.scene.solids[visible[at as usize] as usize];
        for (tile, seen) in tiles.iter().enumerate() {
            let columns = tile * TILE_COLUMNS..((tile + 1) * TILE_COLUMNS).min(width);
            let rays = row * width + columns.start..row * width + columns.end;
            let mut line = RayLine::new(&self.rays.x[rays.clone()], &self.rays.y[rays]);
            // What lies behind glass is seen too: glass is cast apart.
            let mut glass: Option<RayLine> = None;
            let mut farthest_m = f32::MAX;
            for &(nearest_m, at) in seen {
                // The space itself comes last and must be tried whatever was met before.
                if nearest_m <= farthest_m || nearest_m == f32::MAX {
                    let solid = solid(at);
                    if solid.material.is_glass {
                        let glass = glass.get_or_insert_with(|| line.unmet());
                        solid.cast(&local[at as usize], glass, at);
                    } else {
                        solid.cast(&local[at as usize], &mut line, at);
                        farthest_m = line.farthest_m();
                    }
                }
            }
            for (k, column) in columns.enumerate() {
                let at = line.seen[k];
                if at == u32::MAX {
                    continue;
                }
                let ray = [line.x[k], line.y[k]];
                let (mut plane, mut colour) =
                    self.surface(solid(at), &local[at as usize], ray, line.depth_m[k]);
                if let Some(glass) = &glass
                    && glass.depth_m[k] < line.depth_m[k]
                {
                    colour = solid(glass.seen[k]).material.seen_through(colour);
                    plane = [0.0; 3];
                }
                planes[column] = plane;
                if let Some(rgb) = rgb.as_deref_mut() {
                    rgb[3 * column..3 * column + 3].copy_from_slice(&colour);
                }
            }
        }
    }

    /// Tangent plane in inverse depth, and colour, where a ray meets a solid.
    #[inline]
    fn surface(&self, solid: &Solid, rays: &LocalRays, ray: [f32; 2], depth_m: f32) -> ([f32; 3], [u8; 3]) {
        let direction = rays.direction(ray[0], ray[1]);
        let point: [f32; 3] = std::array::from_fn(|k| rays.origin[k] + depth_m * direction[k]);
        let normal = solid.normal(&point);
        let along = normal[0] * direction[0] + normal[1] * direction[1] + normal[2] * direction[2];
        let scale = 1.0 / (depth_m * along);
        let plane = std::array::from_fn(|j| {
            scale * (normal[0] * rays.axes[0][j] + normal[1] * rays.axes[1][j] + normal[2] * rays.axes[2][j])
        });
        let shade = 255.0 * shading(solid.to_world(normal));
        let colour = solid.material.colour(&self.scene.grain, &point, &normal);
        // A cast from float to integer saturates.
        (plane, colour.map(|value| (shade * value + 0.5) as u8))
    }
}

/// Light from above and a little from one side; the same from every viewpoint.
#[inline]
fn shading(normal: [f32; 3]) -> f32 {
    let side = 0.48 * normal[0] + 0.30 * normal[1] + 0.82 * normal[2];
    0.66 + 0.12 * normal[2] + 0.22 * side
}

/// A solid's bounding box in the camera frame.
struct CameraBox {
    centre: [f32; 3],
    /// Half sides as vectors.
    sides: [[f32; 3]; 3],
    /// Least depth that any of its points has.
    nearest_m: f32,
}

impl CameraBox {
    /// The box with these half sides in the axes of `rays`.
    fn new(rays: &LocalRays, half: &[f32; 3]) -> Self {
        let sides: [[f32; 3]; 3] = std::array::from_fn(|k| rays.axes[k].map(|v| v * half[k]));
        let centre: [f32; 3] =
            std::array::from_fn(|j| -(0..3).map(|k| rays.axes[k][j] * rays.origin[k]).sum::<f32>());
        let reach: f32 = sides.iter().map(|side| side[2].abs()).sum();
        Self { centre, sides, nearest_m: centre[2] - reach - SLACK }
    }

    /// Whether any part may lie between the bounds `[x low, x high, y low, y high]` of the rays.
    fn may_be_seen(&self, bounds: &[f32; 4]) -> bool {
        let [x_low, x_high, y_low, y_high] = *bounds;
        let planes = [
            [-1.0, 0.0, x_low],
            [1.0, 0.0, -x_high],
            [0.0, -1.0, y_low],
            [0.0, 1.0, -y_high],
            [0.0, 0.0, -1.0],
        ];
        planes.iter().all(|plane| {
            let dot = |v: &[f32; 3]| plane[0] * v[0] + plane[1] * v[1] + plane[2] * v[2];
            dot(&self.centre) - self.sides.iter().map(|side| dot(side).abs()).sum::<f32>() <= SLACK
        })
    }
}
