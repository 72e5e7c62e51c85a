//! From a run to Rerun: what is in the journal, then what comes.

use crate::arguments::RerunArguments;
use crate::camera::{self, Pictures};
use crate::error::ViewError;
use crate::find::ViewedRun;
use crate::latency::HeardPoses;
use crate::map::Map;
use crate::scene::{log, set_time};
use crate::track::DrawnTrack;
use re_sdk::RecordingStream;
use re_sdk_types::archetypes::{Scalars, TextLog};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use tessera_journal::Follower;
use tessera_slam::{AlignRecord, FrameRecord, State};
use tessera_stage::{ALIGN_JOURNAL, StoredKeyframes};

/// Time between two looks into the journal.
const POLL: Duration = Duration::from_millis(30);
/// Time between two looks whether the run goes on.
const ALIVE: Duration = Duration::from_millis(500);
/// Records between two updates of the trajectory while much is to be read.
const BATCH: usize = 10;

/// Feeds until the run is over and everything of it was shown, or until it is ended.
pub(crate) fn feed(
    run: &ViewedRun,
    arguments: &RerunArguments,
    recording: &RecordingStream,
    is_stopped: &AtomicBool,
) -> Result<(), ViewError> {
    let Some((mut journal, surfaces)) = open(run, is_stopped)? else { return Ok(()) };
    camera::log_static(recording, &run.file.camera)?;
    let pictures = Pictures::open(&run.settings, arguments.images_per_s);
    if let Err(reason) = &pictures {
        log(recording, "states", &TextLog::new(format!("no images: {reason}")))?;
    }
    // Without them there are no latencies, and everything else.
    let mut poses = if run.is_alive()? { HeardPoses::open(run).ok() } else { None };
    let mut feed = ViewFeed {
        recording,
        map: Map::new(surfaces, arguments.keyframe_points),
        track: DrawnTrack::default(),
        pictures: pictures.ok(),
        begin_nanos: None,
        state: State::Tracking,
    };
    let mut is_alive = run.is_alive()?;
    let mut looked = Instant::now();
    while !is_stopped.load(Ordering::Relaxed) {
        if is_alive && looked.elapsed() >= ALIVE {
            is_alive = run.is_alive()?;
            looked = Instant::now();
        }
        let n = feed.drain(&mut journal, is_alive)?;
        if let (Some(poses), Some(begin_nanos)) = (&poses, feed.begin_nanos) {
            poses.log(recording, begin_nanos)?;
        }
        if n < BATCH && !is_alive {
            break;
        }
        if !is_alive {
            poses = None;
        }
        if n < BATCH {
            std::thread::sleep(POLL);
        }
    }
    feed.track.log_final(recording, feed.map.poses())
}

/// Journal and store, once they are there; `None` where it is ended before.
fn open(
    run: &ViewedRun,
    is_stopped: &AtomicBool,
) -> Result<Option<(Follower<AlignRecord>, StoredKeyframes)>, ViewError> {
    let (journal, store) = (run.files.align_journal(), run.files.store());
    let is_there = || journal.is_file() && store.metadata().is_ok_and(|meta| meta.len() > 0);
    while !is_there() && run.is_alive()? {
        if is_stopped.load(Ordering::Relaxed) {
            return Ok(None);
        }
        std::thread::sleep(POLL);
    }
    let grid = run.file.layout(&run.settings).grid;
    let surfaces = StoredKeyframes::open(&store, grid)?;
    Ok(Some((Follower::open(&journal, ALIGN_JOURNAL)?, surfaces)))
}

struct ViewFeed<'a> {
    recording: &'a RecordingStream,
    map: Map,
    track: DrawnTrack,
    pictures: Option<Pictures>,
    /// Stamp of the first frame.
    begin_nanos: Option<i64>,
    state: State,
}

impl ViewFeed<'_> {
    /// Shows the next records, at most [`BATCH`]; how many there were.
    fn drain(&mut self, journal: &mut Follower<AlignRecord>, is_alive: bool) -> Result<usize, ViewError> {
        let mut n = 0;
        while n < BATCH
            && let Some(record) = journal.next()?
        {
            n += 1;
            self.map.apply(&record)?;
            self.track.apply(&record);
            match &record {
                AlignRecord::Frame(frame) => self.show(frame, is_alive)?,
                AlignRecord::Skipped(skipped) => {
                    let last = skipped.frames.end.saturating_sub(1);
                    let frames = match skipped.n() {
                        1 => format!("frame {last}"),
                        _ => format!("frames {} to {last}", skipped.frames.start),
                    };
                    self.say(&format!("{frames}: {}", skipped.reason))?;
                }
                AlignRecord::Correction(_) => self.say("a correction took effect")?,
                AlignRecord::End { n_frames, .. } => self.say(&format!("the end: {n_frames} frames"))?,
                AlignRecord::Map(map) => {
                    self.say(&format!("starts in a map of {} keyframes", map.keyframes.len()))?;
                }
            }
            self.map.log(self.recording)?;
        }
        self.track.log(self.recording)?;
        Ok(n)
    }

    fn show(&mut self, frame: &FrameRecord, is_alive: bool) -> Result<(), ViewError> {
        let begin = *self.begin_nanos.get_or_insert(frame.stamp_nanos);
        set_time(self.recording, frame.index, frame.stamp_nanos.saturating_sub(begin) as f64 * 1e-9);
        camera::log_pose(self.recording, frame)?;
        if let Some(std_m) = std_m(frame) {
            log(self.recording, "certainty/position", &Scalars::single(1e3 * std_m))?;
        }
        if frame.state != self.state {
            self.state = frame.state;
            let words = match frame.state {
                State::Tracking => "tracking".to_owned(),
                State::Lost => format!("lost: {}", frame.reason()),
                State::Relocalising => format!("found again: {}", frame.reason()),
            };
            self.say(&words)?;
        }
        match &mut self.pictures {
            Some(pictures) => pictures.log(self.recording, frame, is_alive),
            None => Ok(()),
        }
    }

    fn say(&self, words: &str) -> Result<(), ViewError> {
        log(self.recording, "states", &TextLog::new(words))
    }
}

/// Standard deviation of the position, from the diagonal of the covariance.
fn std_m(frame: &FrameRecord) -> Option<f64> {
    let variances = [0, 6, 11].map(|place| frame.pose.covariance.get(place).copied());
    let [Some(x), Some(y), Some(z)] = variances else { return None };
    Some((x + y + z).max(0.0).sqrt()).filter(|std| std.is_finite())
}
