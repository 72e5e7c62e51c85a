//! A journal at the base: the robot's bytes, appended where they continue it and nowhere else.

use crate::copies::open_copy;
use crate::error::FleetError;
use crate::wire::request::{Growing, PieceRefusal};
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use tessera_journal::{Chain, set_aside};

/// Bytes of a copy that are read at a time when it is opened.
const READ_BYTES: usize = 1 << 20;

/// The copy of a journal.
pub struct JournalCopy {
    file: File,
    path: PathBuf,
    chain: Chain,
}

impl JournalCopy {
    /// Opens or creates the copy, hands every whole record in it to `take`, and cuts off what is behind
    /// them: the torn end that a death left, or what is damaged or refused, which is set aside first. The robot is
    /// asked for it again.
    ///
    /// # Errors
    /// Where the file cannot be read or written.
    pub fn open(
        folder: &Path,
        which: Growing,
        mut take: impl FnMut(u32, &[u8]) -> Result<(), String>,
    ) -> Result<Self, FleetError> {
        let path = folder.join(which.file());
        let io = |what: &'static str| FleetError::io(what, &path);
        let file = open_copy(&path)?;
        let mut copy = Self { file, path: path.clone(), chain: Chain::new(which.kind()) };
        let end = copy.file.metadata().map_err(io("look at"))?.len();
        let mut n_read = READ_BYTES;
        while copy.len_bytes() < end {
            let n_left = end.saturating_sub(copy.len_bytes());
            let n = usize::try_from(n_left).unwrap_or(n_read).min(n_read);
            let mut bytes = vec![0; n];
            copy.file.read_exact_at(&mut bytes, copy.len_bytes()).map_err(io("read"))?;
            let is_all = n as u64 == n_left;
            let (used, problem) = copy.walk(&bytes, &mut take);
            if problem.is_some() {
                set_aside(&path)?;
                break;
            }
            if used == 0 && is_all {
                break;
            }
            n_read = if used == 0 { n_read.saturating_mul(4) } else { READ_BYTES };
        }
        if copy.len_bytes() < end {
            copy.file.set_len(copy.len_bytes()).map_err(io("cut"))?;
        }
        Ok(copy)
    }

    /// Whole bytes: where the next ones are asked from.
    pub fn len_bytes(&self) -> u64 {
        self.chain.len_bytes()
    }

    /// Checksum of the last record; 0 of a journal without its first bytes.
    pub fn checksum(&self) -> u32 {
        if self.len_bytes() == 0 { 0 } else { self.chain.checksum() }
    }

    /// Records in it.
    pub fn n_records(&self) -> u64 {
        self.chain.n_records()
    }

    /// Appends the whole records that `bytes`, which continue the copy, begin with, and forces them to
    /// disk; `take` has version and payload of each and may refuse it. Answers how many bytes that were, and
    /// why it was not more where that is the robot's doing.
    ///
    /// # Errors
    /// Where the file cannot be written; the copy is then as it was.
    pub fn append(
        &mut self,
        bytes: &[u8],
        take: impl FnMut(u32, &[u8]) -> Result<(), String>,
    ) -> Result<(usize, Option<(PieceRefusal, String)>), FleetError> {
        let before = self.chain;
        let (used, problem) = self.walk(bytes, take);
        if used > 0 {
            let written = self
                .file
                .write_all_at(bytes.get(..used).unwrap_or_default(), before.len_bytes())
                .and_then(|()| self.file.sync_data());
            if let Err(error) = written {
                self.chain = before;
                // What stands there is overwritten by the next bytes if this fails too.
                let _ = self.file.set_len(before.len_bytes());
                return Err(FleetError::io("append to", &self.path)(error));
            }
        }
        Ok((used, problem.map(|problem| (PieceRefusal::Nonsense, problem))))
    }

    /// Goes through whole parts as far as they are good.
    fn walk(
        &mut self,
        bytes: &[u8],
        mut take: impl FnMut(u32, &[u8]) -> Result<(), String>,
    ) -> (usize, Option<String>) {
        let mut used = 0;
        loop {
            let before = self.chain;
            match self.chain.step(bytes.get(used..).unwrap_or_default(), &self.path) {
                Ok(None) => return (used, None),
                Err(error) => return (used, Some(error.to_string())),
                Ok(Some(part)) => {
                    if let Err(problem) = part.payload.map_or(Ok(()), |payload| take(part.version, payload)) {
                        self.chain = before;
                        let at = before.len_bytes();
                        return (
                            used,
                            Some(format!("the record at {at} of {}: {problem}", self.path.display())),
                        );
                    }
                    used = usize::saturating_add(used, part.len);
                }
            }
        }
    }
}
