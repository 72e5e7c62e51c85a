//! Discovery among programs of this machine, on each of its interfaces.
//!
//! RustDDS is kept to loopback, where a program with default settings neither speaks nor listens: Cyclone DDS
//! takes one interface of a network, and finds others by multicast there. This stands between them, and is all
//! that RustDDS hears of: it is in a domain of its own, of whose ports this machine has one user at a time.
//! Announcements of this machine's addresses are heard on all interfaces and handed to RustDDS, without the
//! multicast that it could not send; and what RustDDS announces is sent there with a TTL of 0, which no interface
//! lets out, and to the ports of participants on loopback. Messages of discovery come to a port of this, data to
//! that of RustDDS: unicast on loopback. What RustDDS says to one participant passes here too (`destinations.rs`).

use super::announcement::{sender, set_metatraffic_port, take_out_multicast};
use super::destinations::Destinations;
use nix::ifaddrs::getifaddrs;
use nix::net::if_::InterfaceFlags;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use socket2::{Domain, Protocol, SockAddr, Socket, Type};
use std::collections::BTreeMap;
use std::io;
use std::net::{Ipv4Addr, SocketAddr, SocketAddrV4, UdpSocket};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Group and ports of discovery (RTPS 2.5, 9.6.2.3).
const GROUP: Ipv4Addr = Ipv4Addr::new(239, 255, 0, 1);
const FIRST_PORT: u16 = 7400;
const PORTS_OF_DOMAIN: u16 = 250;
const FIRST_UNICAST: u16 = 10;
/// Participants of this machine to whose ports RustDDS announces itself, and to which this does: as many as
/// rmw_cyclonedds lets have ports of their own.
const N_INNER: u16 = 12;
const N_SLOTS: u16 = 33;
/// Participants that a domain has ports for (RTPS 2.5, 9.6.2.3).
const MOST_PARTICIPANTS: u16 = 120;
/// Domains whose ports lie above those that Linux gives away by itself.
const INNER_DOMAINS: std::ops::RangeInclusive<u16> = 215..=232;
/// Largest datagram of UDP.
const MOST_BYTES: usize = 65_536;
/// Time between two looks at the interfaces: a network may come up later.
const LOOK: Duration = Duration::from_secs(2);
/// Longest wait for a datagram, and so for the end.
const TURN: Timespec = Timespec { tv_sec: 0, tv_nsec: 200_000_000 };
/// Foreign machines that are remembered by name.
const MOST_FOREIGN: usize = 16;

/// The port of discovery by multicast in a domain.
pub(super) fn multicast_port(domain: u16) -> u16 {
    PORTS_OF_DOMAIN.saturating_mul(domain).saturating_add(FIRST_PORT)
}

/// The port of discovery of one participant.
pub(super) fn unicast_port(domain: u16, participant: u16) -> u16 {
    multicast_port(domain).saturating_add(FIRST_UNICAST).saturating_add(participant.saturating_mul(2))
}

/// What was heard, for people.
#[derive(Debug, Default)]
struct HeardAnnouncement {
    /// Addresses on which announcements are sent and heard.
    joined: Vec<Ipv4Addr>,
    /// Other machines that announced themselves, with how often.
    foreign: BTreeMap<Ipv4Addr, u64>,
}

/// The domain in which RustDDS is to be alone, with all ports of it that RustDDS announces itself to.
pub(super) struct Inside {
    /// The domain of the network.
    domain: u16,
    /// That of RustDDS.
    pub(super) inner: u16,
    slots: Vec<Socket>,
}

impl Inside {
    /// Finds one that no other program has.
    ///
    /// # Errors
    /// Where all are taken, or the system refuses sockets.
    pub(super) fn open(domain: u16) -> io::Result<Self> {
        let mut refusal = None;
        for inner in INNER_DOMAINS.rev().filter(|inner| *inner != domain) {
            let bind = |slot| bound(SocketAddrV4::new(Ipv4Addr::LOCALHOST, unicast_port(inner, slot)));
            match (0..N_INNER).map(bind).collect::<io::Result<Vec<Socket>>>() {
                Ok(mut slots) => {
                    // That of RustDDS itself, which takes the first one that is free.
                    slots.remove(0);
                    return Ok(Self { domain, inner, slots });
                }
                Err(error) => refusal = Some(error),
            }
        }
        Err(refusal.unwrap_or_else(|| io::ErrorKind::AddrInUse.into()))
    }

    /// Begins to pass on, between the participant of that number with that prefix and its neighbours. To be
    /// called once the sockets of RustDDS are kept to loopback: those that are made here are not to be.
    ///
    /// # Errors
    /// Where the system refuses a socket or a thread.
    pub(super) fn begin(self, participant: u16, prefix: &[u8]) -> io::Result<Neighbours> {
        let to = SocketAddrV4::new(Ipv4Addr::LOCALHOST, unicast_port(self.inner, participant));
        let free = (0..MOST_PARTICIPANTS).find_map(|slot| {
            let port = unicast_port(self.domain, slot);
            Some((port, bound(SocketAddrV4::new(Ipv4Addr::LOCALHOST, port)).ok()?))
        });
        let (port, meta) = free.ok_or(io::ErrorKind::AddrInUse)?;
        let heard = Arc::new(Mutex::new(HeardAnnouncement::default()));
        let relay = DiscoveryRelay {
            group: group(self.domain)?.into(),
            meta: meta.into(),
            port,
            slots: self.slots.into_iter().map(UdpSocket::from).collect(),
            inside: UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?,
            to,
            domain: self.domain,
            prefix: prefix.to_owned(),
            voices: BTreeMap::new(),
            others: Destinations::default(),
            last_words: None,
            heard: Arc::clone(&heard),
        };
        let is_over = Arc::new(AtomicBool::new(false));
        let stop = Arc::clone(&is_over);
        let thread =
            std::thread::Builder::new().name("neighbours".to_owned()).spawn(move || relay.run(&stop))?;
        Ok(Neighbours { is_over, thread: Some(thread), heard, port })
    }
}

/// The relay as long as it goes on.
pub(super) struct Neighbours {
    is_over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    heard: Arc<Mutex<HeardAnnouncement>>,
    /// Where messages of discovery come to.
    pub(super) port: u16,
}

impl Neighbours {
    /// Addresses of this machine on which announcements are sent and heard.
    pub(super) fn joined(&self) -> Vec<Ipv4Addr> {
        self.heard.lock().unwrap_or_else(PoisonError::into_inner).joined.clone()
    }

    /// Other machines that announced themselves and were not answered.
    pub(super) fn foreign(&self) -> Vec<Ipv4Addr> {
        self.heard.lock().unwrap_or_else(PoisonError::into_inner).foreign.keys().copied().collect()
    }
}

impl Drop for Neighbours {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            // A panic in it was told when it happened.
            let _ = thread.join();
        }
    }
}

struct DiscoveryRelay {
    group: UdpSocket,
    /// Messages of discovery for RustDDS, and their port.
    meta: UdpSocket,
    port: u16,
    /// Announcements of RustDDS.
    slots: Vec<UdpSocket>,
    /// Sends to RustDDS.
    inside: UdpSocket,
    to: SocketAddrV4,
    domain: u16,
    prefix: Vec<u8>,
    /// Of each address of this machine, what sends there.
    voices: BTreeMap<Ipv4Addr, Socket>,
    others: Destinations,
    /// The newest announcement of RustDDS, for interfaces that come later.
    last_words: Option<Vec<u8>>,
    heard: Arc<Mutex<HeardAnnouncement>>,
}

impl DiscoveryRelay {
    fn run(mut self, is_over: &AtomicBool) {
        let mut datagram = vec![0; MOST_BYTES];
        let mut looked: Option<Instant> = None;
        while !is_over.load(Ordering::Acquire) {
            if looked.is_none_or(|at| at.elapsed() >= LOOK) {
                looked = Some(Instant::now());
                self.look();
            }
            let sockets = [&self.group, &self.meta].into_iter().chain(&self.slots).chain(self.others.ears());
            let mut ready: Vec<PollFd<'_>> =
                sockets.map(|socket| PollFd::new(socket, PollFlags::IN)).collect();
            if poll(&mut ready, Some(&TURN)).is_err() {
                continue; // A signal.
            }
            let ready: Vec<bool> = ready.iter().map(|fd| fd.revents().contains(PollFlags::IN)).collect();
            let is_ready = |place: usize| ready.get(place) == Some(&true);
            let first = self.slots.len().saturating_add(2);
            for other in
                (0..ready.len().saturating_sub(first)).filter(|at| is_ready(first.saturating_add(*at)))
            {
                self.others.pass_on(other, &mut datagram, (&self.prefix, self.port), &self.voices);
            }
            if is_ready(0)
                && let Ok((len, SocketAddr::V4(from))) = self.group.recv_from(&mut datagram)
            {
                self.hear(datagram.get_mut(..len).unwrap_or_default(), *from.ip());
            }
            if is_ready(1)
                && let Ok(len) = self.meta.recv(&mut datagram)
            {
                self.hand_in(datagram.get_mut(..len).unwrap_or_default());
            }
            for slot in 0..self.slots.len() {
                if is_ready(slot.saturating_add(2))
                    && let Some(Ok(len)) = self.slots.get(slot).map(|slot| slot.recv(&mut datagram))
                {
                    self.pass_on(datagram.get_mut(..len).unwrap_or_default());
                }
            }
        }
    }

    /// Joins the interfaces that are there now.
    fn look(&mut self) {
        let there = own_addresses();
        self.voices.retain(|address, _| there.contains(address));
        for address in &there {
            if self.voices.contains_key(address) {
                continue;
            }
            // One that was there before is a member already.
            let _ = self.group.join_multicast_v4(&GROUP, address);
            if let Ok(voice) = voice(*address) {
                if let Some(words) = &self.last_words {
                    self.speak(*address, &voice, words);
                }
                self.voices.insert(*address, voice);
            }
        }
        let joined = self.voices.keys().copied().collect();
        self.heard.lock().unwrap_or_else(PoisonError::into_inner).joined = joined;
    }

    /// Hands an announcement to RustDDS where it is one of this machine.
    fn hear(&mut self, datagram: &mut [u8], from: Ipv4Addr) {
        if sender(datagram).is_none_or(|prefix| prefix == self.prefix) {
            return;
        }
        if from.is_loopback() || self.voices.contains_key(&from) {
            self.hand_in(datagram);
            return;
        }
        let mut heard = self.heard.lock().unwrap_or_else(PoisonError::into_inner);
        if heard.foreign.len() < MOST_FOREIGN || heard.foreign.contains_key(&from) {
            let n = heard.foreign.entry(from).or_default();
            *n = n.saturating_add(1);
        }
    }

    /// Hands a message of this machine to RustDDS.
    fn hand_in(&mut self, datagram: &mut [u8]) {
        take_out_multicast(datagram);
        self.others.redirect(datagram);
        // One that is lost comes again, as on a network.
        let _ = self.inside.send_to(datagram, self.to);
    }

    /// Sends an announcement of RustDDS on all interfaces, and to those who have ports of their own. It comes to
    /// each slot: one is enough.
    fn pass_on(&mut self, datagram: &mut [u8]) {
        if sender(datagram).is_none_or(|prefix| prefix != self.prefix) {
            return;
        }
        set_metatraffic_port(datagram, self.port);
        if self.last_words.as_deref() == Some(&*datagram) {
            return;
        }
        self.voices.iter().for_each(|(of, voice)| self.speak(*of, voice, datagram));
        self.last_words = Some(datagram.to_owned());
    }

    /// Announces on one interface, and to the ports of participants at its address: Cyclone DDS takes no
    /// announcement by an interface that it did not choose.
    fn speak(&self, of: Ipv4Addr, voice: &Socket, datagram: &[u8]) {
        let ports = (0..N_SLOTS).map(|slot| unicast_port(self.domain, slot));
        let slots = ports.filter(|port| *port != self.port).map(|port| address(of, port));
        for to in slots.chain([address(GROUP, multicast_port(self.domain))]) {
            // An interface that is down refuses it, and is looked at again soon; most slots are empty.
            let _ = voice.send_to(datagram, &to);
        }
    }
}

fn udp() -> io::Result<Socket> {
    Socket::new(Domain::IPV4, Type::DGRAM, Some(Protocol::UDP))
}

/// What hears the group of a domain, on the interfaces that it joins then.
fn group(domain: u16) -> io::Result<Socket> {
    let group = udp()?;
    group.set_reuse_address(true)?;
    // As RustDDS and others do, without which they could not share the port.
    group.set_reuse_port(true)?;
    group.bind(&address(Ipv4Addr::UNSPECIFIED, multicast_port(domain)))?;
    group.set_multicast_all_v4(false)?;
    Ok(group)
}

fn address(address: Ipv4Addr, port: u16) -> SockAddr {
    SocketAddrV4::new(address, port).into()
}

/// What listens there, and alone.
fn bound(to: SocketAddrV4) -> io::Result<Socket> {
    let socket = udp()?;
    socket.bind(&to.into())?;
    Ok(socket)
}

/// What sends by multicast on one interface and not beyond this machine.
fn voice(of: Ipv4Addr) -> io::Result<Socket> {
    let socket = udp()?;
    socket.set_multicast_ttl_v4(0)?;
    socket.set_multicast_loop_v4(true)?;
    socket.set_multicast_if_v4(&of)?;
    socket.bind(&address(of, 0))?;
    Ok(socket)
}

/// IPv4 addresses of the interfaces that are up.
fn own_addresses() -> Vec<Ipv4Addr> {
    let Ok(all) = getifaddrs() else { return Vec::new() };
    let up = all.filter(|of| of.flags.contains(InterfaceFlags::IFF_UP));
    let mut found: Vec<Ipv4Addr> = up.filter_map(|of| Some(of.address?.as_sockaddr_in()?.ip())).collect();
    found.sort_unstable();
    found.dedup();
    found
}

#[cfg(test)]
mod tests {
    use super::super::own_sockets::alone;
    use super::*;

    #[test]
    fn ports_are_those_of_the_standard() {
        assert_eq!((multicast_port(9), unicast_port(9, 0), unicast_port(9, 11)), (9650, 9660, 9682));
        assert_eq!(sender(b"RTPSvvnn0123456789abrest"), Some(&b"0123456789ab"[..]));
        assert_eq!((sender(b"RTPSvvnn0123"), sender(b"SOMEvvnn0123456789ab")), (None, None));
    }

    #[test]
    fn what_is_announced_stays_on_this_machine_and_reaches_it_on_every_interface() {
        let _alone = alone();
        // Ports below the ephemeral ones.
        let domain = 1 + u16::try_from(std::process::id() % 100).unwrap();
        let inside = Inside::open(domain).unwrap();
        let slot = SocketAddrV4::new(Ipv4Addr::LOCALHOST, unicast_port(inside.inner, 3));
        let participant = UdpSocket::bind((Ipv4Addr::LOCALHOST, unicast_port(inside.inner, 0))).unwrap();
        participant.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
        // No other test gets that domain meanwhile.
        assert_ne!(Inside::open(domain).unwrap().inner, inside.inner);
        // Another program of this machine hears the group as Cyclone DDS does, on one interface.
        let other = group(domain).unwrap();
        let own = own_addresses();
        let chosen = own.iter().copied().find(|address| !address.is_loopback()).unwrap_or(own[0]);
        other.join_multicast_v4(&GROUP, &chosen).unwrap();
        other.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
        let neighbours = inside.begin(0, b"0123456789ab").unwrap();
        let begun = Instant::now();
        while neighbours.joined() != own {
            assert!(begun.elapsed() < Duration::from_secs(60), "{:?}", neighbours.joined());
            std::thread::sleep(Duration::from_millis(5));
        }
        let announced = b"RTPSvvnn0123456789ab here I am";
        participant.send_to(announced, slot).unwrap();
        let (other, mut heard) = (UdpSocket::from(other), [0; 64]);
        let (len, from) = other.recv_from(&mut heard).unwrap();
        assert_eq!((&heard[..len], from.ip()), (&announced[..], chosen.into()));
        assert_eq!(voice(chosen).unwrap().multicast_ttl_v4().unwrap(), 0);
        // And its answers come to the participant: by multicast, and to the port that is announced.
        let answer = b"RTPSvvnnba9876543210 so am I";
        voice(chosen).unwrap().send_to(answer, &address(GROUP, multicast_port(domain))).unwrap();
        let len = participant.recv(&mut heard).unwrap();
        assert_eq!(&heard[..len], &answer[..]);
        other.send_to(answer, (Ipv4Addr::LOCALHOST, neighbours.port)).unwrap();
        assert_eq!(participant.recv(&mut heard).unwrap(), answer.len());
        assert_eq!(neighbours.foreign(), Vec::<Ipv4Addr>::new());
    }
}
