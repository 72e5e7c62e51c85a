//! Features as they travel: the strongest of a keyframe, rounded, in the order of the keyframe, 40 bytes each.

use tessera_features::Feature;
use tessera_messages::POSITION_STEP_PX;

/// Features of a keyframe that travel, at most.
pub const MOST_FEATURES: usize = 300;
/// Bytes of a feature: row and column of two bytes, angle, response, deviation and level of one, and its descriptor.
pub const FEATURE_BYTES: usize = 40;
/// Rounding of a position and of its deviation, pixels.
const PIXEL_STEP: f32 = POSITION_STEP_PX;
/// Steps of a full turn.
const ANGLE_STEPS: f32 = 256.0;
/// Levels of the pyramid are below this one.
const LEVELS: u8 = 16;

/// The strongest of these features, in their order, as bytes, and as their reader has them.
pub fn pack_and_round(features: &[Feature]) -> (Vec<u8>, Vec<Feature>) {
    let rounded = strongest(features);
    let bytes = rounded.iter().flat_map(RoundedFeature::bytes).collect();
    (bytes, rounded.iter().map(RoundedFeature::feature).collect())
}

#[expect(clippy::indexing_slicing, reason = "places of features of ours")]
fn strongest(features: &[Feature]) -> Vec<RoundedFeature> {
    let mut chosen: Vec<usize> = (0..features.len()).collect();
    chosen.sort_by(|&a, &b| features[b].response.total_cmp(&features[a].response).then(a.cmp(&b)));
    chosen.truncate(MOST_FEATURES);
    chosen.sort_unstable();
    chosen.into_iter().map(|place| RoundedFeature::of(&features[place])).collect()
}

/// The features of these bytes; `None` where they are none.
pub fn unpack_features(bytes: &[u8]) -> Option<Vec<Feature>> {
    let (features, rest) = bytes.as_chunks::<FEATURE_BYTES>();
    if !rest.is_empty() || features.len() > MOST_FEATURES {
        return None;
    }
    features.iter().map(|bytes| RoundedFeature::read(bytes).map(|feature| feature.feature())).collect()
}

/// A feature as integers.
struct RoundedFeature {
    place: [u16; 2],
    turn: u8,
    response: u8,
    sigma: u8,
    level: u8,
    descriptor: [u64; 4],
}

#[expect(clippy::cast_possible_truncation, reason = "the casts saturate, and an angle goes round")]
impl RoundedFeature {
    fn of(feature: &Feature) -> Self {
        let turn = (feature.angle_rad / std::f32::consts::TAU * ANGLE_STEPS).round() as i32;
        Self {
            place: feature.pixel.map(|pixel| (pixel / PIXEL_STEP).round() as u16),
            turn: turn as u8,
            response: feature.response.round() as u8,
            sigma: (feature.sigma_px / PIXEL_STEP).round().clamp(1.0, 255.0) as u8,
            level: feature.level % LEVELS,
            descriptor: feature.descriptor,
        }
    }

    fn feature(&self) -> Feature {
        Feature {
            pixel: self.place.map(|place| f32::from(place) * PIXEL_STEP),
            angle_rad: f32::from(self.turn.cast_signed()) / ANGLE_STEPS * std::f32::consts::TAU,
            response: f32::from(self.response),
            sigma_px: f32::from(self.sigma) * PIXEL_STEP,
            level: self.level,
            reserved: [0; 3],
            descriptor: self.descriptor,
        }
    }

    fn bytes(&self) -> impl Iterator<Item = u8> {
        let place = self.place.into_iter().flat_map(u16::to_le_bytes);
        let numbers = [self.turn, self.response, self.sigma, self.level];
        place.chain(numbers).chain(self.descriptor.into_iter().flat_map(u64::to_le_bytes))
    }

    /// `None` where a number is none of a feature.
    fn read(bytes: &[u8; FEATURE_BYTES]) -> Option<Self> {
        let [a, b, c, d, turn, response, sigma, level, words @ ..] = *bytes;
        let mut descriptor = [0; 4];
        for (word, bytes) in descriptor.iter_mut().zip(words.as_chunks().0) {
            *word = u64::from_le_bytes(*bytes);
        }
        let place = [[a, b], [c, d]].map(u16::from_le_bytes);
        (sigma > 0 && level < LEVELS).then_some(Self { place, turn, response, sigma, level, descriptor })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_numerics::SplitMix64;

    fn pack_features(features: &[Feature]) -> Vec<u8> {
        pack_and_round(features).0
    }

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
        assert!(unpack_features(&bytes[..bytes.len() - 1]).is_none());
        assert!(unpack_features(&[bytes.as_slice(), &[0]].concat()).is_none());
        assert!(unpack_features(&[255; 2 * FEATURE_BYTES]).is_none(), "no such level");
        assert!(unpack_features(&pack_features(&[])).unwrap().is_empty());
    }

    #[test]
    fn spoilt_bytes_are_refused_or_sound() {
        let bytes = pack_features(&features(60));
        let sound = |f: &Feature| f.sigma_px > 0.0 && f.pixel.iter().all(|v| v.is_finite()) && f.level < 16;
        let mut random = SplitMix64::new(7);
        for _ in 0..2000 {
            let mut spoilt = bytes.clone();
            let at = random.below(spoilt.len());
            spoilt[at] = random.next_u64() as u8;
            assert!(unpack_features(&spoilt).iter().flatten().all(sound));
            let noise: Vec<u8> = (0..random.below(3000)).map(|_| random.next_u64() as u8).collect();
            assert!(unpack_features(&noise).iter().flatten().all(sound));
        }
    }

    #[test]
    fn what_came_travels_on_as_the_same_bytes() {
        let bytes = pack_features(&features(MOST_FEATURES + 50));
        assert_eq!(pack_features(&unpack_features(&bytes).unwrap()), bytes);
        let (_, rounded) = pack_and_round(&features(MOST_FEATURES + 50));
        assert_eq!(Some(rounded), unpack_features(&bytes));
    }
}
