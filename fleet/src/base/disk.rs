//! Runs that are added from disk, each copied by a worker of its own as a robot's is.

use crate::base::options::BaseOptions;
use crate::base::shared::{NotTaken, SharedRef, lock};
use crate::base::visit::{Visit, visit};
use crate::copies::arrivals::DISK;
use crate::copies::local::LocalCarrier;
use crate::copies::replica::{Pulled, ask_offer};
use crate::error::FleetError;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

/// Starts a worker for each run that is added from disk, also those of before that are not whole.
pub(crate) fn add_from_disk(
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
        let known = shared.arrivals.find(offer.identity).and_then(|n| shared.arrivals.runs.get(n));
        let known = known.map(|run| run.robot.clone());
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
            Visit::Took { .. } => {}
            Visit::Whole => {
                let mut shared = lock(shared);
                let place = shared.arrivals.runs.iter().position(|run| run.origin.as_deref() == Some(folder));
                if let Some(run) = place.and_then(|number| shared.runs.get_mut(number)) {
                    run.status.is_ended = true;
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
