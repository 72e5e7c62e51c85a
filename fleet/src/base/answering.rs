//! When the request of a run is answered: one at a time for each run, beside the copying, and delivered by
//! the worker that visits the robot.

use crate::copies::arrivals::{Arrival, Extent};
use crate::copies::replica::Pulled;
use crate::error::FleetError;
use crate::map::answer::{MadeAnswer, answer};
use crate::wire::carrier::RobotCarrier;
use crate::wire::piece::PieceKind;
use crate::wire::request::{PieceRefusal, Request};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::thread::JoinHandle;

/// What a base last answered to a run.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct AnswerStatus {
    /// The request.
    pub request: u64,
    /// Other runs that the answer is made of.
    pub runs: u64,
}

/// What an answer is made of: the base, all runs, and how much of each is here.
pub(crate) struct KnownAnswer {
    pub(crate) base: PathBuf,
    pub(crate) arrivals: Vec<Arrival>,
    pub(crate) extents: Vec<Extent>,
}

/// The answers to one run.
#[derive(Default)]
pub(crate) struct Answering {
    /// The request that was taken up last.
    taken_up: Option<u64>,
    running: Option<JoinHandle<Result<Option<MadeAnswer>, FleetError>>>,
    /// Computed and not delivered.
    ready: Option<MadeAnswer>,
    pub(crate) last: Option<AnswerStatus>,
    pub(crate) problem: Option<String>,
}

impl Answering {
    /// Takes up the open request of run `number`, where that is a new one, and takes in what was computed.
    pub(crate) fn step(&mut self, number: usize, open: Option<u64>, known: impl FnOnce() -> KnownAnswer) {
        if let Some(thread) = self.running.take_if(|thread| thread.is_finished()) {
            match thread.join() {
                Ok(Ok(answer)) => (self.ready, self.problem) = (answer, None),
                Ok(Err(error)) => self.problem = Some(error.to_string()),
                Err(_) => self.problem = Some("the thread of an answer panicked".into()),
            }
        }
        let is_new = open.is_some() && open != self.taken_up;
        if is_new && self.running.is_none() {
            let known = known();
            let make = move || answer(&known.base, &known.arrivals, number, &known.extents);
            (self.taken_up, self.running) = (open, Some(std::thread::spawn(make)));
        }
    }

    /// Whether an answer is computed, or waits to be delivered.
    pub(crate) fn is_open(&self) -> bool {
        self.running.is_some() || self.ready.is_some()
    }

    /// The answer that waits to be delivered.
    pub(crate) fn take_ready(&mut self) -> Option<MadeAnswer> {
        self.ready.take()
    }

    /// What became of an answer; one that was cut off is delivered again.
    pub(crate) fn delivered(&mut self, answer: MadeAnswer, delivery: AnswerDelivery) {
        match delivery {
            AnswerDelivery::Taken => {
                self.last = Some(AnswerStatus { request: answer.request, runs: answer.n_sharing as u64 });
            }
            AnswerDelivery::Refused => {}
            AnswerDelivery::Cut => self.ready = self.ready.take().or(Some(answer)),
        }
    }
}

/// What became of an answer on its way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum AnswerDelivery {
    /// The robot has it on disk.
    Taken,
    /// The robot does not take it.
    Refused,
    /// Nothing is known.
    Cut,
}

/// Delivers an answer to a robot's run.
pub(crate) fn deliver(
    carrier: &mut dyn RobotCarrier,
    robot: &str,
    identity: u64,
    answer: &MadeAnswer,
    pulled: &mut Pulled,
) -> AnswerDelivery {
    let request = Request::Answer { identity, bytes: answer.bytes.clone() };
    let mut delivery = AnswerDelivery::Cut;
    carrier.ask(robot, &request, &mut |piece| {
        match piece {
            Ok(piece) if piece.kind == PieceKind::Refused => {
                let words = String::from_utf8_lossy(&piece.bytes).chars().take(200).collect::<String>();
                pulled.refused.push((PieceRefusal::Answer, words));
                delivery = AnswerDelivery::Refused;
            }
            Ok(piece) if piece.kind == PieceKind::End && piece.identity == identity => {
                delivery = AnswerDelivery::Taken;
            }
            Ok(_) => pulled.refused.push((PieceRefusal::OtherPlace, "no word on an answer".into())),
            Err(refusal) => pulled.refused.push((refusal, String::new())),
        }
        delivery == AnswerDelivery::Cut
    });
    delivery
}
