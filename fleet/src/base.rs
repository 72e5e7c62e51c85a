//! The base: a worker for each robot that copies its runs, and one map of them all.

use crate::arrivals::{Arrival, Arrivals, DISK, MAX_RUNS};
use crate::carrier::Carrier;
use crate::error::FleetError;
use crate::local::LocalCarrier;
use crate::map::{make_map, map_folder, map_number};
use crate::replica::{Pulled, Replica, ask_offer};
use crate::status::{Refused, RunStatus, Status};
use crate::summary::Summary;
use crate::wire::{Offer, Refusal};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Robots of a base at a time, at most.
pub const MAX_ROBOTS: usize = 64;
/// Between two looks.
const TICK: Duration = Duration::from_millis(50);
/// Between two questions to a robot that had nothing new.
const PAUSE: Duration = Duration::from_millis(200);
/// Between two writings of the status.
const STATUS_EVERY: Duration = Duration::from_millis(500);

/// What a base is asked to do.
#[derive(Clone, Debug)]
pub struct BaseOptions {
    /// Its folder.
    pub folder: PathBuf,
    /// Run directories to be added from disk.
    pub add: Vec<PathBuf>,
    /// Where it listens, in words.
    pub listens: Option<String>,
    /// Ends once so many runs have come and ended, and their map is made; `None`: goes on.
    pub until: Option<usize>,
    /// Between two maps while runs go on; `None`: a map when a run ends.
    pub map_every: Option<Duration>,
}

/// Carriers for workers: each has its own.
pub trait Network {
    /// Names of the robots that can be asked now, and names that were refused since the last call.
    fn robots(&mut self) -> (Vec<String>, Vec<String>);
    /// A carrier for one worker.
    fn carrier(&self) -> Box<dyn Carrier + Send>;
}

/// What all threads of a base share.
struct Shared {
    base: PathBuf,
    arrivals: Arrivals,
    runs: Vec<RunState>,
    refused: Refused,
    failure: Option<FleetError>,
}

/// A run as its worker last left it.
#[derive(Default)]
struct RunState {
    status: RunStatus,
    /// The copy, while no worker has it.
    replica: Option<Replica>,
    align_bytes: u64,
    /// Bytes of the aligner's journal of which every surface is here.
    map_bytes: u64,
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

type SharedRef = Arc<Mutex<Shared>>;

fn lock(shared: &Mutex<Shared>) -> MutexGuard<'_, Shared> {
    // A worker that panicked left numbers behind, nothing half written.
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Runs a base until it is stopped or has what it was asked for.
///
/// # Errors
/// Where its folder cannot be used, or a copy or a map cannot be written.
pub fn base(
    options: &BaseOptions,
    mut network: Option<&mut dyn Network>,
    stop: &Arc<AtomicBool>,
) -> Result<(), FleetError> {
    std::fs::create_dir_all(&options.folder).map_err(FleetError::io("make", &options.folder))?;
    let shared = Arc::new(Mutex::new(Shared::open(&options.folder)?));
    let mut workers: BTreeMap<String, JoinHandle<()>> = BTreeMap::new();
    add_from_disk(options, &shared, &mut workers, stop)?;
    let mut mapper = Mapper::default();
    let mut said = Instant::now().checked_sub(STATUS_EVERY);
    loop {
        let present = match &mut network {
            Some(network) => start_workers(*network, &shared, &mut workers, stop),
            None => BTreeSet::new(),
        };
        workers.retain(|_, worker| !worker.is_finished());
        if let Some(failure) = lock(&shared).failure.take() {
            return Err(failure);
        }
        mapper.step(options, &shared)?;
        let is_done = options.until.is_some_and(|n| mapper.is_done(&shared, n)) && !is_adding(&workers);
        let is_over = is_done || stop.load(Ordering::Relaxed);
        if is_over || said.is_none_or(|said| said.elapsed() >= STATUS_EVERY) {
            status(options, &shared, &mapper, &present).write(&options.folder)?;
            said = Some(Instant::now());
        }
        if is_over {
            stop.store(true, Ordering::Relaxed);
            return Ok(());
        }
        std::thread::sleep(TICK);
    }
}

fn is_adding(workers: &BTreeMap<String, JoinHandle<()>>) -> bool {
    workers.keys().any(|name| name.starts_with('/'))
}

impl Shared {
    fn open(base: &Path) -> Result<Self, FleetError> {
        let arrivals = Arrivals::open(base)?;
        let mut shared = Self {
            base: base.into(),
            runs: Vec::new(),
            refused: Refused::default(),
            failure: None,
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
        let replica = Replica::open(&arrival.folder(&self.base), &arrival.robot, arrival.identity)?;
        let mut state = RunState::default();
        (state.status.robot, state.status.run) = (arrival.robot, arrival.run);
        self.runs.push(state);
        self.note(number, &replica, 0);
        // Of surfaces that were on their way the last map that was begun knows nothing.
        let known = self.arrivals.mapped.align_bytes.get(number).copied().unwrap_or(0);
        self.runs[number].map_bytes = self.runs[number].map_bytes.max(known);
        self.runs[number].replica = Some(replica);
        Ok(())
    }

    /// The number of the run that a robot offers, a new one where it was not here before.
    fn find(&mut self, robot: &str, offer: &Offer, origin: Option<&Path>) -> Result<usize, NotTaken> {
        let refuse = |refusal: Refusal, words: String| NotTaken::Robot(refusal, words);
        if let Some(number) = self.arrivals.find(offer.identity) {
            let known = &self.arrivals.runs[number];
            return match known.robot == robot {
                true => Ok(number),
                false => {
                    Err(refuse(Refusal::Name, format!("its run {} is that of {}", offer.run, known.robot)))
                }
            };
        }
        if self.arrivals.runs.len() >= MAX_RUNS {
            return Err(refuse(Refusal::TooMany, format!("{MAX_RUNS} runs are here")));
        }
        let arrival = Arrival {
            robot: robot.into(),
            run: offer.run.clone(),
            identity: offer.identity,
            origin: origin.map(Path::to_owned),
        };
        let number = self.arrivals.arrive(arrival).map_err(NotTaken::Base)?;
        self.add_run(number).map_err(NotTaken::Base)?;
        Ok(number)
    }

    /// Takes down what a copy has.
    fn note(&mut self, number: usize, replica: &Replica, received: u64) {
        let run = &mut self.runs[number];
        let facts = replica.facts();
        run.align_bytes = replica.align_bytes();
        if replica.is_complete() {
            run.map_bytes = run.align_bytes;
        }
        run.status.frames = facts.n_frames;
        run.status.keyframes = facts.slots.len() as u64;
        run.status.bytes = replica.len_bytes();
        run.status.is_ended = facts.is_ended && replica.is_complete();
        run.status.received_bytes += received;
        run.rate.received += received;
        let seconds = run.rate.since.elapsed().as_secs_f64();
        if seconds >= 2.0 {
            run.status.bytes_per_s = run.rate.received as f64 / seconds;
            run.rate = Rate::default();
        }
    }

    fn count(&mut self, robot: &str, pulled: &Pulled) {
        for (refusal, words) in &pulled.refused {
            self.refused.count(robot, *refusal, words);
        }
    }
}

/// Why a run is not taken: the robot's doing, or the base's.
enum NotTaken {
    Robot(Refusal, String),
    Base(FleetError),
}

/// Starts a worker for each robot that has none; answers who is there.
fn start_workers(
    network: &mut dyn Network,
    shared: &SharedRef,
    workers: &mut BTreeMap<String, JoinHandle<()>>,
    stop: &Arc<AtomicBool>,
) -> BTreeSet<String> {
    let (robots, refused) = network.robots();
    for name in refused {
        lock(shared).refused.count(&name, Refusal::Name, "");
    }
    for robot in &robots {
        if workers.contains_key(robot) {
            continue;
        }
        if workers.len() >= MAX_ROBOTS {
            lock(shared).refused.count(robot, Refusal::TooMany, "");
            continue;
        }
        let (mut carrier, shared, stop) = (network.carrier(), Arc::clone(shared), Arc::clone(stop));
        let name = robot.clone();
        let work = move || {
            let is_gone = |carrier: &mut dyn Carrier| !carrier.robots().contains(&name);
            while !stop.load(Ordering::Relaxed) && !is_gone(&mut *carrier) {
                match visit(&mut *carrier, &shared, &name, None, &stop) {
                    Ok(Visit::Took) => {}
                    Ok(Visit::Nothing | Visit::Whole) => std::thread::sleep(PAUSE),
                    Err(error) => {
                        lock(&shared).failure.get_or_insert(error);
                        return;
                    }
                }
            }
        };
        workers.insert(robot.clone(), std::thread::spawn(work));
    }
    robots.into_iter().collect()
}

/// What a visit to a robot brought.
enum Visit {
    Took,
    Nothing,
    /// Nothing, and nothing is missing.
    Whole,
}

/// Asks a robot once for all that it has and the base has not.
fn visit(
    carrier: &mut dyn Carrier,
    shared: &SharedRef,
    robot: &str,
    origin: Option<&Path>,
    stop: &AtomicBool,
) -> Result<Visit, FleetError> {
    let mut asked = Pulled::default();
    let offer = ask_offer(carrier, robot, &mut asked);
    let (number, mut replica) = {
        let mut shared = lock(shared);
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
    let mut shared = lock(shared);
    let outcome = match pulled {
        Ok(pulled) => {
            shared.note(number, &replica, asked.received_bytes + pulled.received_bytes);
            shared.count(robot, &pulled);
            let run = &mut shared.runs[number].status;
            run.lag_bytes = replica.lag_bytes(&offer);
            run.problem =
                pulled.refused.last().map(|(refusal, words)| format!("{}: {words}", refusal.words()));
            match (pulled.taken_bytes > 0, run.lag_bytes) {
                (true, _) => Ok(Visit::Took),
                (false, 0) => Ok(Visit::Whole),
                (false, _) => Ok(Visit::Nothing),
            }
        }
        Err(error) => Err(error),
    };
    shared.runs[number].replica = Some(replica);
    outcome
}

/// Starts a worker for each run that is added from disk, also those of before that are not whole.
fn add_from_disk(
    options: &BaseOptions,
    shared: &SharedRef,
    workers: &mut BTreeMap<String, JoinHandle<()>>,
    stop: &Arc<AtomicBool>,
) -> Result<(), FleetError> {
    let mut folders: Vec<PathBuf> = Vec::new();
    for folder in &options.add {
        let whole = std::fs::canonicalize(folder).map_err(FleetError::io("read", folder))?;
        if !whole.join("run.json").is_file() {
            let folder = folder.display();
            return Err(FleetError::Input(format!("{folder}: is no folder of a run: it has no run.json")));
        }
        folders.push(whole);
    }
    let before = lock(shared).arrivals.runs.iter().filter_map(|run| run.origin.clone()).collect::<Vec<_>>();
    folders.splice(0..0, before.into_iter().filter(|folder| folder.join("run.json").is_file()));
    let mut known = BTreeSet::new();
    folders.retain(|folder| known.insert(folder.clone()));
    // One after the other: the order of arrival is that of the command line.
    for folder in &folders {
        let mut carrier = LocalCarrier::open(folder)?;
        let mut asked = Pulled::default();
        let Some(offer) = ask_offer(&mut carrier, DISK, &mut asked) else {
            let words = asked.refused.last().map_or("it answers nothing", |(_, words)| words);
            return Err(FleetError::Input(format!("{}: {words}", folder.display())));
        };
        let mut shared = lock(shared);
        let known = shared.arrivals.find(offer.identity).map(|n| shared.arrivals.runs[n].robot.clone());
        match (known, shared.find(DISK, &offer, Some(folder))) {
            (_, Ok(_)) => {}
            // It came over the network before: there is nothing to add.
            (Some(robot), Err(NotTaken::Robot(..))) if robot != DISK => {}
            (_, Err(NotTaken::Robot(_, words))) => return Err(FleetError::Input(words)),
            (_, Err(NotTaken::Base(error))) => return Err(error),
        }
    }
    for folder in folders {
        let (name, shared, stop) = (folder.display().to_string(), Arc::clone(shared), Arc::clone(stop));
        let work = move || {
            let copied = copy_from_disk(&folder, &shared, &stop);
            if let Err(error) = copied {
                lock(&shared).failure.get_or_insert(error);
            }
        };
        workers.insert(name, std::thread::spawn(work));
    }
    Ok(())
}

/// Copies a run from disk until it is whole; its end is where it is now.
fn copy_from_disk(folder: &Path, shared: &SharedRef, stop: &AtomicBool) -> Result<(), FleetError> {
    let mut carrier = LocalCarrier::open(folder)?;
    while !stop.load(Ordering::Relaxed) {
        match visit(&mut carrier, shared, DISK, Some(folder), stop)? {
            Visit::Took => {}
            Visit::Whole => {
                let mut shared = lock(shared);
                let place = shared.arrivals.runs.iter().position(|run| run.origin.as_deref() == Some(folder));
                if let Some(number) = place {
                    shared.runs[number].status.is_ended = true;
                }
                return Ok(());
            }
            Visit::Nothing => {
                let shared = lock(shared);
                let refused = shared.refused.list();
                let words = refused.iter().find(|r| r.robot == DISK).map(|r| r.last.clone());
                let words = words.unwrap_or_else(|| "nothing of it can be used".into());
                return Err(FleetError::Input(format!("{}: {words}", folder.display())));
            }
        }
    }
    Ok(())
}

/// Makes maps, one at a time, beside the copying.
#[derive(Default)]
struct Mapper {
    running: Option<(u64, JoinHandle<Result<Summary, FleetError>>)>,
    /// What the map in its place is made of.
    made_of: Option<Vec<u64>>,
    last: Option<Instant>,
    n_ended: usize,
    problem: Option<String>,
    number: u64,
    summary: Option<Summary>,
}

impl Mapper {
    fn step(&mut self, options: &BaseOptions, shared: &SharedRef) -> Result<(), FleetError> {
        if let Some((number, thread)) = self.running.take_if(|(_, thread)| thread.is_finished()) {
            match thread.join() {
                Ok(Ok(summary)) => (self.number, self.summary, self.problem) = (number, Some(summary), None),
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
            self.summary = Summary::read(&map_folder(&options.folder));
            let last = shared.arrivals.mapped.clone();
            self.made_of = Some(last.align_bytes.clone());
            if last.number > self.number {
                // It was begun and not finished: the same again.
                self.start(&shared, last);
                return Ok(());
            }
            self.n_ended = shared.runs.iter().filter(|run| run.status.is_ended).count();
        }
        let bytes: Vec<u64> = shared.runs.iter().map(|run| run.map_bytes).collect();
        if self.made_of.as_ref() == Some(&bytes) || bytes.iter().all(|n| *n == 0) {
            return Ok(());
        }
        let n_ended = shared.runs.iter().filter(|run| run.status.is_ended).count();
        let is_time =
            options.map_every.is_some_and(|every| self.last.is_none_or(|last| last.elapsed() >= every));
        let is_enough = options.until.is_none_or(|n| n_ended >= n || options.map_every.is_some());
        if is_enough && (n_ended != self.n_ended || n_ended == shared.runs.len() || is_time) {
            self.n_ended = n_ended;
            self.last = Some(Instant::now());
            let mapped = shared.arrivals.begin_map(bytes.clone())?;
            self.made_of = Some(bytes);
            self.start(&shared, mapped);
        }
        Ok(())
    }

    fn start(&mut self, shared: &Shared, mapped: crate::arrivals::Mapped) {
        let (base, arrivals) = (shared.base.clone(), shared.arrivals.runs.clone());
        let number = mapped.number;
        let make = move || make_map(&base, &arrivals, &mapped);
        self.running = Some((number, std::thread::spawn(make)));
    }

    /// Whether so many runs have ended and the map is of all that is here.
    fn is_done(&self, shared: &SharedRef, n_runs: usize) -> bool {
        let shared = lock(shared);
        let n_ended = shared.runs.iter().filter(|run| run.status.is_ended).count();
        let bytes: Vec<u64> = shared.runs.iter().map(|run| run.map_bytes).collect();
        n_ended >= n_runs && self.running.is_none() && self.made_of.as_ref() == Some(&bytes)
    }
}

fn status(options: &BaseOptions, shared: &SharedRef, mapper: &Mapper, present: &BTreeSet<String>) -> Status {
    let shared = lock(shared);
    let runs = shared
        .runs
        .iter()
        .map(|run| RunStatus { is_connected: present.contains(&run.status.robot), ..run.status.clone() });
    Status {
        pid: std::process::id(),
        listens: options.listens.clone(),
        runs: runs.collect(),
        refused: shared.refused.list(),
        mapping: mapper.running.as_ref().map(|(number, _)| *number),
        mapped: mapper.number,
        map_problem: mapper.problem.clone(),
        map: mapper.summary.clone(),
    }
}
