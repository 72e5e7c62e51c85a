//! The sockets of this process, kept to loopback.
//!
//! RustDDS announces and uses the networks that it is told, but binds its sockets to all addresses.

use rustix::process::{PidfdFlags, PidfdGetfdFlags, getpid, pidfd_getfd, pidfd_open};
use socket2::{Domain, SockRef, Type};
use std::io;

/// Binds the UDP sockets that this process has to the loopback device: what comes by another one never
/// reaches them. Answers how many there were.
///
/// # Errors
/// Where the system does not let a process look at its own descriptors, or bind them.
pub(super) fn keep_to_loopback() -> io::Result<usize> {
    let own = pidfd_open(getpid(), PidfdFlags::empty())?;
    let mut n_bound = 0;
    for entry in std::fs::read_dir("/proc/self/fd")? {
        let Some(number) = entry?.file_name().to_str().and_then(|name| name.parse().ok()) else { continue };
        // The directory's own descriptor may be gone.
        let same = match pidfd_getfd(&own, number, PidfdGetfdFlags::empty()) {
            Ok(same) => same,
            Err(rustix::io::Errno::BADF) => continue,
            Err(error) => return Err(error.into()),
        };
        let socket = SockRef::from(&same);
        let is_udp = socket.r#type().is_ok_and(|kind| kind == Type::DGRAM)
            && socket.domain().is_ok_and(|domain| domain == Domain::IPV4 || domain == Domain::IPV6);
        if is_udp {
            socket.bind_device(Some(b"lo"))?;
            n_bound = usize::saturating_add(n_bound, 1);
        }
    }
    Ok(n_bound)
}

/// Holds off other tests that open sockets: those of the whole process are bound.
#[cfg(test)]
pub(super) fn alone() -> std::sync::MutexGuard<'static, ()> {
    static SOCKETS: std::sync::Mutex<()> = std::sync::Mutex::new(());
    SOCKETS.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::UdpSocket;

    #[test]
    fn sockets_bound_to_all_addresses_hear_loopback_alone() {
        let _alone = alone();
        let socket = UdpSocket::bind("0.0.0.0:0").unwrap();
        assert_eq!(SockRef::from(&socket).device().unwrap(), None);
        socket.set_read_timeout(Some(std::time::Duration::from_secs(60))).unwrap();
        assert!(keep_to_loopback().unwrap() >= 1);
        assert_eq!(SockRef::from(&socket).device().unwrap(), Some(b"lo".to_vec()));
        let port = socket.local_addr().unwrap().port();
        UdpSocket::bind("127.0.0.1:0").unwrap().send_to(b"here", ("127.0.0.1", port)).unwrap();
        let mut heard = [0; 8];
        assert_eq!(socket.recv(&mut heard).unwrap(), 4);
    }
}
