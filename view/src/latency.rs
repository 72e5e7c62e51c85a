//! Latency of each stage, frame by frame, from the poses that a run publishes.

use crate::error::ViewError;
use crate::find::ViewedRun;
use crate::scene::{log, set_time};
use re_sdk::RecordingStream;
use re_sdk_types::archetypes::Scalars;
use tessera_messages::PoseMessage;
use tessera_transport::{Link, Subscriber};

/// Listens to a run that goes on.
pub(crate) struct HeardPoses {
    subscriber: Subscriber<PoseMessage>,
    /// Last: the port goes before the node.
    _link: Link,
}

impl HeardPoses {
    /// Joins a run.
    pub(crate) fn open(run: &ViewedRun) -> Result<Self, ViewError> {
        let link = Link::open(&run.file.identity, &run.file.layout(&run.settings), "view")?;
        Ok(Self { subscriber: link.pose_subscriber()?, _link: link })
    }

    /// Logs the latencies of all poses that came; stamps count from `begin_nanos`.
    pub(crate) fn log(&self, recording: &RecordingStream, begin_nanos: i64) -> Result<(), ViewError> {
        while let Some(pose) = self.subscriber.receive()? {
            if pose.validate().is_err() {
                continue;
            }
            set_time(recording, pose.index, pose.stamp_nanos.saturating_sub(begin_nanos) as f64 * 1e-9);
            for (name, ms) in latencies(&pose) {
                log(recording, &format!("latency/{name}"), &Scalars::single(ms))?;
            }
        }
        Ok(())
    }
}

/// Milliseconds by name; only where both ends were measured. A pose that is published again has none.
fn latencies(pose: &PoseMessage) -> Vec<(&'static str, f64)> {
    let t = &pose.times;
    let spans = [
        ("sensor", t.read_began, t.frame_sent),
        ("reconstruct", t.surface_began, t.surface_sent),
        ("align", t.align_began, t.pose_sent),
        ("end_to_end", t.frame_sent, t.pose_sent),
    ];
    let is_measured = |(_, began, ended): &(&str, u64, u64)| *began > 0 && ended >= began;
    spans.into_iter().filter(is_measured).map(|(name, a, b)| (name, (b - a) as f64 * 1e-6)).collect()
}
