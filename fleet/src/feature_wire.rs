//! Features as they travel: the strongest of a keyframe, 40 bytes each, of which 32 are the descriptor.

use tessera_features::Feature;

/// Features of a keyframe that travel, at most.
pub const MOST_FEATURES: usize = 300;
/// Bytes of a feature.
const FEATURE_BYTES: usize = 8 + 32;
/// Rounding of a position and of its deviation, pixels.
const PIXEL_STEP: f32 = 1.0 / 16.0;
/// Steps of a full turn.
const ANGLE_STEPS: f32 = 256.0;
/// Levels of the pyramid are below this one.
const LEVELS: u8 = 16;

/// The strongest of these features, in their order, as bytes.
pub fn pack_features(features: &[Feature]) -> Vec<u8> {
    let mut chosen: Vec<usize> = (0..features.len()).collect();
    chosen.sort_by(|&a, &b| features[b].response.total_cmp(&features[a].response).then(a.cmp(&b)));
    chosen.truncate(MOST_FEATURES);
    chosen.sort_unstable();
    chosen.into_iter().flat_map(|place| pack_feature(&features[place])).collect()
}

/// A conversion of a float to an integer saturates.
fn pack_feature(feature: &Feature) -> [u8; FEATURE_BYTES] {
    let mut bytes = [0; FEATURE_BYTES];
    let [row, column] = feature.pixel.map(|pixel| ((pixel / PIXEL_STEP).round() as u16).to_le_bytes());
    let turn = (feature.angle_rad / std::f32::consts::TAU * ANGLE_STEPS).round() as i32;
    let sigma = (feature.sigma_px / PIXEL_STEP).round().clamp(1.0, 255.0) as u8;
    bytes[..2].copy_from_slice(&row);
    bytes[2..4].copy_from_slice(&column);
    bytes[4..8].copy_from_slice(&[turn as u8, feature.response.round() as u8, sigma, feature.level % LEVELS]);
    for (bytes, word) in bytes[8..].chunks_exact_mut(8).zip(feature.descriptor) {
        bytes.copy_from_slice(&word.to_le_bytes());
    }
    bytes
}

/// The features of these bytes; `None` where they are none.
pub fn unpack_features(bytes: &[u8]) -> Option<Vec<Feature>> {
    let is_whole = bytes.len().is_multiple_of(FEATURE_BYTES) && bytes.len() <= MOST_FEATURES * FEATURE_BYTES;
    is_whole.then(|| bytes.chunks_exact(FEATURE_BYTES).map(unpack_feature).collect())
}

fn unpack_feature(bytes: &[u8]) -> Feature {
    let pixel = [0, 2].map(|at| f32::from(u16::from_le_bytes([bytes[at], bytes[at + 1]])) * PIXEL_STEP);
    let mut descriptor = [0; 4];
    for (word, bytes) in descriptor.iter_mut().zip(bytes[8..].chunks_exact(8)) {
        *word = bytes.iter().rev().fold(0, |sum: u64, byte| (sum << 8) | u64::from(*byte));
    }
    Feature {
        pixel,
        angle_rad: f32::from(bytes[4].cast_signed()) / ANGLE_STEPS * std::f32::consts::TAU,
        response: bytes[5].into(),
        sigma_px: f32::from(bytes[6].max(1)) * PIXEL_STEP,
        level: bytes[7] % LEVELS,
        reserved: [0; 3],
        descriptor,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_numerics::SplitMix64;

    fn features(n: usize) -> Vec<Feature> {
        let mut random = SplitMix64::new(1);
        let mut feature = || Feature {
            pixel: [480.0, 640.0].map(|size| (random.unit() * size) as f32),
            angle_rad: ((random.unit() - 0.5) * std::f64::consts::TAU) as f32,
            response: random.below(200) as f32,
            sigma_px: [1.0, 1.5, 12.0][random.below(3)],
            level: random.below(4) as u8,
            reserved: [0; 3],
            descriptor: [0; 4].map(|_: u64| random.next_u64()),
        };
        (0..n).map(|_| feature()).collect()
    }

    #[test]
    fn features_come_back_within_the_rounding() {
        let features = features(100);
        let back = unpack_features(&pack_features(&features)).unwrap();
        assert_eq!(back.len(), 100);
        for (back, feature) in back.iter().zip(&features) {
            assert!((0..2).all(|k| (back.pixel[k] - feature.pixel[k]).abs() <= 0.5 * PIXEL_STEP));
            let turned = (back.angle_rad - feature.angle_rad).abs();
            assert!(turned.min(std::f32::consts::TAU - turned) < 0.013, "{back:?} {feature:?}");
            let same = |f: &Feature| (f.response as u8, f.sigma_px.to_bits(), f.level, f.descriptor);
            assert_eq!(same(back), same(feature));
        }
    }

    #[test]
    fn the_strongest_travel_and_other_bytes_are_refused() {
        let features = features(MOST_FEATURES + 200);
        let bytes = pack_features(&features);
        let back = unpack_features(&bytes).unwrap();
        assert_eq!(back.len(), MOST_FEATURES);
        let weakest = back.iter().map(|f| f.response).fold(f32::MAX, f32::min);
        assert!(features.iter().filter(|f| f.response > weakest).count() <= MOST_FEATURES);
        assert!(unpack_features(&bytes[1..]).is_none());
        assert!(unpack_features(&[bytes.as_slice(), &bytes].concat()).is_none());
        let sound = |f: &Feature| f.sigma_px > 0.0 && f.pixel.iter().all(|v| v.is_finite()) && f.level < 16;
        assert!(unpack_features(&[0; 80]).unwrap().iter().all(sound));
        assert!(unpack_features(&[255; 80]).unwrap().iter().all(sound));
    }
}
