//! Places of set bits.

/// Bits of a word.
pub const WORD: usize = u64::BITS as usize;

/// The places of the set bits of a word, rising.
///
/// Where many of a row's places need work, but no one can tell which, a branch for each goes wrong as often as not:
/// with their bits put together first, only the end of a word does.
#[derive(Clone, Copy, Debug)]
pub struct Bits(pub u64);

impl Iterator for Bits {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        let place = self.0.trailing_zeros() as usize;
        self.0 &= self.0.wrapping_sub(1);
        (place < WORD).then_some(place)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_rise_and_none_is_left_out() {
        for word in [0, 1, 1 << 63, u64::MAX, 0x8000_0001_0010_0400] {
            let expected: Vec<usize> = (0..WORD).filter(|place| word >> place & 1 == 1).collect();
            assert_eq!(Bits(word).collect::<Vec<_>>(), expected);
        }
    }
}
