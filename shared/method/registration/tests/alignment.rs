//! Acceptance checks that concern alignment, on simulated rooms, corridors and walls.

use nalgebra::Vector3;
use tessera_geometry::{Camera, DepthNoise, Matrix6, Pose, Twist, exp, translation_rotation_norms};
use tessera_graph::{Graph, Pair, PairBlock, entropy_of_covariance};
use tessera_numerics::MethodVariant;
use tessera_registration::{
    GridCamera, KdTree, MatchLimits, Matcher, PairReport, Queries, RegistrationSettings, Sampler, Selection,
    ShutterTable, Target,
};
use tessera_surface::{Reconstructor, SurfaceSettings, SurfaceView, Vertex};

fn camera(readout_s: f64) -> Camera {
    Camera { readout_s, ..Camera::pinhole((640, 480), [525.0, 525.0, 319.5, 239.5], 5000.0) }
}

/// Planes `n . x = d` seen from inside.
type Scene = Vec<(Vector3<f64>, f64)>;

fn room() -> Scene {
    let x = Vector3::x();
    let (y, z) = (Vector3::y(), Vector3::z());
    // Narrow, so that all five planes are in view and every direction is observable.
    vec![(x, 0.9), (-x, 0.8), (y, 0.7), (-y, 0.8), (z, 2.4)]
}

fn corridor() -> Scene {
    vec![(Vector3::x(), 1.0), (-Vector3::x(), 1.0), (Vector3::y(), 1.0), (-Vector3::y(), 1.2)]
}

fn wall() -> Scene {
    vec![(Vector3::z(), 2.0)]
}

/// Renders a scene; each row from where the camera was when it was exposed.
fn surface(
    camera: &Camera,
    scene: &Scene,
    world_from_camera: &Pose,
    velocity: &Twist,
) -> (Vec<Vertex>, Reconstructor) {
    let mut depth = vec![0u16; 640 * 480];
    for row in 0..480 {
        let world_from_row =
            world_from_camera * exp(&velocity.scaled(camera.row_time_s(f64::from(row as u32))));
        for column in 0..640 {
            let ray = world_from_row.rotation * camera.ray(row as f64, column as f64);
            let origin = world_from_row.translation.vector;
            let hit = scene
                .iter()
                .map(|(n, d)| (d - n.dot(&origin)) / n.dot(&ray))
                .filter(|t| *t > 0.0)
                .fold(f64::INFINITY, f64::min);
            depth[row * 640 + column] = if hit < 8.0 { (hit * 5000.0).round() as u16 } else { 0 };
        }
    }
    let mut reconstructor = Reconstructor::new(camera, &SurfaceSettings::default()).unwrap();
    let mut out = vec![Vertex::default(); reconstructor.grid().len()];
    reconstructor.reconstruct(&depth, None, &mut out);
    (out, reconstructor)
}

struct Setup {
    camera: Camera,
    query: Vec<Vertex>,
    target: Vec<Vertex>,
    query_velocity: Twist,
    target_velocity: Twist,
}

impl Setup {
    fn still(scene: &Scene, target_from_query: &Pose) -> Self {
        let camera = camera(0.0);
        let (target, _) = surface(&camera, scene, &Pose::identity(), &Twist::default());
        let (query, _) = surface(&camera, scene, target_from_query, &Twist::default());
        Self { camera, query, target, query_velocity: Twist::default(), target_velocity: Twist::default() }
    }

    /// The pose after ten outer iterations from a start, its information and the last report.
    fn align(&self, start: &Pose) -> (Pose, Matrix6, PairReport, f64) {
        self.align_with(start, &RegistrationSettings::default())
    }

    fn align_with(&self, start: &Pose, settings: &RegistrationSettings) -> (Pose, Matrix6, PairReport, f64) {
        self.align_within(start, settings, |tightness| MatchLimits::new(0.3, tightness))
    }

    fn align_within(
        &self,
        start: &Pose,
        settings: &RegistrationSettings,
        limits: impl Fn(f32) -> MatchLimits,
    ) -> (Pose, Matrix6, PairReport, f64) {
        let (_, reconstructor) = surface(&self.camera, &wall(), &Pose::identity(), &Twist::default());
        let grid = reconstructor.grid();
        let offset_px = 1.5;
        let shutter = |v: &Twist| ShutterTable::new(&self.camera, v, grid.height, grid.step, offset_px);
        let mut samples = Vec::new();
        let view = SurfaceView { grid, vertices: &self.query };
        Sampler::default().draw(&view, 1, settings, &mut samples);
        let mut queries = Queries::default();
        queries.fill(&samples, &shutter(&self.query_velocity));
        let target_shutter = shutter(&self.target_velocity);
        let surface = SurfaceView { grid, vertices: &self.target };
        let tree = settings.variant.is_paper().then(|| KdTree::new(&surface, &target_shutter));
        let target = Target { surface, shutter: &target_shutter, tree: tree.as_ref() };
        let grid_camera = GridCamera::new(&self.camera, grid, offset_px);
        let mut matcher = Matcher::new(grid_camera, DepthNoise::default(), settings);
        let mut pose = *start;
        let mut last = None;
        for k in 0..10 {
            let limits = limits(k as f32 / 9.0);
            let selection = Selection { count: 2000, shift: 0 };
            let (sums, report) = matcher.match_pair(&queries, selection, &target, &pose, &limits);
            let block = PairBlock::new(&pose, &sums.all());
            let mut graph = Graph {
                poses: vec![Pose::identity(), pose],
                is_fixed: vec![true, false],
                pairs: vec![Pair::new(1, 0, block.clone())],
                ..Graph::default()
            };
            graph.optimise(10, &mut || ()).unwrap();
            pose = graph.poses[1];
            last = Some((block.linearise(&pose).0, report));
        }
        let (information, report) = last.unwrap();
        (pose, information, report, matcher.metric_factor())
    }
}

fn check(found: &Pose, truth: &Pose, most_m: f64, most_rad: f64) {
    let (m, rad) = translation_rotation_norms(&(truth.inverse() * found));
    assert!(m < most_m && rad < most_rad, "off by {m} m and {rad} rad");
}

#[test]
fn a_frame_aligned_with_itself_does_not_move() {
    let setup = Setup::still(&room(), &Pose::identity());
    let (pose, _, report, _) = setup.align(&Pose::identity());
    assert_eq!(report.median_residual_sigmas, 0.0);
    check(&pose, &Pose::identity(), 1e-9, 1e-9);
}

#[test]
fn a_planted_motion_is_recovered_and_the_step_goes_the_right_way() {
    let truth = exp(&Twist { rho: Vector3::new(0.06, -0.04, 0.05), phi: Vector3::new(0.03, 0.05, -0.02) });
    let (pose, _, report, _) = Setup::still(&room(), &truth).align(&Pose::identity());
    assert!(report.n_matches > 500, "{report:?}");
    check(&pose, &truth, 1.5e-3, 1e-3);
}

#[test]
fn the_exact_search_finds_the_same() {
    let truth = exp(&Twist { rho: Vector3::new(0.06, -0.04, 0.05), phi: Vector3::new(0.03, 0.05, -0.02) });
    let setup = Setup::still(&room(), &truth);
    let exact = RegistrationSettings { variant: MethodVariant::Paper, ..RegistrationSettings::default() };
    let (pose, _, report, _) = setup.align_with(&Pose::identity(), &exact);
    assert!(report.n_matches > 500, "{report:?}");
    check(&pose, &truth, 1.5e-3, 1e-3);
}

#[test]
fn entropy_orders_room_corridor_and_wall() {
    let entropy = |scene: &Scene| {
        let (_, information, _, factor) = Setup::still(scene, &Pose::identity()).align(&Pose::identity());
        entropy_of_covariance(&information, factor).unwrap()
    };
    let (room, corridor, wall) = (entropy(&room()), entropy(&corridor()), entropy(&wall()));
    assert!(room < corridor && corridor < wall, "room {room}, corridor {corridor}, wall {wall} nats");
}

#[test]
fn a_rolling_shutter_is_undone_when_it_is_known() {
    let camera = camera(0.03);
    let query_velocity = Twist { rho: Vector3::new(0.3, 0.1, -0.2), phi: Vector3::new(0.4, 1.2, -0.3) };
    let target_velocity = Twist { rho: Vector3::new(-0.2, 0.0, 0.1), phi: Vector3::new(-0.8, 0.5, 0.2) };
    let truth = exp(&Twist { rho: Vector3::new(0.03, 0.02, -0.02), phi: Vector3::new(0.02, -0.03, 0.01) });
    let (target, _) = surface(&camera, &room(), &Pose::identity(), &target_velocity);
    let (query, _) = surface(&camera, &room(), &truth, &query_velocity);
    let known = Setup { camera, query, target, query_velocity, target_velocity };
    let (pose, ..) = known.align(&Pose::identity());
    check(&pose, &truth, 2e-3, 1.5e-3);
    let still = Twist::default();
    let ignored = Setup { query_velocity: still, target_velocity: still, ..known };
    let (pose, ..) = ignored.align(&Pose::identity());
    let (_, rad) = translation_rotation_norms(&(truth.inverse() * pose));
    assert!(rad > 3e-3, "ignoring the readout costs only {rad} rad: the test shows nothing");
}

#[test]
fn what_alone_shows_a_drift_is_no_outlier() {
    // A wall fills the view; of the other walls a strip is seen, and it alone holds the sideways pose.
    let scene = vec![(Vector3::z(), 2.0), (Vector3::x(), 1.05), (-Vector3::y(), 0.8)];
    let setup = Setup::still(&scene, &Pose::identity());
    let start = Pose::translation(0.07, 0.0, 0.0);
    let settings = RegistrationSettings::default();
    let off_m = |limits: fn(f64, f32) -> MatchLimits| {
        let (pose, ..) = setup.align_within(&start, &settings, |tightness| limits(0.15, tightness));
        translation_rotation_norms(&pose).0
    };
    let (near, drifted) = (off_m(MatchLimits::new), off_m(MatchLimits::drifted));
    assert!(near > 0.02 && drifted < 0.002, "off by {near} m, {drifted} m where drift is allowed for");
}
