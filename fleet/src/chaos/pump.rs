//! One direction of a connection through a relay: pieces with the instant at which they are due.

use super::relay::RelayedLink;
use std::io::{Read, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::{Duration, Instant};

/// Bytes of a piece, at most.
const PIECE_BYTES: usize = 4 << 10;
/// Pieces under way, at most: what comes then waits at its sender.
const UNDER_WAY: usize = 128;
/// Between two looks whether the link is cut.
const LOOK: Duration = Duration::from_millis(10);

/// Which way.
pub(super) enum RelayDirection {
    /// From the robot to the base; tells when all has come.
    Up(Arc<AtomicBool>),
    /// From the base to the robot.
    Down,
}

struct UnderWay {
    due: Instant,
    bytes: Vec<u8>,
}

/// Carries what comes from one end to the other, until one of them is closed.
pub(super) fn pump(from: TcpStream, to: TcpStream, link: &Arc<RelayedLink>, direction: RelayDirection) {
    let (send, receive) = sync_channel(UNDER_WAY);
    let [reading, writing] = [Arc::clone(link), Arc::clone(link)];
    let Ok(from_too) = from.try_clone() else { return };
    std::thread::spawn(move || take_up(from, &send, &reading));
    std::thread::spawn(move || {
        let is_refused = !deliver((&to, &receive), &writing, &direction);
        let _ = to.shutdown(Shutdown::Both);
        if let RelayDirection::Up(is_carrying) = direction {
            is_carrying.store(false, Ordering::Relaxed);
            if is_refused {
                // The base is gone, and the robot is to know it.
                let _ = from_too.shutdown(Shutdown::Both);
            }
        }
    });
}

fn take_up(mut from: TcpStream, send: &SyncSender<UnderWay>, link: &RelayedLink) {
    let mut buffer = [0; PIECE_BYTES];
    while let Ok(n @ 1..) = from.read(&mut buffer) {
        let piece = UnderWay { due: Instant::now() + link.delay(), bytes: buffer[..n].to_vec() };
        if link.is_cut() || send.send(piece).is_err() {
            break;
        }
    }
}

/// `false`: the end that it goes to took no more.
fn deliver(
    (mut to, receive): (&TcpStream, &Receiver<UnderWay>),
    link: &RelayedLink,
    way: &RelayDirection,
) -> bool {
    let is_up = matches!(way, RelayDirection::Up(_));
    let mut is_first = is_up;
    for UnderWay { due, bytes } in receive {
        while let Some(wait) = due.checked_duration_since(Instant::now()) {
            if link.is_cut() {
                return true;
            }
            std::thread::sleep(wait.min(LOOK));
        }
        if std::mem::take(&mut is_first) && link.repeats_attempts() {
            repeat_attempt(link, &bytes);
        }
        let n_times = if is_up && link.repeats_next.swap(false, Ordering::Relaxed) { 2 } else { 1 };
        for time in 0..n_times {
            if to.write_all(&bytes).is_err() {
                return false;
            }
            let n = bytes.len() as u64;
            let count = if is_up { &link.up_bytes } else { &link.down_bytes };
            count.fetch_add(n, Ordering::Relaxed);
            link.repeated_bytes.fetch_add(n * u64::from(time > 0), Ordering::Relaxed);
        }
        if let Some(bytes_per_s) = link.bytes_per_s() {
            std::thread::sleep(Duration::from_secs_f64(bytes.len() as f64 / bytes_per_s as f64));
        }
    }
    true
}

/// Sends to the base what a robot began with, as if it had come twice; what is answered is not read.
fn repeat_attempt(link: &RelayedLink, bytes: &[u8]) {
    if let Ok(mut again) = TcpStream::connect(link.base)
        && again.write_all(bytes).is_ok()
    {
        let n = bytes.len() as u64;
        link.up_bytes.fetch_add(n, Ordering::Relaxed);
        link.repeated_bytes.fetch_add(n, Ordering::Relaxed);
    }
}
