//! Whether the loops of RustDDS go on.
//!
//! RustDDS 0.15 ends its loops for good where a wait of theirs is interrupted (`EINTR`): when this process was stopped and
//! goes on, when the machine wakes up from sleep, when a debugger is attached. Nothing is received and sent after
//! that, and no call returns an error. Its threads are gone then, which the system tells.

use std::time::{Duration, Instant};

/// A participant has one for messages and one for discovery.
const N_LOOPS: usize = 2;
/// What the names of their threads begin with.
const NAME: &str = "RustDDS";
/// Time between two looks.
const LOOK: Duration = Duration::from_millis(500);

/// The loops of one participant.
#[derive(Debug, Default)]
pub(super) struct Loops {
    looked: Option<Instant>,
    have_begun: bool,
}

impl Loops {
    /// Whether one of them has ended; `false` where the system does not tell.
    pub(super) fn have_ended(&mut self) -> bool {
        if self.looked.is_some_and(|at| at.elapsed() < LOOK) {
            return false;
        }
        self.looked = Some(Instant::now());
        self.judge(n_threads())
    }

    fn judge(&mut self, n_threads: usize) -> bool {
        self.have_begun |= n_threads >= N_LOOPS;
        self.have_begun && n_threads < N_LOOPS
    }
}

/// Threads of RustDDS in this process.
fn n_threads() -> usize {
    let Ok(threads) = std::fs::read_dir("/proc/self/task") else { return 0 };
    let names = threads.flatten().filter_map(|thread| std::fs::read(thread.path().join("comm")).ok());
    names.filter(|name| name.starts_with(NAME.as_bytes())).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_loop_has_ended_where_a_thread_is_gone_that_was_there() {
        let mut loops = Loops::default();
        assert_eq!([0, 1, 2, 3, 2, 1].map(|n| loops.judge(n)), [false, false, false, false, false, true]);
    }
}
