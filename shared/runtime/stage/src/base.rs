//! What an uplink and the optimiser tell each other of the base of a fleet, as files of the run directory:
//! when the base was last heard of, and its last answer to a request. Each is replaced as a whole.

use crate::clock::monotonic_nanos;
use crate::names::RunFiles;
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::time::Duration;
use tessera_journal::{
    Durability, JournalError, RecordKind, sealed_record, unsealed_record, write_atomically,
};
use tessera_slam::{Correction, PairChanges};

/// An answer in its file, and as it travels.
const ANSWER: RecordKind<BaseAnswer> = RecordKind::only("answer", 17);
/// Bytes of an answer, at most: some fifty thousand keyframes.
pub const MAX_ANSWER_BYTES: usize = 4 << 20;
/// Silence after which a base is away.
const SILENCE: Duration = Duration::from_secs(5);
/// Time between two notes that the base was heard of.
const NOTE_EVERY: Duration = Duration::from_secs(1);

/// The answer of a base to a request of this run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BaseAnswer {
    /// The run ([`identity_of`](crate::identity_of)).
    pub identity: u64,
    /// The answer, without frames: untrusted input
    /// ([`Optimiser::accept`](tessera_slam::Optimiser::accept)).
    pub correction: Correction,
    /// What became of the pairs of keyframes: untrusted as well.
    pub changes: PairChanges,
}

impl BaseAnswer {
    /// The answer as it travels and stands in its file.
    ///
    /// # Errors
    /// Where it is too large to be a record.
    pub fn to_bytes(&self) -> Result<Vec<u8>, JournalError> {
        sealed_record(Path::new("base.answer"), ANSWER, self)
    }

    /// The answer in bytes that came from elsewhere, for the run with this identity.
    ///
    /// # Errors
    /// Says what was found and what was expected.
    pub fn from_bytes(bytes: &[u8], identity: u64) -> Result<Self, String> {
        if bytes.len() > MAX_ANSWER_BYTES {
            return Err(format!("an answer of {} bytes, expected at most {MAX_ANSWER_BYTES}", bytes.len()));
        }
        let answer: Self = unsealed_record(ANSWER, bytes)?;
        if answer.identity != identity {
            let found = answer.identity;
            return Err(format!("an answer to run {found:016x}, expected {identity:016x}"));
        }
        Ok(answer)
    }

    /// The bytes in a run directory, which [`Self::from_bytes`] judges; `None` where there are none.
    ///
    /// # Errors
    /// Where there are too many, or they cannot be read.
    pub fn read(files: &RunFiles) -> Result<Option<Vec<u8>>, String> {
        let path = files.base_answer();
        let Ok(found) = std::fs::metadata(&path) else { return Ok(None) };
        if found.len() > MAX_ANSWER_BYTES as u64 {
            return Err(format!("an answer of {} bytes, expected at most {MAX_ANSWER_BYTES}", found.len()));
        }
        std::fs::read(&path).map(Some).map_err(|error| format!("{}: {error}", path.display()))
    }
}

/// When a base was heard of, nanoseconds of the monotonic clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BaseContact {
    /// Since when it was never silent for long.
    pub since_nanos: u64,
    /// The last time.
    pub last_nanos: u64,
}

impl BaseContact {
    /// The contact that a run directory tells of, where it lasts; one of before the machine was started
    /// lies ahead or long ago.
    pub fn read(files: &RunFiles) -> Option<Self> {
        let text = std::fs::read_to_string(files.base_contact()).ok()?;
        serde_json::from_str::<Self>(&text).ok().filter(|contact| contact.lasts_at(monotonic_nanos()))
    }

    fn lasts_at(&self, now: u64) -> bool {
        let silence = now.checked_sub(self.last_nanos);
        self.since_nanos <= self.last_nanos && silence.is_some_and(|silence| silence <= nanos(SILENCE))
    }
}

/// The uplink's side of the contact.
#[derive(Debug, Default)]
pub struct BaseContactWriter(Option<BaseContact>);

impl BaseContactWriter {
    /// Notes that the base was heard of, where the last note is old enough.
    ///
    /// # Errors
    /// Where the run directory cannot be written.
    pub fn heard(&mut self, files: &RunFiles) -> std::io::Result<()> {
        let now = monotonic_nanos();
        let lasting = self.0.filter(|contact| contact.lasts_at(now));
        if lasting.is_some_and(|contact| now.saturating_sub(contact.last_nanos) < nanos(NOTE_EVERY)) {
            return Ok(());
        }
        let since_nanos = lasting.map_or(now, |contact| contact.since_nanos);
        let contact = BaseContact { since_nanos, last_nanos: now };
        let text = serde_json::to_vec(&contact)?;
        write_atomically(&files.base_contact(), Durability::Scratch, |writer| writer.write_all(&text))?;
        self.0 = Some(contact);
        Ok(())
    }
}

fn nanos(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answer() -> BaseAnswer {
        let correction = Correction { request: 3, input_hash: 7, ..Correction::default() };
        BaseAnswer { identity: 5, correction, changes: PairChanges::default() }
    }

    #[test]
    fn an_answer_is_of_one_run_and_whole() {
        let bytes = answer().to_bytes().unwrap();
        assert_eq!(BaseAnswer::from_bytes(&bytes, 5), Ok(answer()));
        let refusal = |bytes: &[u8], identity| BaseAnswer::from_bytes(bytes, identity).unwrap_err();
        assert!(refusal(&bytes, 6).contains("an answer to run 0000000000000005, expected 0000000000000006"));
        assert!(refusal(&bytes[..bytes.len() - 1], 5).contains("cut"));
        assert!(refusal(&vec![0; MAX_ANSWER_BYTES + 1], 5).contains("expected at most"));
        assert!(refusal(b"ply\nformat ascii 1.0\nelement vertex 3", 5).contains("ply"));
    }

    #[test]
    fn a_contact_lasts_until_it_is_silent() {
        let dir = tempfile::tempdir().unwrap();
        let files = RunFiles::new(dir.path());
        assert_eq!(BaseContact::read(&files), None);
        let mut writer = BaseContactWriter::default();
        writer.heard(&files).unwrap();
        let first = BaseContact::read(&files).unwrap();
        assert_eq!(first.since_nanos, first.last_nanos);
        writer.heard(&files).unwrap();
        assert_eq!(BaseContact::read(&files), Some(first), "not noted each time");
        let silence = nanos(SILENCE);
        let contact = BaseContact { since_nanos: 10, last_nanos: 20 };
        assert!(contact.lasts_at(20) && contact.lasts_at(20 + silence));
        assert!(!contact.lasts_at(21 + silence), "too long ago");
        assert!(!contact.lasts_at(19), "of another boot of the machine");
        std::fs::write(files.base_contact(), "nonsense").unwrap();
        assert_eq!(BaseContact::read(&files), None);
    }
}
