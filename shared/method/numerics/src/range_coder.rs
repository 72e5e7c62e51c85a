//! Adaptive binary range coder: bits at the cost of their probability, which is learnt from those before.
//!
//! Martin, "Range encoding: an algorithm for removing redundancy from a digitised message", 1979, with the
//! carryless bounds and the adaptive bits of Mahoney's "Adaptive weighing of context models", 2005.
//! [`BitCoder`] is one walk in both directions: a writer puts the bit that it is given, a reader gives the one
//! that was put. Integers alone, so that every machine writes the same bytes.

/// Fractions of a probability.
const ONE: u32 = 1 << 16;
/// Probabilities stay this far from 0 and 1.
const LEAST: u32 = 48;
/// Bits after which a model learns no slower.
const SLOWEST: u16 = 160;
/// By how much of its surprise a model moves, after so many bits, in fractions: it is the mean of all bits so
/// far, with one and a half of its own before the first.
const RATES: [u32; SLOWEST as usize + 1] = {
    let mut rates = [0; SLOWEST as usize + 1];
    let mut n = 0;
    while n < rates.len() {
        rates[n] = 2 * (ONE - 1) / (2 * n as u32 + 3);
        n += 1;
    }
    rates
};
/// Magnitudes below this have a bucket of their own.
const EXACT: u32 = 4;
/// Buckets of a magnitude of 32 bits.
const BUCKETS: usize = 64;
/// Bits of a state that leave it at once, and the bytes of them.
const OUT_BITS: u32 = 32;
const OUT_BYTES: usize = (OUT_BITS / 8) as usize;
/// Bits behind the last one: most bytes that were not written so end with others.
const END: u32 = 0xa53c;
const END_BITS: u32 = 16;

/// Probability of a bit, learnt from those before.
#[derive(Clone, Copy, Debug)]
pub struct BitModel {
    one: u16,
    n: u16,
}

impl Default for BitModel {
    fn default() -> Self {
        Self { one: (ONE / 2) as u16, n: 0 }
    }
}

impl BitModel {
    #[inline]
    fn learn(&mut self, bit: bool) {
        // Without a branch on the bit: half of all would be taken the wrong way.
        let surprise = i64::from(u32::from(bit) * ONE) - i64::from(self.one);
        let moved = i64::from(self.one) + ((surprise * i64::from(RATES[usize::from(self.n)])) >> 16);
        self.one = moved.clamp(LEAST.into(), (ONE - LEAST).into()) as u16;
        self.n = (self.n + 1).min(SLOWEST);
    }
}

/// Writes or reads bits.
pub trait BitCoder {
    /// A writer puts `bit` and gives it back; a reader gives the bit that was put. `one` of 65,536: how
    /// probable a 1 is, neither 0 nor 65,536.
    fn split(&mut self, one: u16, bit: bool) -> bool;

    /// A bit at the cost that its model says, which learns from it.
    #[inline]
    fn bit(&mut self, model: &mut BitModel, bit: bool) -> bool {
        let bit = self.split(model.one, bit);
        model.learn(bit);
        bit
    }

    /// The `n` lowest bits of `value`, at most 32, the highest first, without a model.
    #[inline]
    fn plain(&mut self, value: u32, n: u32) -> u32 {
        let even = (ONE / 2) as u16;
        (0..n).rev().fold(0, |sum, at| sum << 1 | u32::from(self.split(even, value >> at & 1 != 0)))
    }
}

/// Bits as bytes.
#[derive(Debug)]
pub struct RangeWriter {
    low: u64,
    high: u64,
    bytes: Vec<u8>,
}

impl Default for RangeWriter {
    fn default() -> Self {
        Self { low: 0, high: u64::MAX, bytes: Vec::new() }
    }
}

impl RangeWriter {
    /// All bytes, and what marks their end.
    pub fn finish(mut self) -> Vec<u8> {
        self.plain(END, END_BITS);
        let (last, n) = last_bytes(self.low, self.high);
        self.bytes.extend(&last.to_be_bytes()[..n]);
        self.bytes
    }
}

/// The last value of a range for which the bit is 1.
#[inline]
fn middle(low: u64, high: u64, one: u16) -> u64 {
    low + ((high - low) >> 16) * u64::from(one)
}

/// The fewest highest bytes that say which range it is, zeros behind them, and how many.
fn last_bytes(low: u64, high: u64) -> (u64, usize) {
    let cut = |n: usize| high & (u64::MAX << (64 - 8 * n));
    (1..8).map(|n| (cut(n), n)).find(|(last, _)| *last >= low).unwrap_or((high, 8))
}

impl BitCoder for RangeWriter {
    #[inline]
    fn split(&mut self, one: u16, bit: bool) -> bool {
        let middle = middle(self.low, self.high, one);
        (self.low, self.high) = if bit { (self.low, middle) } else { (middle + 1, self.high) };
        // Seldom, so that the branch is taken right.
        while (self.low ^ self.high) >> OUT_BITS == 0 {
            self.bytes.extend(((self.high >> OUT_BITS) as u32).to_be_bytes());
            (self.low, self.high) = shifted(self.low, self.high);
        }
        bit
    }
}

/// A range without the bits that its ends share.
#[inline]
fn shifted(low: u64, high: u64) -> (u64, u64) {
    (low << OUT_BITS, high << OUT_BITS | u64::from(u32::MAX))
}

/// Bits from bytes. Any bytes are bits of something; whether they were written so, [`Self::ends`] says.
#[derive(Debug)]
pub struct RangeReader<'a> {
    low: u64,
    high: u64,
    value: u64,
    bytes: &'a [u8],
    /// Bytes that were shifted out.
    n_done: usize,
}

impl<'a> RangeReader<'a> {
    /// Begins at the first bit.
    pub fn new(bytes: &'a [u8]) -> Self {
        let value = word(bytes, 0) << OUT_BITS | word(bytes, OUT_BYTES);
        Self { low: 0, high: u64::MAX, value, bytes, n_done: 0 }
    }

    /// Whether the bits so far are all, as [`RangeWriter::finish`] ends them.
    pub fn ends(mut self) -> bool {
        let is_marked = self.plain(0, END_BITS) == END;
        let (last, n) = last_bytes(self.low, self.high);
        is_marked && self.value == last && self.bytes.len() == self.n_done + n
    }
}

/// As many bytes as leave a state at once; behind the last one there are zeros.
fn word(bytes: &[u8], from: usize) -> u64 {
    let byte = |at: usize| u64::from(bytes.get(at).copied().unwrap_or(0));
    (from..from + OUT_BYTES).fold(0, |sum, at| sum << 8 | byte(at))
}

impl BitCoder for RangeReader<'_> {
    #[inline]
    fn split(&mut self, one: u16, _: bool) -> bool {
        let middle = middle(self.low, self.high, one);
        let bit = self.value <= middle;
        (self.low, self.high) = if bit { (self.low, middle) } else { (middle + 1, self.high) };
        while (self.low ^ self.high) >> OUT_BITS == 0 {
            (self.low, self.high) = shifted(self.low, self.high);
            self.value = self.value << OUT_BITS | word(self.bytes, self.n_done + 2 * OUT_BYTES);
            self.n_done += OUT_BYTES;
        }
        bit
    }
}

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

/// The least magnitude of a bucket, and how many bits say which of it.
fn bucket_bounds(bucket: usize) -> (u32, u32) {
    let above = (bucket as u32).wrapping_sub(EXACT);
    if bucket < EXACT as usize {
        (bucket as u32, 0)
    } else {
        ((2 + above % 2) << (above / 2 + 1), above / 2 + 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SplitMix64;

    fn numbers() -> Vec<i32> {
        let mut random = SplitMix64::new(3);
        let edges = [0, 1, -1, 3, 4, 5, 6, 7, 8, -9, 12, i32::MAX, i32::MIN, i32::MIN + 1];
        let spread = (0..3000).map(|k| random.next_u64() as i32 >> (k % 32));
        edges.into_iter().chain(spread).collect()
    }

    fn written(numbers: &[i32]) -> Vec<u8> {
        let (mut writer, mut model) = (RangeWriter::default(), NumberModel::default());
        numbers.iter().for_each(|&number| _ = model.signed(&mut writer, number));
        writer.finish()
    }

    fn read(bytes: &[u8], n: usize) -> (Vec<i32>, bool) {
        let (mut reader, mut model) = (RangeReader::new(bytes), NumberModel::default());
        let numbers = (0..n).map(|_| model.signed(&mut reader, 0)).collect();
        (numbers, reader.ends())
    }

    #[test]
    fn numbers_come_back() {
        let numbers = numbers();
        for n in (0..200).chain([numbers.len()]) {
            assert_eq!(read(&written(&numbers[..n]), n), (numbers[..n].to_vec(), true), "{n} numbers");
        }
        for magnitude in [0, 1, 4, 1 << 31, u32::MAX] {
            let (mut writer, mut model) = (RangeWriter::default(), NumberModel::default());
            assert_eq!(model.magnitude(&mut writer, magnitude), magnitude);
            let bytes = writer.finish();
            assert_eq!(NumberModel::default().magnitude(&mut RangeReader::new(&bytes), 0), magnitude);
        }
    }

    #[test]
    fn bits_cost_what_they_tell() {
        let mut random = SplitMix64::new(5);
        let (mut writer, mut model) = (RangeWriter::default(), BitModel::default());
        // One in ten: 0.469 bits each.
        (0..80_000).for_each(|_| _ = writer.bit(&mut model, random.below(10) == 0));
        let n_bytes = writer.finish().len();
        assert!((4690..4840).contains(&n_bytes), "{n_bytes} bytes");
    }

    #[test]
    fn other_bytes_give_numbers_and_are_told_from_written_ones() {
        let numbers = &numbers()[..500];
        let bytes = written(numbers);
        assert!(!read(&bytes[..bytes.len() - 1], 500).1);
        assert!(!read(&[bytes.as_slice(), &[0]].concat(), 500).1);
        assert!(!read(&[], 500).1 && !read(&[255; 4000], 500).1 && !read(&[0; 4000], 500).1);
    }
}
