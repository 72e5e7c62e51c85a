//! Places where a process dies on purpose, so that each window between two durable steps is hit by
//! a test and not by luck.

use std::collections::BTreeMap;

/// Environment variable that names kill points for one process: `stored:12,journaled:40:panic`,
/// each `point:index` with a fault behind it where it is not `kill`. A `*` at the end lets the
/// supervisor hand the word to every life of the stage instead of its first alone.
pub const KILL_POINTS_VARIABLE: &str = "TESSERA_KILL_POINTS";

/// All kill points with the stage that has them; the number is a frame, or a request for the last four.
pub const KILL_POINTS: [(&str, &str); 19] = [
    ("sensor", "opened"),
    ("sensor", "read"),
    ("sensor", "sent"),
    ("reconstruct", "opened"),
    ("reconstruct", "received"),
    ("reconstruct", "computed"),
    ("reconstruct", "sent"),
    ("align", "opened"),
    ("align", "received"),
    ("align", "computed"),
    ("align", "stored"),
    ("align", "journaled"),
    ("align", "published"),
    ("align", "acknowledged"),
    ("align", "ended"),
    ("optimise", "opened"),
    ("optimise", "received"),
    ("optimise", "solving"),
    ("optimise", "journaled"),
];

/// What happens at a kill point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fault {
    /// SIGKILL: somebody else's doing, as far as the supervisor can tell.
    Kill,
    /// A bug: a panic.
    Panic,
    /// A bug in unsafe code: SIGSEGV.
    Segv,
    /// A loop without an end.
    Hang,
    /// Frozen from outside: SIGSTOP.
    Stop,
}

/// The kill points of this process.
#[derive(Clone, Debug, Default)]
pub struct KillPoints {
    points: BTreeMap<(String, u64), Fault>,
}

impl KillPoints {
    /// Those that the environment names; none where it does not.
    pub fn from_environment() -> Self {
        Self::parse(&std::env::var(KILL_POINTS_VARIABLE).unwrap_or_default())
    }

    fn parse(text: &str) -> Self {
        let points = text.split(',').filter_map(|word| {
            let mut parts = word.trim_end_matches('*').split(':');
            let (point, index) = (parts.next()?, parts.next()?);
            let fault = match parts.next() {
                None | Some("kill") => Fault::Kill,
                Some("panic") => Fault::Panic,
                Some("segv") => Fault::Segv,
                Some("hang") => Fault::Hang,
                Some("stop") => Fault::Stop,
                Some(_) => return None,
            };
            Some(((point.to_string(), index.parse().ok()?), fault))
        });
        Self { points: points.collect() }
    }

    /// Fails here where a test asked for it.
    ///
    /// # Panics
    /// Where that is what the test asked for.
    pub fn pass(&self, point: &str, index: u64) {
        if self.points.is_empty() {
            return;
        }
        let fault = self.points.get(&(point.to_string(), index));
        match fault {
            None => {}
            Some(Fault::Kill) => die(rustix::process::Signal::KILL),
            Some(Fault::Segv) => die(rustix::process::Signal::SEGV),
            Some(Fault::Hang) => sleep_for_ever(),
            Some(Fault::Panic) => panic!("told to panic at {point}:{index}"),
            Some(Fault::Stop) => {
                let _ =
                    rustix::process::kill_process(rustix::process::getpid(), rustix::process::Signal::STOP);
            }
        }
    }
}

/// Rust's own handler takes the first SIGSEGV for a stack that overflowed and waits for the next.
fn die(signal: rustix::process::Signal) -> ! {
    loop {
        let _ = rustix::process::kill_process(rustix::process::getpid(), signal);
        std::thread::sleep(std::time::Duration::from_millis(1));
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
    fn only_what_is_named_kills() {
        let points = KillPoints::parse("stored:3,,nonsense,journaled:x,computed:4:panic*,sent:1:nonsense");
        assert_eq!(points.points.len(), 2);
        assert_eq!(points.points[&("computed".to_string(), 4)], Fault::Panic);
        points.pass("stored", 4);
        points.pass("journaled", 3);
    }
}
