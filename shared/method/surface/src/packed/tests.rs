use super::rounded::POINT_STEP_M;
use super::*;
use tessera_numerics::SplitMix64;

const GRID: Grid = Grid { width: 40, height: 30, step: 4 };

/// Of these one is there twice, one a first vertex, and one behind the grid.
const BESIDE: [usize; 6] = [17, 45, 45, 3, 1003, 40 * 30];

/// A wall with a step, holes, noise and colours.
fn surface() -> Vec<Vertex> {
    let mut random = SplitMix64::new(1);
    let mut vertices = Vec::new();
    for index in 0..GRID.len() {
        let (row, column) = ((index / GRID.width) as f32, (index % GRID.width) as f32);
        let depth = if column < 25.0 { 1.5 } else { 2.5 } + 0.002 * random.unit() as f32;
        let (x, y) = ((column - 19.5) * depth / 130.0, (row - 14.5) * depth / 130.0);
        let (a, b) = (random.unit() as f32 - 0.5, random.unit() as f32 - 0.5);
        let length = (a * a + b * b + 1.0).sqrt();
        let rgb = [0, 1, 2].map(|channel| (40.0 * channel as f32 + 3.0 * row + column) as u8);
        vertices.push(match random.below(10) {
            0 => Vertex { flags_rgb: Vertex::pack(Vertex::BOUNDARY, 0, rgb), ..Vertex::default() },
            _ => Vertex {
                position: [x, y, depth],
                flags_rgb: Vertex::pack(Vertex::VALID, random.below(4) as u32, rgb),
                normal: [a / length, b / length, -1.0 / length],
                reserved: 0,
            },
        });
    }
    vertices
}

#[test]
fn a_surface_comes_back_within_the_rounding() {
    let surface = surface();
    let packed = pack(GRID, &surface, &BESIDE);
    assert!(packed.len() * 3 < size_of_val(surface.as_slice()), "{} bytes", packed.len());
    let back = unpack(GRID, &packed, &BESIDE).unwrap();
    assert_eq!(pack_and_round(GRID, &surface, &BESIDE), (packed.clone(), back.clone()));
    assert_eq!(rounded(&surface), back);
    for (back, vertex) in back.iter().zip(&surface) {
        assert_eq!(back.flags_rgb, vertex.flags_rgb);
        let distance = |a: [f32; 3], b: [f32; 3]| (0..3).map(|k| (a[k] - b[k]).abs()).fold(0.0, f32::max);
        assert!(distance(back.position, vertex.position) <= 0.51 * POINT_STEP_M);
        assert!(distance(back.normal, vertex.normal) < 0.003, "{back:?} {vertex:?}");
    }
    // Packed again, nothing is lost any more.
    assert_eq!(unpack(GRID, &pack(GRID, &back, &BESIDE), &BESIDE).unwrap(), back);
}

#[test]
fn the_first_vertices_are_read_without_the_others() {
    let packed = pack(GRID, &surface(), &BESIDE);
    let back = unpack(GRID, &packed, &BESIDE).unwrap();
    let is_first = |place: usize| {
        BESIDE.contains(&place)
            || (place / GRID.width).is_multiple_of(3) && (place % GRID.width).is_multiple_of(3)
    };
    let n_first = (0..GRID.len()).filter(|place| is_first(*place)).count();
    assert_eq!(n_first, 14 * 10 + 3);
    // A fifth of the bytes holds all of them.
    let beginning = &packed[..packed.len() / 5];
    assert!(unpack(GRID, beginning, &BESIDE).is_err());
    let first = unpack_first(GRID, beginning, &BESIDE).unwrap();
    for (place, vertex) in back.iter().enumerate() {
        assert_eq!(first.vertex(place), if is_first(place) { *vertex } else { Vertex::default() });
    }
    assert_eq!(first.vertex(30 * GRID.width), Vertex::default());
    assert!(unpack_first(GRID, &packed[..packed.len() / 20], &BESIDE).is_err());
}

#[test]
fn other_bytes_are_an_error() {
    let packed = pack(GRID, &surface(), &BESIDE);
    assert!(unpack(GRID, &packed[..packed.len() - 1], &BESIDE).is_err());
    assert!(unpack(GRID, &[packed.as_slice(), &[0]].concat(), &BESIDE).is_err());
    assert!(unpack(Grid { width: 41, ..GRID }, &packed, &BESIDE).is_err());
    let error = unpack(GRID, &[], &BESIDE).unwrap_err().to_string();
    assert!(error.contains("40 x 30"), "{error}");
    let mut random = SplitMix64::new(2);
    for _ in 0..500 {
        let mut damaged = packed.clone();
        let at = random.below(damaged.len());
        damaged[at] = random.next_u64() as u8;
        if let Ok(vertices) = unpack(GRID, &damaged, &BESIDE) {
            let is_finite = |v: &Vertex| v.position.iter().chain(&v.normal).all(|n| n.is_finite());
            assert!(vertices.iter().all(is_finite));
        }
    }
}

/// A sloped wall with a step and holes.
fn wall(one_hole_in: usize) -> Vec<Vertex> {
    let (mut random, length) = (SplitMix64::new(1), 1.04_f32.sqrt());
    let vertex = |place: usize| {
        let (row, column) = ((place / GRID.width) as f32, (place % GRID.width) as f32);
        let (u, v) = ((column - 20.0) / 130.0, (row - 14.5) / 130.0);
        // The plane z = d + 0.2 x.
        let depth = if column < 25.0 { 1.5 } else { 2.5 } / (1.0 - 0.2 * u) + 0.001 * random.unit() as f32;
        match random.below(one_hole_in) {
            0 => Vertex::default(),
            _ => Vertex {
                position: [u * depth, v * depth, depth],
                flags_rgb: Vertex::pack(Vertex::VALID, 1, [9, 100, 255]),
                normal: [0.2 / length, 0.0, -1.0 / length],
                reserved: 0,
            },
        }
    };
    (0..GRID.len()).map(vertex).collect()
}

#[test]
fn what_travels_comes_back_with_what_stands_between() {
    let wall = wall(usize::MAX);
    let bytes = pack_first(GRID, |place| wall[place], &[]);
    assert!(bytes.len() * 4 < pack(GRID, &wall, &[]).len(), "{} bytes", bytes.len());
    let back = unpack_spread(GRID, &bytes, &[]).unwrap();
    let mut n_missing = 0;
    for (place, (back, vertex)) in back.iter().zip(&wall).enumerate() {
        let (row, column) = (place / GRID.width, place % GRID.width);
        if !back.is_valid() {
            // The last rows and columns have none behind them, and nothing stands between wall and step.
            assert!(row > 27 || column > 39 || column.abs_diff(25) < 3, "row {row} column {column}");
            n_missing += 1;
            continue;
        }
        let off_m = (0..3).map(|k| (back.position[k] - vertex.position[k]) * vertex.normal[k]).sum::<f32>();
        assert!(off_m.abs() < 0.0015, "{off_m} m at row {row} column {column}");
        let dot = (0..3).map(|k| back.normal[k] * vertex.normal[k]).sum::<f32>();
        assert!(dot > 0.999 && back.row_offset() == 1 && back.rgb() == vertex.rgb(), "{back:?}");
    }
    assert!(n_missing < 4 * (GRID.width + GRID.height), "{n_missing}");
    let empty = vec![Vertex::default(); GRID.len()];
    assert_eq!(unpack_spread(GRID, &pack_first(GRID, |place| empty[place], &[]), &[]).unwrap(), empty);
}

/// Between the spaced vertices nothing stands about the holes, unless it is told.
#[test]
fn vertices_beside_travel_where_nothing_can_be_interpolated() {
    let wall = wall(4);
    let beside: Vec<usize> = (0..GRID.len()).step_by(4).chain([GRID.len(), usize::MAX]).collect();
    let bytes = pack_first(GRID, |place| wall[place], &beside);
    let back = unpack_spread(GRID, &bytes, &beside).unwrap();
    let told = beside.iter().filter(|place| **place < GRID.len() && wall[**place].is_inner());
    assert!(told.clone().count() > GRID.len() / 6);
    for &place in told {
        assert_eq!(back[place], rounded(&wall[place..=place])[0], "place {place}");
    }
    assert!(unpack_spread(GRID, &bytes, &[]).is_err(), "told, and not asked for");
    assert!(unpack_spread(GRID, &bytes[..bytes.len() - 1], &beside).is_err());
    assert!(unpack_spread(GRID, &[bytes.as_slice(), &[0]].concat(), &beside).is_err());
    assert!(unpack_spread(GRID, &pack(GRID, &wall, &beside), &beside).is_err(), "the others behind");
    assert!(unpack_spread(GRID, &[], &beside).is_err());
}
