//! A keyframe's surface as it stands in the store: the length of the packed vertices, these, and
//! behind them the features as they are. The vertices under features come with the first ones.

use crate::message::Refusal;
use crate::surface_payload::{MAX_FEATURES, check_features, read_features};
use tessera_features::Feature;
use tessera_surface::packed::{FirstVertices, UnpackError, pack_and_round, unpack, unpack_first};
use tessera_surface::{Grid, Vertex};

/// Bytes of the length in front.
const LENGTH: usize = size_of::<u32>();
/// Most bytes of features.
const MAX_FEATURE_BYTES: usize = MAX_FEATURES * size_of::<Feature>();
/// What stands under a feature is found from its position rounded to this, pixels: as it travels.
pub const POSITION_STEP_PX: f32 = 1.0 / 16.0;

/// Why bytes of a store are no surface.
#[derive(Debug, thiserror::Error)]
pub enum StoredSurfaceError {
    /// The vertices.
    #[error(transparent)]
    Vertices(#[from] UnpackError),
    /// The features.
    #[error(transparent)]
    Features(#[from] Refusal),
    /// The lengths.
    #[error("{found} bytes are no surface: expected {expected}")]
    Length {
        /// All bytes.
        found: usize,
        /// What they should hold.
        expected: String,
    },
}

/// The stored form of a surface message's payload, the vertices of the grid and features, with the
/// vertices as [`load_surface`] gives them back.
///
/// # Panics
/// Where the payload has fewer vertices than the grid.
#[expect(
    clippy::indexing_slicing,
    clippy::arithmetic_side_effects,
    clippy::cast_possible_truncation,
    reason = "a surface of ours: its length is bounded by the grid"
)]
pub fn store_surface(grid: Grid, payload: &[Vertex]) -> (Vec<u8>, Vec<Vertex>) {
    let features = read_features(payload, grid.len());
    let (packed, vertices) = pack_and_round(grid, &payload[..grid.len()], &places_under(grid, &features));
    let mut bytes = Vec::with_capacity(LENGTH + packed.len() + size_of_val(features.as_slice()));
    bytes.extend((packed.len() as u32).to_le_bytes());
    bytes.extend(packed);
    bytes.extend(bytemuck::cast_slice::<_, u8>(&features));
    (bytes, vertices)
}

/// Vertices and features of a stored surface.
///
/// # Errors
/// Where the bytes are no surface of this grid.
pub fn load_surface(grid: Grid, bytes: &[u8]) -> Result<(Vec<Vertex>, Vec<Feature>), StoredSurfaceError> {
    let features = load_features(bytes)?;
    let (packed, _) = parts(bytes)?;
    Ok((unpack(grid, packed, &places_under(grid, &features))?, features))
}

/// Of the vertices of a stored surface the first ones alone and those under features; and the features.
///
/// # Errors
/// Where the bytes are no surface of this grid; what is behind the first vertices is not looked at.
pub fn load_first(grid: Grid, bytes: &[u8]) -> Result<(FirstVertices, Vec<Feature>), StoredSurfaceError> {
    let features = load_features(bytes)?;
    let (packed, _) = parts(bytes)?;
    Ok((unpack_first(grid, packed, &places_under(grid, &features))?, features))
}

/// Features of a stored surface alone.
///
/// # Errors
/// Where the bytes are no stored surface; the vertices are not looked at.
pub fn load_features(bytes: &[u8]) -> Result<Vec<Feature>, StoredSurfaceError> {
    let (_, features) = parts(bytes)?;
    let features: Vec<Feature> = bytemuck::pod_collect_to_vec(features);
    check_features(0, &features)?;
    Ok(features)
}

/// The places of the grid under features, rising: what stands there says how far away they are, and most stand at
/// edges, where nothing can be interpolated.
#[expect(clippy::cast_possible_truncation, reason = "a number from 0 to below the length of a side")]
pub fn places_under(grid: Grid, features: &[Feature]) -> Vec<usize> {
    let step = grid.step as f32;
    let cell = |pixel: f32, n: usize| {
        let pixel = (pixel / POSITION_STEP_PX).round() * POSITION_STEP_PX;
        let place = ((pixel - 0.5 * (step - 1.0)) / step + 0.5).floor();
        (place >= 0.0 && place < n as f32).then_some(place as usize)
    };
    let place = |feature: &Feature| {
        let [row, column] = feature.pixel;
        cell(row, grid.height)?.checked_mul(grid.width)?.checked_add(cell(column, grid.width)?)
    };
    let mut places: Vec<usize> = features.iter().filter_map(place).collect();
    places.sort_unstable();
    places.dedup();
    places
}

/// The packed vertices, and the features behind them.
fn parts(bytes: &[u8]) -> Result<(&[u8], &[u8]), StoredSurfaceError> {
    let wrong = |expected: String| StoredSurfaceError::Length { found: bytes.len(), expected };
    let (length, rest) =
        bytes.split_first_chunk::<LENGTH>().ok_or_else(|| wrong(format!("at least {LENGTH}")))?;
    let length = u32::from_le_bytes(*length) as usize;
    let (packed, features) =
        rest.split_at_checked(length).ok_or_else(|| wrong(format!("{length} of packed vertices")))?;
    if features.len() > MAX_FEATURE_BYTES || !features.len().is_multiple_of(size_of::<Feature>()) {
        return Err(wrong(format!("at most {MAX_FEATURES} whole features behind the vertices")));
    }
    Ok((packed, features))
}

/// Most bytes of a stored surface.
pub fn max_stored_bytes(grid: Grid) -> usize {
    // Each number takes at most 57 bits, where it is an escape.
    let vertices = size_of::<Vertex>().saturating_mul(2).saturating_mul(grid.len());
    let rows = grid.height.saturating_mul(64);
    LENGTH.saturating_add(vertices).saturating_add(rows).saturating_add(MAX_FEATURE_BYTES)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface_payload::{vertices_of_features, write_features};

    #[test]
    fn vertices_and_features_come_back() {
        let grid = Grid { width: 8, height: 6, step: 4 };
        let features: Vec<Feature> = (0..5)
            .map(|k| Feature {
                pixel: [k as f32, 2.0],
                descriptor: [k; 4],
                sigma_px: 1.0,
                ..Feature::default()
            })
            .collect();
        let mut payload = vec![Vertex { flags_rgb: 0x0102_0300, ..Vertex::default() }; grid.len()];
        payload.resize(grid.len() + vertices_of_features(features.len()), Vertex::default());
        write_features(&mut payload[grid.len()..], &features);
        let (bytes, rounded) = store_surface(grid, &payload);
        assert!(bytes.len() <= max_stored_bytes(grid));
        let (vertices, back) = load_surface(grid, &bytes).unwrap();
        assert_eq!(vertices, payload[..grid.len()]);
        assert_eq!(vertices, rounded);
        assert_eq!(back[..features.len()], features);
        assert_eq!(load_features(&bytes).unwrap(), back);
        // Features at rows 0 to 4 of column 2, under which are the first vertices of the first two rows.
        let (first, same) = load_first(grid, &bytes).unwrap();
        assert_eq!(same, back);
        assert_eq!([8, 3, 1].map(|place| first.vertex(place)), [vertices[8], vertices[3], Vertex::default()]);
        let message = |bytes: &[u8]| load_surface(grid, bytes).unwrap_err().to_string();
        assert!(message(&bytes[..2]).contains("2 bytes are no surface: expected at least 4"));
        assert!(message(&bytes[..20]).contains("of packed vertices"));
        assert!(message(&bytes[..bytes.len() - 1]).contains("whole features"));
        let mut damaged = bytes;
        damaged[4] ^= 0xff;
        assert!(load_surface(grid, &damaged).is_err());
    }
}
