//! One visit to a robot: which run it has, all of it that the base has not, and the answer to its request.

use crate::base::answering::deliver;
use crate::base::shared::{NotTaken, SharedRef, lock};
use crate::copies::replica::{Pulled, ask_offer};
use crate::error::FleetError;
use crate::map::answer::MadeAnswer;
use crate::wire::carrier::RobotCarrier;
use crate::wire::request::Offer;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// What a visit to a robot brought.
pub(crate) enum Visit {
    Took {
        /// Nothing was missing behind it.
        is_all: bool,
    },
    Nothing,
    /// Nothing, and nothing is missing.
    Whole,
}

/// Asks a robot once for all that it has and the base has not.
#[expect(clippy::indexing_slicing, reason = "runs are numbered by the base, and stay")]
pub(crate) fn visit(
    carrier: &mut dyn RobotCarrier,
    shared_runs: &SharedRef,
    robot: &str,
    origin: Option<&Path>,
    stop: &AtomicBool,
) -> Result<Visit, FleetError> {
    let mut asked = Pulled::default();
    let offer = ask_offer(carrier, robot, &mut asked);
    let (number, mut replica) = {
        let mut shared = lock(shared_runs);
        shared.count(robot, &asked);
        let Some(offer) = &offer else { return Ok(Visit::Nothing) };
        let number = match shared.find(robot, offer, origin) {
            Ok(number) => number,
            Err(NotTaken::Base(error)) => return Err(error),
            Err(NotTaken::Robot(refusal, words)) => {
                shared.refused.count(robot, refusal, &words);
                return Ok(Visit::Nothing);
            }
        };
        let Some(replica) = shared.runs[number].replica.take() else { return Ok(Visit::Nothing) };
        (number, replica)
    };
    let Some(offer) = offer else { return Ok(Visit::Nothing) };
    let pulled = replica.pull(carrier, &offer, &|| stop.load(Ordering::Relaxed));
    let mut shared = lock(shared_runs);
    let outcome = match pulled {
        Ok(pulled) => {
            shared.note(number, &replica, asked.received_bytes.saturating_add(pulled.received_bytes));
            shared.count(robot, &pulled);
            let run = &mut shared.runs[number].status;
            run.lag_bytes = replica.lag_bytes(&offer);
            run.problem =
                pulled.refused.last().map(|(refusal, words)| format!("{}: {words}", refusal.words()));
            match (pulled.taken_bytes > 0, run.lag_bytes) {
                (true, lag_bytes) => Ok(Visit::Took { is_all: lag_bytes == 0 }),
                (false, 0) => Ok(Visit::Whole),
                (false, _) => Ok(Visit::Nothing),
            }
        }
        Err(error) => Err(error),
    };
    // A run on disk cannot be answered.
    let answer = (origin.is_none() && outcome.is_ok()).then(|| shared.next_answer(number, &replica));
    shared.runs[number].replica = Some(replica);
    drop(shared);
    if let Some(answer) = answer.flatten() {
        bring(carrier, shared_runs, (robot, number), &offer, answer);
    }
    outcome
}

/// Brings an answer to a robot; one that was cut off is brought again at the next visit.
#[expect(clippy::indexing_slicing, reason = "runs are numbered by the base, and stay")]
fn bring(
    carrier: &mut dyn RobotCarrier,
    shared: &SharedRef,
    (robot, number): (&str, usize),
    offer: &Offer,
    answer: MadeAnswer,
) {
    let mut pulled = Pulled::default();
    let delivery = deliver(carrier, robot, offer.identity, &answer, &mut pulled);
    let mut shared = lock(shared);
    shared.count(robot, &pulled);
    shared.runs[number].answering.delivered(answer, delivery);
}
