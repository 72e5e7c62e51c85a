//! CDR as messages of ROS have it, field by field: for those of which little is used.

use crate::carrier::ENCAPSULATION;

/// Reads one field after the other.
pub(crate) struct CdrReader<'a> {
    body: &'a [u8],
    at: usize,
    is_big_endian: bool,
}

impl<'a> CdrReader<'a> {
    /// Of a message with its encapsulation; `None` where that is cut off.
    pub(crate) fn new(message: &'a [u8]) -> Option<Self> {
        let (head, body) = message.split_at_checked(ENCAPSULATION)?;
        Some(Self { body, at: 0, is_big_endian: head.get(1) == Some(&0) })
    }

    fn bytes<const N: usize>(&mut self) -> Option<[u8; N]> {
        // Numbers stand at multiples of their size.
        let begin = self.at.checked_next_multiple_of(N)?;
        let end = begin.checked_add(N)?;
        let mut bytes: [u8; N] = self.body.get(begin..end)?.try_into().ok()?;
        self.at = end;
        if self.is_big_endian {
            bytes.reverse();
        }
        Some(bytes)
    }

    /// A number of 4 bytes.
    pub(crate) fn word(&mut self) -> Option<u32> {
        self.bytes().map(u32::from_le_bytes)
    }

    /// A number of 8 bytes.
    pub(crate) fn number(&mut self) -> Option<f64> {
        self.bytes().map(f64::from_le_bytes)
    }

    /// A string.
    pub(crate) fn text(&mut self) -> Option<String> {
        let len = self.word()? as usize;
        let end = self.at.checked_add(len)?;
        let bytes = self.body.get(self.at..end)?;
        self.at = end;
        Some(String::from_utf8_lossy(bytes.strip_suffix(&[0]).unwrap_or(bytes)).into_owned())
    }

    /// A sequence of strings.
    pub(crate) fn texts(&mut self) -> Option<Vec<String>> {
        let n = self.word()?;
        (0..n).map(|_| self.text()).collect()
    }

    /// Passes over so many values of `N` bytes.
    pub(crate) fn skip<const N: usize>(&mut self, n: u32) -> Option<()> {
        if n > 0 {
            let len = N.checked_mul(n as usize)?;
            let end = self.at.next_multiple_of(N).checked_add(len)?;
            self.at = (end <= self.body.len()).then_some(end)?;
        }
        Some(())
    }

    /// Whether nothing follows but what a message is filled up with, to a multiple of four bytes.
    pub(crate) fn is_done(&self) -> bool {
        self.body.get(self.at..).is_some_and(|rest| rest.len() < 4 && rest.iter().all(|byte| *byte == 0))
    }
}
