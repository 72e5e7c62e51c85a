//! Stop conditions: the supervisor is gone or has asked for an end, or a signal has come.

use rustix::process::{Signal, getpid, kill_process};
use std::io::Read;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Looks that a process which is told to end has until it is ended: less than a supervisor gives it, for that may be
/// gone. Looks are counted, and not time, in which the machine may sleep.
const LOOKS: u32 = 10;
/// Time between them.
const LOOK: Duration = Duration::from_millis(100);

/// Ends this process, which does not do so itself: it hangs, or waits without a limit in an opening of iceoryx2 for
/// what the dead left half made, which a supervisor would remove.
fn end_late() {
    (0..LOOKS).for_each(|_| std::thread::sleep(LOOK));
    tracing::warn!("told to end, and still at work: killed");
    let _ = kill_process(getpid(), Signal::KILL);
}

/// Says when it is time to finish the frame in hand, make it durable and end.
#[derive(Clone, Debug)]
pub struct Lifeline {
    is_cut: Arc<AtomicBool>,
}

impl Lifeline {
    /// Listens to SIGTERM, SIGINT and, where `watch_stdin`, to the end of standard input: a pipe
    /// that the supervisor holds, which the kernel closes with it however it dies.
    ///
    /// # Errors
    /// Where a signal handler or the thread cannot be set up.
    pub fn hold(watch_stdin: bool) -> std::io::Result<Self> {
        let is_cut = Arc::new(AtomicBool::new(false));
        for signal in [signal_hook::consts::SIGTERM, signal_hook::consts::SIGINT] {
            signal_hook::flag::register(signal, Arc::clone(&is_cut))?;
        }
        // A file that may not grow is an error to tell, not a signal to die of.
        signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default())?;
        if watch_stdin {
            let flag = Arc::clone(&is_cut);
            std::thread::Builder::new().name("lifeline".into()).spawn(move || {
                let mut word = [0u8; 64];
                // Nothing is ever written: a read returns when the other end is closed.
                while matches!(std::io::stdin().lock().read(&mut word), Ok(n) if n > 0) {}
                flag.store(true, Ordering::Release);
                end_late();
            })?;
        }
        Ok(Self { is_cut })
    }

    /// Whether it is time to end.
    pub fn is_cut(&self) -> bool {
        self.is_cut.load(Ordering::Acquire)
    }
}
