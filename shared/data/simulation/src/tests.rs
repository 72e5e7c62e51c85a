//! Scenes as sources: same bytes for any number of threads, right depth, holes where they belong.

use super::*;
use nalgebra::Point3;
use rayon::prelude::*;

fn open(name: SceneName, options: &SimulationOptions) -> SimulatedSource {
    SimulatedSource::open(name, None, None, options).unwrap()
}

fn read(source: &SimulatedSource, index: u64) -> (Vec<u16>, Vec<u8>) {
    let n = source.rays.width * source.rays.height;
    let (mut depth, mut colour) = (vec![7; n], vec![7; 3 * n]);
    source.read(index, &mut FrameBuffers { depth: &mut depth, colour: &mut colour }).unwrap();
    (depth, colour)
}

#[test]
fn a_frame_is_the_same_in_any_order_and_on_any_thread() {
    let options = SimulationOptions { person: true, readout_s: Some(0.03), ..SimulationOptions::default() };
    let one = open(SceneName::Room, &options);
    let in_order: Vec<_> = (0..4).map(|k| read(&one, 20 * k)).collect();
    let other = open(SceneName::Room, &options);
    let together: Vec<_> = (0..4usize).into_par_iter().rev().map(|k| read(&other, 20 * k as u64)).collect();
    for (k, frame) in in_order.iter().enumerate() {
        assert!(*frame == together[3 - k], "frame {}", 20 * k);
    }
    assert!(in_order[0].0 != in_order[1].0);
    let reseeded = open(SceneName::Room, &SimulationOptions { seed: 2, ..options });
    assert!(read(&reseeded, 0).0 != in_order[0].0);
}

#[test]
fn every_pixel_is_written_whatever_the_buffers_hold() {
    let exact = SimulationOptions { sensor: DepthSensor::Exact, ..SimulationOptions::default() };
    for name in [SceneName::Room, SceneName::House, SceneName::Building] {
        let source = open(name, &exact);
        let n = source.rays.width * source.rays.height;
        // The building looks out of doors in its first frame.
        for index in [0, 90] {
            let [first, second] = [7u8, 99].map(|old| {
                let (mut depth, mut colour) = (vec![u16::from(old); n], vec![old; 3 * n]);
                source.read(index, &mut FrameBuffers { depth: &mut depth, colour: &mut colour }).unwrap();
                (depth, colour)
            });
            assert!(first == second, "{name:?}, frame {index}");
        }
    }
}

#[test]
fn exact_depth_moves_from_frame_to_frame_as_the_true_poses_say() {
    // Points of one frame, carried by the ground truth into another, lie on its surface.
    for (distortion, readout_s) in
        [(None, 0.0), (Some([0.26, -0.95, -0.005, 0.0026, 1.16]), 0.0), (None, 0.03)]
    {
        let options = SimulationOptions {
            sensor: DepthSensor::Exact,
            distortion,
            readout_s: Some(readout_s),
            ..SimulationOptions::default()
        };
        let source = open(SceneName::Room, &options);
        let (a, _) = read(&source, 100);
        let (b, _) = read(&source, 106);
        let camera = source.camera();
        let pose_at = |index: u64, row: f64| {
            source.walk.world_from_camera(stamp_nanos(index) as f64 * 1e-9 + camera.row_time_s(row))
        };
        let (mut close, mut all) = (0, 0);
        for row in (8..472).step_by(8) {
            for column in (8..632).step_by(8) {
                let depth_m = f64::from(a[row * 640 + column]) / camera.units_per_metre;
                let ray = camera.ray(row as f64, column as f64);
                let world = pose_at(100, row as f64) * Point3::from(ray * depth_m);
                // Fixed point: the row decides the pose that decides the row.
                let mut seen_row = row as f64;
                let mut seen = None;
                for _ in 0..4 {
                    let local = pose_at(106, seen_row).inverse() * world;
                    seen = camera.project(&local.coords).map(|(r, c)| (r, c, local.z));
                    seen_row = seen.map_or(seen_row, |(r, _, _)| r.clamp(0.0, 479.0));
                }
                let Some((r, c, z)) = seen else { continue };
                if !(1.0..478.0).contains(&r) || !(1.0..638.0).contains(&c) {
                    continue;
                }
                let found =
                    f64::from(b[r.round() as usize * 640 + c.round() as usize]) / camera.units_per_metre;
                all += 1;
                close += usize::from((found - z).abs() < 0.01 + 0.01 * z);
            }
        }
        assert!(all > 3000 && close * 100 > all * 90, "{close} of {all} agree with readout {readout_s}");
    }
}

#[test]
fn noise_is_a_kinects() {
    let exact = open(
        SceneName::Room,
        &SimulationOptions { sensor: DepthSensor::Exact, ..SimulationOptions::default() },
    );
    let noisy = open(SceneName::Room, &SimulationOptions::default());
    let ((truth, _), (measured, _)) = (read(&exact, 0), read(&noisy, 0));
    let holes = measured.iter().filter(|&&raw| raw == 0).count() as f64 / measured.len() as f64;
    assert!((0.01..0.30).contains(&holes), "{holes} of the pixels are holes");
    let mut errors_m: Vec<f64> = Vec::new();
    for (&a, &b) in truth.iter().zip(&measured) {
        let depth_m = f64::from(a) / 5000.0;
        if b != 0 && (1.9..2.1).contains(&depth_m) {
            errors_m.push((f64::from(b) / 5000.0 - depth_m).abs());
        }
    }
    errors_m.sort_by(f64::total_cmp);
    // A normal error of 7.5 mm has its median magnitude at 5 mm.
    let median_m = errors_m[errors_m.len() / 2];
    assert!(
        errors_m.len() > 1000 && (0.003..0.009).contains(&median_m),
        "{median_m} m over {}",
        errors_m.len()
    );
}

#[test]
fn each_sensor_errs_in_its_own_way_by_some_millimetres_at_two_metres() {
    let exact = open(
        SceneName::Room,
        &SimulationOptions { sensor: DepthSensor::Exact, ..SimulationOptions::default() },
    );
    let (truth, _) = read(&exact, 0);
    let width = exact.rays.width;
    // Holes, pixels between both depths of an edge, and the correlation of errors of neighbours.
    let judge = |sensor: DepthSensor| {
        let source = open(SceneName::Room, &SimulationOptions { sensor, ..SimulationOptions::default() });
        let (measured, _) = read(&source, 0);
        let error = |at: usize| (f64::from(measured[at]) - f64::from(truth[at])) / 5000.0;
        let (mut errors, mut products, mut n_between, mut n_edges) = (Vec::new(), 0.0, 0.0, 0.0);
        for at in (0..truth.len()).filter(|at| at % width > 0 && measured[*at] != 0) {
            let (here, beside) = (f64::from(truth[at]), f64::from(truth[at - 1]));
            if (here - beside).abs() > 0.2 * here {
                let share = (f64::from(measured[at]) - here) / (beside - here);
                n_edges += 1.0;
                n_between += f64::from(u8::from((0.1..0.9).contains(&share)));
            } else if (9500.0..10_500.0).contains(&here) && measured[at - 1] != 0 && error(at).abs() < 0.05 {
                errors.push(error(at) * error(at));
                products += error(at) * error(at - 1);
            }
        }
        let variance: f64 = errors.iter().sum();
        let holes = measured.iter().filter(|raw| **raw == 0).count() as f64 / measured.len() as f64;
        let sigma_m = (variance / errors.len() as f64).sqrt();
        assert!(errors.len() > 1000 && (0.003..0.013).contains(&sigma_m), "{sensor:?}: {sigma_m} m");
        (holes, n_between / f64::max(n_edges, 1.0), products / variance)
    };
    let [kinect, stereo, phase, phone] = [
        DepthSensor::StructuredLight,
        DepthSensor::ActiveStereo,
        DepthSensor::TimeOfFlight,
        DepthSensor::Upsampled,
    ]
    .map(judge);
    assert!(stereo.0 > kinect.0 + 0.05 && phone.0 < 0.01, "holes {stereo:?} {kinect:?} {phone:?}");
    assert!(phase.1 > 0.5 && phone.1 > 0.5 && kinect.1 < 0.2, "edges {phase:?} {phone:?} {kinect:?}");
    assert!(phase.2 < 0.6 && kinect.2 > 0.5 && phone.2 > 0.8, "shared {phase:?} {kinect:?} {phone:?}");
}

#[test]
fn every_scene_is_seen_everywhere_and_colour_lag_moves_colour_alone() {
    for name in SceneName::ALL {
        let source = open(name, &SimulationOptions::default());
        for index in [0, source.n_frames / 3, source.n_frames - 1] {
            let (depth, colour) = read(&source, index);
            let valid = depth.iter().filter(|&&raw| raw != 0).count() as f64 / depth.len() as f64;
            assert!(valid > 0.5, "{name:?} frame {index}: {valid} valid");
            assert!(colour.iter().any(|&c| c > 60), "{name:?} frame {index} is dark");
        }
    }
    let plain = open(SceneName::Room, &SimulationOptions::default());
    let late =
        open(SceneName::Room, &SimulationOptions { colour_lag_s: 0.02, ..SimulationOptions::default() });
    let ((depth, colour), (late_depth, late_colour)) = (read(&plain, 50), read(&late, 50));
    assert!(depth == late_depth && colour != late_colour);
}

/// What a steady hand would see in the building at a time, without noise.
fn seen_at(source: &SimulatedSource, time_s: f64) -> (Vec<u16>, Vec<u8>) {
    let walk = source.walk.clone().steady();
    let n = source.rays.width * source.rays.height;
    let (mut scratch, mut depth, mut colour) = (Scratch::default(), vec![0; n], vec![0; 3 * n]);
    exposure(source, &walk, time_s).cast(&mut scratch, Some(&mut colour));
    sensor::exact_depth(&source.camera, &source.rays, &scratch, &mut depth);
    (depth, colour)
}

fn exposure<'a>(source: &'a SimulatedSource, walk: &'a Walk, stamp_s: f64) -> render::Exposure<'a> {
    let SimulatedSource { camera, rays, scene, .. } = source;
    render::Exposure { camera, rays, scene, walk, stamp_s }
}

/// Share of pixels that are the same but for the last digit of depth and of each colour.
fn same((depth, colour): &(Vec<u16>, Vec<u8>), (other_depth, other_colour): &(Vec<u16>, Vec<u8>)) -> f64 {
    let is_same = |at: &usize| {
        let rgb = 3 * at..3 * at + 3;
        let mut colours = colour[rgb.clone()].iter().zip(&other_colour[rgb]);
        depth[*at].abs_diff(other_depth[*at]) <= 1 && colours.all(|(a, b)| a.abs_diff(*b) <= 1)
    };
    (0..depth.len()).filter(is_same).count() as f64 / depth.len() as f64
}

fn building() -> SimulatedSource {
    open(
        SceneName::Building,
        &SimulationOptions { sensor: DepthSensor::Exact, ..SimulationOptions::default() },
    )
}

/// Shares of the way through a room at which the camera looks north and south, away from the doors.
const NORTH: f64 = 0.36;
const SOUTH: f64 = 0.64;

#[test]
fn rooms_of_one_kind_are_the_same_to_the_camera() {
    let source = building();
    let way = source.walk.building();
    for share in [NORTH, SOUTH] {
        let seen = |storey, room| seen_at(&source, way.in_room_s(storey, room, share));
        let office = seen(0, 0);
        for (storey, room) in [(0, 1), (1, 0), (2, 1)] {
            let same = same(&office, &seen(storey, room));
            assert!(same > 0.999, "storey {storey}, room {room} at {share}: {same} are the same");
        }
        let [ground, upper] = [seen(0, 3), seen(1, 3)];
        assert!(same(&office, &ground) < 0.5 && same(&ground, &upper) < 0.5, "workshops are their own");
    }
}

#[test]
fn glass_has_no_depth_and_shows_what_lies_behind() {
    let source = building();
    let time_s = source.walk.building().in_room_s(0, 0, NORTH);
    let (depth, colour) = seen_at(&source, time_s);
    let panes: Vec<usize> = (0..depth.len()).filter(|&at| depth[at] == 0).collect();
    let share = panes.len() as f64 / depth.len() as f64;
    assert!((0.02..0.4).contains(&share), "{share} of the image is glass");
    assert!(panes.iter().all(|&at| colour[3 * at + 2] > 60), "the window is bright");
    // The recess of the eastern lobby, seen through its glass, has a pattern.
    let way = source.walk.building();
    let lobby_s = way.in_room_s(0, 3, 1.15);
    let (depth, colour) = seen_at(&source, lobby_s);
    let behind = depth.iter().enumerate().filter(|(_, raw)| **raw == 0).map(|(at, _)| colour[3 * at]);
    let (low, high) = behind.fold((u8::MAX, u8::MIN), |(low, high), red| (low.min(red), high.max(red)));
    assert!(high > low.saturating_add(30), "{low} to {high}");
}

#[test]
fn the_lift_moves_the_pose_and_not_the_view() {
    let source = building();
    let way = source.walk.building();
    let steady = source.walk.clone().steady();
    let times_s = [0.2, 0.8].map(|share| way.in_ride_s(1, share));
    let [low, high] = times_s.map(|time_s| steady.world_from_camera(time_s));
    assert!((high.translation.z - low.translation.z) > 1.0, "{low} to {high}");
    let [before, after] = times_s.map(|time_s| seen_at(&source, time_s));
    assert!(same(&before, &after) > 0.999, "{} are the same", same(&before, &after));
    let is_measured = before.0.iter().filter(|raw| **raw != 0).count();
    assert!(is_measured * 1000 > before.0.len() * 999, "the cabin is closed");
}

#[test]
fn a_view_of_the_building_has_a_bounded_number_of_solids() {
    let [house, building] = [SceneName::House, SceneName::Building].map(|name| {
        let source = open(name, &SimulationOptions::default());
        let last_s = (source.n_frames / 30) as u32;
        let mut visible = Vec::new();
        let numbers = (0..last_s).step_by(3).map(|second| {
            let exposure = exposure(&source, &source.walk, f64::from(second));
            exposure.fill_visible(&exposure.viewpoint(f64::from(second)), &mut visible);
            visible.len()
        });
        numbers.max().unwrap()
    });
    assert!(building <= 2 * house, "{building} solids, {house} in the house");
}

#[test]
fn wrong_options_are_named() {
    let message = |options: SimulationOptions| {
        SimulatedSource::open(SceneName::Room, None, None, &options).unwrap_err().to_string()
    };
    let bad = SimulationOptions { colour_lag_s: f64::NAN, ..SimulationOptions::default() };
    assert_eq!(message(bad), "colour_lag_s is NaN, expected -0.2 to 0.2 s");
    let bad = SimulationOptions { distortion: Some([f64::NAN; 5]), ..SimulationOptions::default() };
    assert!(message(bad).contains("distortion is NaN"));
    let error =
        SimulatedSource::open(SceneName::Room, None, Some(0), &SimulationOptions::default()).unwrap_err();
    assert_eq!(error.to_string(), "frames is 0, expected 1 to 1000000 frames");
}

/// A number of bytes.
fn digest(bytes: impl IntoIterator<Item = u8>) -> u64 {
    bytes.into_iter().fold(0, |sum, byte| random::mix(sum ^ u64::from(byte)))
}

#[test]
fn the_buildings_own_proportions_keep_its_solids_its_way_and_its_frames() {
    let source = open(SceneName::Building, &SimulationOptions::default());
    let solids = format!("{:?}", source.scene.solids);
    let poses = format!("{:?}", source.ground_truth().unwrap().poses);
    let frames = [0, 330, 1900, 2040, 6520, 6600, 9000, 13_700].map(|index| read(&source, index));
    let frames = frames.into_iter().flat_map(|(depth, colour)| {
        depth.into_iter().flat_map(u16::to_le_bytes).chain(colour).collect::<Vec<u8>>()
    });
    // As they were before other proportions could be drawn.
    let digests = [digest(solids.bytes()), digest(poses.bytes()), digest(frames)];
    assert_eq!(digests, [0xf068_bbd6_ac72_15b8, 0x1d05_3356_ff57_bdb0, 0x595d_f9a0_ca17_182c]);
}

#[test]
fn a_building_of_other_proportions_hides_what_its_walls_hide_and_leaves_the_way_free() {
    for proportions in [0, 1, 2, 3] {
        let sensor = DepthSensor::Exact;
        let options = SimulationOptions { proportions, sensor, ..SimulationOptions::default() };
        let [source, mut bare] = [0, 1].map(|_| open(SceneName::Building, &options));
        bare.scene.forget_cells();
        for second in (12..205).step_by(16) {
            let time_s = f64::from(second);
            let seen = seen_at(&source, time_s);
            let nearest = seen.0.iter().filter(|raw| **raw != 0).min().copied().unwrap_or(0);
            assert!(nearest > 1000, "proportions {proportions} at {time_s} s: {nearest}");
            // Beyond the corridor the walls beside the doors of rooms are left out.
            let same = same(&seen, &seen_at(&bare, time_s));
            assert!(same > 0.99, "proportions {proportions} at {time_s} s: {same} are the same");
        }
    }
}
