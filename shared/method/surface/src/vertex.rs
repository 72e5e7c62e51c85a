//! One vertex of an organised surface, as it travels and as it is stored.

use bytemuck::{Pod, Zeroable};

/// A vertex in 32 bytes, half a cache line, so that a projective search touches few of them.
///
/// The covariance of Holz and Behnke 2015, eq. 9, is a function of the normal and is not stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Vertex {
    /// Point in the camera frame, metres, as exposed (rolling shutter not removed).
    pub position: [f32; 3],
    /// Bits 0-7 flags, 8-15 red, 16-23 green, 24-31 blue.
    pub flags_rgb: u32,
    /// Unit normal in the camera frame, towards the camera; zero where there is none.
    pub normal: [f32; 3],
    /// Zero.
    pub reserved: u32,
}

impl Vertex {
    /// The vertex is part of at least one quad and has a normal.
    pub const VALID: u32 = 1;
    /// The vertex has fewer than four quads around it: a depth edge or the image border.
    pub const BOUNDARY: u32 = 2;
    /// Bits 2-4: rows between the grid's own pixel and the pixel that was taken.
    const ROW_OFFSET_SHIFT: u32 = 2;

    /// Packs flags, the row offset inside the cell (below 8) and the colour.
    pub fn pack(flags: u32, row_offset: u32, rgb: [u8; 3]) -> u32 {
        let [r, g, b] = rgb.map(u32::from);
        (flags & 3) | ((row_offset & 7) << Self::ROW_OFFSET_SHIFT) | (r << 8) | (g << 16) | (b << 24)
    }

    /// As [`Self::pack`], with red, green, blue and row offset as the bytes of a number, the lowest first.
    #[inline(always)]
    pub(crate) fn with_colour(flags: u32, rgb_offset: u32) -> u32 {
        (flags & 3) | ((rgb_offset >> 24 & 7) << Self::ROW_OFFSET_SHIFT) | (rgb_offset << 8)
    }

    /// Whether the vertex may be aligned to.
    #[inline]
    pub fn is_valid(&self) -> bool {
        self.flags_rgb & Self::VALID != 0
    }

    /// Whether the vertex is valid and not at a depth edge or the image border.
    #[inline]
    pub fn is_inner(&self) -> bool {
        self.flags_rgb & (Self::VALID | Self::BOUNDARY) == Self::VALID
    }

    /// Rows between the grid's own pixel and the pixel that was taken.
    #[inline]
    pub fn row_offset(&self) -> u32 {
        (self.flags_rgb >> Self::ROW_OFFSET_SHIFT) & 7
    }

    /// Colour as red, green, blue.
    pub fn rgb(&self) -> [u8; 3] {
        [8, 16, 24].map(|shift| (self.flags_rgb >> shift) as u8)
    }
}

/// The shape of an organised surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    /// Columns of the grid.
    pub width: usize,
    /// Rows of the grid.
    pub height: usize,
    /// Pixels of the image between neighbouring columns or rows.
    pub step: usize,
}

impl Grid {
    /// Number of vertices.
    pub fn len(&self) -> usize {
        self.width * self.height
    }

    /// Whether the grid has no vertex.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// A surface read in place, wherever it lies: shared memory, a mapped file or a vector.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceView<'a> {
    /// Shape; `vertices` holds `grid.len()` entries, row by row.
    pub grid: Grid,
    /// The vertices, row by row.
    pub vertices: &'a [Vertex],
}
