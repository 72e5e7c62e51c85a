//! What the threads of a base share: which runs there are, and how far each has come.

use crate::base::answering::{Answering, KnownAnswer};
use crate::base::status::{CopyStatus, RefusedCounts};
use crate::copies::arrivals::{Arrival, Arrivals, CopyForm, Extent, MAX_RUNS};
use crate::copies::replica::{Pulled, Replica};
use crate::error::FleetError;
use crate::map::answer::MadeAnswer;
use crate::wire::request::{Offer, PieceRefusal};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

/// What all threads of a base share.
pub(crate) struct Shared {
    pub(crate) base: PathBuf,
    pub(crate) arrivals: Arrivals,
    pub(crate) runs: Vec<SharedRun>,
    pub(crate) refused: RefusedCounts,
    pub(crate) failure: Option<FleetError>,
    /// How much is copied of runs that come over the network from now on.
    form: CopyForm,
}

/// A run as its worker last left it.
#[derive(Default)]
pub(crate) struct SharedRun {
    pub(crate) status: CopyStatus,
    /// The copy, while no worker has it.
    pub(crate) replica: Option<Replica>,
    /// What a map can be made of: of a whole copy, the bytes of the aligner's journal of which every surface
    /// is here.
    pub(crate) extent: Extent,
    /// It has ended, and nothing but a last small file may be on its way.
    pub(crate) is_closing: bool,
    /// Answers to its requests.
    pub(crate) answering: Answering,
    rate: Rate,
}

/// Bytes a second.
struct Rate {
    since: Instant,
    received: u64,
}

impl Default for Rate {
    fn default() -> Self {
        Self { since: Instant::now(), received: 0 }
    }
}

pub(crate) type SharedRef = Arc<Mutex<Shared>>;

pub(crate) fn lock(shared: &Mutex<Shared>) -> MutexGuard<'_, Shared> {
    // A worker that panicked left numbers behind, nothing half written.
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

#[expect(clippy::indexing_slicing, reason = "runs are numbered by the base, and stay")]
impl Shared {
    pub(crate) fn open(base: &Path, form: CopyForm) -> Result<Self, FleetError> {
        let arrivals = Arrivals::open(base)?;
        let mut shared = Self {
            base: base.into(),
            runs: Vec::new(),
            refused: RefusedCounts::default(),
            failure: None,
            form,
            arrivals,
        };
        for number in 0..shared.arrivals.runs.len() {
            shared.add_run(number)?;
        }
        Ok(shared)
    }

    /// Opens the copy of a run that has arrived.
    fn add_run(&mut self, number: usize) -> Result<(), FleetError> {
        let arrival = self.arrivals.runs[number].clone();
        let folder = arrival.folder(&self.base);
        let replica = Replica::open(&folder, &arrival.robot, arrival.identity, arrival.form)?;
        let mut state = SharedRun::default();
        (state.status.robot, state.status.run) = (arrival.robot, arrival.run);
        self.runs.push(state);
        self.note(number, &replica, 0);
        // Of surfaces that were on their way the last map that was begun knows nothing.
        let known = self.arrivals.mapped.extents.get(number).copied().unwrap_or_default();
        let extent = &mut self.runs[number].extent;
        extent.align_bytes = extent.align_bytes.max(known.align_bytes);
        self.runs[number].replica = Some(replica);
        Ok(())
    }

    /// The number of the run that a robot offers, a new one where it was not here before.
    pub(crate) fn find(
        &mut self,
        robot: &str,
        offer: &Offer,
        origin: Option<&Path>,
    ) -> Result<usize, NotTaken> {
        let refuse = |refusal: PieceRefusal, words: String| NotTaken::Robot(refusal, words);
        if let Some(number) = self.arrivals.find(offer.identity) {
            let known = &self.arrivals.runs[number];
            return match known.robot == robot {
                true => Ok(number),
                false => Err(refuse(
                    PieceRefusal::Name,
                    format!("its run {} is that of {}", offer.run, known.robot),
                )),
            };
        }
        if self.arrivals.runs.len() >= MAX_RUNS {
            return Err(refuse(PieceRefusal::TooMany, format!("{MAX_RUNS} runs are here")));
        }
        let arrival = Arrival {
            robot: robot.into(),
            run: offer.run.clone(),
            identity: offer.identity,
            origin: origin.map(Path::to_owned),
            // On this machine nothing is saved by less.
            form: if origin.is_some() { CopyForm::Whole } else { self.form },
        };
        let number = self.arrivals.arrive(arrival).map_err(NotTaken::Base)?;
        self.add_run(number).map_err(NotTaken::Base)?;
        Ok(number)
    }

    /// Takes down what a copy has.
    pub(crate) fn note(&mut self, number: usize, replica: &Replica, received: u64) {
        let run = &mut self.runs[number];
        let facts = replica.facts();
        if let Some(extent) = replica.extent() {
            run.extent = extent;
        }
        run.status.frames = facts.n_frames;
        run.status.keyframes = facts.slots.len() as u64;
        run.status.corrections_from_base = replica.n_from_base();
        run.status.bytes = replica.len_bytes();
        (run.status.surfaces, run.status.surfaces_waiting) = replica.n_surfaces();
        run.status.is_ended = facts.is_ended && replica.is_complete();
        // A run on disk is as it is.
        let is_from_disk = self.arrivals.runs[number].origin.is_some();
        run.is_closing = run.status.is_ended && !is_from_disk && !replica.has_last_word();
        run.status.received_bytes = run.status.received_bytes.saturating_add(received);
        run.rate.received = run.rate.received.saturating_add(received);
        let seconds = run.rate.since.elapsed().as_secs_f64();
        if seconds >= 2.0 {
            run.status.bytes_per_s = run.rate.received as f64 / seconds;
            run.rate = Rate::default();
        }
    }

    /// Runs that have ended.
    pub(crate) fn n_ended(&self) -> usize {
        self.runs.iter().filter(|run| run.status.is_ended).count()
    }

    /// What a map can be made of now.
    pub(crate) fn extents(&self) -> Vec<Extent> {
        self.runs.iter().map(|run| run.extent).collect()
    }

    /// Takes up the open request of a run, if there is one; the answer that waits to be brought to it.
    pub(crate) fn next_answer(&mut self, number: usize, replica: &Replica) -> Option<MadeAnswer> {
        let mut answering = std::mem::take(&mut self.runs[number].answering);
        answering.step(number, replica.open_request(), || KnownAnswer {
            base: self.base.clone(),
            arrivals: self.arrivals.runs.clone(),
            extents: self.extents(),
        });
        let status = &mut self.runs[number].status;
        (status.answer, status.answer_problem) = (answering.last.clone(), answering.problem.clone());
        let ready = answering.take_ready();
        self.runs[number].answering = answering;
        ready
    }

    /// Whether an answer to a run of this robot is made, or waits to be brought.
    pub(crate) fn is_answering(&self, robot: &str) -> bool {
        self.runs.iter().any(|run| run.status.robot == robot && run.answering.is_open())
    }

    pub(crate) fn count(&mut self, robot: &str, pulled: &Pulled) {
        for (refusal, words) in &pulled.refused {
            self.refused.count(robot, *refusal, words);
        }
    }
}

/// Why a run is not taken: the robot's doing, or the base's.
pub(crate) enum NotTaken {
    Robot(PieceRefusal, String),
    Base(FleetError),
}
