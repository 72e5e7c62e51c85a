//! Readers of bytes that came over a network, given bytes that were once right: thousands of changes of each, the
//! same in every run. What is refused says why, what is taken holds the rules of its kind, and nothing panics.

use tessera_features::Feature;
use tessera_fleet::wire::piece::Piece;
use tessera_fleet::wire::request::{Growing, Request};
use tessera_fleet::wire::surfaces::{Framed, append_frame};
use tessera_fleet::wire::surfaces::{WantedSurfaces, frames, from_wire, pack_surface};
use tessera_numerics::SplitMix64;
use tessera_slam::StoreSlot;
use tessera_stage::BaseAnswer;
use tessera_surface::{Grid, Vertex};

const CHANGES: usize = 20_000;
const GRID: Grid = Grid { width: 21, height: 16, step: 4 };

/// Bytes with up to eight bits turned, cut off, or with a part of themselves somewhere else.
fn changed(right: &[u8], random: &mut SplitMix64) -> Vec<u8> {
    let mut bytes = right.to_vec();
    match random.below(4) {
        0 => bytes.truncate(random.below(bytes.len() + 1)),
        1 => {
            let (from, to) = (random.below(bytes.len()), random.below(bytes.len()));
            let n = random.below(bytes.len() - from.max(to)) + 1;
            bytes.copy_within(from..from + n, to);
        }
        2 => bytes.extend(right.iter().take(random.below(right.len()))),
        _ => {}
    }
    for _ in 0..random.below(9).min(bytes.len()) {
        let place = random.below(bytes.len());
        bytes[place] ^= 1 << random.below(8);
    }
    bytes
}

/// Gives a reader changed bytes; `read` answers whether they were taken.
fn read_changed(seed: u64, right: &[u8], mut read: impl FnMut(&[u8]) -> bool) {
    assert!(read(right), "what is right is taken");
    let mut random = SplitMix64::new(seed);
    let n_taken = (0..CHANGES).filter(|_| read(&changed(right, &mut random))).count();
    assert!(n_taken < CHANGES, "nothing was refused");
}

fn surface() -> Vec<u8> {
    let vertex = |place: usize| {
        let (row, column) = ((place / GRID.width) as f32, (place % GRID.width) as f32);
        let depth = if column < 12.0 { 1.5 } else { 2.5 };
        Vertex {
            position: [(column - 10.0) / 130.0 * depth, (row - 7.5) / 130.0 * depth, depth],
            flags_rgb: Vertex::pack(
                if place.is_multiple_of(7) { 0 } else { Vertex::VALID },
                0,
                [place as u8; 3],
            ),
            normal: [0.0, 0.0, -1.0],
            reserved: 0,
        }
    };
    let feature = |k: u64| Feature {
        pixel: [k as f32 * 1.3, k as f32 * 1.7],
        sigma_px: 1.0,
        response: k as f32,
        descriptor: [k, k << 9, 7, !k],
        ..Feature::default()
    };
    let features: Vec<Feature> = (0..30).map(feature).collect();
    pack_surface(GRID, vertex, &features)
}

#[test]
fn a_changed_surface_is_refused_or_is_one() {
    read_changed(1, &surface(), |bytes| match from_wire(GRID, bytes) {
        Ok((vertices, features)) => {
            assert_eq!(vertices.len(), GRID.len());
            let numbers = vertices.iter().flat_map(|v| v.position.into_iter().chain(v.normal));
            let numbers =
                numbers.chain(features.iter().flat_map(|f| f.pixel.into_iter().chain([f.sigma_px])));
            assert!(numbers.into_iter().all(f32::is_finite), "a number that is none");
            true
        }
        Err(error) => {
            assert!(!error.to_string().is_empty());
            false
        }
    });
}

#[test]
fn of_a_changed_stream_only_what_was_sent_is_taken() {
    let right: [&[u8]; 3] = [b"the first surface", b"", b"and the third"];
    let mut stream = Vec::new();
    right.iter().for_each(|bytes| append_frame(&mut stream, Some(*bytes).filter(|bytes| !bytes.is_empty())));
    read_changed(2, &stream, |bytes| {
        let found = frames(bytes);
        let whole = found.iter().filter_map(|frame| match frame {
            Framed::Whole(bytes) => Some(*bytes),
            Framed::Gone | Framed::Spoilt => None,
        });
        assert!(whole.into_iter().all(|bytes| right.contains(&bytes)), "bytes that were never sent");
        found.len() == right.len()
    });
}

#[test]
fn a_changed_request_is_refused_or_means_what_it_says() {
    let slots = (1..=5).map(|k| StoreSlot { offset: k * 64, len: 1 << k, crc: k as u32 });
    let surfaces = Request::Surfaces { identity: 7, max: 900, wanted: WantedSurfaces::new(slots.collect()) };
    let bytes = Request::Bytes { file: Growing::Store, identity: 0xfeed, from: 7, checksum: 9, max: 1 << 40 };
    for (seed, request) in [(3, surfaces), (4, bytes)] {
        let (parameters, payload) = (request.to_parameters(), request.payload().into_owned());
        let n_parameters = parameters.len();
        read_changed(seed, &[parameters.as_bytes(), &payload].concat(), |bytes| {
            let (text, payload) = bytes.split_at(n_parameters.min(bytes.len()));
            let parsed = Request::parse(&String::from_utf8_lossy(text), payload);
            let again = |request: &Request| Request::parse(&request.to_parameters(), &request.payload());
            assert!(parsed.as_ref().map_or_else(|why| !why.is_empty(), |r| again(r).as_ref() == Ok(r)));
            parsed.is_ok()
        });
    }
}

#[test]
fn a_changed_piece_is_none() {
    let piece = Piece::data(7, 77, (0..200).collect());
    let label = piece.label();
    let n_label = label.len();
    read_changed(5, &[label.as_slice(), &piece.bytes].concat(), |bytes| {
        let (label, bytes) = bytes.split_at(n_label.min(bytes.len()));
        let read = Piece::read(label, bytes);
        assert!(read.as_ref().map_or(true, |read| *read == piece), "a piece that was never sent");
        read.is_ok()
    });
}

#[test]
fn a_changed_answer_is_none() {
    let answer = crate::run::answer_of(7, 3);
    read_changed(6, &answer.to_bytes().unwrap(), |bytes| {
        let read = BaseAnswer::from_bytes(bytes, 7);
        assert!(read.as_ref().map_or_else(|why| !why.is_empty(), |read| *read == answer));
        read.is_ok()
    });
}
