//! What the records of a journal are, which version of them is written, and how those before it are read.
//!
//! The form of a record changes, and a run that was recorded before must stay readable. Each record has its
//! version in its header, so a journal may hold several: one that was begun by an earlier program and goes on.

use crate::codec;
use serde::de::DeserializeOwned;
use std::fmt;

/// One kind of records.
pub struct RecordKind<T> {
    /// Its name in the first bytes of a file, of at most 16 bytes.
    pub name: &'static str,
    /// Version of the records that are written, 1 to 1023.
    pub version: u32,
    /// The oldest version that is read.
    pub oldest: u32,
    /// Reads a payload of a version from the oldest to the one before today's: by [`decode`](crate::decode) into
    /// the form that it had, which then becomes that of today.
    pub earlier: fn(u32, &[u8]) -> Result<T, String>,
}

impl<T> Clone for RecordKind<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for RecordKind<T> {}

impl<T> fmt::Debug for RecordKind<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} records of version {}", self.name, self.version)
    }
}

impl<T> RecordKind<T> {
    /// Records of one version alone.
    pub const fn only(name: &'static str, version: u32) -> Self {
        Self { name, version, oldest: version, earlier: |_, _| Err(String::new()) }
    }

    /// The versions that are read, in words.
    fn versions(&self) -> String {
        if self.oldest < self.version {
            format!("{} to {}", self.oldest, self.version)
        } else {
            self.version.to_string()
        }
    }
}

/// Why a whole record cannot be used.
pub(crate) enum UnreadableRecord {
    /// It is of a version that this program does not read.
    Version {
        /// Its version.
        found: u32,
        /// Those that are read.
        expected: String,
    },
    /// It is not what its header states, or names what is not there.
    Damage(String),
}

impl<T: DeserializeOwned> RecordKind<T> {
    /// The record in a payload of this version.
    pub(crate) fn decode(&self, version: u32, payload: &[u8]) -> Result<T, UnreadableRecord> {
        let read = match version {
            now if now == self.version => codec::decode(payload),
            earlier if (self.oldest..self.version).contains(&earlier) => (self.earlier)(version, payload),
            _ => return Err(UnreadableRecord::Version { found: version, expected: self.versions() }),
        };
        read.map_err(UnreadableRecord::Damage)
    }

    /// The record in a payload of this version.
    ///
    /// # Errors
    /// Where it holds something else, or more, or is of a version that this program does not read.
    pub fn read(&self, version: u32, payload: &[u8]) -> Result<T, String> {
        self.decode(version, payload).map_err(|unreadable| match unreadable {
            UnreadableRecord::Version { found, expected } => {
                format!("a record of version {found}, this program reads version {expected}")
            }
            UnreadableRecord::Damage(problem) => problem,
        })
    }
}

#[cfg(test)]
mod tests;
