//! Messages as CDR.

use crate::error::MessageError;
use re_cdr::{LittleEndian, to_vec};
use serde::Serialize;

/// Encapsulation: plain CDR, little-endian.
const HEAD: [u8; 4] = [0, 1, 0, 0];

/// A message with its encapsulation, as recordings and networks have it.
///
/// # Errors
/// Where the message has what CDR cannot hold, such as a sequence of more than 2^32 elements.
pub fn encode(message: &impl Serialize) -> Result<Vec<u8>, MessageError> {
    let body = to_vec::<_, LittleEndian>(message)
        .map_err(|error| MessageError::Kind { kind: "CDR", reason: error.to_string() })?;
    Ok([&HEAD[..], &body].concat())
}
