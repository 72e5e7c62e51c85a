//! The rotated binary descriptor of a patch.

use crate::patch::Patch;
use crate::pattern::{POINTS, Pattern, SHIFTS};

/// 256 comparisons of smoothed intensity, in the orientation of the corner.
#[inline(always)]
pub(crate) fn describe(patch: &Patch, angle_rad: f32, pattern: &Pattern) -> [u64; 4] {
    let samples = pattern.at(angle_rad);
    let mut values = [0u8; 2 * POINTS];
    for i in 0..POINTS {
        values[i] = patch.0[usize::from(samples[i]) % patch.0.len()];
    }
    values.copy_within(..POINTS, POINTS);
    let mut bits = [0u8; 256];
    for (part, shift) in SHIFTS.into_iter().enumerate() {
        let (first, second) = (&values[..POINTS], &values[shift..shift + POINTS]);
        for i in 0..POINTS {
            bits[part * POINTS + i] = u8::from(first[i] < second[i]);
        }
    }
    std::array::from_fn(|word| pack(&bits[64 * word..64 * (word + 1)]))
}

/// 64 bytes of 0 or 1 as bits: a product gathers eight of them in its highest byte.
#[inline(always)]
fn pack(bytes: &[u8]) -> u64 {
    let mut word = 0;
    for (k, eight) in bytes.chunks_exact(8).enumerate() {
        let eight = eight.iter().rev().fold(0u64, |word, &byte| word << 8 | u64::from(byte));
        word |= (eight.wrapping_mul(0x0102_0408_1020_4080) >> 56) << (8 * k);
    }
    word
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_numerics::SplitMix64;

    #[test]
    fn bits_keep_their_order() {
        let mut random = SplitMix64::new(9);
        for _ in 0..50 {
            let word = random.next_u64();
            let bytes: Vec<u8> = (0..64).map(|i| (word >> i & 1) as u8).collect();
            assert_eq!(pack(&bytes), word);
        }
    }
}
