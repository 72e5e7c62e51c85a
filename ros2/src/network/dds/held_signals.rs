//! Threads that no signal interrupts.
//!
//! RustDDS ends its loops where a signal interrupts them ([`super::loops`]). The end of a child is one: a thread that
//! starts a program holds all signals until that runs, and a program that ends at once has its signal delivered to
//! another thread.

use nix::sys::signal::{SigSet, SigmaskHow};

/// All signals are held from this thread, and from those that it starts, until this is dropped.
pub(super) struct HeldSignals {
    before: Option<SigSet>,
}

impl HeldSignals {
    /// Holds them; where the system refuses it, nothing is changed.
    pub(super) fn hold() -> Self {
        Self { before: SigSet::all().thread_swap_mask(SigmaskHow::SIG_SETMASK).ok() }
    }
}

impl Drop for HeldSignals {
    fn drop(&mut self) {
        // Refused for a mask that is none.
        let _ = self.before.map(|before| before.thread_set_mask());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nix::sys::signal::Signal;

    #[test]
    fn threads_that_are_started_meanwhile_are_not_interrupted() {
        let holds = || SigSet::thread_get_mask().unwrap().contains(Signal::SIGCHLD);
        let held = HeldSignals::hold();
        assert!(holds() && std::thread::spawn(holds).join().unwrap());
        drop(held);
        assert!(!holds() && !std::thread::spawn(holds).join().unwrap());
    }
}
