//! Memory asked for ahead of its use.
#![expect(unsafe_code, reason = "the instruction takes an address; no stable safe form of it exists")]

/// Asks for the cache line in which a value begins, without waiting for it: what is read from it some
/// hundred instructions later is there by then. Changes no result; does nothing where the machine has
/// no such instruction in stable Rust.
#[inline(always)]
pub fn prefetch<T>(value: &T) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        let address = std::ptr::from_ref(value).cast::<i8>();
        // SAFETY: a reference points to memory that may be read, and a prefetch writes nothing; the
        // instruction is part of SSE, which every x86-64 has.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(address) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = value;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_stays_as_it_is() {
        let values: Vec<u64> = (0..1000).collect();
        values.iter().for_each(prefetch);
        assert!(values.iter().enumerate().all(|(k, value)| k as u64 == *value));
    }
}
