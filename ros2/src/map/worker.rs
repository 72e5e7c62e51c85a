//! A thread beside the images: it follows the run's directory and makes what is published of the map,
//! as long as something reads it.

use super::cloud::Packed;
use super::follow::Follow;
use super::making::Making;
use super::mapper::GridUpdate;
use crate::poses::base::Base;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{SendError, SyncSender};
use std::time::Duration;
use tessera_outputs::ToolError;
use tessera_transport::RunEntry;

/// Time between two looks into the journal.
const POLL: Duration = Duration::from_millis(100);
/// Time after which a directory that could not be read is tried again.
const AGAIN: Duration = Duration::from_secs(5);

/// Which topics are read, and whether the run is over; set by the network's side.
#[derive(Debug, Default)]
pub(crate) struct Wanted {
    pub(crate) points: AtomicBool,
    pub(crate) cloud: AtomicBool,
    pub(crate) grid: AtomicBool,
    pub(crate) is_over: AtomicBool,
}

/// What is to be published, with the time in the run.
pub(crate) enum MapUpdate {
    /// Points of a new keyframe.
    Points(i64, Packed),
    /// The whole map.
    Cloud(i64, Packed),
    /// The grid, or what changed in it.
    Grid(i64, GridUpdate),
    /// The verdict on the run so far.
    Verdict(String),
    /// The directory cannot be read: why.
    Trouble(String),
}

/// How the map is published.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MapOptions {
    /// Edge of the voxels that thin points, metres.
    pub(crate) spacing_m: f64,
    /// Edge of the grid's cells, metres.
    pub(crate) cell_m: f64,
    /// Heights of what is an obstacle, metres above the origin of `map`.
    pub(crate) heights_m: (f64, f64),
}

/// What the thread has.
pub(crate) struct Worker {
    pub(crate) entry: RunEntry,
    pub(crate) options: MapOptions,
    /// The base of the robot as seen from its camera.
    pub(crate) base: Base,
    pub(crate) wanted: std::sync::Arc<Wanted>,
    pub(crate) to: SyncSender<MapUpdate>,
}

/// Why the thread stops to follow.
pub(crate) enum WorkerEnd {
    Trouble(ToolError),
    /// Nothing takes what it makes.
    NotWanted,
}

impl From<ToolError> for WorkerEnd {
    fn from(error: ToolError) -> Self {
        Self::Trouble(error)
    }
}

impl From<SendError<MapUpdate>> for WorkerEnd {
    fn from(_: SendError<MapUpdate>) -> Self {
        Self::NotWanted
    }
}

impl Worker {
    /// Follows the run until it is over or nothing takes what is made.
    pub(crate) fn work(&self) {
        while let Err(WorkerEnd::Trouble(error)) = self.follow() {
            if self.to.send(MapUpdate::Trouble(error.to_string())).is_err() || self.is_over() {
                return;
            }
            std::thread::sleep(AGAIN);
        }
    }

    fn is_over(&self) -> bool {
        self.wanted.is_over.load(Ordering::Acquire)
    }

    fn follow(&self) -> Result<(), WorkerEnd> {
        let mut making = loop {
            if let Some(follow) = Follow::open(&self.entry)? {
                break Making::new(self, follow);
            }
            if self.is_over() {
                return Ok(());
            }
            std::thread::sleep(POLL);
        };
        loop {
            // Asked before the journal is read: what it has then is the end.
            let is_last = self.is_over();
            making.step(is_last)?;
            if is_last {
                return Ok(());
            }
            std::thread::sleep(POLL);
        }
    }
}
