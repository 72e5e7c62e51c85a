//! Listening to a run: signs of life, times and poses, as any stranger may.

use super::snapshot::{LastPose, Snapshot, StageLine};
use crate::exit::CommandError;
use crate::run_folder::settings_of_living;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};
use tessera_geometry::{Pose, PoseBits};
use tessera_messages::{Beat, BeatState, POSE_STATES, PoseMessage, Stage, StageTimes, WaitingOn};
use tessera_stage::{RunFile, RunFiles};
use tessera_transport::{Link, RunEntry, Subscriber};

/// Time between two looks into the queues: they hold what comes meanwhile.
const POLL: Duration = Duration::from_millis(20);

/// Hears of everything that a run says about itself.
pub(crate) struct Watcher {
    run: RunEntry,
    beat_subscriber: Subscriber<Beat>,
    times_subscriber: Subscriber<StageTimes>,
    pose_subscriber: Subscriber<PoseMessage>,
    /// Last: the ports go before the node.
    _link: Link,
    began: Instant,
    looked_at: Instant,
    beats: BTreeMap<Stage, Beat>,
    /// As they were at the look before.
    earlier: BTreeMap<Stage, Beat>,
    times: BTreeMap<Stage, StageTimes>,
    pose: Option<PoseMessage>,
}

impl Watcher {
    /// Joins a run.
    ///
    /// # Errors
    /// Where its files or its shared memory cannot be read.
    pub(crate) fn open(run: &RunEntry, name: &str) -> Result<Self, CommandError> {
        let files = RunFiles::new(&run.run_dir);
        let layout = RunFile::read(&files)?.layout(&settings_of_living(&files)?);
        let link = Link::open(&run.identity, &layout, name)?;
        let now = Instant::now();
        Ok(Self {
            run: run.clone(),
            beat_subscriber: link.beat_subscriber()?,
            times_subscriber: link.stage_times_subscriber()?,
            pose_subscriber: link.pose_subscriber()?,
            _link: link,
            began: now,
            looked_at: now,
            beats: BTreeMap::new(),
            earlier: BTreeMap::new(),
            times: BTreeMap::new(),
            pose: None,
        })
    }

    /// Listens until every stage was heard, and a little longer, so that the first look has rates; at most
    /// for `time`, for one that is frozen says nothing.
    ///
    /// # Errors
    /// Where a connection is broken.
    pub(crate) fn begin(&mut self, time: Duration) -> Result<(), CommandError> {
        let deadline = Instant::now() + time;
        while self.beats.len() < Stage::ALL.len() && Instant::now() < deadline {
            self.listen(POLL)?;
        }
        self.earlier.clone_from(&self.beats);
        self.looked_at = Instant::now();
        Ok(())
    }

    /// Listens for so long.
    ///
    /// # Errors
    /// Where a connection is broken.
    pub(crate) fn listen(&mut self, time: Duration) -> Result<(), CommandError> {
        let deadline = Instant::now() + time;
        loop {
            while let Some(beat) = self.beat_subscriber.receive()? {
                if let Ok((stage, ..)) = beat.validate() {
                    self.beats.insert(stage, beat);
                }
            }
            while let Some(times) = self.times_subscriber.receive()? {
                if let Ok(stage) = times.validate() {
                    self.times.insert(stage, times);
                }
            }
            if let Some(pose) = self.pose_subscriber.newest()?
                && pose.validate().is_ok()
            {
                self.pose = Some(pose);
            }
            let now = Instant::now();
            if now >= deadline {
                return Ok(());
            }
            std::thread::sleep(POLL.min(deadline - now));
        }
    }

    /// What was heard so far; rates are those since the look before.
    pub(crate) fn look(&mut self) -> Snapshot {
        let now = Instant::now();
        let seconds = (now - self.looked_at).as_secs_f64().max(1e-3);
        self.looked_at = now;
        let statistics = tessera_outputs::read_statistics(&self.run.run_dir).unwrap_or_default();
        let restarts = |stage: Stage| statistics.stages.get(stage.name()).map_or(0, |kept| kept.restarts);
        let stages = Stage::ALL.map(|stage| {
            let times = self.times.get(&stage);
            let earlier = self.earlier.get(&stage);
            let line = line(stage, self.beats.get(&stage), earlier, times, seconds);
            StageLine { restarts: restarts(stage), ..line }
        });
        let align = self.beats.get(&Stage::Align).copied().unwrap_or_default();
        self.earlier.clone_from(&self.beats);
        Snapshot {
            name: self.run.name.clone(),
            at_s: (now - self.began).as_secs_f64(),
            keyframes: align.keyframes,
            loops: align.loops,
            workload: align.workload,
            pose: self.pose.as_ref().map(last_pose),
            stages: stages.to_vec(),
        }
    }
}

fn line(
    stage: Stage,
    beat: Option<&Beat>,
    earlier: Option<&Beat>,
    times: Option<&StageTimes>,
    seconds: f64,
) -> StageLine {
    let name = stage.name();
    let Some(beat) = beat else {
        return StageLine { stage: name, state: "not heard".into(), ..StageLine::default() };
    };
    // A life that has just begun counts from nothing.
    let before = earlier.filter(|earlier| earlier.pid == beat.pid).copied().unwrap_or_default();
    let state = match beat.validate() {
        Ok((_, BeatState::Waiting, on)) if on != WaitingOn::Nothing => format!("waiting: {}", on.name()),
        Ok((_, state, _)) => state.name().to_owned(),
        Err(_) => "unknown".to_owned(),
    };
    let is_first = earlier.is_none();
    let rate = |now: u64, before: u64| {
        if is_first { 0.0 } else { now.saturating_sub(before) as f64 / seconds }
    };
    StageLine {
        stage: name,
        pid: Some(beat.pid),
        state,
        frames: beat.frames,
        frames_per_s: rate(beat.frames, before.frames),
        queue: beat.queue,
        latency_ms: beat.latency.into(),
        cpu_percent: rate(beat.cpu_nanos, before.cpu_nanos) * 1e-7,
        peak_rss_mb: beat.peak_rss_bytes as f64 * 1e-6,
        dropped: beat.dropped,
        lost: beat.lost,
        refused: beat.refused,
        restarts: 0,
        times_ms: times
            .map_or(BTreeMap::new(), |times| times.named().map(|(n, row)| (n, row.into())).collect()),
    }
}

fn last_pose(message: &PoseMessage) -> LastPose {
    let pose = |[x, y, z, qx, qy, qz, qw]: [f64; 7]| {
        Pose::from(&PoseBits { translation_m: [x, y, z], rotation_xyzw: [qx, qy, qz, qw] })
    };
    let world_from_camera = pose(message.world_from_odom) * pose(message.odom_from_camera);
    let bits = PoseBits::from(&world_from_camera);
    let times = &message.times;
    let is_new = times.frame_sent > 0 && times.pose_sent >= times.frame_sent;
    LastPose {
        frame: message.index,
        state: POSE_STATES.get(message.state as usize).copied().unwrap_or("unknown"),
        translation_m: bits.translation_m,
        rotation_xyzw: bits.rotation_xyzw,
        latency_ms: is_new.then(|| (times.pose_sent - times.frame_sent) as f64 * 1e-6),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_count_from_the_look_before_and_a_new_life_from_nothing() {
        let beat = |pid, frames, cpu_nanos| Beat { stage: 2, pid, frames, cpu_nanos, ..Beat::default() };
        let now = beat(7, 30, 600_000_000);
        let of = |earlier: Option<&Beat>| {
            let line = line(Stage::Align, Some(&now), earlier, None, 2.0);
            (line.frames_per_s, line.cpu_percent)
        };
        assert_eq!(of(Some(&beat(7, 10, 200_000_000))), (10.0, 20.0));
        assert_eq!(of(Some(&beat(6, 20, 500_000_000))), (15.0, 30.0));
        assert_eq!(of(None), (0.0, 0.0));
        assert_eq!(line(Stage::Sensor, None, None, None, 1.0).state, "not heard");
    }
}
