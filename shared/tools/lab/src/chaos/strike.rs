//! Carrying a fault out on a process, from outside.

use super::process::stage_pids;
use super::schedule::{FaultKind, Random};
use rustix::process::{Pid, Resource, Rlimit, Signal, kill_process, prlimit};
use std::time::Duration;
use tessera_stage::monotonic_nanos;

/// Longest time from one process that wakes to the next, milliseconds: all five are awake within `flow.hang_s`
/// at its least, 0.5 s.
const WAKING_MS: u64 = 50;

/// Strikes a process; answers when, on the monotonic clock, or `None` where it was gone.
///
/// A stopped process goes on when this returns; the others are dead or will die by themselves.
pub(super) fn strike(pid: u32, kind: FaultKind, random: &mut Random) -> Option<u64> {
    let process = Pid::from_raw(i32::try_from(pid).ok()?)?;
    let at = monotonic_nanos();
    let done = match kind {
        FaultKind::Kill
        | FaultKind::Flip
        | FaultKind::PageZeroed
        | FaultKind::StoreCut
        | FaultKind::StoreLost => kill_process(process, Signal::KILL),
        FaultKind::Segv => kill_process(process, Signal::SEGV),
        FaultKind::Abort => kill_process(process, Signal::ABORT),
        FaultKind::Stop => pause(process, 20 + random.below(400)),
        FaultKind::Slow => (0..10).try_for_each(|_| {
            let paused = pause(process, 20);
            std::thread::sleep(Duration::from_millis(5));
            paused
        }),
        FaultKind::Memory => limit(process, Resource::As),
        FaultKind::Full => limit(process, Resource::Fsize),
        FaultKind::Sleep
        | FaultKind::Drop
        | FaultKind::Corrupt
        | FaultKind::IndexJump
        | FaultKind::SyncFails => return None,
    };
    done.ok().map(|()| at)
}

/// Stops a supervisor and its stages for `asleep`, then continues them one by one in any order; answers when.
pub(super) fn sleep(supervisor: u32, asleep: Duration, random: &mut Random) -> Option<u64> {
    let signal = |pid: u32, signal| {
        let process = i32::try_from(pid).ok().and_then(Pid::from_raw);
        process.is_some_and(|process| kill_process(process, signal).is_ok())
    };
    let at = monotonic_nanos();
    // It first: none of its stages dies unseen or is started while others fall asleep.
    if !signal(supervisor, Signal::STOP) {
        return None;
    }
    let mut asleep_pids: Vec<u32> = stage_pids(supervisor).into_iter().map(|(_, pid)| pid).collect();
    asleep_pids.retain(|pid| signal(*pid, Signal::STOP));
    std::thread::sleep(asleep);
    asleep_pids.push(supervisor);
    random.shuffle(&mut asleep_pids);
    for pid in asleep_pids {
        signal(pid, Signal::CONT);
        std::thread::sleep(Duration::from_millis(random.below(WAKING_MS)));
    }
    Some(at)
}

fn pause(process: Pid, millis: u64) -> rustix::io::Result<()> {
    kill_process(process, Signal::STOP)?;
    std::thread::sleep(Duration::from_millis(millis));
    kill_process(process, Signal::CONT)
}

/// From here on the process gets no more of it.
fn limit(process: Pid, resource: Resource) -> rustix::io::Result<()> {
    prlimit(Some(process), resource, Rlimit { current: Some(0), maximum: Some(0) }).map(drop)
}
