//! The map's side of the network: its topics, and what the thread makes for them.

use super::grid::{grid_message, part_message};
use super::mapper::GridUpdate;
use super::worker::{MapOptions, MapUpdate, Wanted, Worker};
use crate::carrier::{CLOUD, Carrier, CarrierError, GRID, GRID_UPDATE, Publication, Quality};
use crate::error::Ros2Error;
use crate::poses::base::Base;
use crate::report::{Report, ReportEvent};
use crate::run::clock::ImageClock;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::{Duration, Instant};
use tessera_recording::ros::{Header, Time, encode};
use tessera_transport::RunEntry;

const MAP: &str = "map";
/// Updates that wait at most.
const MOST_WAITING: usize = 4;
/// Time that the last updates of a run may take.
const PATIENCE: Duration = Duration::from_secs(10);

/// Topics of the map.
pub(crate) struct MapSide {
    options: MapOptions,
    points: Topic,
    cloud: Topic,
    grid: Topic,
    grid_updates: Topic,
    wanted: Arc<Wanted>,
    updates: Option<Receiver<MapUpdate>>,
    /// The verdict on the run so far, once it has frames.
    pub(crate) verdict: Option<String>,
}

struct Topic {
    name: String,
    to: Box<dyn Publication>,
}

impl MapSide {
    /// Announces the topics.
    ///
    /// # Errors
    /// Where the network refuses one.
    pub(crate) fn new(
        carrier: &mut dyn Carrier,
        (namespace, grid): (&str, &str),
        options: MapOptions,
    ) -> Result<Self, CarrierError> {
        let mut topic =
            |name: String, kind, quality| carrier.publish(&name, kind, quality).map(|to| Topic { name, to });
        Ok(Self {
            options,
            points: topic(format!("{namespace}/map_points"), CLOUD, Quality::DEFAULT)?,
            cloud: topic(format!("{namespace}/map_cloud"), CLOUD, Quality::LATCHED)?,
            grid: topic(grid.to_owned(), GRID, Quality::LATCHED)?,
            grid_updates: topic(format!("{grid}_updates"), GRID_UPDATE, Quality::DEFAULT)?,
            wanted: Arc::default(),
            updates: None,
            verdict: None,
        })
    }

    /// Looks which topics are read; once the base is known, the run is followed.
    pub(crate) fn look(&mut self, carrier: &dyn Carrier, entry: &RunEntry, base: Option<&Base>) {
        let read = carrier.read_topics();
        self.wanted.points.store(read.contains(&self.points.name), Ordering::Relaxed);
        self.wanted.cloud.store(read.contains(&self.cloud.name), Ordering::Relaxed);
        self.wanted.grid.store(read.contains(&self.grid.name), Ordering::Relaxed);
        if self.updates.is_none()
            && let Some(base) = base
        {
            let (to, updates) = sync_channel(MOST_WAITING);
            let worker = Worker {
                entry: entry.clone(),
                options: self.options,
                base: base.clone(),
                wanted: Arc::clone(&self.wanted),
                to,
            };
            std::thread::spawn(move || worker.work());
            self.updates = Some(updates);
        }
    }

    /// Another run begins: the one before is followed no more.
    pub(crate) fn begin_run(&mut self) {
        self.wanted.is_over.store(true, Ordering::Release);
        (self.wanted, self.updates, self.verdict) = (Arc::default(), None, None);
    }

    /// Publishes what was made.
    ///
    /// # Errors
    /// Where a message cannot be written as CDR.
    pub(crate) fn step(&mut self, clock: &ImageClock, report: &mut Report) -> Result<(), Ros2Error> {
        while let Some(update) = self.updates.as_ref().and_then(|updates| updates.try_recv().ok()) {
            self.publish(&update, clock, report)?;
        }
        Ok(())
    }

    /// The run is over: publishes the map as it ended.
    ///
    /// # Errors
    /// As [`Self::step`].
    pub(crate) fn finish(&mut self, clock: &ImageClock, report: &mut Report) -> Result<(), Ros2Error> {
        self.wanted.is_over.store(true, Ordering::Release);
        let deadline = Instant::now() + PATIENCE;
        while let Some(updates) = &self.updates {
            match updates.recv_timeout(deadline.saturating_duration_since(Instant::now())) {
                Ok(update) => self.publish(&update, clock, report)?,
                Err(RecvTimeoutError::Disconnected | RecvTimeoutError::Timeout) => break,
            }
        }
        Ok(())
    }

    fn publish(
        &mut self,
        update: &MapUpdate,
        clock: &ImageClock,
        report: &mut Report,
    ) -> Result<(), Ros2Error> {
        let header = |run_nanos: i64| Header {
            stamp: Time::from_nanos(clock.camera_nanos(run_nanos)),
            frame_id: MAP.into(),
        };
        let sent = match update {
            MapUpdate::Points(at, packed) => self.points.to.send(&encode(&packed.message(header(*at)))?),
            MapUpdate::Cloud(at, packed) => self.cloud.to.send(&encode(&packed.message(header(*at)))?),
            MapUpdate::Grid(at, GridUpdate::Whole(grid)) => {
                self.grid.to.send(&encode(&grid_message(grid, header(*at), self.options.cell_m))?)
            }
            MapUpdate::Grid(at, GridUpdate::Part(part)) => {
                self.grid_updates.to.send(&encode(&part_message(part, header(*at)))?)
            }
            MapUpdate::Verdict(verdict) => {
                self.verdict = Some(verdict.clone());
                return Ok(());
            }
            MapUpdate::Trouble(why) => {
                report.note(ReportEvent::Map, || format!("the map cannot be read: {why}"));
                return Ok(());
            }
        };
        if let Err(error) = sent {
            report.note(ReportEvent::Carrier, || error.to_string());
        }
        Ok(())
    }
}
