//! Depth images and times as files of many frames store them.

use crate::ImageError;
use crate::folder::nanos_of;
use flate2::read::ZlibDecoder;
use std::io::Read;

/// Frames a second where the file has no times.
const USUAL_FPS: f64 = 30.0;
/// Microseconds between two frames, at the least: what is nearer counts frames.
const LEAST_STEP: i64 = 1_000;

/// Values of 16 bits, the lower byte first, as they are or by zlib.
pub(crate) fn depth(
    bytes: &[u8],
    is_zlib: bool,
    size: (u32, u32),
    depth_raw: &mut [u16],
) -> Result<(), ImageError> {
    let expected = depth_raw.len().saturating_mul(2);
    let mut inflated = Vec::new();
    let bytes = match is_zlib {
        true => {
            // One byte more: too many are as wrong as too few.
            let most = (expected as u64).saturating_add(1);
            ZlibDecoder::new(bytes)
                .take(most)
                .read_to_end(&mut inflated)
                .map_err(|error| ImageError::Damaged { format: "zlib stream", message: error.to_string() })?;
            &inflated
        }
        false => bytes,
    };
    if bytes.len() != expected {
        let found = bytes.len().to_string();
        return Err(ImageError::Length { what: "depth", found, expected, size });
    }
    for (raw, bytes) in depth_raw.iter_mut().zip(bytes.as_chunks::<2>().0) {
        *raw = u16::from_le_bytes(*bytes);
    }
    Ok(())
}

/// Nanoseconds of each frame: as written, microseconds, where they rise, else by number.
pub(crate) fn stamps(micros: &[Option<i64>], fps: Option<f64>) -> (Vec<i64>, String) {
    let written: Option<Vec<i64>> = micros.iter().map(|micros| micros.as_ref()?.checked_mul(1_000)).collect();
    let are_times = |stamps: &Vec<i64>| {
        let mut steps: Vec<i64> = stamps
            .iter()
            .zip(stamps.iter().skip(1))
            .map(|(before, after)| after.saturating_sub(*before))
            .collect();
        steps.sort_unstable();
        let is_rising = steps.first().is_none_or(|least| *least > 0);
        is_rising && steps.get(steps.len() / 2).is_none_or(|step| *step >= LEAST_STEP.saturating_mul(1_000))
    };
    match written.filter(are_times).filter(|_| fps.is_none()) {
        Some(stamps) => (stamps, "of depth, in the file".to_owned()),
        None => {
            let fps = fps.unwrap_or(USUAL_FPS);
            let stamp = |at: usize| nanos_of(at as f64 / fps);
            (
                (0..micros.len()).map(stamp).collect(),
                format!("none: {fps} frames a second are assumed (--fps)"),
            )
        }
    }
}
