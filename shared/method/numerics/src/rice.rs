//! Rice codes: small integers in few bits, row by row, each row with the parameter that suits it.
//!
//! Rice and Plaunt, "Adaptive Variable-Length Coding for Efficient Compression of Spacecraft
//! Television Data", 1971. A value `v` with parameter `k` is `v >> k` zeros, a one, and its lowest
//! `k` bits. Bits fill bytes from the lowest on.

/// Zeros of a code before it is an escape: 32 bits of the value follow.
const ESCAPE: u32 = 24;
/// Bits of a row's parameter.
const PARAMETER_BITS: u32 = 5;

/// The code of a signed residual as an unsigned one: 0, -1, 1, -2, 2 are 0, 1, 2, 3, 4.
#[inline]
pub fn zigzag(value: i32) -> u32 {
    ((value << 1) ^ (value >> 31)) as u32
}

/// Inverse of [`zigzag`].
#[inline]
pub fn unzigzag(code: u32) -> i32 {
    (code >> 1) as i32 ^ -((code & 1) as i32)
}

/// Parameter for values of this sum: some 0.7 times their mean lies below `2^k`.
fn parameter(sum: u64, n: usize) -> u32 {
    let mean = sum * 45 / (64 * n.max(1) as u64);
    u64::BITS - mean.leading_zeros()
}

/// Rows of codes, written to bytes.
#[derive(Debug, Default)]
pub struct RiceWriter {
    bytes: Vec<u8>,
    bits: u64,
    n_bits: u32,
}

impl RiceWriter {
    /// Appends a row.
    pub fn row(&mut self, values: &[u32]) {
        let sum = values.iter().map(|&value| u64::from(value)).sum();
        let k = parameter(sum, values.len()).min(31);
        self.push(k.into(), PARAMETER_BITS);
        for &value in values {
            let zeros = value >> k;
            if zeros < ESCAPE {
                let low = value & ((1 << k) - 1);
                self.push((u64::from(low) << 1 | 1) << zeros, zeros + 1 + k);
            } else {
                self.push(1 << ESCAPE, ESCAPE + 1);
                self.push(value.into(), u32::BITS);
            }
        }
    }

    /// Appends the `n` lowest bits of `bits`, at most 56; those above are zero.
    #[inline]
    fn push(&mut self, bits: u64, n: u32) {
        self.bits |= bits << self.n_bits;
        self.n_bits += n;
        if self.n_bits >= u64::BITS {
            self.bytes.extend(self.bits.to_le_bytes());
            self.n_bits -= u64::BITS;
            self.bits = if self.n_bits == 0 { 0 } else { bits >> (n - self.n_bits) };
        }
    }

    /// All bytes; the last bits of the last one are zero.
    pub fn finish(mut self) -> Vec<u8> {
        let n_bytes = self.n_bits.div_ceil(8) as usize;
        self.bytes.extend(&self.bits.to_le_bytes()[..n_bytes]);
        self.bytes
    }
}

/// Rows of codes, read from bytes.
#[derive(Debug)]
pub struct RiceReader<'a> {
    bytes: &'a [u8],
    bits: u64,
    n_bits: u32,
}

impl<'a> RiceReader<'a> {
    /// Begins at the first row.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, bits: 0, n_bits: 0 }
    }

    /// Reads a row; `None` where the bytes end before it does, or hold no code.
    pub fn row(&mut self, values: &mut [u32]) -> Option<()> {
        let k = self.take(PARAMETER_BITS)?;
        let (longest, low) = (ESCAPE + k, (1 << k) - 1);
        for value in values {
            if self.n_bits < longest {
                self.refill();
            }
            let zeros = self.bits.trailing_zeros();
            let n = zeros + 1 + k;
            // Nearly all codes.
            if zeros < ESCAPE && n <= self.n_bits {
                *value = zeros << k | (self.bits >> (zeros + 1)) as u32 & low;
                self.bits >>= n;
                self.n_bits -= n;
                continue;
            }
            self.refill();
            let zeros = self.bits.trailing_zeros();
            if zeros > ESCAPE {
                return None;
            }
            self.skip(zeros + 1)?;
            *value = if zeros < ESCAPE { zeros << k | self.take(k)? } else { self.take(u32::BITS)? };
        }
        Some(())
    }

    /// Whether nothing but the padding of the last byte is left.
    pub fn is_at_end(&self) -> bool {
        self.bytes.is_empty() && self.n_bits < 8 && self.bits == 0
    }

    /// Holds at least 56 bits, or all that are left.
    #[inline]
    fn refill(&mut self) {
        if self.n_bits >= 56 {
            return;
        }
        if let Some((word, _)) = self.bytes.split_first_chunk::<8>() {
            let n_bytes = (u64::BITS - 1 - self.n_bits) / 8;
            let word = u64::from_le_bytes(*word) & (u64::MAX >> (u64::BITS - 8 * n_bytes));
            self.bits |= word << self.n_bits;
            self.n_bits += 8 * n_bytes;
            self.bytes = &self.bytes[n_bytes as usize..];
            return;
        }
        while self.n_bits <= 56
            && let Some((&byte, rest)) = self.bytes.split_first()
        {
            self.bits |= u64::from(byte) << self.n_bits;
            self.n_bits += 8;
            self.bytes = rest;
        }
    }

    #[inline]
    fn take(&mut self, n: u32) -> Option<u32> {
        self.refill();
        let taken = (self.bits & ((1 << n) - 1)) as u32;
        self.skip(n)?;
        Some(taken)
    }

    #[inline]
    fn skip(&mut self, n: u32) -> Option<()> {
        self.n_bits = self.n_bits.checked_sub(n)?;
        self.bits >>= n;
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SplitMix64;

    fn rows() -> Vec<Vec<u32>> {
        let mut random = SplitMix64::new(3);
        let mut rows = vec![vec![], vec![0; 300], vec![u32::MAX; 5], vec![0, 0, 0, u32::MAX, 1]];
        for bits in 1..=32 {
            let len = 1 + random.next_u64() as usize % 200;
            rows.push((0..len).map(|_| (random.next_u64() >> (64 - bits)) as u32).collect());
        }
        rows
    }

    #[test]
    fn rows_come_back() {
        let rows = rows();
        let mut writer = RiceWriter::default();
        rows.iter().for_each(|row| writer.row(row));
        let bytes = writer.finish();
        let mut reader = RiceReader::new(&bytes);
        for row in &rows {
            let mut back = vec![7; row.len()];
            reader.row(&mut back).unwrap();
            assert_eq!(&back, row);
        }
        assert!(reader.is_at_end());
        for value in [0, 1, -1, 77, i32::MAX, i32::MIN] {
            assert_eq!(unzigzag(zigzag(value)), value);
        }
    }

    #[test]
    fn small_values_take_few_bits() {
        let mut random = SplitMix64::new(5);
        let row: Vec<u32> = (0..10_000).map(|_| (random.next_u64() % 8) as u32).collect();
        let mut writer = RiceWriter::default();
        writer.row(&row);
        // Three bits of information and less than one of overhead.
        assert!(writer.finish().len() < 10_000 * 4 / 8);
    }

    #[test]
    fn any_bytes_give_a_row_or_none() {
        let rows = rows();
        let mut writer = RiceWriter::default();
        rows.iter().for_each(|row| writer.row(row));
        let bytes = writer.finish();
        let mut row = vec![0; 5000];
        assert!(RiceReader::new(&bytes[..bytes.len().min(40)]).row(&mut row).is_none());
        assert!(RiceReader::new(&[0; 4000]).row(&mut row).is_none(), "no code is all zeros");
        let mut random = SplitMix64::new(9);
        for _ in 0..200 {
            let noise: Vec<u8> = (0..600).map(|_| random.next_u64() as u8).collect();
            let mut reader = RiceReader::new(&noise);
            while reader.row(&mut row[..100]).is_some() {}
        }
    }

    #[test]
    fn an_escape_comes_back_wherever_it_stands_among_short_codes() {
        for n in 0..130 {
            let row: Vec<u32> = (0..400).map(|at| if at == n { 40 } else { 0 }).collect();
            let mut writer = RiceWriter::default();
            writer.row(&row);
            let bytes = writer.finish();
            let (mut reader, mut back) = (RiceReader::new(&bytes), vec![0; row.len()]);
            reader.row(&mut back).unwrap();
            assert!(back == row && reader.is_at_end(), "at {n}");
        }
    }
}
