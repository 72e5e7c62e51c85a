//! Zenoh as the way between base and robots, as the base has it.
//!
//! A robot is there while its token `fleet/ROBOT/alive` is; it answers at `fleet/ROBOT/run`. Nothing that
//! a robot sends unasked is listened to but the token.

use crate::base::options::{MAX_ROBOTS, RobotNetwork};
use crate::copies::arrivals::DISK;
use crate::error::FleetError;
use crate::wire::carrier::RobotCarrier;
use crate::wire::keys::{alive_key, run_key};
use crate::wire::piece::Piece;
use crate::wire::request::{PieceRefusal, Request};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use zenoh::handlers::FifoChannel;
use zenoh::query::ConsolidationMode;
use zenoh::sample::SampleKind;
use zenoh::{Config, Session, Wait};

/// Pieces of an answer that may wait to be taken: a slow base slows the robot.
const WAITING_PIECES: usize = 4;
/// How long an answer may take, at first and at most.
const PATIENCE: Duration = Duration::from_secs(10);
const MOST_PATIENCE: Duration = Duration::from_secs(900);

#[derive(Default)]
struct Present {
    robots: BTreeSet<String>,
    refused: Vec<String>,
}

/// The base's session.
pub struct ZenohNetwork {
    session: Session,
    present: Arc<Mutex<Present>>,
    _alive: zenoh::pubsub::Subscriber<()>,
}

fn lock(present: &Mutex<Present>) -> MutexGuard<'_, Present> {
    present.lock().unwrap_or_else(PoisonError::into_inner)
}

impl ZenohNetwork {
    /// Listens.
    ///
    /// # Errors
    /// Where the locator is taken or a certificate cannot be used.
    pub fn open(config: Config) -> Result<Self, FleetError> {
        let session = zenoh::open(config).wait().map_err(|e| FleetError::Network(e.to_string()))?;
        let present = Arc::new(Mutex::new(Present::default()));
        let seen = Arc::clone(&present);
        let alive = session
            .liveliness()
            .declare_subscriber(alive_key("*"))
            .history(true)
            .callback(move |sample| {
                let key = sample.key_expr().as_str().to_owned();
                note(&mut lock(&seen), &key, sample.kind() == SampleKind::Put);
            })
            .wait()
            .map_err(|e| FleetError::Network(e.to_string()))?;
        Ok(Self { session, present, _alive: alive })
    }
}

/// Takes down that a token came or went.
fn note(present: &mut Present, key: &str, is_there: bool) {
    let name = key.strip_prefix("fleet/").and_then(|rest| rest.strip_suffix("/alive")).unwrap_or(key);
    if tessera_transport::check_name(name).is_err() || name == DISK {
        if is_there && present.refused.len() < MAX_ROBOTS {
            present.refused.push(name.chars().filter(|c| !c.is_control()).take(64).collect());
        }
    } else if !is_there {
        present.robots.remove(name);
    } else if present.robots.len() < 4 * MAX_ROBOTS {
        present.robots.insert(name.into());
    }
}

impl RobotNetwork for ZenohNetwork {
    fn robots(&mut self) -> (Vec<String>, Vec<String>) {
        let mut present = lock(&self.present);
        (present.robots.iter().cloned().collect(), std::mem::take(&mut present.refused))
    }

    fn carrier(&self) -> Box<dyn RobotCarrier + Send> {
        Box::new(ZenohCarrier {
            session: self.session.clone(),
            present: Arc::clone(&self.present),
            patience: BTreeMap::new(),
        })
    }
}

/// One worker's way to its robot.
struct ZenohCarrier {
    session: Session,
    present: Arc<Mutex<Present>>,
    /// By robot, where an answer was slower than [`PATIENCE`].
    patience: BTreeMap<String, Duration>,
}

impl RobotCarrier for ZenohCarrier {
    fn robots(&mut self) -> Vec<String> {
        lock(&self.present).robots.iter().cloned().collect()
    }

    fn ask(
        &mut self,
        robot: &str,
        request: &Request,
        take: &mut dyn FnMut(Result<Piece, PieceRefusal>) -> bool,
    ) {
        let patience = self.patience.get(robot).copied().unwrap_or(PATIENCE);
        let begun = Instant::now();
        let asking = self
            .session
            .get(format!("{}?{}", run_key(robot), request.to_parameters()))
            .consolidation(ConsolidationMode::None)
            .timeout(patience);
        let asking = match request.payload() {
            payload if payload.is_empty() => asking,
            payload => asking.payload(payload.into_owned()),
        };
        let asked = asking.with(FifoChannel::new(WAITING_PIECES)).wait();
        // A session that is closed: the base ends.
        let Ok(replies) = asked else { return };
        let (mut is_taking, mut n_pieces) = (true, 0);
        while is_taking && let Ok(reply) = replies.recv() {
            // An error is the end of patience.
            let Ok(sample) = reply.result() else { break };
            n_pieces = u32::saturating_add(n_pieces, 1);
            let label = sample.attachment().map(|label| label.to_bytes());
            let label = label.as_deref().unwrap_or_default();
            is_taking = take(Piece::read(label, &sample.payload().to_bytes()));
        }
        // A record that is too large for the link in that time would never come.
        let is_slow = is_taking && n_pieces > 0 && begun.elapsed() >= patience.mul_f64(0.95);
        match is_slow {
            true => self.patience.insert(robot.into(), patience.saturating_mul(2).min(MOST_PATIENCE)),
            false => self.patience.remove(robot),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_robots_with_names_are_there() {
        let mut present = Present::default();
        for key in ["fleet/a/alive", "fleet/../alive", "fleet/disk/alive", "fleet/a b/alive", "fleet/b/alive"]
        {
            note(&mut present, key, true);
        }
        note(&mut present, "fleet/b/alive", false);
        assert_eq!(present.robots.iter().collect::<Vec<_>>(), ["a"]);
        assert_eq!(present.refused, ["..", "disk", "a b"]);
        for n in 0..10_000 {
            note(&mut present, &format!("fleet/r{n}/alive"), true);
        }
        assert!(present.robots.len() <= 4 * MAX_ROBOTS);
    }
}
