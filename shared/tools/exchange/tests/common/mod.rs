//! Meshes against the surfaces that they are of.
#![allow(dead_code, unreachable_pub, reason = "each test file uses a part of it")]

#[path = "../../../../../tests/requirements.rs"]
mod requirements;

use nalgebra::{Point3, Vector3};
use std::collections::HashMap;
use tessera_fusion::{FusionError, FusionSettings, Mesh, View, Volume};
use tessera_geometry::{Camera, Pose, Twist, log};
use tessera_sources::{DepthSensor, FrameBuffers, SimulationOptions, Source, SourceOptions, SourceSpec};
use tessera_surface::{Grid, Reconstructor, SurfaceSettings, SurfaceView, Vertex};

/// A surface with its pose and motion.
pub struct Shot {
    pub grid: Grid,
    pub vertices: Vec<Vertex>,
    pub world_from_camera: Pose,
    pub velocity: Twist,
}

pub fn open(spec: &str, noise: bool) -> Box<dyn Source> {
    let sensor = if noise { DepthSensor::StructuredLight } else { DepthSensor::Exact };
    let simulation = SimulationOptions { sensor, ..SimulationOptions::default() };
    tessera_sources::open(&SourceSpec::parse(spec), &SourceOptions { simulation, ..SourceOptions::default() })
        .unwrap()
}

pub fn shots(source: &dyn Source, every: usize, settings: &SurfaceSettings) -> Vec<Shot> {
    let camera = source.camera();
    let n_pixels = (camera.width * camera.height) as usize;
    let (mut depth, mut colour) = (vec![0; n_pixels], vec![0; 3 * n_pixels]);
    let mut reconstructor = Reconstructor::new(camera, settings).unwrap();
    let truth = source.ground_truth().unwrap();
    let pose = |index: u64| {
        let stamp = source.stamp_nanos(index).unwrap();
        let near = (0..truth.poses.len()).min_by_key(|&k| truth.stamps_nanos[k].abs_diff(stamp)).unwrap();
        truth.poses[near]
    };
    let last = source.n_frames().unwrap() - 1;
    (0..last)
        .step_by(every)
        .map(|index| {
            source.read(index, &mut FrameBuffers { depth: &mut depth, colour: &mut colour }).unwrap();
            let mut vertices = vec![Vertex::default(); reconstructor.grid().len()];
            reconstructor.reconstruct(&depth, Some(&colour), &mut vertices);
            let dt_s =
                (source.stamp_nanos(index + 1).unwrap() - source.stamp_nanos(index).unwrap()) as f64 * 1e-9;
            let velocity = log(&(pose(index).inverse() * pose(index + 1))).scaled(1.0 / dt_s);
            Shot { grid: reconstructor.grid(), vertices, world_from_camera: pose(index), velocity }
        })
        .collect()
}

pub fn view<'a>(camera: &'a Camera, shot: &'a Shot) -> View<'a> {
    let surface = SurfaceView { grid: shot.grid, vertices: &shot.vertices };
    View { camera, surface, world_from_camera: shot.world_from_camera, velocity: shot.velocity }
}

pub fn fuse(camera: &Camera, shots: &[Shot], settings: &FusionSettings) -> Result<Volume, FusionError> {
    let mut volume = Volume::new(settings);
    let views: Vec<View<'_>> = shots.iter().map(|shot| view(camera, shot)).collect();
    volume.integrate(&views)?;
    Ok(volume)
}

/// Distance of each vertex of the mesh to the exact surface that some view saw there, millimetres.
pub fn accuracy_mm(mesh: &Mesh, camera: &Camera, exact: &[Shot]) -> Vec<f64> {
    let views: Vec<(Pose, &Shot)> =
        exact.iter().map(|shot| (shot.world_from_camera.inverse(), shot)).collect();
    let distance = |position: &[f32; 3]| {
        let point = Point3::from(position.map(f64::from));
        views
            .iter()
            .filter_map(|(camera_from_world, shot)| {
                let at = camera_from_world * point;
                let (row, column) = camera.project(&at.coords)?;
                let step = shot.grid.step as f64;
                let (row, column) = ((row / step).round(), (column / step).round());
                let is_inside = row >= 0.0
                    && column >= 0.0
                    && row < shot.grid.height as f64
                    && column < shot.grid.width as f64;
                let vertex = shot
                    .vertices
                    .get(is_inside.then(|| row as usize * shot.grid.width + column as usize)?)?;
                let offset = at.coords - Vector3::from(vertex.position.map(f64::from));
                let normal = Vector3::from(vertex.normal.map(f64::from));
                (vertex.is_valid() && offset.norm() < 0.2).then(|| 1e3 * normal.dot(&offset).abs())
            })
            .min_by(f64::total_cmp)
    };
    mesh.positions.iter().map(|position| distance(position).unwrap_or(200.0)).collect()
}

/// Distance of each exact point to the mesh near it, millimetres; 100 where there is none.
pub fn completeness_mm(mesh: &Mesh, exact: &[Shot], max_depth_m: f32) -> Vec<f64> {
    const CELL_M: f64 = 0.02;
    let cell = |point: &Vector3<f64>| (point / CELL_M).map(|c| c.floor() as i32);
    let mut cells: HashMap<[i32; 3], Vec<usize>> = HashMap::new();
    for (k, position) in mesh.positions.iter().enumerate() {
        let at = cell(&Vector3::from(position.map(f64::from)));
        cells.entry(at.into()).or_default().push(k);
    }
    let mut all = Vec::new();
    for shot in exact {
        for vertex in shot.vertices.iter().step_by(7).filter(|v| v.is_inner() && v.position[2] < max_depth_m)
        {
            let point = (shot.world_from_camera * Point3::from(vertex.position.map(f64::from))).coords;
            let middle = cell(&point);
            let around =
                (0..27).map(|k| [middle[0] + k % 3 - 1, middle[1] + k / 3 % 3 - 1, middle[2] + k / 9 - 1]);
            let near = around.filter_map(|at| cells.get(&at)).flatten().map(|&k| {
                let offset = point - Vector3::from(mesh.positions[k].map(f64::from));
                (offset.norm(), Vector3::from(mesh.normals[k].map(f64::from)).dot(&offset).abs())
            });
            all.push(near.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(100.0, |(_, plane_m)| 1e3 * plane_m));
        }
    }
    all
}

/// Median and 95 %.
pub fn figures(mut values: Vec<f64>) -> (f64, f64) {
    values.sort_by(f64::total_cmp);
    let at = |share: f64| values[(share * (values.len() - 1) as f64) as usize];
    (at(0.5), at(0.95))
}

/// Fuses what was seen, and compares it with `every`th view, without noise where it is simulated: median and 95 % of
/// accuracy and of completeness, millimetres.
pub fn measure(spec: &str, every: usize, seen: &[Shot]) -> [(f64, f64); 2] {
    let source = open(spec, false);
    let camera = source.camera();
    let unfiltered = SurfaceSettings { filter_rings: 0, step: 2, ..SurfaceSettings::default() };
    let exact = shots(&*source, every, &unfiltered);
    let settings = FusionSettings::default();
    let volume = fuse(camera, seen, &settings).unwrap();
    let mesh = volume.mesh();
    assert!(mesh.triangles.len() > 10_000);
    let accuracy = figures(accuracy_mm(&mesh, camera, &exact));
    let completeness = figures(completeness_mm(&mesh, &exact, settings.max_depth_m as f32));
    println!(
        "{spec}: {} views, {} triangles, {} MB; accuracy median {:.2} 95 % {:.2} mm, completeness {:.2} {:.2} mm",
        seen.len(),
        mesh.triangles.len(),
        volume.bytes() / 1_000_000,
        accuracy.0,
        accuracy.1,
        completeness.0,
        completeness.1
    );
    [accuracy, completeness]
}

/// The kitchen whose poses are exact, where it is at hand.
pub fn kitchen() -> Option<String> {
    requirements::data("kitchen_exact_120")?.to_str().map(str::to_owned)
}
