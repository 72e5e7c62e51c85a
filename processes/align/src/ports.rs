//! The aligner's connections: surfaces in; poses, flow and wake-ups out.

use crate::durable_state::JournaledAligner;
use crate::flow::FlowControl;
use crate::inbox::Inbox;
use crate::publish::pose_message;
use tessera_messages::{Flow, PoseMessage, Stage, StepTimes, WaitingOn};
use tessera_slam::FrameRecord;
use tessera_stage::{IDLE, Pulse, StageContext, StageError, monotonic_nanos};
use tessera_transport::{Link, Listener, Notifier, Publisher};

/// All connections of the aligner.
pub(crate) struct Ports {
    pub(crate) inbox: Inbox,
    pub(crate) control: FlowControl,
    pub(crate) pulse: Pulse,
    /// Nothing was received yet: a writer's history may be under way.
    pub(crate) is_fresh: bool,
    pub(crate) poses: PosePort,
    listener: Listener,
    flow: Publisher<Flow>,
    sensor: Notifier,
    optimise: Notifier,
}

impl Ports {
    pub(crate) fn open(link: &Link, context: &StageContext) -> Result<Self, StageError> {
        Ok(Self {
            listener: link.listener(Stage::Align)?,
            inbox: Inbox::open(link, context.run.n_frames)?,
            control: FlowControl::begin(0, 0),
            is_fresh: true,
            poses: PosePort(link.pose_publisher()?),
            flow: link.flow_publisher()?,
            sensor: link.notifier(Stage::Sensor)?,
            optimise: link.notifier(Stage::Optimise)?,
            pulse: Pulse::start(link, Stage::Align, context)?,
        })
    }

    /// Adopts the epoch of a predecessor, whose surfaces `seen` came by the history, and notifies
    /// the sensor.
    pub(crate) fn adopt_epoch(
        &mut self,
        epoch: u64,
        next: u64,
        seen: &[(u64, u64)],
    ) -> Result<(), StageError> {
        let now = monotonic_nanos();
        self.control = FlowControl::adopt(epoch, next, now);
        seen.iter().for_each(|&(index, epoch)| self.control.saw(index, epoch, now));
        self.notify_sensor()
    }

    /// Begins an epoch at the first index that is missing and notifies the sensor.
    pub(crate) fn begin_epoch(&mut self, first_missing: u64) -> Result<(), StageError> {
        self.control = FlowControl::begin(first_missing, monotonic_nanos());
        self.notify_sensor()
    }

    /// Publishes the last frame's pose again.
    pub(crate) fn publish_again(&mut self, state: &JournaledAligner) -> Result<(), StageError> {
        if let Some(record) = &state.fold.last_frame {
            self.poses.0.send(pose_message(record, StepTimes::default()))?;
        }
        Ok(())
    }

    /// Sends the flow and wakes the sensor.
    pub(crate) fn notify_sensor(&mut self) -> Result<(), StageError> {
        self.flow.send(self.control.flow())?;
        self.sensor.notify();
        Ok(())
    }

    /// Wakes the optimiser: the journal has grown by something that matters to it.
    pub(crate) fn notify_optimiser(&self) {
        self.optimise.notify();
    }

    /// Sleeps until something comes, at most [`IDLE`].
    pub(crate) fn wait(&mut self, on: WaitingOn) -> Result<(), StageError> {
        self.pulse.waiting(on);
        if !self.listener.wait(IDLE)? {
            // Late subscribers get the last messages.
            self.flow.update()?;
            self.poses.0.update()?;
        }
        Ok(())
    }

    /// Releases the surfaces in hand.
    pub(crate) fn release(&mut self) {
        self.inbox.clear();
    }
}

/// Where poses go out.
pub(crate) struct PosePort(Publisher<PoseMessage>);

impl PosePort {
    /// Publishes the pose of a frame.
    pub(crate) fn publish(
        &mut self,
        pulse: &mut Pulse,
        record: &FrameRecord,
        mut times: StepTimes,
    ) -> Result<(), StageError> {
        times.pose_sent = monotonic_nanos();
        self.0.send(pose_message(record, times))?;
        pulse.output(record.index);
        if times.frame_sent > 0 {
            pulse.published(times.pose_sent.saturating_sub(times.frame_sent));
        }
        Ok(())
    }
}
