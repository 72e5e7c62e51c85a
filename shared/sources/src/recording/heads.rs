//! The heads of messages, without the images behind them.

use super::error::RecordingError;
use super::file::{FRAMING, McapFile, Place, message};
use mcap::records::{MessageHeader, op};

/// Bytes of a chunk's record before its compression: three numbers and a checksum.
const CHUNK_HEAD: u64 = 28;
/// Bytes behind that where nothing is compressed: the lengths of no name and of the records.
const NO_COMPRESSION: u64 = 12;
/// Bytes of a message's record before its data: channel, sequence and two times.
const MESSAGE_HEAD: u64 = 22;

/// Gives the messages of a place by at most `n_bytes` bytes of their data, and reads no more of the
/// file than these. `false`: the chunk is compressed, and nothing was given.
///
/// The chunk's checksum is not looked at.
pub(super) fn heads(
    file: &McapFile,
    place: &Place,
    n_bytes: u64,
    mut take: impl FnMut(MessageHeader, &[u8]) -> Result<(), RecordingError>,
) -> Result<bool, RecordingError> {
    let damaged = |reason: &str| RecordingError::Damaged { offset: place.offset, reason: reason.to_owned() };
    let (mut at, mut end) = (place.offset, place.offset + place.len);
    if place.opcode == op::CHUNK {
        at += FRAMING + CHUNK_HEAD;
        if end.saturating_sub(at) < NO_COMPRESSION {
            return Err(damaged("it is shorter than a chunk's head"));
        }
        let mut lengths = [0; NO_COMPRESSION as usize];
        file.read(at, &mut lengths)?;
        let [n0, n1, n2, n3, n_records @ ..] = lengths;
        if [n0, n1, n2, n3] != [0; 4] {
            return Ok(false);
        }
        at += NO_COMPRESSION;
        let n_records = u64::from_le_bytes(n_records);
        if n_records > end - at {
            return Err(damaged("its records are longer than itself"));
        }
        end = at + n_records;
    }
    let mut bytes = vec![0; (FRAMING + MESSAGE_HEAD + n_bytes) as usize];
    while at < end {
        let n = (end - at).min(bytes.len() as u64) as usize;
        let head = &mut bytes[..n];
        file.read(at, head)?;
        let torn = || damaged("a record in it is not whole");
        let ([opcode, length @ ..], body) =
            head.split_first_chunk::<{ FRAMING as usize }>().ok_or_else(torn)?;
        let length = u64::from_le_bytes(*length);
        if *opcode == 0 || length > end - at - FRAMING {
            return Err(torn());
        }
        if *opcode == op::MESSAGE {
            let body = &body[..body.len().min(length as usize)];
            let (header, data) = message(body).map_err(|reason| damaged(&reason))?;
            take(header, data)?;
        }
        at += FRAMING + length;
    }
    Ok(true)
}
