//! Other participants, each behind a port of ours.
//!
//! RustDDS speaks to those that it knows directly, and announces its own ports then. Those are of a domain that another
//! program takes once this one is gone, and a participant that was not told goes on sending to them: it would be
//! discovered there, across domains. So RustDDS is given a port of ours as each participant's, and what comes there is
//! passed on with the port of discovery that is ours for as long as this goes on.

use super::announcement::{metatraffic, redirect_metatraffic, set_metatraffic_port};
use socket2::Socket;
use std::collections::BTreeMap;
use std::io;
use std::net::{Ipv4Addr, SocketAddrV4, UdpSocket};

/// Participants that are kept; one that has not announced itself for longest goes first.
const MOST: usize = 128;

/// One of them: where RustDDS speaks to it, and where it listens.
struct Participant {
    prefix: Vec<u8>,
    ear: UdpSocket,
    at: SocketAddrV4,
}

/// All that have announced themselves, the newest last.
#[derive(Default)]
pub(super) struct Participants {
    known: Vec<Participant>,
}

impl Participants {
    /// Puts a port of ours in the place of those in an announcement; other messages stay as they are. `own`: addresses
    /// of this machine.
    ///
    /// # Errors
    /// Where the system refuses a socket.
    pub(super) fn stand_before(
        &mut self,
        prefix: &[u8],
        datagram: &mut [u8],
        own: &BTreeMap<Ipv4Addr, Socket>,
    ) -> io::Result<()> {
        let listens = metatraffic(datagram);
        let near = listens.iter().find(|at| own.contains_key(at.ip())).or(listens.first());
        let Some(at) = near.copied() else { return Ok(()) };
        let place = self.known.iter().position(|known| known.prefix == prefix);
        let known = match place.map(|place| self.known.remove(place)) {
            Some(known) => Participant { at, ..known },
            None => {
                let ear = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?;
                Participant { prefix: prefix.to_owned(), ear, at }
            }
        };
        redirect_metatraffic(
            datagram,
            SocketAddrV4::new(Ipv4Addr::LOCALHOST, known.ear.local_addr()?.port()),
        );
        if self.known.len() >= MOST {
            self.known.remove(0);
        }
        self.known.push(known);
        Ok(())
    }

    /// Sockets at which RustDDS speaks to them.
    pub(super) fn ears(&self) -> impl Iterator<Item = &UdpSocket> {
        self.known.iter().map(|known| &known.ear)
    }

    /// Passes on what RustDDS said to one of them, with `port` as that of its discovery, from the address at which the
    /// other listens.
    pub(super) fn pass_on(
        &self,
        place: usize,
        datagram: &mut [u8],
        port: u16,
        own: &BTreeMap<Ipv4Addr, Socket>,
    ) {
        let Some(known) = self.known.get(place) else { return };
        let Ok(len) = known.ear.recv(datagram) else { return };
        let Some(message) = datagram.get_mut(..len) else { return };
        set_metatraffic_port(message, port);
        // One that is lost comes again, as on a network.
        let _ = match own.get(known.at.ip()) {
            Some(voice) => voice.send_to(message, &known.at.into()),
            None => known.ear.send_to(message, known.at),
        };
    }
}
