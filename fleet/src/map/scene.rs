//! `map/scene.html`: the map in 3D with the way of each robot in its colour, for the page of a base.

use crate::copies::arrivals::{Arrival, DISK};
use crate::error::FleetError;
use crate::map::summary::JoinSummary;
use std::path::Path;
use tessera_geometry::Pose;
use tessera_outputs::{MapPoint, Replay, write_file};
use tessera_report::{CYCLE, JointComponent, JointFrame, SceneRobot, joint_scene};

/// Its name.
pub const SCENE_FILE: &str = "scene.html";
/// Points of the map in it: as many as in the report of a run.
pub(crate) const MOST_POINTS: usize = 60_000;
/// Frames of a run in it: more cannot be seen.
const MOST_FRAMES: usize = 4000;

/// Colours of robots on a dark ground, in the order of those of the plots.
const BRIGHT: [[u8; 3]; CYCLE.len()] =
    [[86, 156, 255], [255, 120, 50], [60, 200, 150], [230, 140, 190], [240, 180, 40], [150, 215, 255]];

/// The robot of a run; of runs that were added from disk each stands for itself.
fn name_of(arrival: &Arrival) -> &str {
    if arrival.robot == DISK { &arrival.run } else { &arrival.robot }
}

/// The scene as it is gathered, component by component.
pub(crate) struct JointScene {
    components: Vec<JointComponent>,
    voxel_m: f64,
    robots: Vec<String>,
}

impl JointScene {
    /// Of components with these names and clouds; robots in the order in which they came.
    pub(crate) fn new(
        names: impl Iterator<Item = String>,
        (voxel_m, clouds): (f64, Vec<Vec<MapPoint>>),
        arrivals: &[Arrival],
    ) -> Self {
        let components = names.zip(clouds).map(|(name, points)| JointComponent {
            name,
            points,
            ..JointComponent::default()
        });
        let mut robots: Vec<String> = Vec::new();
        for arrival in arrivals {
            let name = name_of(arrival);
            if !robots.iter().any(|known| known == name) {
                robots.push(name.to_owned());
            }
        }
        Self { components: components.collect(), voxel_m, robots }
    }

    /// Adds the frames of a run; `place` tells the component of each.
    pub(crate) fn add_run(
        &mut self,
        arrival: &Arrival,
        replay: &Replay,
        place: impl Fn(u32) -> Option<usize>,
    ) {
        let robot = self.robots.iter().position(|known| known == name_of(arrival)).unwrap_or(0);
        let begin = replay.frames.first().map_or(0, |frame| frame.stamp_nanos);
        let step = replay.frames.len().div_ceil(MOST_FRAMES).max(1);
        for record in replay.frames.iter().step_by(step) {
            let component = place(replay.component(record)).and_then(|at| self.components.get_mut(at));
            let Some(component) = component else { continue };
            let world_from_camera: Pose = replay.final_pose(record);
            component.frames.push(JointFrame {
                robot,
                index: record.index,
                time_s: record.stamp_nanos.saturating_sub(begin) as f64 * 1e-9,
                state: record.state,
                world_from_camera,
            });
        }
    }

    /// Writes it into a map's folder, with the joins that hold.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub(crate) fn write(
        mut self,
        folder: &Path,
        joins: &[JoinSummary],
        place: impl Fn(u32) -> Option<usize>,
    ) -> Result<(), FleetError> {
        for join in joins {
            let component = join.component.and_then(&place).and_then(|at| self.components.get_mut(at));
            if let (Some(component), Some(at), Some(with)) = (component, join.at_m, join.with_at_m) {
                component.joins_m.push([at, with]);
            }
        }
        let robots = self
            .robots
            .into_iter()
            .enumerate()
            .map(|(at, name)| SceneRobot { name, rgb: BRIGHT[at % BRIGHT.len()] });
        let scene = joint_scene(&self.components, robots.collect(), self.voxel_m);
        write_file(&folder.join(SCENE_FILE), |writer| writer.write_all(scene.html().as_bytes()))?;
        Ok(())
    }
}
