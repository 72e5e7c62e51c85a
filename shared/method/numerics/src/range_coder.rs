//! Adaptive binary range coder: bits at the cost of their probability, which is learnt from those before.
//!
//! Martin, "Range encoding: an algorithm for removing redundancy from a digitised message", 1979, with the
//! carryless bounds and the adaptive bits of Mahoney's "Adaptive weighing of context models", 2005.
//! [`BitCoder`] is one walk in both directions: a writer puts the bit that it is given, a reader gives the one
//! that was put. Integers alone, so that every machine writes the same bytes.

mod number_model;
mod parts;

pub use number_model::NumberModel;
use parts::EvenParts;
pub use parts::{ByteParts, Parts};

/// Fractions of a probability.
const ONE: u32 = 1 << ONE_BITS;
const ONE_BITS: u32 = 16;
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

    /// A value at the cost of its part of all.
    fn part(&mut self, parts: &impl Parts, value: u32) -> u32;

    /// A bit at the cost of its model, which learns from it.
    #[inline]
    fn bit(&mut self, model: &mut BitModel, bit: bool) -> bool {
        let bit = self.split(model.one, bit);
        model.learn(bit);
        bit
    }

    /// The `n` lowest bits of `value`, at most 32, the highest first, without a model.
    #[inline]
    fn plain(&mut self, value: u32, n: u32) -> u32 {
        let n_low = n.min(ONE_BITS);
        let above = if n > n_low { self.plain(value >> n_low, n - n_low) << n_low } else { 0 };
        above | self.part(&EvenParts(n_low), value & ((1 << n_low) - 1))
    }
}

/// One bit after the other: for a range that is too narrow to be parted.
fn bits(coder: &mut (impl BitCoder + ?Sized), value: u32, n: u32) -> u32 {
    let even = (ONE / 2) as u16;
    (0..n).rev().fold(0, |sum, at| sum << 1 | u32::from(coder.split(even, value >> at & 1 != 0)))
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
    #[inline]
    fn shift(&mut self) {
        // Seldom, so that the branch is taken right.
        while (self.low ^ self.high) >> OUT_BITS == 0 {
            self.bytes.extend(((self.high >> OUT_BITS) as u32).to_be_bytes());
            (self.low, self.high) = shifted(self.low, self.high);
        }
    }

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

/// A part of a range; the last one has what is left.
#[inline]
fn narrowed(low: u64, high: u64, [from, to]: [u32; 2]) -> (u64, u64) {
    let step = (high - low) >> ONE_BITS;
    (low + step * u64::from(from), if to < ONE { low + step * u64::from(to) - 1 } else { high })
}

/// The fewest highest bytes that identify the range, zeros behind them, and their number.
fn last_bytes(low: u64, high: u64) -> (u64, usize) {
    let cut = |n: usize| high & (u64::MAX << (64 - 8 * n));
    (1..8).map(|n| (cut(n), n)).find(|(last, _)| *last >= low).unwrap_or((high, 8))
}

impl BitCoder for RangeWriter {
    #[inline]
    fn split(&mut self, one: u16, bit: bool) -> bool {
        let middle = middle(self.low, self.high, one);
        (self.low, self.high) = if bit { (self.low, middle) } else { (middle + 1, self.high) };
        self.shift();
        bit
    }

    #[inline]
    fn part(&mut self, parts: &impl Parts, value: u32) -> u32 {
        if (self.high - self.low) >> ONE_BITS == 0 {
            return bits(self, value, parts.n_bits());
        }
        (self.low, self.high) = narrowed(self.low, self.high, parts.bounds(value));
        self.shift();
        value
    }
}

/// A range without the bits that its ends share.
#[inline]
fn shifted(low: u64, high: u64) -> (u64, u64) {
    (low << OUT_BITS, high << OUT_BITS | u64::from(u32::MAX))
}

/// Bits from bytes. Any bytes are bits of something; [`Self::ends`] checks whether they were written so.
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

    #[inline]
    fn shift(&mut self) {
        while (self.low ^ self.high) >> OUT_BITS == 0 {
            (self.low, self.high) = shifted(self.low, self.high);
            self.value = self.value << OUT_BITS | word(self.bytes, self.n_done + 2 * OUT_BYTES);
            self.n_done += OUT_BYTES;
        }
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
        self.shift();
        bit
    }

    #[inline]
    fn part(&mut self, parts: &impl Parts, _: u32) -> u32 {
        let step = (self.high - self.low) >> ONE_BITS;
        if step == 0 {
            return bits(self, 0, parts.n_bits());
        }
        let at = (self.value - self.low) / step;
        let value = parts.value_at(at.min((ONE - 1).into()) as u32);
        (self.low, self.high) = narrowed(self.low, self.high, parts.bounds(value));
        self.shift();
        value
    }
}

#[cfg(test)]
mod tests;
