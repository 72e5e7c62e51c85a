//! Integers, bit by bit, each bit by a model of its own.

use super::{BitCoder, BitModel};

/// Magnitudes below this have a bucket of their own.
const EXACT: u32 = 4;
/// Buckets of a magnitude of 32 bits.
const BUCKETS: usize = 64;

/// Learnt probabilities of integers, small ones for the most part.
///
/// A magnitude is a bucket, counted in ones, and the bits within it: buckets hold one magnitude below 4, and
/// above it halves of a power of two.
#[derive(Clone, Debug)]
pub struct NumberModel {
    buckets: [BitModel; BUCKETS],
    first: [BitModel; BUCKETS],
    sign: BitModel,
}

impl Default for NumberModel {
    fn default() -> Self {
        let even = BitModel::default();
        Self { buckets: [even; BUCKETS], first: [even; BUCKETS], sign: even }
    }
}

impl NumberModel {
    /// A number without a sign.
    pub fn magnitude(&mut self, coder: &mut impl BitCoder, value: u32) -> u32 {
        let wanted = bucket(value);
        let mut found = 0;
        while found + 1 < BUCKETS && coder.bit(&mut self.buckets[found], found < wanted) {
            found += 1;
        }
        let (least, n_bits) = bucket_bounds(found);
        let rest = value.wrapping_sub(least);
        let Some(n_plain) = n_bits.checked_sub(1) else { return least };
        let first = coder.bit(&mut self.first[found], rest >> n_plain & 1 != 0);
        least + (u32::from(first) << n_plain) + coder.plain(rest, n_plain)
    }

    /// A number with a sign.
    pub fn signed(&mut self, coder: &mut impl BitCoder, value: i32) -> i32 {
        let magnitude = self.magnitude(coder, value.unsigned_abs());
        let is_negative = magnitude != 0 && coder.bit(&mut self.sign, value < 0);
        if is_negative { magnitude.wrapping_neg() as i32 } else { magnitude as i32 }
    }
}

fn bucket(value: u32) -> usize {
    if value < EXACT {
        return value as usize;
    }
    let n_below = value.ilog2() - 1;
    (EXACT + 2 * (n_below - 1) + (value >> n_below & 1)) as usize
}

/// The least magnitude of a bucket, and the number of bits that select within it.
fn bucket_bounds(bucket: usize) -> (u32, u32) {
    let above = (bucket as u32).wrapping_sub(EXACT);
    if bucket < EXACT as usize {
        (bucket as u32, 0)
    } else {
        ((2 + above % 2) << (above / 2 + 1), above / 2 + 1)
    }
}
