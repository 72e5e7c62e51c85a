//! What rmw_zenoh has beside each message: a number, the time, and who sent it.

use std::time::{SystemTime, UNIX_EPOCH};

/// Bytes of an identity, and of all together: two numbers, the identity's length, the identity.
const IDENTITY: usize = 16;
const LENGTH: usize = 8 + 8 + 1 + IDENTITY;
const IDENTITY_LENGTH: u8 = 16;

/// What is beside a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Attachment {
    /// Number of the message, or of the request.
    pub(super) number: i64,
    /// Identity of the sending end.
    pub(super) from: [u8; IDENTITY],
}

impl Attachment {
    /// Bytes, with the time now.
    pub(super) fn bytes(&self) -> Vec<u8> {
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let nanos = i64::try_from(now.as_nanos()).unwrap_or(i64::MAX);
        let mut bytes = Vec::with_capacity(LENGTH);
        bytes.extend(self.number.to_le_bytes());
        bytes.extend(nanos.to_le_bytes());
        bytes.push(IDENTITY_LENGTH);
        bytes.extend(self.from);
        bytes
    }

    /// Reads it.
    ///
    /// # Errors
    /// In words, where it has another form: rmw_zenoh before April 2025 had one.
    pub(super) fn read(bytes: Option<&[u8]>) -> Result<Self, String> {
        let Some(bytes) = bytes else { return Err("no attachment".to_owned()) };
        let wrong = || format!("an attachment of {} bytes, expected {LENGTH} as of rmw_zenoh", bytes.len());
        let bytes: &[u8; LENGTH] = bytes.try_into().map_err(|_| wrong())?;
        let (number, rest) = bytes.split_first_chunk().ok_or_else(wrong)?;
        let (_nanos, rest) = rest.split_first_chunk::<8>().ok_or_else(wrong)?;
        let (length, from) = rest.split_first().ok_or_else(wrong)?;
        if *length != IDENTITY_LENGTH {
            return Err(format!("an attachment with an identity of {length} bytes, expected {IDENTITY}"));
        }
        let number = i64::from_le_bytes(*number);
        let from = from.try_into().map_err(|_| wrong())?;
        Ok(Self { number, from })
    }
}

/// The identity of an end of a session, by the end's number.
pub(super) fn identity(session: [u8; IDENTITY], number: u32) -> [u8; IDENTITY] {
    let mut identity = session;
    if let Some(last) = identity.last_chunk_mut() {
        *last = number.to_le_bytes();
    }
    identity
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_attachment_is_read_as_it_is_written() {
        let attachment = Attachment { number: 77, from: identity([9; 16], 3) };
        let bytes = attachment.bytes();
        assert_eq!((bytes.len(), bytes[0], bytes[16]), (33, 77, 16));
        assert_eq!(bytes[17..], [9, 9, 9, 9, 9, 9, 9, 9, 9, 9, 9, 9, 3, 0, 0, 0]);
        assert_eq!(Attachment::read(Some(&bytes)), Ok(attachment));
    }

    #[test]
    fn another_form_has_its_words() {
        let bytes = Attachment { number: 1, from: [0; 16] }.bytes();
        for len in 0..bytes.len() {
            let words = Attachment::read(Some(&bytes[..len])).unwrap_err();
            assert!(words.contains("expected 33"), "{words}");
        }
        let mut other = bytes;
        other[16] = 24;
        assert!(Attachment::read(Some(&other)).unwrap_err().contains("24 bytes"));
        assert_eq!(Attachment::read(None).unwrap_err(), "no attachment");
    }
}
