//! Relay of discovery messages from RustDDS to each other participant.
//!
//! RustDDS sends to participants that it knows directly, and announces the ports of its inner domain then. The next
//! program on this machine takes those ports, in whatever domain of ROS, and a participant that does not know of a kill
//! sends to them until the lease ends (50 s): it would be discovered across domains. So each place where others listen
//! for discovery is replaced by a port of this relay, which passes on what RustDDS sends there with its own port.

use super::announcement::{redirect_metatraffic, sender, set_metatraffic_port};
use socket2::Socket;
use std::collections::BTreeMap;
use std::io;
use std::net::{Ipv4Addr, SocketAddrV4, UdpSocket};

/// Destinations that are kept; the one that was not announced for longest goes first.
const MOST: usize = 128;

/// Where others listen for discovery, and the socket to which RustDDS sends instead.
struct Destination {
    at: SocketAddrV4,
    ear: UdpSocket,
}

/// All that were announced, the newest last.
#[derive(Default)]
pub(super) struct Destinations {
    known: Vec<Destination>,
}

impl Destinations {
    /// Replaces the places where others listen, in announcements; other messages stay as they are. A message may have
    /// the announcements of several participants.
    pub(super) fn redirect(&mut self, datagram: &mut [u8]) {
        redirect_metatraffic(datagram, &mut |at| self.port_for(at).ok());
    }

    /// The port to which RustDDS is to send what is for that place.
    fn port_for(&mut self, at: SocketAddrV4) -> io::Result<u16> {
        let place = self.known.iter().position(|known| known.at == at);
        let known = match place.map(|place| self.known.remove(place)) {
            Some(known) => known,
            None => Destination { at, ear: UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))? },
        };
        let port = known.ear.local_addr()?.port();
        if self.known.len() >= MOST {
            self.known.remove(0);
        }
        self.known.push(known);
        Ok(port)
    }

    /// Sockets to which RustDDS sends.
    pub(super) fn ears(&self) -> impl Iterator<Item = &UdpSocket> {
        self.known.iter().map(|known| &known.ear)
    }

    /// Passes on what RustDDS, which has that prefix, sent to one of them, with `port` as that of its discovery, from
    /// the address at which the other listens. What others send to this port was for a program that had it before.
    pub(super) fn pass_on(
        &self,
        place: usize,
        datagram: &mut [u8],
        (prefix, port): (&[u8], u16),
        own: &BTreeMap<Ipv4Addr, Socket>,
    ) {
        let Some(known) = self.known.get(place) else { return };
        let Ok(len) = known.ear.recv(datagram) else { return };
        let Some(message) = datagram.get_mut(..len) else { return };
        if sender(message) != Some(prefix) {
            return;
        }
        set_metatraffic_port(message, port);
        // One that is lost comes again, as on a network.
        let _ = match own.get(known.at.ip()) {
            Some(voice) => voice.send_to(message, &known.at.into()),
            None => known.ear.send_to(message, known.at),
        };
    }
}
