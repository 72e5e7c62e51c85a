//! Decompression of chunks: zstd, lz4 and bzip2, as streams.

use bzip2_rs::DecoderReader as Bzip2;
use lz4_flex::frame::FrameDecoder as Lz4;
use ruzstd::decoding::errors::{FrameDecoderError, ReadFrameHeaderError};
use ruzstd::decoding::{BlockDecodingStrategy, FrameDecoder};
use std::borrow::Cow;
use std::io::{self, BufRead, Read};

/// The beginning of a frame of zstd; no message of ROS begins so.
pub(super) const ZSTD: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];
/// Bytes of a message at most.
const MOST_BYTES: u64 = 1 << 30;

/// A message that the recorder may have compressed by itself (rosbag2's `compression_mode: message`).
///
/// # Errors
/// It is damaged, or larger than any image.
pub(super) fn whole(data: &[u8]) -> io::Result<Cow<'_, [u8]>> {
    if !data.starts_with(&ZSTD) {
        return Ok(Cow::Borrowed(data));
    }
    let decoder = Zstd { decoder: FrameDecoder::new(), source: data, is_inside: false };
    let mut bytes = Vec::new();
    let n = decoder.take(MOST_BYTES).read_to_end(&mut bytes)?;
    match n as u64 {
        MOST_BYTES => Err(io::Error::other("a compressed message of more than 1 GB")),
        _ => Ok(Cow::Owned(bytes)),
    }
}

/// The bytes behind a compression, by the name that a chunk gives it. `None`: an unknown name.
pub(super) fn decompress<'a>(name: &str, source: impl BufRead + 'a) -> Option<Box<dyn Read + 'a>> {
    match name {
        "zstd" => Some(Box::new(Zstd { decoder: FrameDecoder::new(), source, is_inside: false })),
        "lz4" => Some(Box::new(Lz4::new(source))),
        "bz2" => Some(Box::new(Bzip2::new(source))),
        _ => None,
    }
}

/// Frames of zstd, one after the other. Takes the memory of a frame's window.
struct Zstd<S> {
    decoder: FrameDecoder,
    source: S,
    /// A frame has begun and has not ended.
    is_inside: bool,
}

impl<S: BufRead> Zstd<S> {
    /// Begins the next frame. `false`: there is none.
    fn begin(&mut self) -> io::Result<bool> {
        while !self.source.fill_buf()?.is_empty() {
            match self.decoder.reset(&mut self.source) {
                Ok(()) => return Ok(true),
                Err(FrameDecoderError::ReadFrameHeaderError(ReadFrameHeaderError::SkipFrame {
                    length,
                    ..
                })) => {
                    io::copy(&mut (&mut self.source).take(u64::from(length)), &mut io::sink())?;
                }
                Err(error) => return Err(io::Error::other(error)),
            }
        }
        Ok(false)
    }

    fn check(&self) -> io::Result<()> {
        let written = self.decoder.get_checksum_from_data();
        if written.is_some() && written != self.decoder.get_calculated_checksum() {
            return Err(io::Error::other("the checksum of a zstd frame is not that of its bytes"));
        }
        Ok(())
    }
}

impl<S: BufRead> Read for Zstd<S> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        loop {
            if !self.is_inside {
                self.is_inside = self.begin()?;
                if !self.is_inside {
                    return Ok(0);
                }
            }
            while self.decoder.can_collect() == 0 && !self.decoder.is_finished() {
                let step = BlockDecodingStrategy::UptoBlocks(1);
                self.decoder.decode_blocks(&mut self.source, step).map_err(io::Error::other)?;
            }
            let n = self.decoder.read(bytes)?;
            if n > 0 || bytes.is_empty() {
                return Ok(n);
            }
            self.check()?;
            self.is_inside = false;
        }
    }
}
