//! Profiling hooks: the named steps of the work on one frame or request, and an optional observer.
//!
//! The method announces its step and knows no clock: an observer that a stage gives it may
//! look at one. No result depends on an observer, and without one an announcement is one branch.

use std::sync::Arc;

/// A named part of the work on one frame or request.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Step {
    /// Reading and decoding images.
    Decode,
    /// Depth to points, with colour.
    Cloud,
    /// The quad mesh.
    Mesh,
    /// Normals of the raw and of the filtered points.
    Normals,
    /// The filter over rings of neighbours.
    Filter,
    /// Writing the surface out.
    Vertices,
    /// Corners of the colour image with their descriptors.
    Features,
    /// Choosing samples of a surface.
    Sampling,
    /// Leaving out samples and features of dynamic points.
    Dynamic,
    /// Lifting and matching features, and the relative poses that they agree on.
    Match,
    /// Bringing samples and targets into the form that the search reads.
    Prepare,
    /// Correspondences.
    Search,
    /// Rejecting and weighing correspondences.
    Reject,
    /// Sums over correspondences.
    Accumulate,
    /// Solving for poses.
    Solve,
    /// Covariance, keyframe test and the frame's record.
    Keyframe,
    /// Finding places again by what they look like.
    Recognise,
    /// All frames on their optimised keyframes.
    Refine,
    /// A keyframe's surface into the store.
    Store,
    /// A record into the journal.
    Journal,
    /// Sending the result.
    Send,
}

impl Step {
    /// All steps, in the order of a frame's life.
    pub const ALL: [Step; 21] = [
        Step::Decode,
        Step::Cloud,
        Step::Mesh,
        Step::Normals,
        Step::Filter,
        Step::Vertices,
        Step::Features,
        Step::Sampling,
        Step::Dynamic,
        Step::Match,
        Step::Prepare,
        Step::Search,
        Step::Reject,
        Step::Accumulate,
        Step::Solve,
        Step::Keyframe,
        Step::Recognise,
        Step::Refine,
        Step::Store,
        Step::Journal,
        Step::Send,
    ];

    /// Name for people and for metrics.
    pub fn name(self) -> &'static str {
        match self {
            Step::Decode => "decode",
            Step::Cloud => "cloud",
            Step::Mesh => "mesh",
            Step::Normals => "normals",
            Step::Filter => "filter",
            Step::Vertices => "vertices",
            Step::Features => "features",
            Step::Sampling => "sampling",
            Step::Dynamic => "dynamic",
            Step::Match => "match",
            Step::Prepare => "prepare",
            Step::Search => "search",
            Step::Reject => "reject",
            Step::Accumulate => "accumulate",
            Step::Solve => "solve",
            Step::Keyframe => "keyframe",
            Step::Recognise => "recognise",
            Step::Refine => "refine",
            Step::Store => "store",
            Step::Journal => "journal",
            Step::Send => "send",
        }
    }

    /// Position in [`Step::ALL`].
    pub fn number(self) -> usize {
        self as usize
    }

    /// The step at that position, where there is one.
    pub fn from_number(number: usize) -> Option<Step> {
        Step::ALL.get(number).copied()
    }
}

/// Hears of steps.
pub trait Observer: Send + Sync {
    /// From now on the work is in this step, or in none that has a name.
    fn enters(&self, step: Option<Step>);
}

/// Reports the current step to an observer; none by default.
#[derive(Clone, Default)]
pub struct Steps(Option<Arc<dyn Observer>>);

impl Steps {
    /// Steps that `observer` hears of.
    pub fn heard_by(observer: Arc<dyn Observer>) -> Self {
        Self(Some(observer))
    }

    /// A step begins, and the one before ends.
    #[inline]
    pub fn enter(&self, step: Step) {
        if let Some(observer) = &self.0 {
            observer.enters(Some(step));
        }
    }

    /// The step ends, and none with a name begins.
    #[inline]
    pub fn leave(&self) {
        if let Some(observer) = &self.0 {
            observer.enters(None);
        }
    }
}

impl std::fmt::Debug for Steps {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(if self.0.is_some() { "Steps(heard)" } else { "Steps" })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    #[derive(Default)]
    struct Notes(Mutex<Vec<Option<Step>>>);

    impl Observer for Notes {
        fn enters(&self, step: Option<Step>) {
            self.0.lock().unwrap().push(step);
        }
    }

    #[test]
    fn an_observer_hears_what_is_entered_and_left() {
        let notes = Arc::new(Notes::default());
        let steps = Steps::heard_by(notes.clone());
        steps.enter(Step::Search);
        steps.clone().enter(Step::Solve);
        steps.leave();
        Steps::default().enter(Step::Mesh);
        assert_eq!(*notes.0.lock().unwrap(), [Some(Step::Search), Some(Step::Solve), None]);
    }

    #[test]
    fn numbers_and_names_tell_all_steps_apart() {
        for (number, step) in Step::ALL.into_iter().enumerate() {
            assert_eq!((step.number(), Step::from_number(number)), (number, Some(step)));
            assert!(Step::ALL[..number].iter().all(|other| other.name() != step.name()));
        }
        assert_eq!(Step::from_number(Step::ALL.len()), None);
    }
}
