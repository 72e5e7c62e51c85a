//! The scene in 3D of several robots: their ways in colours in the maps that they share.

use crate::run_directory::frames::{FrameView, state};
use crate::run_directory::scene::{Bounds, moved, placed_point, rows};
use crate::scene::{ReportScene, SceneFrame, ScenePart, ScenePoint, SceneRobot, SceneSubmap};
use crate::{ReportedVerdict, SceneLoop};
use nalgebra::Vector3;
use tessera_geometry::Pose;
use tessera_outputs::MapPoint;
use tessera_slam::State;

/// A frame of a robot in the axes of its component.
#[derive(Clone, Copy, Debug)]
pub struct JointFrame {
    /// Place of its robot in the list of robots.
    pub robot: usize,
    /// As its run counts.
    pub index: u64,
    /// Since the first frame of its run, seconds.
    pub time_s: f64,
    /// Whether its pose can be trusted.
    pub state: State,
    /// Its pose.
    pub world_from_camera: Pose,
}

/// What hangs together, the largest first.
#[derive(Clone, Debug, Default)]
pub struct JointComponent {
    /// What it is called.
    pub name: String,
    /// Its points.
    pub points: Vec<MapPoint>,
    /// Run after run, each in the order of its frames.
    pub frames: Vec<JointFrame>,
    /// Both ends of each join that holds, metres.
    pub joins_m: Vec<[[f64; 3]; 2]>,
}

/// All components beside each other, upright, with points that are means of voxels of an edge of `voxel_m`.
pub fn joint_scene(components: &[JointComponent], robots: Vec<SceneRobot>, voxel_m: f64) -> ReportScene {
    let mut scene = ReportScene { voxel_m, robots, ..ReportScene::default() };
    let mut boxes: Vec<Bounds> = Vec::new();
    for (part, component) in components.iter().enumerate() {
        let upright = FrameView::new(component.frames.iter().map(|frame| &frame.world_from_camera)).pose();
        let bounds = bounds(component, &upright);
        let offset = boxes
            .first()
            .zip(boxes.last())
            .map_or(Vector3::zeros(), |(first, last)| bounds.beside(first, last));
        let page_from_world = Pose::translation(offset.x, offset.y, offset.z) * upright;
        let bounds = bounds.moved(&offset);
        scene.parts.push(ScenePart {
            name: component.name.clone(),
            label_m: bounds.top(),
            page_from_world: rows(&page_from_world),
            n_points: component.points.len(),
        });
        scene.submaps.push(SceneSubmap { name: component.name.clone(), part });
        let points = component.points.iter().map(|point| placed_point(&page_from_world, point));
        // No keyframe is told of.
        scene.points.extend(points.map(|point| ScenePoint { keyframe: 0, ..point }));
        scene.frames.extend(component.frames.iter().map(|frame| placed_frame(&page_from_world, part, frame)));
        scene.loops.extend(component.joins_m.iter().map(|ends| SceneLoop {
            ends_m: ends.map(|end| moved(&page_from_world, &Vector3::from(end)).into()),
            submaps: [part, part],
            verdict: ReportedVerdict::Accepted,
        }));
        boxes.push(bounds);
    }
    scene
}

fn bounds(component: &JointComponent, upright: &Pose) -> Bounds {
    if component.points.is_empty() {
        let poses = component.frames.iter().map(|frame| upright * frame.world_from_camera);
        return Bounds::around(poses.map(|pose| pose.translation.vector));
    }
    Bounds::around(component.points.iter().map(|point| moved(upright, &point.position)))
}

fn placed_frame(page_from_world: &Pose, part: usize, frame: &JointFrame) -> SceneFrame {
    let pose = page_from_world * frame.world_from_camera;
    SceneFrame {
        index: frame.index,
        time_s: frame.time_s,
        state: state(frame.state),
        part,
        submap: part,
        robot: frame.robot,
        position_m: pose.translation.vector.into(),
        rotation: pose.rotation.coords.into(),
        std_m: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn component(name: &str, robots: &[usize]) -> JointComponent {
        let point = |x| MapPoint {
            position: Vector3::new(x, 0.0, 2.0),
            normal: -Vector3::z(),
            rgb: [7; 3],
            keyframe: 9,
        };
        let frame = |robot| {
            let world_from_camera = Pose::translation(robot as f64, 0.0, 0.0);
            JointFrame { robot, index: 3, time_s: 0.1, state: State::Tracking, world_from_camera }
        };
        JointComponent {
            name: name.into(),
            points: vec![point(0.0), point(1.0)],
            frames: robots.iter().copied().map(frame).collect(),
            joins_m: vec![[[0.0; 3], [1.0, 0.0, 0.0]]],
        }
    }

    #[test]
    fn maps_of_robots_stand_beside_each_other_with_their_colours() {
        let robot = |name: &str, rgb| SceneRobot { name: name.into(), rgb };
        let robots = vec![robot("a", [200, 0, 0]), robot("b<", [0, 0, 200])];
        let scene = joint_scene(&[component("one", &[0, 1]), component("two", &[1])], robots, 0.05);
        assert_eq!((scene.points.len(), scene.frames.len(), scene.loops.len()), (4, 3, 2));
        assert_eq!(
            scene.frames.iter().map(|f| (f.part, f.robot)).collect::<Vec<_>>(),
            [(0, 0), (0, 1), (1, 1)]
        );
        // Forward of the camera is the page's second axis.
        let first = Vector3::from(scene.points[0].position_m);
        assert!((first - Vector3::new(0.0, 2.0, 0.0)).norm() < 1e-12, "{first}");
        assert!(scene.points[2].position_m[0] > scene.points[1].position_m[0]);
        let html = scene.html();
        assert!(html.contains("</i>a</span>") && html.contains("rgb(0,0,200)") && html.contains("b&lt;"));
        let absent = ["uncertainty", "ground truth", "b<", "{"].iter().find(|words| {
            // Braces are those of the data alone.
            html.split("<script").next().is_some_and(|head| head.contains(*words))
        });
        assert_eq!(absent, None, "{html}");
    }
}
