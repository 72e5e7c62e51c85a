//! What is said of locators in messages of discovery, changed in place (RTPS 2.5, 8.3 and 9.6).

use std::net::{Ipv4Addr, SocketAddrV4};

/// Where an RTPS message has its sender: magic, version and vendor come before.
const PREFIX: std::ops::Range<usize> = 8..20;
const MAGIC: &[u8] = b"RTPS";
/// Submessages before which the header of a message stands.
const HEADER: usize = 20;
const DATA: u8 = 0x15;
/// Submessages that may have no content; a length of 0 else means the rest of the message.
const MAY_BE_EMPTY: [u8; 2] = [0x01, 0x09];
/// Flags of a submessage: little-endian; of data: quality inline, and a payload.
const IS_LITTLE: u8 = 1;
const HAS_QUALITY: u8 = 2;
const HAS_PAYLOAD: u8 = 4;
/// Who writes announcements of participants, writers and readers.
const DISCOVERY: [[u8; 4]; 3] = [[0, 1, 0, 0xc2], [0, 0, 3, 0xc2], [0, 0, 4, 0xc2]];
/// Parameters: the end of a list, and locators.
const END: u16 = 0x0001;
const MULTICAST: u16 = 0x0030;
const METATRAFFIC_UNICAST: u16 = 0x0032;
const METATRAFFIC_MULTICAST: u16 = 0x0033;
const DEFAULT_MULTICAST: u16 = 0x0048;
/// A parameter of a vendor: who does not know it leaves it out.
const OF_A_VENDOR: u16 = 0x8000;
/// A locator: its kind, its port, 16 bytes of address.
const LOCATOR: usize = 24;
const UDP_V4: u32 = 1;
/// Where a locator has its port, behind its kind.
const PORT: std::ops::Range<usize> = 4..8;

/// Who sent an RTPS message.
pub(super) fn sender(datagram: &[u8]) -> Option<&[u8]> {
    datagram.get(PREFIX).filter(|_| datagram.starts_with(MAGIC))
}

/// Takes multicast out of what others announce: they are spoken to by unicast alone.
pub(super) fn take_out_multicast(message: &mut [u8]) {
    for_parameters(message, &mut |id, is_little, head, _| {
        if [MULTICAST, METATRAFFIC_MULTICAST, DEFAULT_MULTICAST].contains(&id) {
            let other = id | OF_A_VENDOR;
            head.copy_from_slice(&if is_little { other.to_le_bytes() } else { other.to_be_bytes() });
        }
    });
}

/// Says that discovery is listened for on that port.
pub(super) fn set_metatraffic_port(message: &mut [u8], port: u16) {
    for_parameters(message, &mut |id, is_little, _, value| {
        if id == METATRAFFIC_UNICAST
            && let Some(place) = value.get_mut(PORT)
        {
            let port = u32::from(port);
            place.copy_from_slice(&if is_little { port.to_le_bytes() } else { port.to_be_bytes() });
        }
    });
}

/// Replaces each place where discovery is listened for by a port of this machine that `port_for` gives. One of another
/// kind than UDP over IPv4 is taken out, and one that has no port.
pub(super) fn redirect_metatraffic(
    message: &mut [u8],
    port_for: &mut impl FnMut(SocketAddrV4) -> Option<u16>,
) {
    for_parameters(message, &mut |id, is_little, head, value| {
        if id != METATRAFFIC_UNICAST {
            return;
        }
        let at = locator(value, is_little).filter(|(kind, ..)| *kind == UDP_V4);
        let port = at.and_then(|(_, port, address)| port_for(SocketAddrV4::new(address, port)));
        let number = |n: u32| if is_little { n.to_le_bytes() } else { n.to_be_bytes() };
        match (port, value.get_mut(..LOCATOR)) {
            (Some(port), Some(value)) => {
                let to = Ipv4Addr::LOCALHOST.octets();
                let locator = [number(UDP_V4), number(port.into()), [0; 4], [0; 4], [0; 4], to];
                value.copy_from_slice(locator.as_flattened());
            }
            _ => {
                let other = id | OF_A_VENDOR;
                head.copy_from_slice(&if is_little { other.to_le_bytes() } else { other.to_be_bytes() });
            }
        }
    });
}

/// Kind, port and address of a locator.
fn locator(value: &[u8], is_little: bool) -> Option<(u32, u16, Ipv4Addr)> {
    let (words, _) = value.as_chunks::<4>();
    let &[kind, port, _, _, _, address] = words else { return None };
    let number = |bytes| if is_little { u32::from_le_bytes(bytes) } else { u32::from_be_bytes(bytes) };
    Some((number(kind), u16::try_from(number(port)).ok()?, address.into()))
}

/// Calls `visit` with each parameter of what is announced: its id, whether it is little-endian, the bytes of
/// the id, and its value. A message that is cut off ends there.
fn for_parameters(message: &mut [u8], visit: &mut impl FnMut(u16, bool, &mut [u8], &mut [u8])) {
    let mut at = HEADER;
    while let Some(&[kind, flags, a, b]) = message.get(at..at.saturating_add(4)) {
        let is_little = flags & IS_LITTLE != 0;
        let len = usize::from(word([a, b], is_little));
        let end = match len {
            0 if !MAY_BE_EMPTY.contains(&kind) => message.len(),
            len => at.saturating_add(4).saturating_add(len),
        };
        let Some(content) = message.get_mut(at.saturating_add(4)..end) else { return };
        if kind == DATA {
            visit_data(content, flags, visit);
        }
        at = end;
    }
}

fn visit_data(content: &mut [u8], flags: u8, visit: &mut impl FnMut(u16, bool, &mut [u8], &mut [u8])) {
    let is_little = flags & IS_LITTLE != 0;
    let is_discovery = content.get(8..12).is_some_and(|writer| DISCOVERY.iter().any(|of| of == writer));
    if !is_discovery || flags & HAS_PAYLOAD == 0 {
        return;
    }
    let Some(&[_, _, a, b]) = content.get(..4) else { return };
    let mut at = usize::from(word([a, b], is_little)).saturating_add(4);
    if flags & HAS_QUALITY != 0 {
        at = visit_list(content, at, is_little, &mut |_, _, _, _| ());
    }
    // Encapsulation: a list of parameters, big-endian or little-endian.
    let is_little = match content.get(at..at.saturating_add(2)) {
        Some([0, 2]) => false,
        Some([0, 3]) => true,
        _ => return,
    };
    visit_list(content, at.saturating_add(4), is_little, visit);
}

/// Visits a list of parameters from `at` on; answers where it ends.
fn visit_list(
    content: &mut [u8],
    mut at: usize,
    is_little: bool,
    visit: &mut impl FnMut(u16, bool, &mut [u8], &mut [u8]),
) -> usize {
    while let Some(&[a, b, c, d]) = content.get(at..at.saturating_add(4)) {
        let (id, len) = (word([a, b], is_little), usize::from(word([c, d], is_little)));
        if id == END {
            return at.saturating_add(4);
        }
        let end = at.saturating_add(4).saturating_add(len);
        let Some([of_id_0, of_id_1, _, _, value @ ..]) = content.get_mut(at..end) else {
            return content.len();
        };
        let mut of_id = [*of_id_0, *of_id_1];
        visit(id, is_little, &mut of_id, value);
        [*of_id_0, *of_id_1] = of_id;
        at = end;
    }
    content.len()
}

fn word(bytes: [u8; 2], is_little: bool) -> u16 {
    if is_little { u16::from_le_bytes(bytes) } else { u16::from_be_bytes(bytes) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An announcement with one locator of each kind; `quality` puts a list of its own before it.
    fn announcement(is_little: bool, has_quality: bool) -> Vec<u8> {
        let word = |v: u16| if is_little { v.to_le_bytes() } else { v.to_be_bytes() };
        let long = |v: u32| if is_little { v.to_le_bytes() } else { v.to_be_bytes() };
        let parameter = |id: u16, value: &[u8]| [&word(id), &word(value.len() as u16), value].concat();
        let locator = |port: u32| [&long(1)[..], &long(port), &[0; 12], &[127, 0, 0, 1]].concat();
        let mut content = [&word(0)[..], &word(16), &[0, 1, 0, 0xc7], &[0, 1, 0, 0xc2], &[0; 8]].concat();
        if has_quality {
            content.extend([parameter(METATRAFFIC_UNICAST, &locator(1)), parameter(END, &[])].concat());
        }
        content.extend([0, 2 + u8::from(is_little), 0, 0]);
        for id in [METATRAFFIC_UNICAST, METATRAFFIC_MULTICAST, 0x0031, DEFAULT_MULTICAST, MULTICAST] {
            content.extend(parameter(id, &locator(7410)));
        }
        content.extend(parameter(END, &[]));
        let flags = HAS_PAYLOAD | u8::from(is_little) | if has_quality { HAS_QUALITY } else { 0 };
        let time = [&[0x09, u8::from(is_little)][..], &word(8), &[0; 8]].concat();
        let data = [&[DATA, flags][..], &word(content.len() as u16), &content].concat();
        [&b"RTPSvvnn0123456789ab"[..], &time, &data].concat()
    }

    fn read(message: &mut [u8]) -> Vec<(u16, u32)> {
        let mut found = Vec::new();
        for_parameters(message, &mut |id, is_little, _, value| {
            let port = value[PORT].try_into().unwrap();
            found.push((id, if is_little { u32::from_le_bytes(port) } else { u32::from_be_bytes(port) }));
        });
        found
    }

    #[test]
    fn multicast_is_taken_out_and_the_port_is_set_and_nothing_else() {
        for (is_little, has_quality) in [(true, false), (false, false), (true, true), (false, true)] {
            let mut message = announcement(is_little, has_quality);
            take_out_multicast(&mut message);
            set_metatraffic_port(&mut message, 9999);
            let expected = [(0x32, 9999), (0x8033, 7410), (0x31, 7410), (0x8048, 7410), (0x8030, 7410)];
            assert_eq!(read(&mut message), expected, "{is_little} {has_quality}");
        }
    }

    /// Cyclone DDS puts the announcements of all participants of a process into one message.
    #[test]
    fn each_place_where_others_listen_is_replaced_by_a_port_of_its_own() {
        for (is_little, has_quality) in [(true, false), (false, false), (true, true), (false, true)] {
            let mut message = announcement(is_little, has_quality);
            let other = announcement(is_little, has_quality);
            message.extend(&other[HEADER..]);
            let mut seen = Vec::new();
            redirect_metatraffic(&mut message, &mut |at| {
                seen.push(at);
                Some(4320 + seen.len() as u16)
            });
            let at = SocketAddrV4::new(Ipv4Addr::LOCALHOST, 7410);
            assert_eq!(seen, [at; 2]);
            let unicast: Vec<(u16, u32)> =
                read(&mut message).into_iter().filter(|(id, _)| *id == METATRAFFIC_UNICAST).collect();
            assert_eq!(unicast, [(METATRAFFIC_UNICAST, 4321), (METATRAFFIC_UNICAST, 4322)]);
            redirect_metatraffic(&mut message, &mut |_| None);
            assert!(read(&mut message).iter().all(|(id, _)| *id != METATRAFFIC_UNICAST));
        }
    }

    #[test]
    fn what_is_cut_off_or_none_of_discovery_stays_as_it_is() {
        let whole = announcement(true, true);
        for len in 0..whole.len() {
            let mut cut = whole[..len].to_vec();
            take_out_multicast(&mut cut);
            set_metatraffic_port(&mut cut, 9999);
            redirect_metatraffic(&mut cut, &mut |_| Some(1));
            assert_eq!(cut.len(), len);
        }
        let mut of_a_user = announcement(true, false);
        let writer = of_a_user.windows(4).position(|bytes| bytes == [0, 1, 0, 0xc2]).unwrap();
        of_a_user[writer + 3] = 3;
        assert_eq!(read(&mut of_a_user), []);
    }
}
