//! When a map is made: one at a time, beside the copying, of what is whole at that moment.

use crate::base::options::BaseOptions;
use crate::base::shared::{Shared, SharedRef, lock};
use crate::copies::arrivals::{Extent, Mapped};
use crate::error::FleetError;
use crate::map::joint::{KnownMap, MadeMap, MapCost, make_map, map_folder, map_number};
use crate::map::summary::JointSummary;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Makes maps, one at a time, beside the copying.
#[derive(Default)]
pub(crate) struct BaseMapper {
    pub(crate) running: Option<(u64, JoinHandle<Result<MadeMap, FleetError>>)>,
    /// What the map in its place is made of.
    pub(crate) made_of: Option<Vec<Extent>>,
    pub(crate) last: Option<Instant>,
    pub(crate) n_ended: usize,
    pub(crate) problem: Option<String>,
    pub(crate) number: u64,
    pub(crate) summary: Option<JointSummary>,
    pub(crate) cost: Option<MapCost>,
    known: KnownMap,
    /// Since when there is nothing to be done but to wait for last words.
    done: Option<Instant>,
}

/// How long a base waits for the last word of a run that has ended: a run whose supervisor was killed
/// behind the end of its journals never says it.
const LAST_WORD_WITHIN: Duration = Duration::from_secs(30);

impl BaseMapper {
    pub(crate) fn step(&mut self, options: &BaseOptions, shared: &SharedRef) -> Result<(), FleetError> {
        if let Some((number, thread)) = self.running.take_if(|(_, thread)| thread.is_finished()) {
            match thread.join() {
                Ok(Ok(MadeMap { summary, cost, known })) => {
                    (self.number, self.summary, self.problem) = (number, Some(summary), None);
                    (self.cost, self.known) = (Some(cost), known);
                }
                Ok(Err(error)) => self.problem = Some(error.to_string()),
                Err(_) => self.problem = Some("the map's thread panicked".into()),
            }
        }
        if self.running.is_some() {
            return Ok(());
        }
        let mut shared = lock(shared);
        if self.made_of.is_none() {
            self.number = map_number(&options.folder);
            self.summary = JointSummary::read(&map_folder(&options.folder));
            let last = shared.arrivals.mapped.clone();
            self.made_of = Some(last.extents.clone());
            if last.number > self.number {
                // It was begun and not finished: the same again.
                self.start(&shared, last);
                return Ok(());
            }
            self.n_ended = shared.n_ended();
        }
        let extents = shared.extents();
        if self.made_of.as_ref() == Some(&extents) || extents.iter().all(|extent| extent.align_bytes == 0) {
            return Ok(());
        }
        let n_ended = shared.n_ended();
        let is_time =
            options.map_every.is_some_and(|every| self.last.is_none_or(|last| last.elapsed() >= every));
        let is_enough = options.until.is_none_or(|n| n_ended >= n || options.map_every.is_some());
        if is_enough && (n_ended != self.n_ended || n_ended == shared.runs.len() || is_time) {
            self.n_ended = n_ended;
            self.last = Some(Instant::now());
            let mapped = shared.arrivals.begin_map(extents.clone())?;
            self.made_of = Some(extents);
            self.start(&shared, mapped);
        }
        Ok(())
    }

    fn start(&mut self, shared: &Shared, mapped: Mapped) {
        let (base, arrivals) = (shared.base.clone(), shared.arrivals.runs.clone());
        let number = mapped.number;
        let known = std::mem::take(&mut self.known);
        let make = move || make_map(&base, &arrivals, &mapped, known);
        self.running = Some((number, std::thread::spawn(make)));
    }

    /// Whether so many runs have ended, with their last words, and the map is of all that is here.
    pub(crate) fn is_done(&mut self, shared: &SharedRef, n_runs: usize) -> bool {
        let shared = lock(shared);
        let n_ended = shared.n_ended();
        if n_ended < n_runs || self.running.is_some() || self.made_of != Some(shared.extents()) {
            self.done = None;
            return false;
        }
        let done = *self.done.get_or_insert_with(Instant::now);
        shared.runs.iter().all(|run| !run.is_closing) || done.elapsed() >= LAST_WORD_WITHIN
    }
}
