//! The scene in 3D from the run directory: each component of submaps in axes of the page, beside the others.

use super::frames::{FrameView, GAP_M, GAP_SHARE, Placed, state, std_m};
use crate::run::LoopPair;
use crate::scene::{ReportScene, SceneFrame, SceneKeyframe, SceneLoop, ScenePart, ScenePoint, SceneSubmap};
use nalgebra::Vector3;
use std::collections::{BTreeMap, BTreeSet};
use tessera_geometry::Pose;
use tessera_outputs::{MapPoint, Preview, Replay, preview};
use tessera_settings::Settings;
use tessera_slam::FrameRecord;
use tessera_stage::RunFiles;

/// The scene, whose map has at most `most_points` points.
pub(super) fn of(
    (files, settings): (&RunFiles, &Settings),
    replay: &Replay,
    placed: &Placed,
    loops: &[LoopPair],
    most_points: usize,
) -> ReportScene {
    let (map, no_map) = match preview(files, replay, settings, most_points) {
        Ok(map) => (map, None),
        Err(error) => (Preview::default(), Some(error.to_string())),
    };
    ReportScene { no_map, ..assemble(replay, placed, loops, map) }
}

/// Everything at its place in the page.
fn assemble(replay: &Replay, placed: &Placed, loops: &[LoopPair], map: Preview) -> ReportScene {
    let mut numbers = vec![replay.main_component()];
    numbers.extend(replay.apart().into_keys());
    let mut points: BTreeMap<u32, Vec<MapPoint>> = map.components.into_iter().collect();
    let mut scene =
        ReportScene { voxel_m: map.voxel_m, truth_m: placed.truth_m.clone(), ..ReportScene::default() };
    let mut boxes: Vec<Bounds> = Vec::new();
    let mut pages = BTreeMap::new();
    for (place, number) in numbers.iter().enumerate() {
        let own = points.remove(number).unwrap_or_default();
        let upright = upright(replay, placed, *number, place == 0);
        let bounds = Bounds::of(&upright, &own, replay, *number);
        let offset = boxes
            .first()
            .zip(boxes.last())
            .map_or(Vector3::zeros(), |(first, last)| bounds.beside(first, last));
        let page_from_world = Pose::translation(offset.x, offset.y, offset.z) * upright;
        let bounds = bounds.moved(&offset);
        scene.parts.push(ScenePart {
            name: if place == 0 { "main map".into() } else { format!("submap {number}, apart") },
            label_m: bounds.top(),
            page_from_world: rows(&page_from_world),
            n_points: own.len(),
        });
        scene.points.extend(own.iter().map(|point| placed_point(&page_from_world, point)));
        boxes.push(bounds);
        pages.insert(*number, (place, page_from_world));
    }
    let places = submaps(replay, &pages);
    scene.submaps = named(&places, &scene.parts);
    scene.frames = frames(replay, &pages, &places);
    scene.keyframes = keyframes(replay, &pages, &places);
    let end =
        |id: u32| scene.keyframes.get(id as usize).map(|keyframe| (keyframe.position_m, keyframe.submap));
    let pairs = loops.iter().filter_map(|pair| {
        let ((newer_m, newer), (older_m, older)) = end(pair.newer).zip(end(pair.older))?;
        let verdict = pair.verdict;
        Some(SceneLoop { ends_m: [newer_m, older_m], submaps: [newer, older], verdict })
    });
    scene.loops = pairs.collect();
    scene
}

/// From the world of a component to right, forward and up.
fn upright(replay: &Replay, placed: &Placed, component: u32, is_main: bool) -> Pose {
    if is_main {
        return placed.view.pose() * placed.view_from_world;
    }
    let own = replay.frames.iter().filter(|frame| replay.component(frame) == component);
    let poses: Vec<Pose> = own.map(|frame| replay.final_pose(frame)).collect();
    FrameView::new(poses.iter()).pose()
}

/// Box around a map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bounds {
    low: Vector3<f64>,
    high: Vector3<f64>,
}

impl Bounds {
    /// Around the points, or around the frames where there is no point.
    fn of(page_from_world: &Pose, points: &[MapPoint], replay: &Replay, component: u32) -> Self {
        if !points.is_empty() {
            return Self::around(points.iter().map(|p| moved(page_from_world, &p.position)));
        }
        let own = replay.frames.iter().filter(|frame| replay.component(frame) == component);
        Self::around(own.map(|f| (page_from_world * replay.final_pose(f)).translation.vector))
    }

    pub(crate) fn around(positions: impl Iterator<Item = Vector3<f64>>) -> Self {
        let all = positions.map(|at| (at, at)).reduce(|(low, high), (at, _)| (low.inf(&at), high.sup(&at)));
        let (low, high) = all.unwrap_or_default();
        Self { low, high }
    }

    pub(crate) fn moved(&self, by: &Vector3<f64>) -> Self {
        Self { low: self.low + by, high: self.high + by }
    }

    /// What moves this box to the right of `last`, on the ground and in the middle of `first`.
    pub(crate) fn beside(&self, first: &Self, last: &Self) -> Vector3<f64> {
        let gap = GAP_M + GAP_SHARE * (last.high.x - last.low.x);
        let middle = 0.5 * (first.low.y + first.high.y - self.low.y - self.high.y);
        Vector3::new(last.high.x + gap - self.low.x, middle, first.low.z - self.low.z)
    }

    /// Above the middle.
    pub(crate) fn top(&self) -> [f64; 3] {
        let middle = 0.5 * (self.low + self.high);
        [middle.x, middle.y, self.high.z]
    }
}

pub(crate) fn moved(page_from_world: &Pose, position: &Vector3<f64>) -> Vector3<f64> {
    page_from_world.rotation * position + page_from_world.translation.vector
}

pub(crate) fn rows(pose: &Pose) -> [[f64; 4]; 3] {
    pose.to_homogeneous().fixed_rows::<3>(0).transpose().into()
}

pub(crate) fn placed_point(page_from_world: &Pose, point: &MapPoint) -> ScenePoint {
    ScenePoint {
        position_m: moved(page_from_world, &point.position).into(),
        normal: (page_from_world.rotation * point.normal).into(),
        rgb: point.rgb,
        keyframe: point.keyframe as usize,
    }
}

/// Place among the parts, and pose, of the world of each component.
type ComponentPlaces = BTreeMap<u32, (usize, Pose)>;

/// Place in the list of submaps of each that has frames, by its part and its number.
type SubmapPlaces = BTreeMap<(usize, u32), usize>;

fn submaps(replay: &Replay, pages: &ComponentPlaces) -> SubmapPlaces {
    let key = |frame| Some((pages.get(&replay.component(frame))?.0, frame.submap));
    let all: BTreeSet<(usize, u32)> = replay.frames.iter().filter_map(key).collect();
    all.into_iter().zip(0..).collect()
}

/// The submaps by name: that of their part where it is the only one of it.
fn named(places: &SubmapPlaces, parts: &[ScenePart]) -> Vec<SceneSubmap> {
    let is_alone = |part: usize| places.keys().filter(|(other, _)| *other == part).count() == 1;
    let name = |part: usize, number: u32| match parts.get(part) {
        Some(of) if is_alone(part) => of.name.clone(),
        _ => format!("submap {number}"),
    };
    places.keys().map(|(part, number)| SceneSubmap { name: name(*part, *number), part: *part }).collect()
}

fn frames(replay: &Replay, pages: &ComponentPlaces, submaps: &SubmapPlaces) -> Vec<SceneFrame> {
    let begin = replay.frames.first().map_or(0, |frame| frame.stamp_nanos);
    let frame = |record: &FrameRecord| {
        let (part, page_from_world) = pages.get(&replay.component(record))?;
        let pose = page_from_world * replay.final_pose(record);
        Some(SceneFrame {
            index: record.index,
            time_s: record.stamp_nanos.saturating_sub(begin) as f64 * 1e-9,
            state: state(record.state),
            part: *part,
            submap: submaps.get(&(*part, record.submap)).copied().unwrap_or_default(),
            robot: 0,
            position_m: pose.translation.vector.into(),
            rotation: pose.rotation.coords.into(),
            std_m: std_m(record),
        })
    };
    replay.frames.iter().filter_map(frame).collect()
}

fn keyframes(replay: &Replay, pages: &ComponentPlaces, submaps: &SubmapPlaces) -> Vec<SceneKeyframe> {
    let submap_of_frame: BTreeMap<u64, usize> = replay
        .frames
        .iter()
        .filter_map(|frame| {
            let (part, _) = pages.get(&replay.component(frame))?;
            Some((frame.index, *submaps.get(&(*part, frame.submap))?))
        })
        .collect();
    let std_of_frame: BTreeMap<u64, f64> =
        replay.frames.iter().filter_map(|record| Some((record.index, std_m(record)?))).collect();
    // A component without a frame of this run has no part; its keyframes stand in the main map's world.
    let main = pages.values().find(|(place, _)| *place == 0).map_or(Pose::identity(), |(_, pose)| *pose);
    let part_of: BTreeMap<u32, Pose> = pages
        .iter()
        .flat_map(|(number, (_, page))| {
            replay.keyframes_of(*number).map(|(keyframe, _)| (keyframe.id, *page))
        })
        .collect();
    let all = replay.keyframes.iter().zip(replay.keyframe_poses()).enumerate();
    all.map(|(place, (keyframe, pose))| {
        let is_of_map = place < replay.n_map_keyframes;
        let page_from_world = part_of.get(&keyframe.id).unwrap_or(&main);
        SceneKeyframe {
            position_m: (page_from_world * pose).translation.vector.into(),
            // Frames of another run have numbers of their own: theirs is the first.
            submap: match is_of_map {
                true => 0,
                false => submap_of_frame.get(&keyframe.frame_index).copied().unwrap_or_default(),
            },
            is_of_map,
            std_m: if is_of_map { None } else { std_of_frame.get(&keyframe.frame_index).copied() },
        }
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run_directory::{frames::place, loops};
    use tessera_outputs::test_run;
    use tessera_slam::AlignRecord;

    fn point(x: f64, keyframe: u32) -> MapPoint {
        MapPoint { position: Vector3::new(x, 0.0, 2.0), normal: -Vector3::z(), rgb: [1, 2, 3], keyframe }
    }

    fn scene_of(replay: &Replay, components: Vec<(u32, Vec<MapPoint>)>) -> ReportScene {
        let placed = place(replay, None);
        assemble(replay, &placed, &loops::of(replay), Preview { voxel_m: 0.01, components })
    }

    #[test]
    fn everything_of_a_run_is_there_in_axes_of_the_page() {
        let replay = test_run::replay();
        let scene = scene_of(&replay, vec![(0, vec![point(0.0, 0), point(1.4, 2)])]);
        // Right, forward, up of a camera that looks along z.
        assert_eq!(scene.points[1].position_m.map(|v| (1e6 * v).round()), [1.4e6, 2e6, 0.0]);
        assert!((scene.points[0].normal[1] + 1.0).abs() < 1e-12);
        let counts = (scene.parts.len(), scene.frames.len(), scene.keyframes.len(), scene.loops.len());
        assert_eq!(counts, (1, 6, 3, 2), "the frame that was dropped has no place");
        assert_eq!(scene.frames[4].state, crate::FrameState::Lost);
        assert!((scene.loops[0].ends_m[0][0] - 1.4).abs() < 1e-9 && scene.loops[0].ends_m[1][0].abs() < 1e-9);
        // The camera's third axis is the page's second.
        let [x, y, z, w] = scene.frames[0].rotation;
        let forward = [2.0 * (x * z + y * w), 2.0 * (y * z - x * w), 1.0 - 2.0 * (x * x + y * y)];
        assert!((forward[1] - 1.0).abs() < 1e-9, "{forward:?}");
    }

    #[test]
    fn maps_that_are_apart_do_not_touch() {
        let mut replay = Replay::default();
        for mut record in test_run::records() {
            if let AlignRecord::Frame(frame) = &mut record {
                frame.submap = u32::from(frame.index == 5);
            }
            replay.apply(record);
        }
        let scene =
            scene_of(&replay, vec![(0, vec![point(0.0, 0), point(1.4, 1)]), (1, vec![point(0.0, 2)])]);
        assert_eq!(
            scene.parts.iter().map(|part| part.name.as_str()).collect::<Vec<_>>(),
            ["main map", "submap 1, apart"]
        );
        let x: Vec<f64> = scene.points.iter().map(|point| point.position_m[0]).collect();
        assert!((x[2] - (1.4 + GAP_M + GAP_SHARE * 1.4)).abs() < 1e-9, "{x:?}");
        assert_eq!(scene.frames.iter().map(|frame| frame.part).collect::<Vec<_>>(), [0, 0, 0, 0, 0, 1]);
        assert_eq!(scene.frames.iter().map(|frame| frame.submap).collect::<Vec<_>>(), [0, 0, 0, 0, 0, 1]);
        let names = |scene: &ReportScene| -> Vec<String> {
            scene.submaps.iter().map(|submap| submap.name.clone()).collect()
        };
        assert_eq!(names(&scene), ["main map", "submap 1, apart"]);
        let html = scene.html();
        assert!(html.contains("data-submap=\"1\" checked> submap 1, apart"), "{html}");
        let whole = scene_of(&test_run::replay(), vec![(0, vec![point(0.0, 0)])]);
        assert_eq!(names(&whole), ["main map"]);
        assert!(!whole.html().contains("data-submap"));
    }

    #[test]
    fn a_run_of_nothing_has_an_empty_scene() {
        let scene = scene_of(&Replay::default(), Vec::new());
        assert!(scene.points.is_empty() && scene.frames.is_empty());
        assert_eq!(scene.parts.len(), 1);
    }
}
