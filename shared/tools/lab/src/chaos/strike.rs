//! Carrying a fault out on a process, from outside.

use super::schedule::{FaultKind, Random};
use rustix::process::{Pid, Resource, Rlimit, Signal, kill_process, prlimit};
use std::os::unix::fs::FileExt;
use std::path::PathBuf;
use std::time::Duration;
use tessera_stage::{RunFiles, monotonic_nanos};

/// Strikes a process; answers when, on the monotonic clock, or `None` where it was gone.
///
/// A stopped process goes on when this returns; the others are dead or will die by themselves.
pub(super) fn strike(pid: u32, kind: FaultKind, random: &mut Random) -> Option<u64> {
    let process = Pid::from_raw(i32::try_from(pid).ok()?)?;
    let at = monotonic_nanos();
    let done = match kind {
        FaultKind::Kill | FaultKind::Flip => kill_process(process, Signal::KILL),
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
        FaultKind::Drop | FaultKind::Corrupt => return None,
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

/// A bit of a durable file that was flipped.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Flip {
    /// The file.
    pub(super) path: PathBuf,
    /// The byte that was hit.
    pub(super) offset: u64,
    /// What it was before.
    pub(super) before: u8,
}

/// Flips a random bit of a journal or of the store; `None` where there is none to flip.
pub(super) fn flip(files: &RunFiles, random: &mut Random) -> Option<Flip> {
    let paths = [files.align_journal(), files.optimise_journal(), files.store()];
    let path = paths[random.below(3) as usize].clone();
    let file = std::fs::OpenOptions::new().read(true).write(true).open(&path).ok()?;
    let len = file.metadata().ok()?.len();
    let offset = (len > 0).then(|| random.below(len))?;
    let mut byte = [0];
    file.read_exact_at(&mut byte, offset).ok()?;
    let before = byte[0];
    file.write_all_at(&[before ^ (1 << random.below(8))], offset).ok()?;
    Some(Flip { path, offset, before })
}

/// Puts the byte back.
pub(super) fn mend(flip: &Flip) -> std::io::Result<()> {
    let file = std::fs::OpenOptions::new().write(true).open(&flip.path)?;
    file.write_all_at(&[flip.before], flip.offset)
}
