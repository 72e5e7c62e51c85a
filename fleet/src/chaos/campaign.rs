//! A fleet under faults, the same fleet undisturbed, and what differs.

use super::arguments::FleetChaosArguments;
use super::processes::{FleetProcess, Patience, Starter, free_port};
use super::relay::Relay;
use super::report::{FleetReport, RobotReport};
use super::robot_run::RobotRun;
use super::schedule::{FleetFault, FleetStrike, schedule};
use super::simulated::simulated_runs;
use super::verdict::{copy_of, map_difference, map_files};
use crate::base::status::Status;
use crate::error::FleetError;
use crate::wire::request::JOURNALS;
use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};
use tessera_stage::identity_of;

/// Robots of a campaign, at most.
pub const MOST_ROBOTS: usize = 8;
/// How far a campaign is: faults so far, and what is done now.
pub type OnFault<'a> = &'a mut dyn FnMut(usize, &str);

/// A base, its robots' uplinks, and the relays between them.
struct RunningFleet {
    folder: PathBuf,
    port: u16,
    starter: Starter,
    base: FleetProcess,
    uplinks: Vec<FleetProcess>,
    /// Empty: nothing is between robots and base.
    relays: Vec<Relay>,
}

/// Runs the fleet under faults, then undisturbed, and compares.
///
/// # Errors
/// Where a run cannot be used, a process cannot be started or ends by itself, or all time is over. A broken
/// promise is in the report.
pub fn fleet_campaign(
    program: &Path,
    options: &FleetChaosArguments,
    stop: &AtomicBool,
    on_fault: OnFault<'_>,
) -> Result<FleetReport, FleetError> {
    check(options)?;
    let folder = match &options.out {
        Some(out) => {
            std::fs::create_dir_all(out).map(|()| out.clone()).map_err(FleetError::io("make", out))?
        }
        None => temporary_folder()?,
    };
    let folder = std::fs::canonicalize(&folder).map_err(FleetError::io("read", &folder))?;
    let done = disturb_and_compare((program, options), &folder, stop, on_fault);
    let is_of_use = match &done {
        Ok(report) => !report.broken.is_empty(),
        Err(FleetError::Interrupted | FleetError::Input(_)) => false,
        Err(_) => true,
    };
    if options.out.is_none() && !is_of_use {
        let _ = std::fs::remove_dir_all(&folder);
        return done;
    }
    match done {
        Ok(report) => Ok(FleetReport { kept_in: Some(folder), ..report }),
        Err(error @ (FleetError::Interrupted | FleetError::Input(_))) => Err(error),
        Err(error) => Err(error.kept(&folder)),
    }
}

/// A folder that nothing else has, and that is this user's alone.
fn temporary_folder() -> Result<PathBuf, FleetError> {
    let name = |n: u32| format!("tessera-chaos-fleet-{}-{n}", std::process::id());
    let mut number = 0;
    loop {
        let folder = std::env::temp_dir().join(name(number));
        match std::fs::DirBuilder::new().mode(0o700).create(&folder) {
            Ok(()) => return Ok(folder),
            // What another one kept for a look.
            Err(error) if error.kind() == ErrorKind::AlreadyExists && number < 100 => number += 1,
            Err(error) => return Err(FleetError::io("make", &folder)(error)),
        }
    }
}

fn check(options: &FleetChaosArguments) -> Result<(), FleetError> {
    let n = options.run.len();
    if n == 1 || n > MOST_ROBOTS {
        return Err(FleetError::Arguments(format!("--run {n} times, expected 2 to {MOST_ROBOTS} or none")));
    }
    let mut identities: BTreeMap<u64, &PathBuf> = BTreeMap::new();
    for run in &options.run {
        let path = run.join("run.json");
        let bytes = std::fs::read(&path).map_err(FleetError::io("read", &path));
        let identity = identity_of(&bytes.map_err(|error| FleetError::Input(error.to_string()))?);
        if let Some(same) = identities.insert(identity, run) {
            let words = format!("{} is given twice, once as {}", run.display(), same.display());
            return Err(FleetError::Arguments(words));
        }
    }
    let is_taken = |out: &PathBuf| out.read_dir().is_ok_and(|mut items| items.next().is_some());
    match options.out.as_ref().filter(|out| is_taken(out)) {
        Some(out) => Err(FleetError::Arguments(format!("{}: expected an empty folder", out.display()))),
        None => Ok(()),
    }
}

fn disturb_and_compare(
    (program, options): (&Path, &FleetChaosArguments),
    folder: &Path,
    stop: &AtomicBool,
    on_fault: OnFault<'_>,
) -> Result<FleetReport, FleetError> {
    let patience = Patience { until: Instant::now() + Duration::from_secs(options.patience_s), stop };
    let originals = if options.run.is_empty() {
        on_fault(0, "makes two runs of the simulated room");
        simulated_runs(folder, &folder.join("simulated.log"), &patience)?
    } else {
        options.run.clone()
    };
    let mut robots = Vec::new();
    for (number, original) in (1..).zip(&originals) {
        let robot = format!("robot{number}");
        robots.push(RobotRun::begin(original, &robot, &folder.join("robots").join(&robot))?);
    }
    let starter = |name: &str| Starter {
        program: program.to_owned(),
        log: Some(folder.join(format!("{name}.log"))),
        is_whole: options.whole,
    };
    let mut report = FleetReport { seed: options.seed, ..FleetReport::default() };
    let strikes = schedule(options.seed, options.times, robots.len());
    let disturbed = folder.join("disturbed");
    let mut fleet =
        RunningFleet::open(starter("disturbed"), &disturbed, &mut robots, true, (strikes.len(), patience))?;
    let begun = Instant::now();
    fleet.strike_all(&strikes, &mut robots, &mut report, (patience, on_fault))?;
    report.catch_up_s = fleet.finish(&mut robots, patience)?;
    report.wall_s = begun.elapsed().as_secs_f64();
    fleet.take_refused(&mut report);
    for (robot, relay) in robots.iter().zip(&fleet.relays) {
        let carried = relay.carried();
        let (name, run, run_bytes) = (robot.robot.clone(), robot.original.clone(), robot.len_bytes());
        report.robots.push(RobotReport { robot: name, run, run_bytes, carried, identical: false });
    }
    drop(fleet);
    on_fault(strikes.len(), "the same undisturbed");
    let quiet = folder.join("undisturbed");
    RunningFleet::open(starter("undisturbed"), &quiet, &mut robots, false, (strikes.len(), patience))?
        .finish(&mut robots, patience)?;
    if options.flip {
        flip(&disturbed, &robots[0])?;
    }
    compare(&disturbed, &quiet, &robots, &mut report)?;
    Ok(report)
}

impl RunningFleet {
    /// Starts a base and the uplinks of all robots, one after the other: the order of arrival is part of
    /// what a map is made of. Of each run the first of `n_parts` and one more is there then.
    fn open(
        starter: Starter,
        folder: &Path,
        robots: &mut [RobotRun],
        is_disturbed: bool,
        (n_parts, patience): (usize, Patience<'_>),
    ) -> Result<Self, FleetError> {
        let port = free_port()?;
        let base = starter.base(folder, port, robots.len())?;
        let folder = folder.to_owned();
        let mut fleet = Self { folder, port, starter, base, uplinks: Vec::new(), relays: Vec::new() };
        for (number, robot) in robots.iter_mut().enumerate() {
            robot.grow_to(1, n_parts as u64 + 1)?;
            if is_disturbed {
                fleet.relays.push(Relay::to(port)?);
            }
            let uplink = fleet.uplink(number, robot)?;
            fleet.uplinks.push(uplink);
            patience.wait_for(&format!("{} at the base", robot.robot), || {
                fleet.base.ended().is_some() || fleet.status().runs.iter().any(|run| run.robot == robot.robot)
            })?;
            fleet.check()?;
        }
        Ok(fleet)
    }

    fn uplink(&self, number: usize, robot: &RobotRun) -> Result<FleetProcess, FleetError> {
        let port = self.relays.get(number).map_or(self.port, |relay| relay.port);
        self.starter.uplink(&robot.folder, &robot.robot, port)
    }

    fn status(&self) -> Status {
        Status::read(&self.folder).unwrap_or_default()
    }

    /// Fails where a process ended that was not killed. A base that ends well has, as it says, everything.
    fn check(&mut self) -> Result<(), FleetError> {
        if self.base.ended() == Some(false) {
            return Err(FleetError::Ended("the base".into()));
        }
        match self.uplinks.iter_mut().position(|uplink| uplink.ended().is_some()) {
            Some(k) => Err(FleetError::Ended(format!("the uplink of robot{}", k + 1))),
            None => Ok(()),
        }
    }

    fn strike_all(
        &mut self,
        strikes: &[FleetStrike],
        robots: &mut [RobotRun],
        report: &mut FleetReport,
        (patience, on_fault): (Patience<'_>, OnFault<'_>),
    ) -> Result<(), FleetError> {
        for (number, strike) in strikes.iter().enumerate() {
            on_fault(number, "faults");
            for robot in &mut *robots {
                robot.grow_to(number as u64 + 1, strikes.len() as u64 + 1)?;
            }
            self.strike(strike, robots, report, patience)?;
            report.strikes.push(*strike);
            patience.sleep(strike.pause)?;
            self.check()?;
        }
        Ok(())
    }

    fn strike(
        &mut self,
        strike: &FleetStrike,
        robots: &[RobotRun],
        report: &mut FleetReport,
        patience: Patience<'_>,
    ) -> Result<(), FleetError> {
        let (k, holds) = (strike.robot, strike.holds);
        let relay = &self.relays[k];
        match strike.fault {
            FleetFault::Cut => relay.cut(holds),
            FleetFault::Delay => relay.delay(holds),
            FleetFault::Throttle => relay.throttle(holds),
            FleetFault::Repeat => relay.repeat(holds),
            FleetFault::Reconnect => {
                // So that there is something under way.
                relay.delay(holds);
                patience.sleep(holds)?;
                relay.reconnect();
            }
            FleetFault::KillUplink => {
                self.uplinks[k].kill();
                patience.sleep(holds)?;
                self.uplinks[k] = self.uplink(k, &robots[k])?;
            }
            FleetFault::KillBase => {
                self.take_refused(report);
                self.base.kill();
                patience.sleep(holds)?;
                self.base = self.starter.base(&self.folder, self.port, robots.len())?;
            }
        }
        Ok(())
    }

    /// Adds what this base has refused; the next one begins to count anew.
    fn take_refused(&self, report: &mut FleetReport) {
        let status = self.status();
        // The status of a base before this one was counted when that was killed.
        for refused in status.refused.iter().filter(|_| status.pid == self.base.0.id()) {
            *report.refused.entry(refused.what).or_default() += refused.n;
        }
    }

    /// Ends all faults, lets the runs come to their end, and waits until the base has all of them and its
    /// map; answers after how many seconds it had them.
    fn finish(&mut self, robots: &mut [RobotRun], patience: Patience<'_>) -> Result<f64, FleetError> {
        self.relays.iter().for_each(Relay::heal);
        let begun = Instant::now();
        for robot in &mut *robots {
            robot.grow_to(1, 1)?;
        }
        let n_robots = robots.len();
        let mut caught_up = None;
        patience.wait_for("the base to have everything", || {
            let status = self.status();
            let is_ended = self.base.ended().is_some();
            if is_ended || (status.runs.len() == n_robots && status.runs.iter().all(|run| run.is_ended)) {
                caught_up.get_or_insert(begun.elapsed().as_secs_f64());
            }
            is_ended
        })?;
        match self.base.ended() {
            Some(true) => Ok(caught_up.unwrap_or_default()),
            _ => Err(FleetError::Ended("the base".into())),
        }
    }
}

/// Flips a bit in the middle of a copy's journal.
fn flip(base: &Path, robot: &RobotRun) -> Result<(), FleetError> {
    let path = copy_of(base, &robot.robot)?.join(JOURNALS[0].file());
    let mut bytes = std::fs::read(&path).map_err(FleetError::io("read", &path))?;
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&path, bytes).map_err(FleetError::io("write", &path))
}

fn compare(
    disturbed: &Path,
    undisturbed: &Path,
    robots: &[RobotRun],
    report: &mut FleetReport,
) -> Result<(), FleetError> {
    for (number, robot) in robots.iter().enumerate() {
        for base in [disturbed, undisturbed] {
            let differs = match copy_of(base, &robot.robot) {
                Ok(copy) => robot.difference(&copy)?,
                Err(error) => Some(error.to_string()),
            };
            report.robots[number].identical |= base == disturbed && differs.is_none();
            report.broken.extend(differs.map(|words| format!("{}: {words}", robot.robot)));
        }
    }
    let (found, expected) = (map_files(disturbed)?, map_files(undisturbed)?);
    report.map_files = found.len();
    let differs = map_difference(&found, &expected);
    report.is_map_identical = differs.is_none();
    report.broken.extend(differs);
    Ok(())
}
