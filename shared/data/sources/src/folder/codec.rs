//! How the depth and confidence images of a layout are stored.

use super::lzfse;
use crate::ImageError;
use std::path::Path;
use tessera_frames::decode;
use tessera_geometry::Camera;

/// The form of depth and confidence images.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum DepthCodec {
    /// 16-bit PNG, PGM or NPY; confidence as PNG of 8 bits.
    Png,
    /// 32-bit floats in metres, and bytes, compressed by LZFSE.
    Lzfse,
}

impl DepthCodec {
    /// Decodes raw depth of the camera's columns and rows, in its units.
    pub(super) fn depth(
        self,
        bytes: &[u8],
        camera: &Camera,
        depth_raw: &mut [u16],
    ) -> Result<(), ImageError> {
        let size = (camera.width, camera.height);
        match self {
            Self::Png => decode::depth_in(bytes, size, camera.units_per_metre, depth_raw),
            Self::Lzfse => lzfse::depth(bytes, size, camera.units_per_metre, depth_raw),
        }
    }

    /// Decodes confidence into three bytes a pixel.
    pub(super) fn confidence(self, bytes: &[u8], size: (u32, u32), rgb: &mut [u8]) -> Result<(), ImageError> {
        match self {
            Self::Png => decode::colour(bytes, size, rgb),
            Self::Lzfse => lzfse::confidence(bytes, size, rgb),
        }
    }

    /// As [`Self::inspect`], of an image in memory.
    pub(super) fn inspect_bytes(self, bytes: &[u8]) -> Result<(), ImageError> {
        match self {
            Self::Png => decode::inspect_bytes(bytes),
            Self::Lzfse => lzfse::inspect_bytes(bytes),
        }
    }

    /// Looks at an image from outside: whether it is there and whole.
    pub(super) fn inspect(self, path: &Path) -> Result<(), ImageError> {
        match self {
            Self::Png => decode::inspect(path),
            Self::Lzfse => lzfse::inspect(path),
        }
    }
}
