//! The uplink: a run directory behind a queryable. A process like the others, and less: of a run that asks no
//! base it writes nothing, of one that does the answers alone.

use crate::error::FleetError;
use crate::robot::inbox::AnswerInbox;
use crate::robot::served::Served;
use crate::wire::keys::{alive_key, run_key};
use crate::wire::piece::Deflater;
use crate::wire::piece::Piece;
use crate::wire::request::Request;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, Instant};
use zenoh::handlers::FifoChannel;
use zenoh::query::Query;
use zenoh::{Config, Session, Wait};

/// Requests that may wait: a base has one under way.
const WAITING_REQUESTS: usize = 4;
const TICK: Duration = Duration::from_millis(200);

/// What an uplink is asked to do.
#[derive(Clone, Debug)]
pub struct UplinkOptions {
    /// Folders where the run may be, or come to be.
    pub folders: Vec<PathBuf>,
    /// Name of this robot.
    pub robot: String,
    /// Bytes a second, at most.
    pub max_bytes_per_s: Option<f64>,
    /// Say nothing.
    pub is_quiet: bool,
}

/// Answers for a run until it is stopped.
///
/// # Errors
/// Where the network cannot be used.
pub fn uplink(options: &UplinkOptions, config: Config, stop: &AtomicBool) -> Result<(), FleetError> {
    let say = |words: &str| {
        if !options.is_quiet {
            println!("{words}");
        }
    };
    let Some(mut served) = wait_for_run(options, stop, &say) else { return Ok(()) };
    let Some(session) = wait_for_base(config, stop, &say)? else { return Ok(()) };
    let network = |e: zenoh::Error| FleetError::Network(e.to_string());
    let queries = session
        .declare_queryable(run_key(&options.robot))
        .with(FifoChannel::new(WAITING_REQUESTS))
        .wait()
        .map_err(network)?;
    let _alive = session.liveliness().declare_token(alive_key(&options.robot)).wait().map_err(network)?;
    say(&format!("answers as robot {}", options.robot));
    let mut way = UplinkWay { pace: UplinkPace::new(options.max_bytes_per_s), deflater: Deflater::default() };
    let mut inbox = AnswerInbox::default();
    while !stop.load(Ordering::Relaxed) {
        match queries.recv_timeout(TICK) {
            Ok(Some(query)) => answer((&mut served, &mut inbox), &query, &mut way, stop),
            Ok(None) => {}
            Err(error) => return Err(FleetError::Network(error.to_string())),
        }
    }
    Ok(())
}

/// How pieces go out.
struct UplinkWay {
    pace: UplinkPace,
    deflater: Deflater,
}

fn answer(
    (served, inbox): (&mut Served, &mut AnswerInbox),
    query: &Query,
    way: &mut UplinkWay,
    stop: &AtomicBool,
) {
    let mut give = |piece: Piece| {
        let (label, bytes) = piece.to_wire(&mut way.deflater);
        way.pace.wait_for(bytes.len());
        // That a reply was taken says nothing; the next request does.
        let given = query.reply(query.key_expr().clone(), bytes.into_owned()).attachment(label).wait();
        given.is_ok() && !stop.load(Ordering::Relaxed)
    };
    let payload = query.payload().map(|payload| payload.to_bytes()).unwrap_or_default();
    match Request::parse(query.parameters().as_str(), &payload) {
        Ok(request) => {
            inbox.heard(served);
            match &request {
                Request::Answer { identity, bytes } => {
                    give(inbox.take(served, *identity, bytes));
                }
                _ => served.answer(&request, &mut give),
            }
        }
        Err(reason) => {
            give(Piece::refused(0, &reason));
        }
    }
}

/// The run, once it is there; `None` where the uplink is stopped before.
fn wait_for_run(options: &UplinkOptions, stop: &AtomicBool, say: &dyn Fn(&str)) -> Option<Served> {
    let mut is_said = false;
    while !stop.load(Ordering::Relaxed) {
        if let Some(served) = options.folders.iter().find_map(|folder| Served::open(folder).ok()) {
            return Some(served);
        }
        if !is_said {
            say("waits for the run");
            is_said = true;
        }
        std::thread::sleep(TICK);
    }
    None
}

/// A session, once the base is there; `None` where the uplink is stopped before.
fn wait_for_base(
    config: Config,
    stop: &AtomicBool,
    say: &dyn Fn(&str),
) -> Result<Option<Session>, FleetError> {
    let (send, receive) = channel();
    // A client's opening blocks until the base comes.
    std::thread::spawn(move || send.send(zenoh::open(config).wait()));
    let mut is_said = false;
    while !stop.load(Ordering::Relaxed) {
        match receive.recv_timeout(TICK) {
            Ok(Ok(session)) => return Ok(Some(session)),
            Ok(Err(error)) => return Err(FleetError::Network(error.to_string())),
            Err(RecvTimeoutError::Disconnected) => {
                return Err(FleetError::Network("the session's thread ended".into()));
            }
            Err(RecvTimeoutError::Timeout) if is_said => {}
            Err(RecvTimeoutError::Timeout) => {
                say("waits for the base");
                is_said = true;
            }
        }
    }
    Ok(None)
}

/// A bound on bytes a second.
struct UplinkPace {
    bytes_per_s: Option<f64>,
    due: Instant,
}

impl UplinkPace {
    fn new(bytes_per_s: Option<f64>) -> Self {
        Self { bytes_per_s, due: Instant::now() }
    }

    /// Waits until so many bytes may go.
    fn wait_for(&mut self, n: usize) {
        let Some(bytes_per_s) = self.bytes_per_s else { return };
        let now = Instant::now();
        if let Some(wait) = self.due.checked_duration_since(now) {
            std::thread::sleep(wait);
        }
        // What was not used before is not saved up.
        let takes = Duration::try_from_secs_f64(n as f64 / bytes_per_s).unwrap_or_default();
        self.due = self.due.max(now).checked_add(takes).unwrap_or(now);
    }
}
