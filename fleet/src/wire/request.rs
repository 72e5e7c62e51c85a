//! What travels: a base asks for bytes of a robot's run from an offset on, and the robot answers in
//! pieces, each with where it stands and a checksum.
//!
//! The other way goes the answer of the base to a request of a run, as the payload of a request of its own,
//! so that it is known whether the robot has taken it.
//!
//! Journals and store are bytes here: what they mean is for the files' own formats. A piece is believed
//! only where it continues what the base has; the next request is the acknowledgement of the last.
//! Surfaces of single keyframes are asked for by where they lie in the store
//! ([`WantedSurfaces`]).

pub use crate::wire::piece::{Piece, PieceKind};
use crate::wire::surfaces::WantedSurfaces;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::BTreeMap;
use tessera_stage::MAX_ANSWER_BYTES;

/// Version of the protocol; robots and bases of another one refuse each other by name.
pub const PROTOCOL: u32 = 8;
/// Bytes of one piece, at most.
pub const MAX_PIECE_BYTES: usize = 64 << 10;
/// Bytes of an offer or of a small file, at most.
pub const MAX_SMALL_BYTES: usize = 4 << 20;

/// The files of a run that grow, in the order in which they are asked for.
pub const JOURNALS: [Growing; 2] = [Growing::Align, Growing::Optimise];

/// The files of a run that are written once: what a run directory needs to be read, and what says how
/// good it is.
pub const SMALL_FILES: [&str; 5] =
    ["run.json", "config.toml", "groundtruth.txt", "broken_frames.txt", "statistics.json"];

/// A file of a run that grows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Growing {
    /// The aligner's journal.
    Align,
    /// The optimiser's journal.
    Optimise,
    /// The surfaces of the keyframes.
    Store,
}

impl Growing {
    /// Its name in a run directory.
    pub fn file(self) -> &'static str {
        match self {
            Self::Align => "align.journal",
            Self::Optimise => "optimise.journal",
            Self::Store => "keyframes.store",
        }
    }

    /// What a journal calls itself in its first bytes; nothing for the store.
    pub fn kind(self) -> &'static str {
        match self {
            Self::Align => tessera_stage::ALIGN_JOURNAL.name,
            Self::Optimise => tessera_stage::OPTIMISE_JOURNAL.name,
            Self::Store => "",
        }
    }

    fn of_file(name: &str) -> Option<Self> {
        [Self::Align, Self::Optimise, Self::Store].into_iter().find(|file| file.file() == name)
    }
}

/// What a base asks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Request {
    /// Which run there is, and how long its files are.
    Offer,
    /// A small file, whole.
    Small {
        /// One of [`SMALL_FILES`].
        file: String,
    },
    /// Bytes of a growing file.
    Bytes {
        /// The file.
        file: Growing,
        /// The run that is meant.
        identity: u64,
        /// Offset of the first byte; of a journal, behind its last whole record at the base.
        from: u64,
        /// Checksum of that record, which the robot's own must have; 0 for the store and at the start.
        checksum: u32,
        /// Bytes that are wanted, at most; of a journal, one record at least.
        max: u64,
    },
    /// Surfaces of keyframes, in the order in which they are named, as they travel
    /// ([`wire_form`](crate::wire::surfaces::wire_form)).
    Surfaces {
        /// The run that is meant.
        identity: u64,
        /// Bytes that are wanted, at most; one surface at least.
        max: u64,
        /// Which ones, as the payload.
        wanted: WantedSurfaces,
    },
    /// No question: the base's answer to a request of the run.
    Answer {
        /// The run that is meant.
        identity: u64,
        /// The answer ([`BaseAnswer`](tessera_stage::BaseAnswer)), which travels as the payload.
        bytes: Vec<u8>,
    },
}

impl Request {
    /// The request as parameters of a selector.
    pub fn to_parameters(&self) -> String {
        match self {
            Self::Offer => "what=offer".into(),
            Self::Small { file } => format!("what=small;file={file}"),
            Self::Bytes { file, identity, from, checksum, max } => format!(
                "what=bytes;file={};run={identity:016x};from={from};sum={checksum:08x};max={max}",
                file.file()
            ),
            Self::Surfaces { identity, max, .. } => format!("what=surfaces;run={identity:016x};max={max}"),
            Self::Answer { identity, .. } => format!("what=answer;run={identity:016x}"),
        }
    }

    /// What travels beside the parameters.
    pub fn payload(&self) -> Cow<'_, [u8]> {
        match self {
            Self::Answer { bytes, .. } => bytes.into(),
            Self::Surfaces { wanted, .. } => wanted.to_bytes().into(),
            _ => Cow::Borrowed(&[]),
        }
    }

    /// The request that parameters and a payload hold.
    ///
    /// # Errors
    /// Says what is missing or wrong.
    pub fn parse(text: &str, payload: &[u8]) -> Result<Self, String> {
        if text.len() > 300 {
            return Err(format!("a request of {} bytes, expected at most 300", text.len()));
        }
        let fields: BTreeMap<&str, &str> = text.split(';').filter_map(|part| part.split_once('=')).collect();
        let field = |name: &str| {
            fields.get(name).copied().ok_or_else(|| format!("a request without {name}: {text:?}"))
        };
        let wrong = |name: &str| format!("{name} of a request is no number: {text:?}");
        let decimal = |name: &str| field(name)?.parse::<u64>().map_err(|_| wrong(name));
        let hex = |name: &str| u64::from_str_radix(field(name)?, 16).map_err(|_| wrong(name));
        match field("what")? {
            "offer" => Ok(Self::Offer),
            "small" => {
                let file = field("file")?;
                let known = SMALL_FILES.into_iter().find(|name| *name == file);
                Ok(Self::Small { file: known.ok_or_else(|| format!("no file {file:?} to ask for"))?.into() })
            }
            "bytes" => {
                let name = field("file")?;
                Ok(Self::Bytes {
                    file: Growing::of_file(name).ok_or_else(|| format!("no file {name:?} to ask for"))?,
                    identity: hex("run")?,
                    from: decimal("from")?,
                    checksum: u32::try_from(hex("sum")?).map_err(|_| wrong("sum"))?,
                    max: decimal("max")?,
                })
            }
            "surfaces" => Ok(Self::Surfaces {
                identity: hex("run")?,
                max: decimal("max")?,
                wanted: WantedSurfaces::from_bytes(payload)?,
            }),
            "answer" if payload.len() > MAX_ANSWER_BYTES => {
                let n = payload.len();
                Err(format!("an answer of {n} bytes, expected at most {MAX_ANSWER_BYTES}"))
            }
            "answer" => Ok(Self::Answer { identity: hex("run")?, bytes: payload.to_vec() }),
            other => {
                Err(format!("a request for {other:?}, expected offer, small, bytes, surfaces or answer"))
            }
        }
    }
}

/// Which run a robot has.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Offer {
    /// [`PROTOCOL`].
    pub protocol: u32,
    /// Version of the program.
    pub version: String,
    /// Name of the run.
    pub run: String,
    /// Names the run among all: a hash of its `run.json`.
    pub identity: u64,
    /// Whole bytes of the aligner's journal.
    pub align_bytes: u64,
    /// Whole bytes of the optimiser's journal.
    pub optimise_bytes: u64,
    /// Bytes of the store.
    pub store_bytes: u64,
    /// Small files that are there, with the CRC-32 of each.
    pub small: BTreeMap<String, u32>,
}

/// Why something that came is not used. Each is counted by its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PieceRefusal {
    /// No piece of this protocol.
    Foreign,
    /// More bytes than were asked for.
    TooLarge,
    /// The bytes are not those that were sent.
    Checksum,
    /// A piece of another run than was asked.
    OtherRun,
    /// A piece that does not continue what is here: old, twice, or behind a gap.
    OtherPlace,
    /// Bytes that are no records, or records that hold nonsense.
    Nonsense,
    /// A name that no robot or run may have.
    Name,
    /// An offer that cannot be read, or of another version.
    Offer,
    /// More robots or runs than a base takes.
    TooMany,
    /// A surface that the robot has no more.
    Gone,
    /// The robot's journal is not the one that was copied so far.
    Replaced,
    /// An answer of the base that the robot does not take.
    Answer,
}

impl PieceRefusal {
    /// What it says.
    pub fn words(self) -> &'static str {
        match self {
            Self::Foreign => "no piece of this protocol",
            Self::TooLarge => "more bytes than were asked for",
            Self::Checksum => "bytes with a wrong checksum",
            Self::OtherRun => "bytes of another run",
            Self::OtherPlace => "bytes of another place",
            Self::Nonsense => "bytes that are no records",
            Self::Name => "a name that none may have",
            Self::Offer => "an offer that cannot be used",
            Self::TooMany => "more robots or runs than allowed",
            Self::Gone => "a surface that the robot has no more",
            Self::Replaced => "a journal that is not the one copied so far",
            Self::Answer => "an answer that the robot does not take",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_slam::StoreSlot;

    #[test]
    fn requests_come_back_from_their_parameters() {
        let bytes = Request::Bytes {
            file: Growing::Store,
            identity: 0xfeed_0000_0000_0001,
            from: 7,
            checksum: u32::MAX,
            max: 1 << 40,
        };
        let answer = Request::Answer { identity: 7, bytes: vec![1, 2, 3] };
        let slots = [1, 2].map(|k| StoreSlot { offset: k << 40, len: k, crc: u32::MAX });
        let wanted = WantedSurfaces::new(slots.to_vec());
        let surfaces = Request::Surfaces { identity: 7, max: 9, wanted };
        let small = Request::Small { file: "config.toml".into() };
        for request in [Request::Offer, small, bytes, surfaces, answer] {
            assert_eq!(Request::parse(&request.to_parameters(), &request.payload()), Ok(request));
        }
        let large = vec![0; MAX_ANSWER_BYTES + 1];
        assert!(Request::parse("what=answer;run=1", &large).unwrap_err().contains("expected at most"));
        let nonsense = [
            "",
            "what=offered",
            "what=small;file=../../etc/passwd",
            "what=bytes;file=align.journal;run=1;from=-1;sum=0;max=1",
            "what=bytes;file=align.journal;run=1;from=1;sum=0",
            "what=bytes;file=log.txt;run=1;from=1;sum=0;max=1",
            "what=answer;run=x",
            "what=surfaces;run=1;max=1",
        ];
        for text in nonsense {
            assert!(Request::parse(text, &[]).is_err(), "{text}");
        }
        assert!(Request::parse(&"a=b;".repeat(1000), &[]).is_err());
    }
}
