//! Surfaces there and back.

use super::*;
use tessera_numerics::SplitMix64;

const GRID: Grid = Grid { width: 41, height: 30, step: 4 };
const FINE: Thinning = Thinning { spacing: 2, inverse_depth_steps: 4096, normal_steps: 31 };

/// A sloped wall with a step, noise and holes.
fn surface(one_hole_in: usize) -> Vec<Vertex> {
    let mut random = SplitMix64::new(1);
    let mut vertices = Vec::new();
    for index in 0..GRID.len() {
        let (row, column) = ((index / GRID.width) as f32, (index % GRID.width) as f32);
        let (u, v) = ((column - 20.0) / 130.0, (row - 14.5) / 130.0);
        // The plane z = d + 0.2 x.
        let depth = if column < 25.0 { 1.5 } else { 2.5 } / (1.0 - 0.2 * u) + 0.001 * random.unit() as f32;
        let length = 1.04_f32.sqrt();
        vertices.push(match random.below(one_hole_in) {
            0 => Vertex::default(),
            _ => Vertex {
                position: [u * depth, v * depth, depth],
                flags_rgb: Vertex::pack(Vertex::VALID, 1, [9, 100, 255]),
                normal: [0.2 / length, 0.0, -1.0 / length],
                reserved: 0,
            },
        });
    }
    vertices
}

fn pack(grid: Grid, vertices: &[Vertex], beside: &[usize], thinning: Thinning) -> Vec<u8> {
    super::pack(grid, |place| vertices[place], beside, thinning)
}

#[test]
fn a_wall_comes_back_within_a_fraction_of_the_noise() {
    (1..=4).for_each(check_wall);
}

fn check_wall(spacing: u8) {
    let (surface, thinning) = (surface(usize::MAX), Thinning { spacing, ..FINE });
    let bytes = pack(GRID, &surface, &[], thinning);
    let kept = KeptVertices::new(GRID, thinning.step());
    let (width, height) = (kept.width(), kept.height());
    assert!(bytes.len() < 50 + 4 * width * height, "{} bytes", bytes.len());
    let back = unpack(GRID, &bytes, &[]).unwrap();
    let mut n_missing = 0;
    for (at, (back, vertex)) in back.iter().zip(&surface).enumerate() {
        let (row, column) = (at / GRID.width, at % GRID.width);
        if !back.is_valid() {
            // The last rows have none below them, and nothing stands between wall and step.
            let is_last = row > (height - 1) * thinning.step() || column > (width - 1) * thinning.step();
            assert!(is_last || column.abs_diff(25) < thinning.step(), "row {row} column {column}");
            n_missing += 1;
            continue;
        }
        let off = (0..3).map(|k| (back.position[k] - vertex.position[k]) * vertex.normal[k]).sum::<f32>();
        assert!(off.abs() < 0.0025, "{off} m at row {row} column {column}");
        let dot = (0..3).map(|k| back.normal[k] * vertex.normal[k]).sum::<f32>();
        assert!(dot > 0.999 && back.row_offset() == 1, "{dot}");
        assert!((0..3).all(|k| back.rgb()[k].abs_diff(vertex.rgb()[k]) <= 16), "{:?}", back.rgb());
    }
    assert!(n_missing <= thinning.step() * (GRID.width + GRID.height), "{n_missing} with {spacing}");
}

#[test]
fn nothing_stands_where_nothing_was_seen() {
    let bytes = pack(GRID, &vec![Vertex::default(); GRID.len()], &[], FINE);
    assert_eq!(unpack(GRID, &bytes, &[]).unwrap(), vec![Vertex::default(); GRID.len()]);
    let surface = surface(4);
    let back = unpack(GRID, &pack(GRID, &surface, &[], FINE), &[]).unwrap();
    for (at, (back, vertex)) in back.iter().zip(&surface).enumerate() {
        let is_kept = (at / GRID.width).is_multiple_of(2) && (at % GRID.width).is_multiple_of(2);
        assert!(!is_kept || back.is_valid() == vertex.is_valid());
    }
}

#[test]
fn one_interpolated_vertex_is_that_of_all() {
    let own = surface(9);
    for step in 1..=4 {
        let kept = KeptVertices::of(GRID, step, |place| own[place]);
        for (place, expected) in kept.spread().iter().enumerate() {
            assert_eq!(kept.interpolated(place), *expected, "place {place} of {step}");
        }
    }
}

/// Between the kept vertices nothing stands at the step and about the holes, unless it is told.
#[test]
fn vertices_beside_the_kept_ones_come_back_where_nothing_can_be_interpolated() {
    let (surface, thinning) = (surface(4), Thinning { spacing: 4, ..FINE });
    let beside: Vec<usize> = (0..GRID.len()).step_by(3).chain([GRID.len(), usize::MAX]).collect();
    let bytes = pack(GRID, &surface, &beside, thinning);
    let back = unpack(GRID, &bytes, &beside).unwrap();
    let mut n_told = 0;
    for &at in beside.iter().filter(|at| **at < GRID.len() && surface[**at].is_inner()) {
        let off_m = (back[at].position[2] - surface[at].position[2]).abs();
        assert!(back[at].is_inner() && off_m < 0.0025, "{off_m} m at {at}");
        n_told += 1;
    }
    assert!(n_told > GRID.len() / 5);
    let without = pack(GRID, &surface, &[], thinning);
    let bits = 8 * (bytes.len() - without.len()) / n_told;
    assert!(bits <= 16, "{bits} bits each");
    assert!(unpack(GRID, &bytes, &[]).is_err(), "told, and not asked for");
}

#[test]
fn other_bytes_are_an_error() {
    let beside: Vec<usize> = (0..GRID.len()).step_by(7).collect();
    let unpack = |grid: Grid, bytes: &[u8]| unpack(grid, bytes, &beside);
    let packed = pack(GRID, &surface(10), &beside, FINE);
    assert!(unpack(GRID, &packed[..packed.len() - 1]).is_err());
    assert!(unpack(GRID, &[packed.as_slice(), &[0]].concat()).is_err());
    assert!(unpack(Grid { width: 51, ..GRID }, &packed).is_err());
    assert!(unpack(GRID, &[]).is_err());
    // No steps at all.
    for head in [[2, 0, 0, 31], [0, 0, 16, 31], [MOST_SPACING + 1, 0, 16, 31], [2, 0, 16, 0]] {
        let stepless = [&packed[..16], &head, &packed[20..]].concat();
        assert!(unpack(GRID, &stepless).is_err());
    }
    let mut random = SplitMix64::new(2);
    for _ in 0..500 {
        let mut damaged = packed.clone();
        let at = random.below(damaged.len());
        damaged[at] = random.next_u64() as u8;
        if let Ok(vertices) = unpack(GRID, &damaged) {
            let is_finite = |v: &Vertex| v.position.iter().chain(&v.normal).all(|n| n.is_finite());
            assert!(vertices.iter().all(is_finite));
        }
    }
}
