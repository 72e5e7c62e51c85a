//! Features of a textured image: found again under rotation and scale, spread, and the same bits
//! everywhere.

use std::f64::consts::FRAC_PI_2;
use tessera_features::{
    ExtractWorkspace, Feature, FeatureMatch, FeatureSettings, MatchSettings, MatchWorkspace, Picture,
    extract, hamming_distance, match_features,
};

const SIZE: [usize; 2] = [640, 480];

/// Rectangles on each other, each of a random plane of grey: `(column, row)` in pixels.
struct Texture {
    rectangles: Vec<[f64; 7]>,
    /// Rectangles of each tile of 20 px, the topmost first.
    tiles: Vec<Vec<usize>>,
}

/// Tiles along each side, and the position of the first.
const TILES: usize = 64;
const ORIGIN: f64 = -200.0;

impl Texture {
    fn new(seed: u64) -> Self {
        let mut state = seed;
        let mut unit = move || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 40) as f64 / (1u64 << 24) as f64
        };
        let rectangle = |_| {
            let size = [unit(), unit()].map(|s| 8.0 + 60.0 * s * s);
            let (grey, slope) = (40.0 + 175.0 * unit(), [unit(), unit()].map(|s| 4.0 * s - 2.0));
            [900.0 * unit() - 130.0, 740.0 * unit() - 130.0, size[0], size[1], grey, slope[0], slope[1]]
        };
        let rectangles: Vec<[f64; 7]> = (0..900).map(rectangle).collect();
        let tile = |position: f64| ((position - ORIGIN) / 20.0) as usize;
        let mut tiles = vec![Vec::new(); TILES * TILES];
        for (i, r) in rectangles.iter().enumerate().rev() {
            for row in tile(r[1])..=tile(r[1] + r[3]) {
                (tile(r[0])..=tile(r[0] + r[2])).for_each(|column| tiles[row * TILES + column].push(i));
            }
        }
        Self { rectangles, tiles }
    }

    /// The image at `of(column, row)`, means of 2x2 samples.
    fn image(&self, [width, height]: [usize; 2], of: impl Fn(f64, f64) -> [f64; 2]) -> Vec<u8> {
        let samples = [(-0.25, -0.25), (0.25, -0.25), (-0.25, 0.25), (0.25, 0.25)];
        let value = |i: usize| {
            let (column, row) = ((i % width) as f64, (i / width) as f64);
            let at = |&(u, v): &(f64, f64)| self.at(of(column + u, row + v));
            (samples.iter().map(at).sum::<f64>() / 4.0) as u8
        };
        (0..width * height).map(value).collect()
    }

    fn at(&self, [x, y]: [f64; 2]) -> f64 {
        let plane = |r: &[f64; 7]| r[4] + r[5] * (x - r[0] - r[2] / 2.0) + r[6] * (y - r[1] - r[3] / 2.0);
        let tile = |position: f64| (((position - ORIGIN) / 20.0) as usize).min(TILES - 1);
        let near = self.tiles[tile(y) * TILES + tile(x)].iter().map(|&i| &self.rectangles[i]);
        let covers = |r: &&[f64; 7]| x >= r[0] && y >= r[1] && x < r[0] + r[2] && y < r[1] + r[3];
        near.copied().find(|r| covers(&r)).map_or(100.0, |r| plane(&r)).clamp(0.0, 255.0)
    }
}

fn features(image: &[u8], [width, height]: [usize; 2]) -> Vec<Feature> {
    let picture = Picture::grey(width, height, image).unwrap();
    extract(&picture, &FeatureSettings::default(), &mut ExtractWorkspace::new(pulp::Arch::new()))
}

fn matches(queries: &[Feature], targets: &[Feature]) -> Vec<FeatureMatch> {
    let mut workspace = MatchWorkspace::new(pulp::Arch::new());
    match_features(queries, targets, None, &MatchSettings::default(), &mut workspace)
}

/// Share of the query's features inside the target image that are found again within two standard
/// deviations, and the share of matches that are right.
fn found_again(angle_rad: f64, scale: f64) -> [f64; 2] {
    let texture = Texture::new(5);
    let (sine, cosine) = (angle_rad.sin() * scale, angle_rad.cos() * scale);
    let of = |x: f64, y: f64| {
        let (u, v) = (x - 320.0, y - 240.0);
        [320.0 + cosine * u - sine * v, 240.0 + sine * u + cosine * v]
    };
    let queries = features(&texture.image(SIZE, |x, y| [x, y]), SIZE);
    let targets = features(&texture.image(SIZE, of), SIZE);
    let is_right = |q: &Feature, t: &Feature| {
        let [x, y] = of(t.pixel[1].into(), t.pixel[0].into());
        let (dx, dy) = (x - f64::from(q.pixel[1]), y - f64::from(q.pixel[0]));
        (dx * dx + dy * dy).sqrt() < 2.0 * f64::from(q.sigma_px.max(t.sigma_px * scale as f32))
    };
    // Those that the target image sees, away from its border.
    let is_visible = |q: &&Feature| {
        let (u, v) = (f64::from(q.pixel[1]) - 320.0, f64::from(q.pixel[0]) - 240.0);
        let norm = scale * scale;
        let (x, y) = ((cosine * u + sine * v) / norm, (cosine * v - sine * u) / norm);
        x.abs() < 320.0 - 60.0 && y.abs() < 240.0 - 60.0
    };
    let visible: Vec<&Feature> = queries.iter().filter(is_visible).collect();
    let repeated = visible.iter().filter(|q| targets.iter().any(|t| is_right(q, t))).count();
    let found = matches(&queries, &targets);
    let right =
        found.iter().filter(|m| is_right(&queries[m.query as usize], &targets[m.target as usize])).count();
    assert!(found.len() > 60, "{} matches at {angle_rad} {scale}", found.len());
    [repeated as f64 / visible.len() as f64, right as f64 / found.len() as f64]
}

#[test]
fn corners_are_found_again_under_rotation_and_scale() {
    for (angle_rad, scale) in [
        (0.0, 1.0),
        (0.1, 1.0),
        (0.7, 1.0),
        (FRAC_PI_2, 1.0),
        (3.0, 1.0),
        (-2.0, 1.0),
        (0.2, 1.2),
        (0.0, 0.7),
    ] {
        let [repeated, right] = found_again(angle_rad, scale);
        println!("{angle_rad} {scale}: repeated {repeated:.2}, right {right:.2}");
        assert!(repeated > 0.5, "{repeated} repeated at {angle_rad} rad, scale {scale}");
        assert!(right > 0.8, "{right} right at {angle_rad} rad, scale {scale}");
    }
}

#[test]
fn orientation_and_descriptor_turn_with_the_image() {
    let texture = Texture::new(8);
    let image = texture.image([480, 480], |x, y| [x, y]);
    let turned: Vec<u8> = (0..480 * 480).map(|i| image[(479 - i % 480) * 480 + i / 480]).collect();
    let (queries, targets) = (features(&image, [480, 480]), features(&turned, [480, 480]));
    let (mut n, mut n_turned, mut bits) = (0, 0, 0);
    for q in queries.iter().filter(|q| q.level == 0) {
        // The pixel (row, column) goes to (column, 479 - row).
        let at = [q.pixel[1], 479.0 - q.pixel[0]];
        let is_same = |t: &&Feature| {
            t.level == 0 && (t.pixel[0] - at[0]).abs() < 0.01 && (t.pixel[1] - at[1]).abs() < 0.01
        };
        let Some(t) = targets.iter().find(is_same) else { continue };
        let turn = (t.angle_rad - q.angle_rad - FRAC_PI_2 as f32).rem_euclid(std::f32::consts::TAU);
        // Rounding in the smoothing turns it, by much where the centroid is near the corner.
        n_turned += u32::from(turn.min(std::f32::consts::TAU - turn) < 0.1);
        n += 1;
        bits += hamming_distance(&q.descriptor, &t.descriptor);
    }
    assert!(n > 60 && n_turned * 10 > n * 9, "{n} features found again, {n_turned} turned");
    assert!(bits < 20 * n, "{} bits differ on average", bits / n);
}

#[test]
fn features_are_spread_over_the_image() {
    let texture = Texture::new(6);
    // Contrast falls to a twentieth from left to right.
    let mut image = texture.image(SIZE, |x, y| [x, y]);
    for (i, value) in image.iter_mut().enumerate() {
        let share = 1.0 - 0.9 * (i % 640) as f64 / 640.0;
        *value = (128.0 + share * (f64::from(*value) - 128.0)) as u8;
    }
    let found = features(&image, SIZE);
    let most = FeatureSettings::default().max_features as usize;
    assert_eq!(found.len(), most);
    let mut of_tile = [[0; 4]; 4];
    for f in &found {
        of_tile[(f.pixel[0] / 120.0) as usize][(f.pixel[1] / 160.0) as usize] += 1;
    }
    assert!(of_tile.iter().flatten().all(|&n| (8..80).contains(&n)), "{of_tile:?}");
    assert!((0..4).all(|level| found.iter().filter(|f| f.level == level).count() >= most / 10));
    assert!(
        found
            .iter()
            .all(|f| f.pixel[0] > 16.0 && f.pixel[0] < 463.0 && f.pixel[1] > 16.0 && f.pixel[1] < 623.0)
    );
}

#[test]
fn images_without_contrast_have_no_features() {
    for value in [0, 90, 255] {
        assert_eq!(features(&vec![value; 640 * 480], SIZE), []);
    }
    let dark: Vec<u8> = (0..640 * 480).map(|i| (i * 7 % 5) as u8).collect();
    assert_eq!(features(&dark, SIZE), []);
}

#[test]
fn any_size_is_accepted() {
    let texture = Texture::new(7);
    let sizes = [
        [0, 0],
        [1, 1],
        [0, 9],
        [5, 700],
        [700, 5],
        [36, 36],
        [37, 37],
        [38, 37],
        [39, 64],
        [53, 49],
        [64, 48],
        [127, 99],
        [176, 144],
        [1920, 1080],
    ];
    for size in sizes {
        let found = features(&texture.image(size, |x, y| [x / 2.0, y / 2.0]), size);
        let least = match size[0].min(size[1]) {
            0..100 => 0,
            _ => 50,
        };
        assert!(found.len() >= least && found.len() <= 500, "{size:?}: {}", found.len());
    }
}

#[test]
fn rgb_of_equal_channels_is_nearly_grey() {
    let grey = Texture::new(5).image(SIZE, |x, y| [x, y]);
    let rgb: Vec<u8> = grey.iter().flat_map(|&v| [v; 3]).collect();
    let picture = Picture::rgb(640, 480, &rgb).unwrap();
    let found = extract(&picture, &FeatureSettings::default(), &mut ExtractWorkspace::new(pulp::Arch::new()));
    assert_eq!(found, features(&grey, SIZE));
}

#[test]
fn the_same_bits_for_every_instruction_set_and_whatever_came_before() {
    let texture = Texture::new(5);
    let image = texture.image(SIZE, |x, y| [x, y]);
    let picture = Picture::grey(640, 480, &image).unwrap();
    let settings = FeatureSettings::default();
    let first = features(&image, SIZE);
    assert_eq!(first.len(), settings.max_features as usize);
    let mut scalar = ExtractWorkspace::new(pulp::Arch::Scalar);
    assert_eq!(extract(&picture, &settings, &mut scalar), first);
    let small = texture.image([176, 144], |x, y| [x, y]);
    extract(&Picture::grey(176, 144, &small).unwrap(), &settings, &mut scalar);
    assert_eq!(extract(&picture, &settings, &mut scalar), first);
    assert_eq!(bytemuck::cast_slice::<Feature, u8>(&first).len(), 56 * first.len());
    let queries = &first[..300];
    let settings = MatchSettings { max_ratio: 1.0, max_distance: 256, ..MatchSettings::default() };
    let run = |arch| match_features(queries, &first, None, &settings, &mut MatchWorkspace::new(arch));
    assert_eq!(run(pulp::Arch::Scalar), run(pulp::Arch::new()));
}
