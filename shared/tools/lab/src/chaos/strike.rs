//! Carrying a fault out on a process, from outside.

use super::schedule::{FaultKind, Random};
use rustix::process::{Pid, Resource, Rlimit, Signal, kill_process, prlimit};
use std::time::Duration;
use tessera_stage::monotonic_nanos;

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
        FaultKind::Drop | FaultKind::Corrupt | FaultKind::IndexJump | FaultKind::SyncFails => return None,
    };
    done.ok().map(|()| at)
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
