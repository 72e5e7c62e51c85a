//! What a run leaves: its records, and what follows from them.

use tessera_evaluation::Trajectory;
use tessera_geometry::Pose;
use tessera_slam::{AlignRecord, FrameRecord, PoseHistory, RefinedCamera, Refinement, State, Submaps};

/// All records of a run, from which every output follows.
pub struct Records {
    /// In order.
    pub records: Vec<AlignRecord>,
}

impl Records {
    /// Poses as first published.
    pub fn online(&self) -> Trajectory {
        let mut trajectory = Trajectory::default();
        for frame in self.frames() {
            let _ = trajectory.push(frame.stamp_nanos, Pose::from(&frame.pose.world_from_camera));
        }
        trajectory
    }

    /// Every frame on its keyframe as finally corrected, or as solved again by the last correction;
    /// with the refined camera where there is one.
    pub fn last(&self) -> Trajectory {
        self.corrected(true)
    }

    /// As [`Self::last`], with the camera as it was.
    pub fn before_refinement(&self) -> Trajectory {
        self.corrected(false)
    }

    fn corrected(&self, refined: bool) -> Trajectory {
        let mut history = self.history();
        if let Some(camera) = self.refined_camera().filter(|_| refined) {
            history = history.with_refined_camera(camera);
        }
        let mut trajectory = Trajectory::default();
        for frame in self.frames() {
            let _ = trajectory.push(frame.stamp_nanos, history.final_pose(&frame.into()));
        }
        trajectory
    }

    /// The component of each frame, in order: frames of one component alone have a common gauge.
    pub fn components(&self) -> Vec<u32> {
        let history = self.history();
        self.frames().map(|frame| history.component_of_frame(frame)).collect()
    }

    fn history(&self) -> PoseHistory {
        let mut history = PoseHistory::default();
        self.records.iter().for_each(|record| history.apply(record));
        history
    }

    /// The submaps at the end, and which of them are joined.
    pub fn submaps(&self) -> Submaps {
        self.history().submaps().clone()
    }

    /// The camera of the final optimisation, where it was asked for and found.
    pub fn refined_camera(&self) -> Option<&RefinedCamera> {
        self.records.iter().rev().find_map(|record| match record {
            AlignRecord::Correction(applied) => match &applied.correction.refinement {
                Some(Refinement::Refined(refined)) => Some(&**refined),
                _ => None,
            },
            _ => None,
        })
    }

    /// Frames in order.
    pub fn frames(&self) -> impl Iterator<Item = &FrameRecord> {
        self.records.iter().filter_map(|record| match record {
            AlignRecord::Frame(frame) => Some(&**frame),
            _ => None,
        })
    }

    /// Frames whose state is not tracking.
    pub fn n_untracked(&self) -> usize {
        self.frames().filter(|f| f.state != State::Tracking).count()
    }

    /// Keyframes made.
    pub fn n_keyframes(&self) -> usize {
        self.frames().filter(|f| f.change.new_keyframe.is_some()).count()
    }

    /// Keyframes that were culled.
    pub fn n_culled(&self) -> usize {
        self.frames().filter_map(|f| f.change.new_keyframe.as_ref()).map(|k| k.retires.len()).sum()
    }

    /// Corrections applied, the final one included.
    pub fn n_corrections(&self) -> usize {
        self.records.iter().filter(|r| matches!(r, AlignRecord::Correction(_))).count()
    }
}
