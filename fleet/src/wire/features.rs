//! Features as they travel: the strongest of a keyframe, rounded, in the order of the keyframe, which is by level
//! and row. A descriptor is told by where it differs from the nearest one before it.

use tessera_features::{Feature, hamming_distance, nearest_before};
use tessera_messages::POSITION_STEP_PX;
use tessera_numerics::{BitCoder, BitModel, ByteParts, Isa, NumberModel, RangeReader, RangeWriter};

/// Features of a keyframe that travel, at most.
pub const MOST_FEATURES: usize = 300;
/// Bits of their number.
const COUNT_BITS: u32 = 9;
/// Rounding of a position and of its deviation, pixels.
const PIXEL_STEP: f32 = POSITION_STEP_PX;
/// Bits of a position, and of how many bits the columns of a keyframe take.
const PLACE_BITS: u32 = 16;
const WIDTH_BITS: u32 = 5;
/// Steps of a full turn, in bits.
const ANGLE_BITS: u32 = 8;
const ANGLE_STEPS: f32 = (1 << ANGLE_BITS) as f32;
/// Levels of the pyramid are below this one.
const LEVELS: u8 = 16;
/// A descriptor that differs from all before it in more bits than this is told by itself.
const MOST_DIFFERENT: u32 = 90;
/// Distances of a class, of which each has one probability for a bit to differ.
const DISTANCES: u32 = 8;
const CLASSES: usize = (MOST_DIFFERENT / DISTANCES) as usize + 1;
/// Bytes by where a descriptor differs from a like one: how often each comes, by class.
#[expect(clippy::indexing_slicing, reason = "computed when it is compiled")]
static DIFFERENCES: [ByteParts; CLASSES] = {
    let mut parts = [ByteParts::new(&[1; 256]); CLASSES];
    let mut class = 0;
    while class < CLASSES {
        parts[class] = differences(class as u64);
        class += 1;
    }
    parts
};

/// Each bit of a byte differs with the probability of the middle of a class of distances, of 256 bits.
#[expect(clippy::arithmetic_side_effects, clippy::indexing_slicing, reason = "computed when it is compiled")]
const fn differences(class: u64) -> ByteParts {
    // In 64ths: 4 and 12 of 256 are 1 and 3.
    let one = 2 * class + 1;
    let mut shares = [1; 256];
    let mut byte: usize = 1;
    while byte < 256 {
        let n_ones = byte.count_ones();
        let share = (one.pow(n_ones) * (64 - one).pow(8 - n_ones)) >> 32;
        if share > 1 {
            shares[byte] = share as u32;
        }
        byte += 1;
    }
    ByteParts::new(&shares)
}

/// The strongest of these features, in their order, as bytes, and as their reader has them.
pub fn pack_and_round(features: &[Feature]) -> (Vec<u8>, Vec<Feature>) {
    let rounded = strongest(features);
    (pack_rounded(&rounded), rounded.iter().map(RoundedFeature::feature).collect())
}

#[expect(clippy::indexing_slicing, reason = "places of features of ours")]
fn strongest(features: &[Feature]) -> Vec<RoundedFeature> {
    let mut chosen: Vec<usize> = (0..features.len()).collect();
    chosen.sort_by(|&a, &b| features[b].response.total_cmp(&features[a].response).then(a.cmp(&b)));
    chosen.truncate(MOST_FEATURES);
    chosen.sort_unstable();
    chosen.into_iter().map(|place| RoundedFeature::of(&features[place])).collect()
}

#[expect(
    clippy::arithmetic_side_effects,
    clippy::indexing_slicing,
    clippy::cast_possible_truncation,
    reason = "features of ours, 300 at most"
)]
fn pack_rounded(rounded: &[RoundedFeature]) -> Vec<u8> {
    let widest = rounded.iter().map(|feature| feature.column).max().unwrap_or(0);
    let mut writer = RangeWriter::default();
    writer.plain(rounded.len() as u32, COUNT_BITS);
    let mut models = ByteModels::new(writer.plain(u32::BITS - widest.leading_zeros(), WIDTH_BITS));
    let descriptors: Vec<[u64; 4]> = rounded.iter().map(|feature| feature.descriptor).collect();
    let nearest = nearest_before(&descriptors, Isa::default());
    for (place, (feature, nearest)) in rounded.iter().zip(nearest).enumerate() {
        let like = nearest.filter(|(_, distance)| *distance <= MOST_DIFFERENT).map(|(like, _)| like as u32);
        // What is rounded is within its bounds, so that it comes back as it is.
        models.code(&mut writer, &rounded[..place], *feature, like);
    }
    writer.finish()
}

/// The features of these bytes; `None` where they are none.
pub fn unpack_features(bytes: &[u8]) -> Option<Vec<Feature>> {
    let mut reader = RangeReader::new(bytes);
    let n = reader.plain(0, COUNT_BITS) as usize;
    let width_bits = reader.plain(0, WIDTH_BITS);
    if n > MOST_FEATURES || width_bits > PLACE_BITS {
        return None;
    }
    let (mut models, mut found) = (ByteModels::new(width_bits), Vec::with_capacity(n));
    for _ in 0..n {
        found.push(models.code(&mut reader, &found, RoundedFeature::default(), None)?);
    }
    reader.ends().then(|| found.iter().map(RoundedFeature::feature).collect())
}

/// A feature as integers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct RoundedFeature {
    row: u32,
    column: u32,
    turn: u32,
    response: u32,
    sigma: u32,
    level: u8,
    descriptor: [u64; 4],
}

#[expect(clippy::cast_possible_truncation, reason = "the casts saturate, and an angle goes round")]
impl RoundedFeature {
    /// A conversion of a float to an integer saturates.
    fn of(feature: &Feature) -> Self {
        let [row, column] = feature.pixel.map(|pixel| u32::from((pixel / PIXEL_STEP).round() as u16));
        let turn = (feature.angle_rad / std::f32::consts::TAU * ANGLE_STEPS).round() as i32;
        Self {
            row,
            column,
            turn: (turn as u8).into(),
            response: (feature.response.round() as u8).into(),
            sigma: (feature.sigma_px / PIXEL_STEP).round().clamp(1.0, 255.0) as u32,
            level: feature.level % LEVELS,
            descriptor: feature.descriptor,
        }
    }

    fn feature(&self) -> Feature {
        Feature {
            pixel: [self.row, self.column].map(|place| place as f32 * PIXEL_STEP),
            angle_rad: f32::from((self.turn as u8).cast_signed()) / ANGLE_STEPS * std::f32::consts::TAU,
            response: self.response as f32,
            sigma_px: self.sigma as f32 * PIXEL_STEP,
            level: self.level,
            reserved: [0; 3],
            descriptor: self.descriptor,
        }
    }
}

/// What was learnt of the features so far.
struct ByteModels {
    width_bits: u32,
    level: NumberModel,
    /// Row steps, responses and deviations, by level.
    numbers: Vec<[NumberModel; 3]>,
    is_like_another: BitModel,
    /// Classes of distances to like descriptors.
    class: NumberModel,
}

impl ByteModels {
    fn new(width_bits: u32) -> Self {
        Self {
            width_bits,
            level: NumberModel::default(),
            numbers: (0..LEVELS).map(|_| Default::default()).collect(),
            is_like_another: BitModel::default(),
            class: NumberModel::default(),
        }
    }

    /// Writes the feature behind those `before`, or reads it; `None` where what is read is no feature. `like`: the
    /// place of one before that the descriptor to be written is told by.
    fn code(
        &mut self,
        coder: &mut impl BitCoder,
        before: &[RoundedFeature],
        feature: RoundedFeature,
        like: Option<u32>,
    ) -> Option<RoundedFeature> {
        let last = before.last().copied().unwrap_or_default();
        let step = i32::from(feature.level).saturating_sub(i32::from(last.level));
        let step = self.level.signed(coder, step);
        let level = u8::try_from(i32::from(last.level).checked_add(step)?).ok().filter(|l| *l < LEVELS)?;
        let [rows, responses, sigmas] = self.numbers.get_mut(usize::from(level))?;
        // The rows of a level begin anew.
        let above = if level == last.level { last.row as i32 } else { 0 };
        let row = above.checked_add(rows.signed(coder, (feature.row as i32).saturating_sub(above)))?;
        let row = u32::from(u16::try_from(row).ok()?);
        let column = coder.plain(feature.column, self.width_bits);
        let turn = coder.plain(feature.turn, ANGLE_BITS);
        let response = responses.magnitude(coder, feature.response);
        let sigma = sigmas.magnitude(coder, feature.sigma);
        let is_sound = response <= 255 && (1..=255).contains(&sigma);
        let descriptor = self.descriptor(coder, before, feature.descriptor, like)?;
        is_sound.then_some(RoundedFeature { row, column, turn, response, sigma, level, descriptor })
    }

    /// A descriptor, by where it differs from the one before it at the place `nearest`.
    fn descriptor(
        &mut self,
        coder: &mut impl BitCoder,
        before: &[RoundedFeature],
        descriptor: [u64; 4],
        nearest: Option<u32>,
    ) -> Option<[u64; 4]> {
        let is_like_another = !before.is_empty() && coder.bit(&mut self.is_like_another, nearest.is_some());
        if !is_like_another {
            let mut word = |word: u64| {
                let [high, low] = [word >> u32::BITS, word & u64::from(u32::MAX)];
                let [high, low] = [high, low].map(|half| u32::try_from(half).unwrap_or_default());
                u64::from(coder.plain(high, u32::BITS)) << u32::BITS | u64::from(coder.plain(low, u32::BITS))
            };
            return Some(descriptor.map(&mut word));
        }
        let n_bits = usize::BITS.saturating_sub(before.len().saturating_sub(1).leading_zeros());
        let place = coder.plain(nearest.unwrap_or(0), n_bits);
        let like = before.get(place as usize)?.descriptor;
        let class = self.class.magnitude(coder, hamming_distance(&descriptor, &like) / DISTANCES);
        let parts = DIFFERENCES.get(class as usize)?;
        let mut found = like;
        for (found, of) in found.iter_mut().zip(descriptor) {
            let different = (*found ^ of).to_le_bytes();
            let part = |byte: u8| coder.part(parts, byte.into()).to_le_bytes();
            *found ^= u64::from_le_bytes(different.map(part).map(|[lowest, ..]| lowest));
        }
        Some(found)
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
        assert!(unpack_features(&[]).is_none() && unpack_features(&[255; 80]).is_none());
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

    #[test]
    fn like_descriptors_cost_less() {
        let mut random = SplitMix64::new(9);
        let mut like = features(200);
        let first = like[0].descriptor;
        for feature in &mut like {
            feature.descriptor = first;
            (0..20).for_each(|_| feature.descriptor[random.below(4)] ^= 1 << random.below(64));
        }
        // 37 bytes a feature of noise, of which the descriptor has 32.
        let [like, other] = [like, features(200)].map(|features| pack_features(&features).len());
        assert!(other < 200 * 41 && like < 200 * 25, "{like} and {other} bytes");
    }
}
