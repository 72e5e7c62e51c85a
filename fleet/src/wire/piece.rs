//! One piece of an answer, as it travels: a label that says which bytes of which run it is, and the bytes,
//! deflated where that is less.

use crate::wire::request::{MAX_SMALL_BYTES, PieceRefusal};
use flate2::read::DeflateDecoder;
use flate2::{Compress, Compression, FlushCompress, Status};
use std::borrow::Cow;
use std::io::Read;

/// What a piece is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PieceKind {
    /// Bytes.
    Data,
    /// The answer is whole: nothing was cut off.
    End,
    /// The robot has nothing to give, and why.
    Refused,
}

/// One piece of an answer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Piece {
    /// What it is.
    pub kind: PieceKind,
    /// The run that it is of.
    pub identity: u64,
    /// Offset of its first byte.
    pub at: u64,
    /// Its bytes; of a refusal, the reason.
    pub bytes: Vec<u8>,
    /// Bytes that travelled for it.
    pub wire_bytes: usize,
    /// Whether its bytes are packed already, so that deflating them would be in vain; not told to the reader.
    pub is_packed: bool,
}

/// Bytes of a piece's label.
const LABEL_BYTES: usize = 4 + 1 + 8 + 8 + 4;
const MAGIC: &[u8; 4] = b"TSF1";
/// Kind of a piece of data whose bytes are deflated.
const DEFLATED: u8 = 4;

impl Piece {
    /// A piece with bytes.
    pub fn data(identity: u64, at: u64, bytes: Vec<u8>) -> Self {
        let wire_bytes = bytes.len();
        Self { kind: PieceKind::Data, identity, at, bytes, wire_bytes, is_packed: false }
    }

    /// A piece with bytes that are packed already.
    pub fn packed(identity: u64, at: u64, bytes: Vec<u8>) -> Self {
        Self { is_packed: true, ..Self::data(identity, at, bytes) }
    }

    /// The end of an answer, which reached up to `at`.
    pub fn end(identity: u64, at: u64) -> Self {
        Self { kind: PieceKind::End, identity, at, bytes: Vec::new(), wire_bytes: 0, is_packed: false }
    }

    /// A refusal.
    pub fn refused(identity: u64, reason: &str) -> Self {
        let bytes = reason.as_bytes().to_vec();
        Self { kind: PieceKind::Refused, identity, at: 0, wire_bytes: bytes.len(), bytes, is_packed: false }
    }

    /// What travels: a label, and the bytes behind it, deflated where that is less.
    pub fn to_wire(&self, deflater: &mut Deflater) -> (Vec<u8>, Cow<'_, [u8]>) {
        let is_loose = self.kind == PieceKind::Data && !self.is_packed;
        match is_loose.then(|| deflater.less(&self.bytes)).flatten() {
            Some(deflated) => (self.label_of(DEFLATED, &deflated), deflated.into()),
            None => (self.label(), Cow::Borrowed(&self.bytes)),
        }
    }

    /// What travels beside the bytes where they are as they are.
    pub fn label(&self) -> Vec<u8> {
        let kind = match self.kind {
            PieceKind::Data => 1,
            PieceKind::End => 2,
            PieceKind::Refused => 3,
        };
        self.label_of(kind, &self.bytes)
    }

    /// Magic, kind, run, offset, CRC-32 of all that and the bytes as they travel.
    fn label_of(&self, kind: u8, bytes: &[u8]) -> Vec<u8> {
        let mut label = MAGIC.to_vec();
        label.push(kind);
        label.extend(self.identity.to_le_bytes());
        label.extend(self.at.to_le_bytes());
        label.extend(checksum(&label, bytes).to_le_bytes());
        label
    }

    /// The piece of a label and its bytes.
    ///
    /// # Errors
    /// Names what is wrong with it.
    pub fn read(label: &[u8], bytes: &[u8]) -> Result<Self, PieceRefusal> {
        let label: &[u8; LABEL_BYTES] = label.try_into().map_err(|_| PieceRefusal::Foreign)?;
        if !label.starts_with(MAGIC) {
            return Err(PieceRefusal::Foreign);
        }
        if bytes.len() > MAX_SMALL_BYTES {
            return Err(PieceRefusal::TooLarge);
        }
        let (head, sum) = label.split_last_chunk::<4>().ok_or(PieceRefusal::Foreign)?;
        let number = |from: usize| {
            head.get(from..).and_then(<[u8]>::first_chunk).map_or(0, |number| u64::from_le_bytes(*number))
        };
        if checksum(head, bytes).to_le_bytes() != *sum {
            return Err(PieceRefusal::Checksum);
        }
        let (identity, at, wire_bytes) = (number(5), number(13), bytes.len());
        let (kind, bytes) = match head.get(4).copied().unwrap_or_default() {
            1 => (PieceKind::Data, bytes.to_vec()),
            2 => (PieceKind::End, bytes.to_vec()),
            3 => (PieceKind::Refused, bytes.to_vec()),
            DEFLATED => (PieceKind::Data, inflate(bytes)?),
            _ => return Err(PieceRefusal::Foreign),
        };
        Ok(Self { kind, identity, at, bytes, wire_bytes, is_packed: false })
    }
}

/// Deflates one piece after the other. Its tables take more memory than most pieces, so that making them anew for
/// each would cost more than the work.
pub struct Deflater(Compress);

impl Default for Deflater {
    fn default() -> Self {
        // On journals, most of whose bytes are noise, as good as the slow way but for a hundredth.
        Self(Compress::new(Compression::fast(), false))
    }
}

impl Deflater {
    /// These bytes deflated; `None` where that is not less.
    fn less(&mut self, bytes: &[u8]) -> Option<Vec<u8>> {
        self.0.reset();
        let mut deflated = Vec::with_capacity(bytes.len());
        let status = self.0.compress_vec(bytes, &mut deflated, FlushCompress::Finish);
        let is_whole = matches!(status, Ok(Status::StreamEnd));
        (is_whole && deflated.len() < bytes.len()).then_some(deflated)
    }
}

fn inflate(bytes: &[u8]) -> Result<Vec<u8>, PieceRefusal> {
    let mut found = Vec::new();
    let mut reader = DeflateDecoder::new(bytes).take((MAX_SMALL_BYTES as u64).saturating_add(1));
    reader.read_to_end(&mut found).map_err(|_| PieceRefusal::Foreign)?;
    if found.len() > MAX_SMALL_BYTES { Err(PieceRefusal::TooLarge) } else { Ok(found) }
}

fn checksum(head: &[u8], bytes: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(head);
    hasher.update(bytes);
    hasher.finalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_piece_comes_back_or_is_refused_by_name() {
        let piece = Piece::data(5, 77, vec![1, 2, 3]);
        let label = piece.label();
        assert_eq!(Piece::read(&label, &[1, 2, 3]), Ok(piece));
        assert_eq!(Piece::read(&label, &[1, 2, 4]), Err(PieceRefusal::Checksum));
        assert_eq!(Piece::read(&label[1..], &[1, 2, 3]), Err(PieceRefusal::Foreign));
        assert_eq!(Piece::read(b"", &[]), Err(PieceRefusal::Foreign));
        for at in 4..label.len() {
            let mut flipped = label.clone();
            flipped[at] ^= 1;
            assert!(Piece::read(&flipped, &[1, 2, 3]).is_err(), "byte {at}");
        }
    }

    #[test]
    fn a_piece_is_deflated_where_that_is_less_and_never_grows_beyond_a_bound() {
        let mut deflater = Deflater::default();
        let random: Vec<u8> = (0..3000u32).map(|k| (k.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
        for bytes in [vec![], vec![7; 3000], random] {
            let piece = Piece::data(5, 77, bytes.clone());
            let (label, wire) = piece.to_wire(&mut deflater);
            assert!(wire.len() <= bytes.len());
            let back = Piece::read(&label, &wire).unwrap();
            assert_eq!((back.kind, back.at, back.wire_bytes), (PieceKind::Data, 77, wire.len()));
            assert_eq!(back.bytes, bytes);
        }
        let packed = Piece::packed(5, 77, vec![7; 3000]);
        let (label, wire) = packed.to_wire(&mut deflater);
        assert_eq!((&label, &*wire), (&packed.label(), packed.bytes.as_slice()));
        assert_eq!(Piece::read(&label, &wire).unwrap().bytes, packed.bytes);
        let bomb = Piece::data(5, 77, vec![7; MAX_SMALL_BYTES + 1]);
        let (label, wire) = bomb.to_wire(&mut deflater);
        assert_eq!(Piece::read(&label, &wire), Err(PieceRefusal::TooLarge));
        let nonsense = Piece::data(5, 77, vec![1, 2, 3]);
        assert_eq!(
            Piece::read(&nonsense.label_of(DEFLATED, &[1, 2, 3]), &[1, 2, 3]),
            Err(PieceRefusal::Foreign)
        );
    }
}
