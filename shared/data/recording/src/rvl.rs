//! RVL, the lossless code of depth images in ROS's `compressedDepth`: Wilson, "Fast Lossless
//! Depth Image Compression", ISS 2017.
//!
//! Runs of zeros and runs of measurements take turns; a measurement is its difference to the one
//! before. Each number is written in nibbles of three bits, lowest first, whose fourth bit says
//! that more follow; eight nibbles make a little-endian word, the first one at its top.

use crate::error::MessageError;

/// Bytes of columns and rows, as little-endian words, before the code.
const SIZE_BYTES: usize = 8;

/// Columns, rows and code of an image.
pub(super) fn split(data: &[u8]) -> Result<((u32, u32), &[u8]), MessageError> {
    let split = data.split_first_chunk().and_then(|(width, rest)| Some((width, rest.split_first_chunk()?)));
    let (width, (height, code)) =
        split.ok_or_else(|| wrong(format!("{} bytes, expected at least {SIZE_BYTES}", data.len())))?;
    Ok(((u32::from_le_bytes(*width), u32::from_le_bytes(*height)), code))
}

/// Decodes all of `depth_raw`; 0 is no measurement.
pub(super) fn decode(code: &[u8], depth_raw: &mut [u16]) -> Result<(), MessageError> {
    let mut nibbles = code.as_chunks::<4>().0.iter().flat_map(|word| {
        let word = u32::from_le_bytes(*word);
        (0..u32::BITS).step_by(4).rev().map(move |at| word >> at & 0xf)
    });
    let n_pixels = depth_raw.len();
    let mut number = |at: usize| -> Result<u32, MessageError> {
        let mut value = 0;
        for shift in (0..u32::BITS).step_by(3) {
            let nibble =
                nibbles.next().ok_or_else(|| wrong(format!("it ends at pixel {at} of {n_pixels}")))?;
            value |= (nibble & 7) << shift;
            if nibble & 8 == 0 {
                return Ok(value);
            }
        }
        Err(wrong(format!("a number of more than 32 bits at pixel {at}")))
    };
    let (mut at, mut last) = (0_usize, 0i32);
    while at < n_pixels {
        for is_measured in [false, true] {
            let n = number(at)? as usize;
            let Some(run) = depth_raw.get_mut(at..).and_then(|rest| rest.get_mut(..n)) else {
                return Err(wrong(format!("a run of {n} at pixel {at} of {n_pixels}")));
            };
            if is_measured {
                for (step, raw) in run.iter_mut().enumerate() {
                    let pixel = at.saturating_add(step);
                    let zigzag = number(pixel)?;
                    let sign = ((zigzag & 1) as i32).wrapping_neg();
                    last = last.wrapping_add((zigzag >> 1) as i32 ^ sign);
                    let out = |_| wrong(format!("depth {last} at pixel {pixel}, expected 16 bits"));
                    *raw = u16::try_from(last).map_err(out)?;
                }
            } else {
                run.fill(0);
            }
            at = at.saturating_add(n);
        }
    }
    Ok(())
}

fn wrong(reason: String) -> MessageError {
    MessageError::Kind { kind: "RVL image", reason }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_code_of_another_encoder_is_read() {
        // Of the package `rvl` from PyPI.
        let check = |code: &[u8], depth_raw: &[u16]| {
            let mut found = vec![9; depth_raw.len()];
            decode(code, &mut found).unwrap();
            assert_eq!(found, depth_raw);
        };
        check(&[0x14, 0x13, 0x28, 0x02], &[1, 5, 0, 0, 0, 7]);
        check(&[0x20, 0x10, 0x22, 0x41], &[0, 0, 0, 0, 1, 0, 0, 1, 0, 0]);
        check(&[0x00, 0xa1, 0x2c, 0x0c, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0], &[42; 20]);
    }

    #[test]
    fn what_cannot_be_is_named() {
        let words = |code: &[u8], n: usize| decode(code, &mut vec![0; n]).unwrap_err().to_string();
        assert!(words(&[], 6).contains("no RVL image: it ends at pixel 0 of 6"));
        assert!(words(&[0x14, 0x13, 0x28, 0x02], 60).contains("it ends at pixel 6 of 60"));
        assert!(words(&[0x14, 0x13, 0x28, 0x02], 1).contains("a run of 2 at pixel 0 of 1"));
        assert!(words(&[0xff; 16], 6).contains("more than 32 bits"));
        // A first difference of -1.
        assert!(words(&[0, 0, 0x10, 0x01], 6).contains("depth -1 at pixel 0, expected 16 bits"));
        assert!(split(&[1, 0, 0, 0, 2]).unwrap_err().to_string().contains("5 bytes, expected at least 8"));
    }
}
