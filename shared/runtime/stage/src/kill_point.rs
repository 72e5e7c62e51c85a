//! Places where a process dies on purpose, or errs, so that each window between two durable steps
//! is hit by a test and not by luck.

use rustix::process::{Resource, Rlimit, Signal, getpid, kill_process, setrlimit};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::clock::monotonic_nanos;

/// Environment variable that names kill points for one process: `stored:12,journaled:40:panic`,
/// each `point:index` with a fault behind it where it is not `kill`. The end of a word tells the
/// supervisor which lives of the stage get it: the first alone; with `*` every life; with `+` every
/// life until one has struck, as the log tells.
pub const KILL_POINTS_VARIABLE: &str = "TESSERA_KILL_POINTS";

/// All kill points with the stage that has them; the number is a frame, or a request for those of `optimise`.
pub const KILL_POINTS: [(&str, &str); 22] = [
    ("sensor", "opened"),
    ("sensor", "read"),
    ("sensor", "sent"),
    ("reconstruct", "opened"),
    ("reconstruct", "received"),
    ("reconstruct", "extracted"),
    ("reconstruct", "computed"),
    ("reconstruct", "sent"),
    ("align", "opened"),
    ("align", "received"),
    ("align", "computed"),
    ("align", "stored"),
    ("align", "journaled"),
    ("align", "published"),
    ("align", "acknowledged"),
    ("align", "checkpointed"),
    ("align", "ended"),
    ("optimise", "opened"),
    ("optimise", "received"),
    ("optimise", "solving"),
    ("optimise", "journaled"),
    ("optimise", "checkpointed"),
];

/// What happens at a kill point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fault {
    /// SIGKILL: a kill from outside, as far as the supervisor can see.
    Kill,
    /// A bug: a panic.
    Panic,
    /// A bug in unsafe code: SIGSEGV.
    Segv,
    /// SIGABRT.
    Abort,
    /// No memory left: the next allocation fails.
    Memory,
    /// A full disk: no file can grow.
    Full,
    /// A disk with an error: no sync succeeds.
    SyncFails,
    /// A loop without an end.
    Hang,
    /// Frozen from outside: SIGSTOP.
    Stop,
    /// A pause of [`SLOW`].
    Slow,
    /// The message is not sent.
    Drop,
    /// The message says nonsense.
    Corrupt,
    /// The message has an index far ahead, as of a counter that was misread.
    IndexJump,
}

impl Fault {
    /// It befalls a message, not the process.
    fn is_of_message(self) -> bool {
        matches!(self, Self::Drop | Self::Corrupt | Self::IndexJump)
    }
}

/// All faults by their names in a plan.
const FAULTS: [(&str, Fault); 13] = [
    ("kill", Fault::Kill),
    ("panic", Fault::Panic),
    ("segv", Fault::Segv),
    ("abort", Fault::Abort),
    ("memory", Fault::Memory),
    ("full", Fault::Full),
    ("sync-fails", Fault::SyncFails),
    ("hang", Fault::Hang),
    ("stop", Fault::Stop),
    ("slow", Fault::Slow),
    ("drop", Fault::Drop),
    ("corrupt", Fault::Corrupt),
    ("index-jump", Fault::IndexJump),
];

/// Names of the faults that a kill point knows.
pub fn fault_names() -> impl Iterator<Item = &'static str> {
    FAULTS.iter().map(|(name, _)| *name)
}

/// Points in front of which a message is about to be sent: `drop`, `corrupt` and `index-jump` work only here.
pub const MESSAGE_POINTS: [(&str, &str); 2] = [("sensor", "read"), ("reconstruct", "computed")];

/// How long a slow stage takes over its frame.
const SLOW: Duration = Duration::from_millis(300);

/// What becomes of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Delivery {
    /// It is sent.
    Whole,
    /// It is not sent.
    Dropped,
    /// It is sent with nonsense in it.
    Corrupt,
    /// It is sent with an index far ahead.
    Jumped,
}

#[derive(Debug)]
struct KillPoint {
    point: String,
    index: u64,
    fault: Fault,
    has_struck: AtomicBool,
}

/// The kill points of this process; each strikes once in a life.
#[derive(Debug, Default)]
pub struct KillPoints {
    points: Vec<KillPoint>,
}

impl KillPoints {
    /// Those that the environment names, in a run that was started with `--faults`; else none: a variable
    /// alone ends no process of a robot.
    pub fn of_run(are_allowed: bool) -> Self {
        Self::named(&std::env::var(KILL_POINTS_VARIABLE).unwrap_or_default(), are_allowed)
    }

    fn named(text: &str, are_allowed: bool) -> Self {
        if are_allowed {
            return Self::parse(text);
        }
        if !text.is_empty() {
            tracing::warn!("{KILL_POINTS_VARIABLE} is ignored: the run was started without --faults");
        }
        Self::default()
    }

    fn parse(text: &str) -> Self {
        let points = text.split(',').filter_map(|word| {
            let mut parts = word.trim_end_matches(['*', '+']).split(':');
            let (point, index) = (parts.next()?, parts.next()?);
            let name = parts.next().unwrap_or("kill");
            let fault = FAULTS.iter().find(|(known, _)| *known == name)?.1;
            Some(KillPoint {
                point: point.to_string(),
                index: index.parse().ok()?,
                fault,
                has_struck: AtomicBool::new(false),
            })
        });
        Self { points: points.collect() }
    }

    /// Fails here where a test asked for it.
    ///
    /// # Panics
    /// Where that is what the test asked for.
    pub fn pass(&self, point: &str, index: u64) {
        if let Some(fault) = self.strike(point, index, |fault| !fault.is_of_message()) {
            fail(fault, point, index);
        }
    }

    /// What becomes of the message that is about to be sent; to be asked behind [`Self::pass`].
    pub fn deliver(&self, point: &str, index: u64) -> Delivery {
        match self.strike(point, index, Fault::is_of_message) {
            None => Delivery::Whole,
            Some(Fault::Corrupt) => Delivery::Corrupt,
            Some(Fault::IndexJump) => Delivery::Jumped,
            Some(_) => Delivery::Dropped,
        }
    }

    /// The fault of that kind at this place, once; says so in the log first.
    fn strike(&self, point: &str, index: u64, is_of_kind: impl Fn(Fault) -> bool) -> Option<Fault> {
        let here = self.points.iter().find(|known| {
            known.index == index
                && known.point == point
                && is_of_kind(known.fault)
                && !known.has_struck.swap(true, Ordering::Relaxed)
        })?;
        let name = FAULTS.iter().find(|(_, fault)| *fault == here.fault)?.0;
        tracing::warn!(at_nanos = monotonic_nanos(), "{STRUCK} {point}:{index}:{name}");
        Some(here.fault)
    }
}

/// How a log line about a fault that has struck begins; behind it `point:index:fault`.
pub const STRUCK: &str = "struck by";

fn fail(fault: Fault, point: &str, index: u64) {
    match fault {
        Fault::Kill => die(Signal::KILL),
        Fault::Segv => die(Signal::SEGV),
        Fault::Abort => std::process::abort(),
        Fault::Memory => run_out_of_memory(),
        Fault::Full => {
            let limit = Rlimit { current: Some(0), maximum: Some(0) };
            let _ = setrlimit(Resource::Fsize, limit);
        }
        Fault::SyncFails => tessera_journal::let_syncs_fail(),
        Fault::Hang => sleep_for_ever(),
        Fault::Panic => panic!("told to panic at {point}:{index}"),
        Fault::Stop => {
            let _ = kill_process(getpid(), Signal::STOP);
        }
        Fault::Slow => std::thread::sleep(SLOW),
        Fault::Drop | Fault::Corrupt | Fault::IndexJump => {}
    }
}

/// Rust's own handler takes the first SIGSEGV for a stack that overflowed and waits for the next.
fn die(signal: Signal) -> ! {
    loop {
        let _ = kill_process(getpid(), signal);
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// An allocation that the limit forbids ends the process as any failed allocation does.
fn run_out_of_memory() -> ! {
    let _ = setrlimit(Resource::As, Rlimit { current: Some(0), maximum: Some(0) });
    let mut hoard: Vec<Vec<u8>> = Vec::new();
    loop {
        hoard.push(vec![1; 64 << 20]);
    }
}

fn sleep_for_ever() -> ! {
    loop {
        std::thread::park();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_variable_alone_makes_no_fault() {
        assert_eq!(KillPoints::named("stored:3,journaled:4:panic*", false).points.len(), 0);
        assert_eq!(KillPoints::named("stored:3,journaled:4:panic*", true).points.len(), 2);
    }

    #[test]
    fn only_what_is_named_strikes_and_only_once() {
        let points = KillPoints::parse(
            "stored:3,,nonsense,journaled:x,computed:4:panic*,sent:1:nonsense,read:5:drop+,read:6:corrupt",
        );
        assert_eq!(points.points.len(), 4);
        assert_eq!((points.points[1].fault, points.points[1].index), (Fault::Panic, 4));
        points.pass("stored", 4);
        points.pass("journaled", 3);
        points.pass("read", 5);
        assert_eq!(points.deliver("read", 4), Delivery::Whole);
        assert_eq!(points.deliver("read", 5), Delivery::Dropped);
        assert_eq!(points.deliver("read", 5), Delivery::Whole);
        assert_eq!(points.deliver("read", 6), Delivery::Corrupt);
    }
}
