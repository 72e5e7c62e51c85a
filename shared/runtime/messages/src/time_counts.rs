//! Histogram of durations, of fixed size, that travels in every beat.

use bytemuck::{Pod, Zeroable};

/// Buckets.
const N: usize = 64;
/// Buckets of one doubling.
const PER_OCTAVE: u32 = 4;
/// Everything below 2^16 ns (66 us) is in the first bucket.
const FIRST_OCTAVE: u32 = 16;

/// Counts of durations in 64 buckets, four for each doubling from 66 us to 4.3 s; the first and
/// the last hold what lies beyond.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct TimeCounts(pub [u32; N]);

impl Default for TimeCounts {
    fn default() -> Self {
        Self([0; N])
    }
}

impl TimeCounts {
    /// Counts one duration.
    #[expect(
        clippy::arithmetic_side_effects,
        clippy::indexing_slicing,
        clippy::cast_possible_truncation,
        reason = "an octave is 16 to 63 where it is used, a quarter 0 to 3, and the bucket below N"
    )]
    pub fn add(&mut self, nanos: u64) {
        let octave = nanos.max(1).ilog2();
        let bucket = match octave.checked_sub(FIRST_OCTAVE) {
            None => 0,
            Some(above) => {
                let quarter = (nanos >> (octave - 2)) as usize & 3;
                ((above * PER_OCTAVE) as usize + quarter).min(N - 1)
            }
        };
        self.0[bucket] = self.0[bucket].saturating_add(1);
    }

    /// Both together.
    #[must_use]
    pub fn and(&self, other: &Self) -> Self {
        let mut both = *self;
        both.0.iter_mut().zip(&other.0).for_each(|(sum, n)| *sum = sum.saturating_add(*n));
        both
    }

    /// Least duration of a bucket, nanoseconds; that of the bucket behind the last is its end.
    #[expect(
        clippy::arithmetic_side_effects,
        clippy::cast_possible_truncation,
        reason = "buckets are 0 to N, octaves therefore 16 to 32"
    )]
    pub fn begin_nanos(bucket: usize) -> u64 {
        let (octave, quarter) = (bucket as u32 / PER_OCTAVE + FIRST_OCTAVE, bucket as u64 % 4);
        (4 + quarter) << (octave - 2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_duration_is_in_the_bucket_whose_borders_hold_it() {
        for nanos in [65_536, 81_919, 81_920, 1_000_000, 7_400_000, 999_999_999, 4_294_967_295] {
            let mut counts = TimeCounts::default();
            counts.add(nanos);
            let bucket = counts.0.iter().position(|&n| n == 1).unwrap();
            let (begin, end) = (TimeCounts::begin_nanos(bucket), TimeCounts::begin_nanos(bucket + 1));
            assert!((begin..end).contains(&nanos), "{nanos} in {bucket}: {begin}..{end}");
        }
    }

    #[test]
    fn what_lies_beyond_is_in_the_first_and_the_last() {
        let mut counts = TimeCounts::default();
        [0, 1, 65_535, u64::MAX].into_iter().for_each(|nanos| counts.add(nanos));
        assert_eq!((counts.0[0], counts.0[63]), (3, 1));
        assert_eq!(counts.and(&counts).0[0], 6);
    }
}
