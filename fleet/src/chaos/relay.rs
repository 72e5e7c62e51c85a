//! A TCP relay between one robot and the base, on this machine alone, that cuts, delays, throttles and
//! repeats what it carries. Each fault ends by itself.

use super::pump::{RelayDirection, pump};
use crate::error::FleetError;
use serde::Serialize;
use std::net::{Ipv4Addr, Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// How long a piece is under way while a link is slow.
pub const DELAY: Duration = Duration::from_millis(500);
/// Bytes a second of a link that is throttled.
pub const THROTTLED_BYTES_PER_S: u64 = 50_000;
/// Connections of a relay at a time, at most; further ones are refused.
const MOST_CONNECTIONS: usize = 32;

/// What a relay has carried.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct CarriedBytes {
    /// Bytes from the robot to the base, those that the relay repeated included.
    pub up_bytes: u64,
    /// Bytes from the base to the robot.
    pub down_bytes: u64,
    /// Bytes that the relay sent once more: in their stream, or as an attempt of their own.
    pub repeated_bytes: u64,
    /// Connections that were made.
    pub connections: u64,
}

/// What the threads of a relay share.
pub(super) struct RelayedLink {
    pub(super) base: SocketAddr,
    begun: Instant,
    is_closed: AtomicBool,
    /// Ends of the faults, nanoseconds since `begun`.
    cut_until: AtomicU64,
    delay_until: AtomicU64,
    throttle_until: AtomicU64,
    /// Attempts to connect come twice until then.
    repeat_until: AtomicU64,
    /// The next piece comes twice in its stream.
    pub(super) repeats_next: AtomicBool,
    pub(super) up_bytes: AtomicU64,
    pub(super) down_bytes: AtomicU64,
    pub(super) repeated_bytes: AtomicU64,
    connections: AtomicU64,
    /// Both ends of each connection, and whether it still carries something.
    open: Mutex<Vec<(TcpStream, TcpStream, Arc<AtomicBool>)>>,
}

impl RelayedLink {
    fn lasts(&self, until: &AtomicU64) -> bool {
        self.begun.elapsed().as_nanos() < u128::from(until.load(Ordering::Relaxed))
    }

    fn begin(&self, until: &AtomicU64, lasting: Duration) {
        let end = (self.begun.elapsed() + lasting).as_nanos();
        until.store(u64::try_from(end).unwrap_or(u64::MAX), Ordering::Relaxed);
    }

    pub(super) fn is_cut(&self) -> bool {
        self.lasts(&self.cut_until) || self.is_closed.load(Ordering::Relaxed)
    }

    pub(super) fn delay(&self) -> Duration {
        if self.lasts(&self.delay_until) { DELAY } else { Duration::ZERO }
    }

    /// Bytes a second; `None`: as fast as it goes.
    pub(super) fn bytes_per_s(&self) -> Option<u64> {
        self.lasts(&self.throttle_until).then_some(THROTTLED_BYTES_PER_S)
    }

    pub(super) fn repeats_attempts(&self) -> bool {
        self.lasts(&self.repeat_until)
    }

    fn open(&self) -> MutexGuard<'_, Vec<(TcpStream, TcpStream, Arc<AtomicBool>)>> {
        // A thread that panicked left a list of streams behind, nothing half written.
        self.open.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The relay; its threads end with it.
pub struct Relay {
    /// Where the robot connects to, on 127.0.0.1.
    pub port: u16,
    link: Arc<RelayedLink>,
}

impl Relay {
    /// A relay to the base on a port of this machine.
    ///
    /// # Errors
    /// Where the system has no port for it.
    pub fn to(base_port: u16) -> Result<Self, FleetError> {
        let network = |error: std::io::Error| FleetError::Network(format!("relay: {error}"));
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).map_err(network)?;
        let port = listener.local_addr().map_err(network)?.port();
        let none = || AtomicU64::new(0);
        let link = Arc::new(RelayedLink {
            base: SocketAddr::from((Ipv4Addr::LOCALHOST, base_port)),
            begun: Instant::now(),
            is_closed: AtomicBool::new(false),
            cut_until: none(),
            delay_until: none(),
            throttle_until: none(),
            repeat_until: none(),
            repeats_next: AtomicBool::new(false),
            up_bytes: none(),
            down_bytes: none(),
            repeated_bytes: none(),
            connections: none(),
            open: Mutex::new(Vec::new()),
        });
        let shared = Arc::clone(&link);
        std::thread::spawn(move || accept(&listener, &shared));
        Ok(Self { port, link })
    }

    /// Ends all connections, and lets none come for so long.
    pub fn cut(&self, lasting: Duration) {
        self.link.begin(&self.link.cut_until, lasting);
        for (robot, base, _) in self.link.open().drain(..) {
            let _ = robot.shutdown(Shutdown::Both);
            let _ = base.shutdown(Shutdown::Both);
        }
    }

    /// What comes within this time is under way for [`DELAY`].
    pub fn delay(&self, lasting: Duration) {
        self.link.begin(&self.link.delay_until, lasting);
    }

    /// Carries [`THROTTLED_BYTES_PER_S`] in each direction for so long.
    pub fn throttle(&self, lasting: Duration) {
        self.link.begin(&self.link.throttle_until, lasting);
    }

    /// Sends the next piece to the base twice, and for so long what a robot sends first, which the base
    /// gets over a connection of its own too.
    pub fn repeat(&self, lasting: Duration) {
        self.link.begin(&self.link.repeat_until, lasting);
        self.link.repeats_next.store(true, Ordering::Relaxed);
    }

    /// Ends the robot's side of all connections: it connects anew, and what is still under way comes to the
    /// base later than what the robot sends then.
    pub fn reconnect(&self) {
        for (robot, ..) in self.link.open().iter() {
            let _ = robot.shutdown(Shutdown::Both);
        }
    }

    /// Ends all faults.
    pub fn heal(&self) {
        let RelayedLink { cut_until, delay_until, throttle_until, repeat_until, .. } = &*self.link;
        for until in [cut_until, delay_until, throttle_until, repeat_until] {
            until.store(0, Ordering::Relaxed);
        }
        self.link.repeats_next.store(false, Ordering::Relaxed);
    }

    /// What it has carried.
    pub fn carried(&self) -> CarriedBytes {
        let RelayedLink { up_bytes, down_bytes, repeated_bytes, connections, .. } = &*self.link;
        let [up_bytes, down_bytes, repeated_bytes, connections] =
            [up_bytes, down_bytes, repeated_bytes, connections].map(|n| n.load(Ordering::Relaxed));
        CarriedBytes { up_bytes, down_bytes, repeated_bytes, connections }
    }
}

impl Drop for Relay {
    fn drop(&mut self) {
        self.link.is_closed.store(true, Ordering::Relaxed);
        self.cut(Duration::ZERO);
        // Wakes the listener, which sees that it is over.
        let _ = TcpStream::connect((Ipv4Addr::LOCALHOST, self.port));
    }
}

fn accept(listener: &TcpListener, link: &Arc<RelayedLink>) {
    for robot in listener.incoming().flatten() {
        if link.is_closed.load(Ordering::Relaxed) {
            return;
        }
        if link.is_cut() {
            continue;
        }
        let mut open = link.open();
        open.retain(|(_, _, is_carrying)| is_carrying.load(Ordering::Relaxed));
        if open.len() >= MOST_CONNECTIONS {
            continue;
        }
        let Ok(base) = TcpStream::connect(link.base) else { continue };
        let copies = [&robot, &base, &robot, &base].map(TcpStream::try_clone);
        let [Ok(robot_too), Ok(base_too), Ok(robot_kept), Ok(base_kept)] = copies else { continue };
        let is_carrying = Arc::new(AtomicBool::new(true));
        open.push((robot_kept, base_kept, Arc::clone(&is_carrying)));
        drop(open);
        link.connections.fetch_add(1, Ordering::Relaxed);
        pump(robot, base, link, RelayDirection::Up(is_carrying));
        pump(base_too, robot_too, link, RelayDirection::Down);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Read, Write};

    /// A relay, the robot's end and the base's end of a connection through it.
    fn connected() -> (Relay, TcpStream, TcpStream, TcpListener) {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        let relay = Relay::to(listener.local_addr().unwrap().port()).unwrap();
        let robot = TcpStream::connect((Ipv4Addr::LOCALHOST, relay.port)).unwrap();
        let base = listener.accept().unwrap().0;
        (relay, robot, base, listener)
    }

    #[test]
    fn bytes_come_through_late_or_twice_or_not_at_all() {
        let (relay, mut robot, mut base, _listener) = connected();
        let mut four = [0; 4];
        robot.write_all(b"once").unwrap();
        base.read_exact(&mut four).unwrap();
        base.write_all(b"back").unwrap();
        robot.read_exact(&mut four).unwrap();
        assert_eq!(&four, b"back");
        let begun = Instant::now();
        relay.delay(Duration::from_secs(3600));
        robot.write_all(b"late").unwrap();
        base.read_exact(&mut four).unwrap();
        assert!(&four == b"late" && begun.elapsed() >= DELAY);
        relay.heal();
        relay.repeat(Duration::from_secs(3600));
        robot.write_all(b"twin").unwrap();
        let mut eight = [0; 8];
        base.read_exact(&mut eight).unwrap();
        assert_eq!(&eight, b"twintwin");
        let carried = relay.carried();
        assert_eq!((carried.up_bytes, carried.down_bytes, carried.repeated_bytes), (16, 4, 4));
        relay.cut(Duration::from_secs(3600));
        assert_eq!(base.read(&mut four).unwrap(), 0, "the base's end is closed");
        let mut refused = TcpStream::connect((Ipv4Addr::LOCALHOST, relay.port)).unwrap();
        assert_eq!(refused.read(&mut four).unwrap_or(0), 0, "none comes through while it is cut");
    }

    #[test]
    fn what_is_under_way_when_a_robot_connects_anew_comes_behind_it() {
        let (relay, mut robot, mut base, listener) = connected();
        relay.delay(Duration::from_secs(3600));
        robot.write_all(b"old").unwrap();
        // Until the relay has taken it up.
        std::thread::sleep(DELAY / 5);
        relay.reconnect();
        relay.heal();
        let mut again = TcpStream::connect((Ipv4Addr::LOCALHOST, relay.port)).unwrap();
        let mut newer = listener.accept().unwrap().0;
        again.write_all(b"new").unwrap();
        let mut three = [0; 3];
        newer.read_exact(&mut three).unwrap();
        assert_eq!(&three, b"new");
        base.read_exact(&mut three).unwrap();
        assert_eq!(&three, b"old");
    }

    #[test]
    fn what_a_robot_sends_first_comes_over_a_connection_of_its_own_too() {
        let (relay, robot, _base, listener) = connected();
        relay.repeat(Duration::from_secs(3600));
        drop(robot);
        let mut robot = TcpStream::connect((Ipv4Addr::LOCALHOST, relay.port)).unwrap();
        let mut base = listener.accept().unwrap().0;
        robot.write_all(b"hello").unwrap();
        let mut again = listener.accept().unwrap().0;
        let mut five = [0; 5];
        for end in [&mut base, &mut again] {
            end.read_exact(&mut five).unwrap();
            assert_eq!(&five, b"hello");
        }
    }
}
