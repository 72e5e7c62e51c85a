//! Random numbers that depend on a seed and nothing else.

/// SplitMix64 (Steele, Lea and Flood 2014): small, fast, and the same everywhere.
#[derive(Clone, Debug)]
pub struct SplitMix64(u64);

/// Finaliser of SplitMix64: neighbouring words have nothing in common after it.
#[inline]
pub fn mix(word: u64) -> u64 {
    let word = (word ^ (word >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let word = (word ^ (word >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    word ^ (word >> 31)
}

/// Distance of two successive states.
const GAMMA: u64 = 0x9e37_79b9_7f4a_7c15;

impl SplitMix64 {
    /// The generator of a seed.
    pub const fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Word number `n` of the generator of a seed, by position instead of by sequence; the first
    /// has number 1.
    #[inline]
    pub fn nth_word(seed: u64, n: u64) -> u64 {
        mix(seed.wrapping_add(n.wrapping_mul(GAMMA)))
    }

    /// A generator for one frame: the run's seed mixed with the frame's index.
    pub fn for_frame(seed: u64, index: u64) -> Self {
        let mut mixer = Self(seed ^ 0x5851_f42d_4c95_7f2d);
        let start = mixer.next_u64() ^ index.wrapping_mul(GAMMA);
        Self(start)
    }

    /// The next 64 bits.
    pub fn next_u64(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(GAMMA);
        mix(self.0)
    }

    /// A number in `0..n`, without the bias of a remainder that matters; 0 for `n == 0`.
    pub fn below(&mut self, n: usize) -> usize {
        ((u128::from(self.next_u64()) * n as u128) >> 64) as usize
    }

    /// A number in `0.0..1.0`.
    pub fn unit(&mut self) -> f64 {
        (self.next_u64() >> 11) as f64 / (1u64 << 53) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_those_of_the_published_generator() {
        // The first outputs for seed 1234567, from the reference implementation in C.
        let expected = [6_457_827_717_110_365_317, 3_203_168_211_198_807_973, 9_817_491_932_198_370_423];
        let mut random = SplitMix64::new(1_234_567);
        for (n, word) in (1..).zip(expected) {
            assert_eq!((random.next_u64(), SplitMix64::nth_word(1_234_567, n)), (word, word));
        }
    }
}
