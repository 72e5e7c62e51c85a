//! The one file that knows how a record becomes bytes, so that the codec can change later.
//!
//! bincode 2.0.1: 3.0.0 is a stub that does not compile.

use crate::error::JournalError;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::path::Path;

/// Largest record that is written or believed: a correction of some ten thousand keyframes.
pub(crate) const MAX_RECORD_BYTES: usize = 64 << 20;

fn config() -> bincode::config::Configuration<
    bincode::config::LittleEndian,
    bincode::config::Varint,
    bincode::config::Limit<MAX_RECORD_BYTES>,
> {
    bincode::config::standard().with_limit::<MAX_RECORD_BYTES>()
}

/// Appends the bytes of `record` to `out`.
pub(crate) fn encode<T: Serialize>(
    record: &T,
    mut out: impl std::io::Write,
    path: &Path,
) -> Result<(), JournalError> {
    bincode::serde::encode_into_std_write(record, &mut out, config())
        .map(drop)
        .map_err(|error| JournalError::Encode { path: path.into(), reason: error.to_string() })
}

/// CRC-32 of a record's bytes: names the record.
///
/// # Errors
/// Where it is too large to be a record.
pub fn fingerprint<T: Serialize>(record: &T) -> Result<u32, JournalError> {
    let mut bytes = Vec::new();
    encode(record, &mut bytes, Path::new("a fingerprint"))?;
    Ok(crc32fast::hash(&bytes))
}

/// The record that `bytes` hold, no byte more and no byte less; the reason where there is none.
pub(crate) fn decode<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, String> {
    let (record, used) =
        bincode::serde::decode_from_slice(bytes, config()).map_err(|error| error.to_string())?;
    if used == bytes.len() {
        Ok(record)
    } else {
        Err(format!("the record takes {used} of {} bytes", bytes.len()))
    }
}
