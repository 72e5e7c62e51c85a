//! Images of messages into the caller's memory.

use crate::error::MessageError;
use crate::messages::{ImageForm, ImageMessage};
use crate::raw_forms::CameraForm;
use crate::rvl;
use tessera_frames::decode::MetresDepth;
use tessera_frames::{ImageError, decode};

/// Bytes before the image in ROS's `compressedDepth`: a word and two floats.
const COMPRESSED_DEPTH_HEADER: usize = 12;
const PNG: &[u8] = b"\x89PNG";

/// Depth as raw units; what is metres in the message is counted in `units_per_metre`.
pub(super) fn depth(
    image: &ImageMessage<'_>,
    size: (u32, u32),
    units_per_metre: f64,
    depth_raw: &mut [u16],
) -> Result<(), MessageError> {
    let mut counted = MetresDepth::new(units_per_metre);
    match &image.form {
        ImageForm::Raw { encoding, width, height, step, is_big_endian } => {
            check_size("depth", (*width, *height), size)?;
            let swap = |bytes: [u8; 2]| match is_big_endian {
                true => u16::from_be_bytes(bytes),
                false => u16::from_le_bytes(bytes),
            };
            match encoding.as_str() {
                "16UC1" | "mono16" => {
                    let rows = rows(&image.data, size, *step, 2)?;
                    for (to, from) in depth_raw.chunks_exact_mut(size.0 as usize).zip(rows) {
                        for (raw, bytes) in to.iter_mut().zip(from.as_chunks().0) {
                            *raw = swap(*bytes);
                        }
                    }
                }
                "32FC1" => {
                    let rows = rows(&image.data, size, *step, 4)?;
                    for (to, from) in depth_raw.chunks_exact_mut(size.0 as usize).zip(rows) {
                        for (raw, bytes) in to.iter_mut().zip(from.as_chunks().0) {
                            *raw = counted.raw(f64::from(match is_big_endian {
                                true => f32::from_be_bytes(*bytes),
                                false => f32::from_le_bytes(*bytes),
                            }));
                        }
                    }
                }
                other => return Err(unknown(other, "16UC1 or 32FC1")),
            }
        }
        ImageForm::File { format } => {
            compressed_depth(&image.data, format, size, &mut counted, depth_raw)?;
        }
    }
    Ok(counted.check()?)
}

/// The picture of a depth image in a file: behind the header of `compressedDepth`, if it has one.
pub(super) fn picture_of_depth(data: &[u8]) -> &[u8] {
    let inside = data.get(COMPRESSED_DEPTH_HEADER..).filter(|inside| inside.starts_with(PNG));
    inside.unwrap_or(data)
}

/// A PNG of depth; behind the header of `compressedDepth` a PNG or RVL, which may hold inverse depth.
fn compressed_depth(
    data: &[u8],
    format: &str,
    size: (u32, u32),
    counted: &mut MetresDepth,
    depth_raw: &mut [u16],
) -> Result<(), MessageError> {
    if data.starts_with(PNG) {
        return Ok(decode::depth(data, size, depth_raw)?);
    }
    let is_rvl = format.trim_end().ends_with("compressedDepth rvl");
    let (head, inside) = data
        .split_first_chunk::<COMPRESSED_DEPTH_HEADER>()
        .filter(|(_, inside)| is_rvl || inside.starts_with(PNG))
        .ok_or_else(|| unknown(format, "a PNG, or compressedDepth with a PNG or RVL"))?;
    if is_rvl {
        let (found, code) = rvl::split(inside)?;
        check_size("depth", found, size)?;
        rvl::decode(code, depth_raw)?;
    } else {
        decode::depth(inside, size, depth_raw)?;
    }
    if format.starts_with("32FC1") {
        let [_, _, _, _, a0, a1, a2, a3, b0, b1, b2, b3] = *head;
        let (a, b) = (f32::from_le_bytes([a0, a1, a2, a3]), f32::from_le_bytes([b0, b1, b2, b3]));
        for raw in depth_raw.iter_mut().filter(|raw| **raw != 0) {
            *raw = counted.raw(f64::from(a / (f32::from(*raw) - b)));
        }
    }
    Ok(())
}

/// Whether an image is one of depth, by its encoding.
pub(super) fn is_depth(image: &ImageMessage<'_>) -> bool {
    match &image.form {
        ImageForm::Raw { encoding, .. } => ["16UC1", "32FC1", "mono16"].contains(&encoding.as_str()),
        ImageForm::File { format } => {
            let is_of_depth = format.starts_with("16UC1") || format.starts_with("32FC1");
            is_of_depth || decode::is_deep_grey(&image.data)
        }
    }
}

/// Colour as red, green, blue.
pub(super) fn colour(image: &ImageMessage<'_>, size: (u32, u32), rgb: &mut [u8]) -> Result<(), MessageError> {
    let (encoding, width, height, step, is_big_endian) = match &image.form {
        ImageForm::File { .. } => return Ok(decode::colour(&image.data, size, rgb)?),
        ImageForm::Raw { encoding, width, height, step, is_big_endian } => {
            (encoding, *width, *height, *step, *is_big_endian)
        }
    };
    check_size("colour", (width, height), size)?;
    if let Some(form) = CameraForm::of(encoding) {
        let rows = rows(&image.data, size, step, form.bytes_per_pixel())?;
        form.to_rgb(&rows.collect::<Vec<&[u8]>>(), is_big_endian, rgb);
        return Ok(());
    }
    // Where red, green and blue stand in a pixel.
    let (n_channels, places) = match encoding.as_str() {
        "rgb8" | "8UC3" => (3, [0, 1, 2]),
        "bgr8" => (3, [2, 1, 0]),
        "rgba8" => (4, [0, 1, 2]),
        "bgra8" => (4, [2, 1, 0]),
        "mono8" | "8UC1" => (1, [0, 0, 0]),
        other => {
            return Err(unknown(
                other,
                "rgb8, bgr8, rgba8, bgra8, mono8, mono16, rgb16, bgr16, yuv422, yuv422_yuy2 or bayer",
            ));
        }
    };
    let rows = rows(&image.data, size, step, n_channels)?;
    for (to, from) in rgb.chunks_exact_mut((size.0 as usize).saturating_mul(3)).zip(rows) {
        for (pixel, from) in to.as_chunks_mut().0.iter_mut().zip(from.chunks_exact(n_channels)) {
            *pixel = places.map(|place| from.get(place).copied().unwrap_or_default());
        }
    }
    Ok(())
}

/// Looks whether an image is whole, without decoding it: pixels by their number, files by their marks.
///
/// `size`: that of the camera, where there may be no other.
pub(super) fn inspect(
    image: &ImageMessage<'_>,
    what: &'static str,
    size: Option<(u32, u32)>,
) -> Result<(), MessageError> {
    match &image.form {
        ImageForm::Raw { encoding, width, height, step, .. } => {
            let found = (*width, *height);
            check_size(what, found, size.unwrap_or(found))?;
            let bytes_per_pixel =
                bytes_per_pixel(encoding).ok_or_else(|| unknown(encoding, "one of ROS's"))?;
            rows(&image.data, found, *step, bytes_per_pixel).map(|_| ())
        }
        ImageForm::File { format } if format.trim_end().ends_with("compressedDepth rvl") => {
            let inside = image.data.get(COMPRESSED_DEPTH_HEADER..).unwrap_or_default();
            let (found, _) = rvl::split(inside)?;
            Ok(check_size(what, found, size.unwrap_or(found))?)
        }
        ImageForm::File { .. } => {
            let behind_header =
                image.data.get(COMPRESSED_DEPTH_HEADER..).filter(|file| file.starts_with(PNG));
            Ok(decode::inspect_bytes(behind_header.unwrap_or(&image.data))?)
        }
    }
}

fn bytes_per_pixel(encoding: &str) -> Option<usize> {
    if let Some(form) = CameraForm::of(encoding) {
        return Some(form.bytes_per_pixel());
    }
    Some(match encoding {
        "mono8" | "8UC1" => 1,
        "16UC1" | "mono16" => 2,
        "rgb8" | "bgr8" | "8UC3" => 3,
        "32FC1" | "rgba8" | "bgra8" => 4,
        _ => return None,
    })
}

/// The rows of an image, after a check that they are all there.
fn rows(
    data: &[u8],
    (width, height): (u32, u32),
    step: usize,
    bytes_per_pixel: usize,
) -> Result<impl Iterator<Item = &[u8]>, MessageError> {
    let (row, height) = ((width as usize).saturating_mul(bytes_per_pixel), height as usize);
    let expected = step.saturating_mul(height.saturating_sub(1)).saturating_add(row);
    if step < row || data.len() < expected {
        return Err(MessageError::Length { found: data.len(), step, expected, row });
    }
    Ok(data.chunks(step.max(1)).take(height).filter_map(move |whole| whole.get(..row)))
}

fn unknown(found: &str, expected: &'static str) -> MessageError {
    MessageError::Encoding { found: found.chars().take(64).collect(), expected }
}

fn check_size(what: &'static str, found: (u32, u32), expected: (u32, u32)) -> Result<(), ImageError> {
    if found == expected { Ok(()) } else { Err(ImageError::Size { what, found, expected }) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::borrow::Cow;

    fn raw(encoding: &str, step: usize, data: &[u8]) -> ImageMessage<'static> {
        let form =
            ImageForm::Raw { encoding: encoding.into(), width: 2, height: 2, step, is_big_endian: false };
        ImageMessage { stamp_nanos: 0, data: Cow::Owned(data.to_vec()), form }
    }

    #[test]
    fn metres_are_counted_and_what_is_none_is_zero() {
        let metres = [1.0f32, f32::NAN, -2.0, 100.0];
        let bytes: Vec<u8> = metres.iter().flat_map(|m| m.to_le_bytes()).collect();
        let mut found = [9; 4];
        depth(&raw("32FC1", 8, &bytes), (2, 2), 5000.0, &mut found).unwrap();
        assert_eq!(found, [5000, 0, 0, 0]);
    }

    #[test]
    fn an_image_is_whole_or_says_what_is_missing() {
        let words = |image: &ImageMessage<'_>, size| inspect(image, "depth", size).unwrap_err().to_string();
        inspect(&raw("16UC1", 4, &[0; 8]), "depth", Some((2, 2))).unwrap();
        assert!(words(&raw("16UC1", 4, &[0; 7]), Some((2, 2))).contains("7 bytes of data"));
        assert!(words(&raw("16UC1", 4, &[0; 8]), Some((3, 2))).contains("2x2 px, expected 3x2"));
        assert!(words(&raw("bayer", 4, &[0; 8]), None).contains("encoding is 'bayer'"));
        let file = |format: &str, data: &[u8]| ImageMessage {
            stamp_nanos: 0,
            data: Cow::Owned(data.to_vec()),
            form: ImageForm::File { format: format.to_owned() },
        };
        let png = b"\x89PNG\r\n\x1a\n....IEND\xaeB`\x82";
        let behind_header = [&[0; COMPRESSED_DEPTH_HEADER][..], png].concat();
        inspect(&file("png", png), "depth", None).unwrap();
        inspect(&file("16UC1; compressedDepth png", &behind_header), "depth", None).unwrap();
        assert!(words(&file("png", &png[..12]), None).contains("no end marker in 12 bytes"));
        assert!(words(&file("jpeg", b"GIF89a"), None).contains("JPEG"));
        let rvl = file("16UC1; compressedDepth rvl", &behind_header[..14]);
        assert!(inspect(&rvl, "depth", None).is_err());
    }

    #[test]
    fn rows_may_be_padded_and_must_be_there() {
        let mut rgb = [0; 12];
        let padded = [1, 2, 3, 4, 5, 6, 0, 0, 7, 8, 9, 10, 11, 12];
        colour(&raw("bgr8", 8, &padded), (2, 2), &mut rgb).unwrap();
        assert_eq!(rgb, [3, 2, 1, 6, 5, 4, 9, 8, 7, 12, 11, 10]);
        let words = |image| colour(&image, (2, 2), &mut [0; 12]).unwrap_err().to_string();
        assert!(words(raw("bgr8", 8, &padded[1..])).contains("13 bytes of data and step 8, expected 14"));
        assert!(words(raw("bgr8", 5, &padded)).contains("rows of at least 6"));
        assert!(words(raw("nv12", 8, &padded)).contains("encoding is 'nv12', expected rgb8"));
        assert!(
            colour(&raw("mono8", 2, &padded), (3, 2), &mut [0; 18])
                .unwrap_err()
                .to_string()
                .contains("2x2 px, expected 3x2")
        );
    }
}
