//! Acceptance checks that concern surfaces, on simulated walls.

use crate::mesh::{self, EdgeTest};
use crate::planes::Workspace;
use crate::settings::SurfaceSettings;
use crate::vertex::{Grid, Vertex};
use crate::{Reconstructor, SurfaceStats};
use tessera_geometry::Camera;
use tessera_numerics::MethodVariant;

const WIDTH: usize = 320;
const HEIGHT: usize = 240;

fn camera() -> Camera {
    Camera::pinhole((WIDTH as u32, HEIGHT as u32), [525.0, 525.0, 160.0, 120.0], 5000.0)
}

/// Standard normal numbers: the sum of twelve uniform ones, from a fixed sequence.
struct Normal(u64);

impl Normal {
    fn next(&mut self) -> f64 {
        let mut uniform = || {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 33) as f64 / (1u64 << 31) as f64
        };
        (0..12).map(|_| uniform()).sum::<f64>() - 6.0
    }
}

/// A Kinect's measurement: noise of 0.08 px in disparity, then steps of 1/8 px.
fn kinect(depth_m: f64, noise: &mut Normal) -> f64 {
    let baseline_px = 580.0 * 0.075;
    let disparity = ((baseline_px / depth_m + 0.08 * noise.next()) * 8.0).round() / 8.0;
    baseline_px / disparity
}

/// Share of valid quads on a wall of depth `depth_m(column)`, and the share of horizontal edges
/// between the columns `left` and `left + 1` of the grid that are valid.
fn quads(n: u32, variant: MethodVariant, left: usize, depth_m: impl Fn(f64) -> f64) -> (f64, f64) {
    let settings = SurfaceSettings { step: n, variant, ..SurfaceSettings::default() };
    let step = n as usize;
    let grid = Grid { width: WIDTH / step, height: HEIGHT / step, step };
    let mut w = Workspace::new(grid);
    let mut noise = Normal(1);
    for row in 0..HEIGHT {
        for column in 0..WIDTH {
            let z = kinect(depth_m(column as f64), &mut noise);
            if row % step == 0 && column % step == 0 {
                let x = (column as f64 - 160.0) * z / 525.0;
                let y = (row as f64 - 120.0) * z / 525.0;
                w.points.set(w.layout.row(row / step) + column / step, [x as f32, y as f32, z as f32]);
            }
        }
    }
    mesh::build(EdgeTest::new(&settings), &mut w);
    let n_quads: f32 = w.mesh.quad.iter().sum();
    let kept: f32 = (0..grid.height).map(|row| w.mesh.right[w.layout.row(row) + left]).sum();
    let n_cells = ((grid.width - 1) * (grid.height - 1)) as f32;
    (f64::from(n_quads / n_cells), f64::from(kept / grid.height as f32))
}

#[test]
fn a_far_wall_keeps_its_quads_by_or_and_loses_them_by_and() {
    for z in [3.0, 4.0, 5.0] {
        let (or, _) = quads(1, MethodVariant::Tessera, 0, |_| z);
        let (and, _) = quads(1, MethodVariant::Paper, 0, |_| z);
        assert!(or >= 0.6, "or keeps {or} at {z} m");
        assert!(and <= 0.2, "and keeps {and} at {z} m");
    }
    for z in [1.0, 2.0, 3.0, 4.0, 5.0] {
        let (or, _) = quads(4, MethodVariant::Tessera, 0, |_| z);
        assert!(or >= 0.97, "n = 4: or keeps {or} at {z} m");
    }
}

#[test]
fn steps_well_above_the_noise_are_cut_by_both_rules() {
    // method 1.3: n = 1, 1 m, 2 cm and n = 4, 2 m, 10 cm are never bridged.
    for (n, z, step_m) in [(1u32, 1.0, 0.02), (4, 2.0, 0.10), (4, 3.0, 0.20)] {
        let left = 160 / n as usize - 1;
        for variant in [MethodVariant::Tessera, MethodVariant::Paper] {
            let (_, kept) = quads(n, variant, left, |column| if column < 160.0 { z } else { z + step_m });
            assert!(kept < 0.02, "{variant:?} keeps {kept} of a {step_m} m step at {z} m, n = {n}");
        }
    }
}

/// The surface of an image whose depth is a function of the pixel, metres.
fn reconstruct(
    settings: &SurfaceSettings,
    depth_m: impl Fn(usize, usize) -> f64,
) -> (Vec<Vertex>, SurfaceStats, Grid) {
    let mut reconstructor = Reconstructor::new(&camera(), settings).unwrap();
    let depth: Vec<u16> =
        (0..WIDTH * HEIGHT).map(|i| (depth_m(i / WIDTH, i % WIDTH) * 5000.0).round() as u16).collect();
    let grid = reconstructor.grid();
    let mut out = vec![Vertex::default(); grid.len()];
    let stats = reconstructor.reconstruct(&depth, None, &mut out);
    (out, stats, grid)
}

#[test]
fn the_filter_smooths_by_the_size_of_its_rings_and_keeps_a_crease() {
    let plane_noise = |rings: u32| {
        let settings = SurfaceSettings {
            filter_rings: rings,
            variant: MethodVariant::Paper,
            // Position and normals alone would let no weight fall below 0.9 on a plane.
            filter_normal: 0.0,
            ..SurfaceSettings::default()
        };
        let mut noise = Normal(3);
        let noisy: Vec<f64> = (0..WIDTH * HEIGHT).map(|_| 2.0 + 0.004 * noise.next()).collect();
        let (vertices, _, grid) = reconstruct(&settings, |r, c| noisy[r * WIDTH + c]);
        let inner: Vec<f64> = (8..grid.height - 8)
            .flat_map(|r| (8..grid.width - 8).map(move |c| r * grid.width + c))
            .map(|i| f64::from(vertices[i].position[2]) - 2.0)
            .collect();
        (inner.iter().map(|d| d * d).sum::<f64>() / inner.len() as f64).sqrt()
    };
    let raw = plane_noise(0);
    for (rings, n_neighbours) in [(1, 6.0), (2, 18.0), (3, 36.0), (4, 60.0f64)] {
        let expected = raw / (n_neighbours + 1.0).sqrt();
        let found = plane_noise(rings);
        assert!(
            (found / expected - 1.0).abs() < 0.25,
            "{rings} rings: {found} m, expected about {expected} m"
        );
    }
}

#[test]
fn a_right_angled_crease_moves_by_less_than_a_cell() {
    for rings in 1..=4 {
        let settings = SurfaceSettings { filter_rings: rings, ..SurfaceSettings::default() };
        // Two walls that meet at 90 degrees in the middle of the image, 2 m away.
        let depth = |_: usize, c: usize| {
            let slope = (c as f64 - 160.0).abs() / 525.0;
            2.0 / (1.0 + slope)
        };
        let (vertices, stats, grid) = reconstruct(&settings, depth);
        assert!(stats.n_valid > grid.len() * 9 / 10);
        let row = &vertices[30 * grid.width..31 * grid.width];
        let ridge = row.iter().map(|v| v.position[2]).fold(0.0, f32::max);
        let at = row.iter().position(|v| v.position[2] == ridge).unwrap();
        assert!(at.abs_diff(40) <= 1, "{rings} rings: the ridge is at column {at}");
        // A cell is 15 mm wide there.
        assert!((ridge - 2.0).abs() < 0.015 * rings as f32, "{rings} rings: the ridge is at {ridge} m");
    }
}

#[test]
fn normals_of_a_wall_face_the_camera_and_holes_make_no_vertices() {
    let settings = SurfaceSettings::default();
    let hole = |r: usize, c: usize| (100..140).contains(&r) && (100..140).contains(&c);
    let (vertices, stats, grid) = reconstruct(&settings, |r, c| if hole(r, c) { 0.0 } else { 1.5 });
    for (i, v) in vertices.iter().enumerate() {
        let (r, c) = (i / grid.width * 4, i % grid.width * 4);
        assert_eq!(v.is_valid(), !hole(r, c), "row {r}, column {c}");
        if v.is_valid() {
            assert!(v.normal[2] < -0.999 && v.normal[0].abs() < 0.02);
        }
    }
    assert_eq!(stats.n_measured, stats.n_valid);
    assert!(stats.n_inner < stats.n_valid, "the rim of the hole and of the image is a boundary");
}

#[test]
fn scattered_holes_cost_few_vertices() {
    // 37 % holes, as in a time-of-flight depth warped into the colour view.
    let mut noise = Normal(9);
    let holes: Vec<bool> = (0..WIDTH * HEIGHT).map(|_| noise.next() < -0.332).collect();
    let (_, stats, grid) =
        reconstruct(&SurfaceSettings::default(), |r, c| if holes[r * WIDTH + c] { 0.0 } else { 1.5 });
    assert!(stats.n_inner as f64 > 0.9 * grid.len() as f64, "{stats:?}");
    let corner = SurfaceSettings { variant: MethodVariant::Paper, ..SurfaceSettings::default() };
    let (_, stats, _) = reconstruct(&corner, |r, c| if holes[r * WIDTH + c] { 0.0 } else { 1.5 });
    assert!((stats.n_inner as f64) < 0.3 * grid.len() as f64, "the corner rule loses them: {stats:?}");
}
