//! The trait of a message, and the errors of a refused one.

use bytemuck::{Pod, Zeroable};

/// Frames that may be left out in a row: those of an hour at 30 Hz. A run without a frame for a moment ends
/// long before.
pub const MOST_LEFT_OUT: u64 = 108_000;

/// Plain data that may travel: fixed layout, no pointers, any bit pattern is a value.
pub trait Message: Pod + std::fmt::Debug + Send + Sync {
    /// Name on the wire, with the version of the layout.
    const NAME: &'static str;
}

/// An element of a payload slice.
pub trait Element: Pod + std::fmt::Debug + Send + Sync {
    /// Name on the wire, with the version of the layout.
    const NAME: &'static str;
}

/// Raw depth units and packed colour bytes: the machine's own type, so that programs in other
/// languages can write frames.
impl Element for u16 {
    const NAME: &'static str = "u16";
}

impl Element for tessera_surface::Vertex {
    const NAME: &'static str = "tessera.Vertex.v1";
}

/// Why a received message is not used. It is counted and logged; the sender sends again.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Refusal {
    /// A size differs from what the run's own configuration says.
    #[error("frame {index}: {what} is {found}, expected {expected}")]
    Size {
        /// Frame index of the message.
        index: u64,
        /// Which size.
        what: &'static str,
        /// What the message says.
        found: u64,
        /// What the configuration says.
        expected: u64,
    },
    /// The frame index cannot be in flight.
    #[error("frame {index} is not in flight: only indices below {limit} may come")]
    Future {
        /// Frame index of the message.
        index: u64,
        /// First index that cannot have been sent.
        limit: u64,
    },
    /// A number is not finite or outside its range.
    #[error("frame {index}: {what} is {found}, expected {rule}")]
    Value {
        /// Frame index of the message.
        index: u64,
        /// Which value.
        what: &'static str,
        /// What was found, as text.
        found: String,
        /// What must hold.
        rule: &'static str,
    },
}

impl Refusal {
    /// Refuses what contradicts the number of frames in the source, where that is known: a frame
    /// behind the last one, or an end in the middle. Where it is not known, one that leaves out more than
    /// [`MOST_LEFT_OUT`] frames from `next` on.
    ///
    /// # Errors
    /// Names the index and the rule.
    pub fn unless_in_source(
        index: u64,
        kind: crate::Kind,
        n_frames: Option<u64>,
        next: u64,
    ) -> Result<(), Refusal> {
        let (is_right, rule) = match (kind, n_frames) {
            (_, None) => {
                (index.saturating_sub(next) <= MOST_LEFT_OUT, "at most an hour of frames left out in a row")
            }
            (crate::Kind::Frame, Some(n)) => (index < n, "a frame of the source"),
            (crate::Kind::End, Some(n)) => (index == n, "the end where the source ends"),
        };
        if is_right {
            return Ok(());
        }
        Err(Refusal::Value { index, what: "index", found: index.to_string(), rule })
    }

    /// Refuses a frame that asks for relocalisation from a later one on.
    pub(crate) fn unless_reached(index: u64, relocalise_from: u64) -> Result<(), Refusal> {
        if relocalise_from <= index {
            return Ok(());
        }
        let (what, found) = ("relocalise_from", relocalise_from.to_string());
        Err(Refusal::Value { index, what, found, rule: "at most the frame's own index" })
    }

    /// Refuses `found` unless it is `expected`.
    pub(crate) fn unless_equal(
        index: u64,
        what: &'static str,
        found: u64,
        expected: u64,
    ) -> Result<(), Refusal> {
        if found == expected { Ok(()) } else { Err(Refusal::Size { index, what, found, expected }) }
    }
}

/// When each step of a frame happened, nanoseconds of the monotonic clock; 0: not yet.
///
/// For latency figures only: no result depends on them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct StepTimes {
    /// The sensor began to read or decode the frame.
    pub read_began: u64,
    /// The frame was complete in shared memory.
    pub frame_sent: u64,
    /// Reconstruction took it up.
    pub surface_began: u64,
    /// The surface was complete in shared memory.
    pub surface_sent: u64,
    /// Alignment took it up.
    pub align_began: u64,
    /// The pose was published.
    pub pose_sent: u64,
}
