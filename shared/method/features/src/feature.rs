//! A feature as plain data: it travels in shared memory and is stored as it is.

use bytemuck::{Pod, Zeroable};

/// An oriented corner of an image with its binary descriptor; 56 bytes, no padding.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Feature {
    /// Row and column in pixels of the full image; the centre of the first pixel is `(0, 0)`.
    pub pixel: [f32; 2],
    /// Orientation of the intensity centroid, radians in `-pi..=pi`, from the column axis towards
    /// the row axis.
    pub angle_rad: f32,
    /// Corner score: the largest FAST threshold, in grey levels, at which this is still a corner.
    pub response: f32,
    /// Standard deviation of `pixel` along each axis, pixels of the full image.
    pub sigma_px: f32,
    /// Level of the pyramid, 0: the full image.
    pub level: u8,
    /// Zero.
    pub reserved: [u8; 3],
    /// 256 comparisons of smoothed intensity around the corner, in its orientation.
    pub descriptor: [u64; 4],
}

const _: () = assert!(size_of::<Feature>() == 56);
