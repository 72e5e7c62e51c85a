//! The input image.

/// Pixels row by row, without gaps.
#[derive(Clone, Copy, Debug)]
pub enum Pixels<'a> {
    /// One byte a pixel.
    Grey(&'a [u8]),
    /// Red, green and blue, one byte each.
    Rgb(&'a [u8]),
}

/// An image whose size agrees with its bytes.
#[derive(Clone, Copy, Debug)]
pub struct Picture<'a> {
    width: usize,
    height: usize,
    pixels: Pixels<'a>,
}

/// The bytes of an image do not agree with its size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PictureError {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Bytes of a pixel.
    pub n_channels: usize,
    /// Bytes found.
    pub n_bytes: usize,
}

impl std::fmt::Display for PictureError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { width, height, n_channels, n_bytes } = self;
        write!(
            f,
            "image of {width}x{height} px with {n_channels} channels holds {n_bytes} bytes, expected sides up to \
             16384 px and one byte per channel and pixel"
        )
    }
}

impl std::error::Error for PictureError {}

/// Largest side, pixels: positions are kept in 16 bits.
const MAX_SIDE: usize = 16384;

impl<'a> Picture<'a> {
    /// Checks that there are exactly the bytes that the size asks for.
    ///
    /// # Errors
    /// Where there are more or fewer, or a side is above 16384 px.
    pub fn new(width: usize, height: usize, pixels: Pixels<'a>) -> Result<Self, PictureError> {
        let (n_channels, n_bytes) = match pixels {
            Pixels::Grey(bytes) => (1, bytes.len()),
            Pixels::Rgb(bytes) => (3, bytes.len()),
        };
        if width > MAX_SIDE || height > MAX_SIDE || n_bytes != width * height * n_channels {
            return Err(PictureError { width, height, n_channels, n_bytes });
        }
        Ok(Self { width, height, pixels })
    }

    /// A grey image of one byte a pixel.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn grey(width: usize, height: usize, bytes: &'a [u8]) -> Result<Self, PictureError> {
        Self::new(width, height, Pixels::Grey(bytes))
    }

    /// A colour image of three bytes a pixel.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn rgb(width: usize, height: usize, bytes: &'a [u8]) -> Result<Self, PictureError> {
        Self::new(width, height, Pixels::Rgb(bytes))
    }

    /// Columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The bytes.
    pub fn pixels(&self) -> Pixels<'a> {
        self.pixels
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_and_size_must_agree() {
        assert!(Picture::grey(4, 3, &[0; 12]).is_ok());
        assert!(Picture::rgb(0, 7, &[]).is_ok());
        let error = Picture::rgb(4, 3, &[0; 12]).unwrap_err();
        assert!(error.to_string().contains("4x3 px with 3 channels holds 12 bytes"));
        assert!(Picture::grey(20000, 0, &[]).is_err());
    }
}
