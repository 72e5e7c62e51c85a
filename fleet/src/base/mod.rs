//! The base: a worker for each robot that copies its runs, and one map of them all.

mod answering;
mod disk;
mod mapper;
pub mod network;
pub mod options;
pub mod report;
mod shared;
mod shown;
pub mod status;
pub mod traffic;
mod visit;

use crate::base::disk::add_from_disk;
use crate::base::mapper::BaseMapper;
use crate::base::options::{BaseOptions, MAX_ROBOTS, RobotNetwork};
use crate::base::shared::{Shared, SharedRef, lock};
use crate::base::shown::ShownFiles;
use crate::base::status::{CopyStatus, Status};
use crate::base::visit::{Visit, visit};
use crate::error::FleetError;
use crate::wire::carrier::RobotCarrier;
use crate::wire::request::PieceRefusal;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

/// Between two looks.
const TICK: Duration = Duration::from_millis(50);
/// Between two questions to a robot, where nothing was left to take.
const PAUSE: Duration = Duration::from_millis(500);
/// While an answer to it is made.
const SHORT_PAUSE: Duration = Duration::from_millis(100);

/// Runs a base until it is stopped or has what it was asked for.
///
/// # Errors
/// Where its folder cannot be used, or a copy or a map cannot be written.
pub fn base(
    options: &BaseOptions,
    mut network: Option<&mut dyn RobotNetwork>,
    stop: &Arc<AtomicBool>,
) -> Result<(), FleetError> {
    std::fs::create_dir_all(&options.folder).map_err(FleetError::io("make", &options.folder))?;
    let shared = Arc::new(Mutex::new(Shared::open(&options.folder, options.form)?));
    let mut workers: BTreeMap<String, JoinHandle<()>> = BTreeMap::new();
    add_from_disk(options, &shared, &mut workers, stop)?;
    let mut mapper = BaseMapper::default();
    let mut shown = ShownFiles::default();
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
        if is_over || shown.is_due() {
            shown.show(&options.folder, &status(options, &shared, &mapper, &present), is_over)?;
        }
        if is_over {
            stop.store(true, Ordering::Relaxed);
            let problem = mapper.problem.take().filter(|_| is_done);
            return problem.map_or(Ok(()), |problem| Err(FleetError::Input(format!("no map: {problem}"))));
        }
        std::thread::sleep(TICK);
    }
}

fn is_adding(workers: &BTreeMap<String, JoinHandle<()>>) -> bool {
    workers.keys().any(|name| name.starts_with('/'))
}

/// Starts a worker for each robot that has none; answers who is there.
fn start_workers(
    network: &mut dyn RobotNetwork,
    shared: &SharedRef,
    workers: &mut BTreeMap<String, JoinHandle<()>>,
    stop: &Arc<AtomicBool>,
) -> BTreeSet<String> {
    let (robots, refused) = network.robots();
    for name in refused {
        lock(shared).refused.count(&name, PieceRefusal::Name, "");
    }
    for robot in &robots {
        if workers.contains_key(robot) {
            continue;
        }
        if workers.len() >= MAX_ROBOTS {
            lock(shared).refused.count(robot, PieceRefusal::TooMany, "");
            continue;
        }
        let (mut carrier, shared, stop) = (network.carrier(), Arc::clone(shared), Arc::clone(stop));
        let name = robot.clone();
        let work = move || {
            let is_gone = |carrier: &mut dyn RobotCarrier| !carrier.robots().contains(&name);
            while !stop.load(Ordering::Relaxed) && !is_gone(&mut *carrier) {
                match visit(&mut *carrier, &shared, &name, None, &stop) {
                    Ok(Visit::Took { is_all: false }) => {}
                    Ok(_) if lock(&shared).is_answering(&name) => std::thread::sleep(SHORT_PAUSE),
                    Ok(_) => std::thread::sleep(PAUSE),
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

fn status(
    options: &BaseOptions,
    shared: &SharedRef,
    mapper: &BaseMapper,
    present: &BTreeSet<String>,
) -> Status {
    let shared = lock(shared);
    let runs = shared
        .runs
        .iter()
        .map(|run| CopyStatus { is_connected: present.contains(&run.status.robot), ..run.status.clone() });
    Status {
        pid: std::process::id(),
        listens: options.listens.clone(),
        runs: runs.collect(),
        refused: shared.refused.list(),
        mapping: mapper.running.as_ref().map(|(number, _)| *number),
        mapped: mapper.number,
        map_problem: mapper.problem.clone(),
        map: mapper.summary.clone(),
        map_cost: mapper.cost,
    }
}
