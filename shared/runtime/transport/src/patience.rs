//! Opening what may still be half made or taken by the dead.

use crate::error::TransportError;
use iceoryx2::prelude::{Node, ServiceName, ipc};
use std::time::{Duration, Instant};

/// How long opening is tried while dead predecessors are cleaned up.
const PATIENCE: Duration = Duration::from_secs(3);
/// Time that the supervisor has for cleaning up before another process does: there may be none.
const SUPERVISOR: Duration = Duration::from_millis(250);
/// Longest time that an attempt counts, above iceoryx2's own 500 ms: in one that took longer the machine slept, and
/// so did those that are waited for.
const TURN: Duration = Duration::from_secs(1);

/// A name as iceoryx2 takes it.
pub(crate) fn service_name(name: &str) -> Result<ServiceName, TransportError> {
    ServiceName::new(name)
        .map_err(|e| TransportError::Open { what: format!("service {name}"), reason: format!("{e:?}") })
}

/// Tries again while places may still be taken by the dead or a service is half made.
pub(crate) fn patiently<T, E: std::fmt::Debug>(
    what: &str,
    node: Option<&Node<ipc::Service>>,
    mut attempt: impl FnMut() -> Result<T, E>,
) -> Result<T, TransportError> {
    let (mut waited, mut turn) = (Duration::ZERO, Instant::now());
    loop {
        match attempt() {
            Ok(made) => return Ok(made),
            Err(error) if waited > PATIENCE => {
                return Err(TransportError::Open { what: what.into(), reason: format!("{error:?}") });
            }
            Err(_) => {
                if let Some(node) = node.filter(|_| waited > SUPERVISOR) {
                    let _ = node.blocking_cleanup_dead_nodes(Duration::from_millis(100));
                }
                std::thread::sleep(Duration::from_millis(5));
                waited = waited.saturating_add(turn.elapsed().min(TURN));
                turn = Instant::now();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_attempt_in_which_the_machine_slept_is_not_the_last() {
        let mut n = 0;
        let made = patiently("a service", None, || {
            n += 1;
            std::thread::sleep(if n == 1 { PATIENCE + TURN } else { Duration::ZERO });
            if n < 3 { Err("half made") } else { Ok(n) }
        });
        assert_eq!(made.unwrap(), 3);
    }
}
