//! Keyframes of a run that goes on, read from its directory: nothing in it is written or locked.

use super::live_verdict::LiveVerdict;
use crate::run::known;
use tessera_geometry::{Camera, Pose};
use tessera_journal::Follower;
use tessera_occupancy::{ColouredPoint, KeyframeView, thinned_surface};
use tessera_outputs::ToolError;
use tessera_slam::{AlignRecord, KeyframeRecord, PoseHistory, WorldUp};
use tessera_stage::{ALIGN_JOURNAL, RunFiles, StoredKeyframes};
use tessera_transport::RunEntry;

/// Where the keyframes of a map stand: each with `world_from_camera`, by id.
pub(crate) type FollowedKeyframes = Vec<(u32, Pose)>;

/// A fold over the aligner's journal.
pub(crate) struct Follow {
    journal: Follower<AlignRecord>,
    surfaces: StoredKeyframes,
    camera: Camera,
    step: usize,
    max_depth_m: f64,
    poses: PoseHistory,
    world_up: WorldUp,
    /// Stamp and velocity of each keyframe.
    made: Vec<(i64, [f64; 6])>,
    /// Submap of the newest frame.
    submap: u32,
    newest_nanos: i64,
    verdict: LiveVerdict,
}

impl Follow {
    /// Opens the directory of a run; `None` where the run has not written it yet.
    ///
    /// # Errors
    /// Where one of its files is something else or cannot be read.
    pub(crate) fn open(entry: &RunEntry) -> Result<Option<Self>, ToolError> {
        let files = RunFiles::new(&entry.run_dir);
        let (journal, store) = (files.align_journal(), files.store());
        if !journal.is_file() || !store.metadata().is_ok_and(|meta| meta.len() > 0) {
            return Ok(None);
        }
        let Some((run, settings)) = known(entry)? else { return Ok(None) };
        Ok(Some(Self {
            journal: Follower::open(&journal, ALIGN_JOURNAL)?,
            surfaces: StoredKeyframes::open(&store, run.layout(&settings).grid)?,
            verdict: LiveVerdict::new(&run.camera),
            camera: run.camera,
            step: settings.surface.step as usize,
            max_depth_m: settings.output.map_max_depth_m,
            world_up: settings.mapping.world_up,
            poses: PoseHistory::default(),
            made: Vec::new(),
            submap: 0,
            newest_nanos: 0,
        }))
    }

    /// Axes of the run's world.
    pub(crate) fn world_up(&self) -> WorldUp {
        self.world_up
    }

    /// Takes in what was written since; a record that is not whole yet is read later.
    ///
    /// # Errors
    /// Where the journal is damaged.
    pub(crate) fn drain(&mut self) -> Result<(), ToolError> {
        while let Some(record) = self.journal.next()? {
            self.surfaces.take_unread(&record)?;
            self.poses.apply(&record);
            self.verdict.add(&record);
            match record {
                AlignRecord::Map(map) => {
                    self.made.extend(map.keyframes.iter().map(|k| (k.stamp_nanos, k.velocity)));
                }
                AlignRecord::Frame(frame) => {
                    let made = |keyframe: &KeyframeRecord| (keyframe.stamp_nanos, keyframe.velocity);
                    self.made.extend(frame.change.new_keyframe.as_ref().map(made));
                    (self.submap, self.newest_nanos) = (frame.submap, frame.stamp_nanos);
                }
                AlignRecord::Skipped(..) | AlignRecord::Correction(_) | AlignRecord::End { .. } => {}
            }
        }
        Ok(())
    }

    /// The keyframes of the map that the camera is in now. Those of a submap that is not joined to it
    /// have no known place in it and are left out.
    pub(crate) fn scene(&self) -> FollowedKeyframes {
        let component = self.poses.submaps().component(self.submap);
        let poses = self.poses.keyframe_poses().zip(0..);
        let own = poses.filter(|(_, id)| self.poses.component_of_keyframe(*id) == Some(component));
        own.map(|(pose, id)| (id, pose)).collect()
    }

    /// The verdict on the run so far, in a line; `None` before the first frame.
    pub(crate) fn verdict(&self) -> Option<String> {
        self.verdict.words(|submap| self.poses.submaps().component(submap))
    }

    /// Number of keyframes.
    pub(crate) fn n_keyframes(&self) -> u32 {
        self.made.len() as u32
    }

    /// Stamp of a keyframe.
    pub(crate) fn stamp_nanos(&self, keyframe: u32) -> i64 {
        self.made.get(keyframe as usize).map_or(self.newest_nanos, |(stamp_nanos, _)| *stamp_nanos)
    }

    /// Stamp of the newest frame.
    pub(crate) fn newest_nanos(&self) -> i64 {
        self.newest_nanos
    }

    /// Points of a keyframe in its camera's axes, one a voxel of that edge.
    ///
    /// # Errors
    /// Where it is unknown, or damaged in the store.
    pub(crate) fn points(&self, keyframe: u32, edge_m: f64) -> Result<Vec<ColouredPoint>, ToolError> {
        let vertices = self.surfaces.load(keyframe)?;
        let velocity = self.made.get(keyframe as usize).map_or([0.0; 6], |(_, velocity)| *velocity);
        let seen = KeyframeView { camera: &self.camera, step: self.step, velocity };
        Ok(thinned_surface(&vertices, &seen, self.max_depth_m, edge_m))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_transport::RunIdentity;

    #[test]
    fn a_folder_is_waited_for_and_one_of_something_else_is_told() {
        let dir = tempfile::tempdir().unwrap();
        let identity = RunIdentity { root: "r".into(), prefix: "p".into(), config_file: "c".into() };
        let entry = RunEntry { name: "x".to_owned(), pid: 1, run_dir: dir.path().to_owned(), identity };
        assert!(Follow::open(&entry).unwrap().is_none());
        for name in ["run.json", "align.journal", "keyframes.store"] {
            std::fs::write(dir.path().join(name), "{}").unwrap();
        }
        let words = Follow::open(&entry).err().unwrap().to_string();
        assert!(words.contains("run.json"), "{words}");
        assert!(Follow::open(&RunEntry { run_dir: dir.path().join("no"), ..entry }).unwrap().is_none());
    }
}
