//! Surfaces of keyframes as they travel: which ones a base wants, and the stream in which they come.

use crate::wire::features::{pack_and_round, unpack_features};
use tessera_features::Feature;
use tessera_messages::{StoredSurfaceError, load_first, places_under};
use tessera_slam::StoreSlot;
use tessera_surface::packed::{UnpackError, pack_first, unpack_spread};
use tessera_surface::{Grid, Vertex};

/// Surfaces of one request, at most.
pub const MOST_WANTED: usize = 64;
/// Bytes of a slot in a request.
const SLOT_BYTES: usize = 20;
/// Bytes in front of a surface: its length and its checksum.
const FRAME_BYTES: usize = 8;

/// Where the wanted surfaces lie in the robot's store, as its journal says.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct WantedSurfaces(Vec<StoreSlot>);

impl WantedSurfaces {
    /// These, in this order; at most [`MOST_WANTED`] of them.
    pub fn new(mut slots: Vec<StoreSlot>) -> Self {
        slots.truncate(MOST_WANTED);
        Self(slots)
    }

    /// Where they lie.
    pub fn slots(&self) -> &[StoreSlot] {
        &self.0
    }

    /// As they travel.
    pub fn to_bytes(&self) -> Vec<u8> {
        let bytes = |slot: &StoreSlot| {
            let [offset, len] = [slot.offset, slot.len].map(u64::to_le_bytes);
            offset.into_iter().chain(len).chain(slot.crc.to_le_bytes())
        };
        self.0.iter().flat_map(bytes).collect()
    }

    /// The inverse of [`Self::to_bytes`].
    ///
    /// # Errors
    /// Where the bytes are none, too many, or no whole number of slots.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, String> {
        let n = bytes.len() / SLOT_BYTES;
        if n == 0 || n > MOST_WANTED || !bytes.len().is_multiple_of(SLOT_BYTES) {
            return Err(format!(
                "{} bytes of wanted surfaces, expected 1 to {MOST_WANTED} times {SLOT_BYTES}",
                bytes.len()
            ));
        }
        let slot = |bytes: &[u8; SLOT_BYTES]| {
            let (offset, rest) = bytes.split_first_chunk()?;
            let (len, rest) = rest.split_first_chunk()?;
            let [offset, len] = [*offset, *len].map(u64::from_le_bytes);
            Some(StoreSlot { offset, len, crc: u32::from_le_bytes(*rest.first_chunk()?) })
        };
        Ok(Self(bytes.as_chunks().0.iter().filter_map(slot).collect()))
    }
}

/// Why bytes that travelled are no surface.
#[derive(Debug, thiserror::Error)]
pub enum SurfaceError {
    /// The stored form.
    #[error(transparent)]
    Stored(#[from] StoredSurfaceError),
    /// The vertices.
    #[error(transparent)]
    Vertices(#[from] UnpackError),
    /// The rest.
    #[error("{0} bytes are no surface: expected packed vertices, and features behind them")]
    Length(usize),
}

/// A stored surface as it travels: the length of its first vertices, these, and features.
///
/// # Errors
/// Where the bytes are no surface of this grid.
pub fn wire_form(grid: Grid, stored: &[u8]) -> Result<Vec<u8>, SurfaceError> {
    // What travels is among the first vertices.
    let (vertices, features) = load_first(grid, stored)?;
    Ok(pack_surface(grid, |place| vertices.vertex(place), &features))
}

/// Vertices, by their places in the grid, and features as they travel.
#[expect(clippy::cast_possible_truncation, reason = "a surface of ours: its length is bounded by the grid")]
pub fn pack_surface(grid: Grid, vertex_at: impl Fn(usize) -> Vertex, features: &[Feature]) -> Vec<u8> {
    let (features, rounded) = pack_and_round(features);
    // Its reader finds the places under features anew, from those that it has.
    let vertices = pack_first(grid, vertex_at, &places_under(grid, &rounded));
    let length = (vertices.len() as u32).to_le_bytes();
    [length.as_slice(), &vertices, &features].concat()
}

/// Vertices and features of a surface that travelled.
///
/// # Errors
/// Where the bytes are no surface of this grid.
pub fn from_wire(grid: Grid, bytes: &[u8]) -> Result<(Vec<Vertex>, Vec<Feature>), SurfaceError> {
    let wrong = || SurfaceError::Length(bytes.len());
    let (length, rest) = bytes.split_first_chunk().ok_or_else(wrong)?;
    let length = u32::from_le_bytes(*length) as usize;
    let (packed, features) = rest.split_at_checked(length).ok_or_else(wrong)?;
    let features = unpack_features(features).ok_or_else(wrong)?;
    Ok((unpack_spread(grid, packed, &places_under(grid, &features))?, features))
}

/// Appends a surface to a stream; `None`: the robot has it no more.
#[expect(clippy::cast_possible_truncation, reason = "a surface of ours: its length is bounded by the grid")]
pub fn append_frame(stream: &mut Vec<u8>, surface: Option<&[u8]>) {
    let bytes = surface.unwrap_or_default();
    stream.extend((bytes.len() as u32).to_le_bytes());
    stream.extend(crc32fast::hash(bytes).to_le_bytes());
    stream.extend(bytes);
}

/// A surface in a stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Framed<'a> {
    /// Its bytes.
    Whole(&'a [u8]),
    /// The robot has it no more.
    Gone,
    /// The bytes are not those that were sent.
    Spoilt,
}

/// The surfaces of a stream, as far as it has come.
pub fn frames(stream: &[u8]) -> Vec<Framed<'_>> {
    let (mut rest, mut found) = (stream, Vec::new());
    while let Some((head, behind)) = rest.split_first_chunk::<FRAME_BYTES>() {
        let [a, b, c, d, crc @ ..] = *head;
        let Some((bytes, next)) = behind.split_at_checked(u32::from_le_bytes([a, b, c, d]) as usize) else {
            break;
        };
        found.push(match crc32fast::hash(bytes) == u32::from_le_bytes(crc) {
            false => Framed::Spoilt,
            true if bytes.is_empty() => Framed::Gone,
            true => Framed::Whole(bytes),
        });
        rest = next;
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_messages::{load_surface, store_surface, vertices_of_features, write_features};

    #[test]
    fn wanted_surfaces_come_back_or_are_refused() {
        let slots = (1..=70).map(|k| StoreSlot { offset: k * 64, len: 1 << k.min(50), crc: !(k as u32) });
        let wanted = WantedSurfaces::new(slots.collect());
        assert_eq!(wanted.slots().len(), MOST_WANTED);
        let bytes = wanted.to_bytes();
        assert_eq!(WantedSurfaces::from_bytes(&bytes), Ok(wanted));
        for wrong in [&bytes[1..], &[], &[bytes.as_slice(), &bytes].concat()] {
            assert!(WantedSurfaces::from_bytes(wrong).unwrap_err().contains("expected 1 to 64"));
        }
    }

    /// The robot looks at few of the stored vertices: what it leaves out is not what travels.
    #[test]
    fn a_stored_surface_travels_as_its_vertices_and_features_do() {
        let grid = Grid { width: 41, height: 30, step: 4 };
        let vertex = |place: usize| {
            let (row, column) = ((place / grid.width) as f32, (place % grid.width) as f32);
            let depth = if column < 25.0 { 1.5 } else { 2.5 };
            Vertex {
                position: [(column - 20.0) / 130.0 * depth, (row - 14.5) / 130.0 * depth, depth],
                flags_rgb: Vertex::pack(Vertex::VALID, 0, [place as u8; 3]),
                normal: [0.0, 0.0, -1.0],
                reserved: 0,
            }
        };
        let features: Vec<Feature> = (0..60)
            .map(|k| Feature {
                pixel: [k as f32 * 1.9, k as f32 * 2.7],
                sigma_px: 1.0,
                descriptor: [k; 4],
                ..Feature::default()
            })
            .collect();
        let mut payload: Vec<Vertex> = (0..grid.len()).map(vertex).collect();
        payload.resize(grid.len() + vertices_of_features(features.len()), Vertex::default());
        write_features(&mut payload[grid.len()..], &features);
        let (stored, _) = store_surface(grid, &payload);
        let (vertices, features) = load_surface(grid, &stored).unwrap();
        assert_eq!(wire_form(grid, &stored).unwrap(), pack_surface(grid, |place| vertices[place], &features));
    }

    #[test]
    fn what_stands_under_a_feature_travels_though_nothing_stands_around_it() {
        let grid = Grid { width: 40, height: 30, step: 4 };
        let mut vertices = vec![Vertex::default(); grid.len()];
        let (row, column) = (10, 20);
        let place = row * grid.width + column;
        vertices[place] = Vertex {
            position: [0.1, -0.2, 2.0],
            flags_rgb: Vertex::pack(Vertex::VALID, 0, [90; 3]),
            normal: [0.0, 0.0, -1.0],
            reserved: 0,
        };
        let pixel = [row, column].map(|cell| cell as f32 * 4.0 + 2.2);
        let feature = Feature { pixel, sigma_px: 1.0, response: 20.0, ..Feature::default() };
        let travelled = |features: &[Feature]| {
            let bytes = pack_surface(grid, |place| vertices[place], features);
            from_wire(grid, &bytes).unwrap().0[place]
        };
        assert!((travelled(&[feature]).position[2] - 2.0).abs() < 0.001);
        assert!(!travelled(&[]).is_valid());
    }

    #[test]
    fn a_stream_is_read_as_far_as_it_has_come() {
        let mut stream = Vec::new();
        append_frame(&mut stream, Some(b"first"));
        append_frame(&mut stream, None);
        append_frame(&mut stream, Some(b"third"));
        let all = [Framed::Whole(b"first"), Framed::Gone, Framed::Whole(b"third")];
        assert_eq!(frames(&stream), all);
        for end in 0..stream.len() {
            let found = frames(&stream[..end]);
            assert_eq!(found, all[..found.len()], "{end} bytes");
        }
        stream[9] ^= 1;
        assert_eq!(frames(&stream)[0], Framed::Spoilt);
        assert!(frames(&[255; 40]).is_empty());
    }
}
