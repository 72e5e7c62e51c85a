//! How good a fused mesh is: the simulated room against its exact surface, and a kitchen against
//! its depth images. Poses are the true ones, so that fusion alone is measured.

mod common;

use common::{fuse, kitchen, measure, open, shots, view};
use nalgebra::Vector3;
use std::collections::HashMap;
use tessera_fusion::{FusionError, FusionSettings, VIEWS_AT_ONCE, Volume};
use tessera_geometry::Camera;
use tessera_numerics::Isa;
use tessera_surface::SurfaceSettings;

#[test]
fn the_room_is_where_it_is() {
    let seen = shots(&*open("room", true), 12, &SurfaceSettings::default());
    let [accuracy, completeness] = measure("room", 12, &seen);
    assert!(accuracy.0 < 5.0 && accuracy.1 < 25.0, "{accuracy:?}");
    assert!(completeness.0 < 5.0 && completeness.1 < 30.0, "{completeness:?}");
}

#[test]
fn a_kitchen_is_where_it_was_seen() {
    let Some(folder) = kitchen() else { return };
    let seen = shots(&*open(&folder, true), 6, &SurfaceSettings::default());
    let [accuracy, completeness] = measure(&folder, 6, &seen);
    assert!(accuracy.0 < 3.0 && accuracy.1 < 15.0, "{accuracy:?}");
    assert!(completeness.0 < 3.0 && completeness.1 < 15.0, "{completeness:?}");
}

#[test]
fn a_mesh_is_made_of_whole_triangles_that_face_the_camera() {
    let source = open("wall", true);
    let seen = shots(&*source, 100, &SurfaceSettings::default());
    let mesh = fuse(source.camera(), &seen, &FusionSettings::default()).unwrap().mesh();
    assert!(mesh.triangles.len() > 1000);
    let at = |k: u32| Vector3::from(mesh.positions[k as usize].map(f64::from));
    let mut n_edges: HashMap<(u32, u32), u32> = HashMap::new();
    // Twice the area that faces the camera, and that which turns its back.
    let (mut front, mut back) = (0.0, 0.0);
    for t in &mesh.triangles {
        let face = (at(t[1]) - at(t[0])).cross(&(at(t[2]) - at(t[0])));
        let normal = Vector3::from(mesh.normals[t[0] as usize].map(f64::from));
        *(if face.dot(&normal) > 0.0 { &mut front } else { &mut back }) += face.norm();
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            *n_edges.entry((a, b)).or_default() += 1;
        }
    }
    assert!(back < 0.01 * front, "{back} of {front}");
    let mut sorted: Vec<[u32; 3]> = mesh.triangles.clone();
    sorted.iter_mut().for_each(|t| t.sort_unstable());
    sorted.sort_unstable();
    assert!(sorted.windows(2).all(|pair| pair[0] != pair[1]), "no triangle is there twice");
    // Manifold: an edge runs once each way.
    assert!(n_edges.values().all(|&n| n == 1));
    // One surface, also where blocks meet: most edges have a triangle on either side.
    let inner = n_edges.keys().filter(|(a, b)| n_edges.contains_key(&(*b, *a))).count();
    assert!(inner * 100 > n_edges.len() * 90, "{inner} of {}", n_edges.len());
}

#[test]
fn memory_has_a_bound_and_the_same_views_give_the_same_mesh() {
    let source = open("wall", true);
    let seen = shots(&*source, 150, &SurfaceSettings::default());
    let small = FusionSettings { max_bytes: 100_000, ..FusionSettings::default() };
    let error = fuse(source.camera(), &seen, &small).unwrap_err();
    assert_eq!(error, FusionError::Memory { max_mb: 0, voxel_mm: 10.0 });
    let mesh = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| fuse(source.camera(), &seen, &FusionSettings::default()).unwrap().mesh())
    };
    assert!(mesh(1) == mesh(3));
}

#[test]
fn instruction_sets_and_how_views_come_change_no_bit() {
    // A camera that moves during the readout, and more views than go together.
    let source = open("room", true);
    let mut seen = shots(&*source, 18, &SurfaceSettings::default());
    seen.iter_mut().enumerate().for_each(|(k, shot)| shot.world_from_camera.translation.x += 1e-3 * k as f64);
    let camera = Camera { readout_s: 0.03, ..source.camera().clone() };
    assert!(seen.len() > VIEWS_AT_ONCE, "{}", seen.len());
    let mesh =
        |isa| fuse(&camera, &seen, &FusionSettings { isa, ..FusionSettings::default() }).unwrap().mesh();
    let narrow = mesh(Isa::Baseline);
    assert!(narrow.triangles.len() > 10_000, "{}", narrow.triangles.len());
    assert!(mesh(Isa::Auto) == narrow);
    let mut one_by_one = Volume::new(&FusionSettings::default());
    seen.iter().for_each(|shot| one_by_one.integrate(&[view(&camera, shot)]).unwrap());
    assert!(one_by_one.mesh() == narrow);
}
