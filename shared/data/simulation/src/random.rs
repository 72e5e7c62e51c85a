//! Random numbers by position instead of by sequence: the same for any order and any thread.

use tessera_numerics::SplitMix64;
pub(super) use tessera_numerics::mix;

/// The word at position `at` of the stream named by `key`.
#[inline]
pub(super) fn word(key: u64, at: u64) -> u64 {
    SplitMix64::nth_word(key, at)
}

/// The key of all draws of one frame.
pub(super) fn frame_key(seed: u64, index: u64) -> u64 {
    mix(word(seed, 0x00f7_a3e5).wrapping_add(index.wrapping_mul(0xd1b5_4a32_d192_ed03)))
}

/// Uniform in `[0, 1)`.
pub(super) fn unit(key: u64, at: u64) -> f64 {
    (word(key, at) >> 11) as f64 / (1u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn draws_are_uniform_and_differ_between_frames() {
        let n = 10_000u64;
        let mean: f64 = (0..n).map(|k| unit(frame_key(1, 7), k)).sum::<f64>() / n as f64;
        assert!((mean - 0.5).abs() < 0.02, "{mean}");
        assert_ne!(frame_key(1, 7), frame_key(1, 8));
        assert_ne!(frame_key(1, 7), frame_key(2, 7));
    }
}
