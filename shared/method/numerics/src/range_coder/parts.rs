//! Values that are told at once, by how large their parts of all are.

use super::{ONE, ONE_BITS};

/// Parts of 65,536, one for each value below a power of two.
pub trait Parts {
    /// How many bits all values have, at most 16.
    fn n_bits(&self) -> u32;

    /// Where the part of a value begins and ends.
    fn bounds(&self, value: u32) -> [u32; 2];

    /// The value in whose part this is.
    fn value_at(&self, at: u32) -> u32;
}

/// All parts of the same size, for values of so many bits.
pub(super) struct EvenParts(pub(super) u32);

impl Parts for EvenParts {
    #[inline]
    fn n_bits(&self) -> u32 {
        self.0
    }

    #[inline]
    fn bounds(&self, value: u32) -> [u32; 2] {
        [value, value + 1].map(|value| value << (ONE_BITS - self.0))
    }

    #[inline]
    fn value_at(&self, at: u32) -> u32 {
        at >> (ONE_BITS - self.0)
    }
}

/// Parts of bytes, each as large as its probability.
#[derive(Clone, Copy, Debug)]
pub struct ByteParts {
    starts: [u32; 257],
}

impl ByteParts {
    /// These shares of 65,536, at least 1 each; what they lack of the sum goes to the first byte.
    ///
    /// # Panics
    /// Where they are more.
    pub const fn new(shares: &[u32; 256]) -> Self {
        let mut starts = [ONE; 257];
        let mut byte = 256;
        while byte > 1 {
            byte -= 1;
            assert!(shares[byte] > 0 && shares[byte] < starts[byte + 1], "shares of 65,536");
            starts[byte] = starts[byte + 1] - shares[byte];
        }
        starts[0] = 0;
        Self { starts }
    }
}

impl Parts for ByteParts {
    #[inline]
    fn n_bits(&self) -> u32 {
        8
    }

    #[inline]
    fn bounds(&self, value: u32) -> [u32; 2] {
        let byte = usize::from(value as u8);
        [self.starts[byte], self.starts[byte + 1]]
    }

    #[inline]
    fn value_at(&self, at: u32) -> u32 {
        self.starts.partition_point(|start| *start <= at) as u32 - 1
    }
}
