//! Durable files: append-only journals of records, and a store of large byte blocks.
//!
//! The state of a stage is a fold over its journal, so a journal that is whole up to some record
//! is a run that went up to that record. Files are untrusted input: a checksum first, then the
//! decoder with a byte limit.
//!
//! Invariants:
//! * A record is there with all its bytes or not at all; after a crash the longest prefix of
//!   whole records is what happened.
//! * What is whole is never cut off: damage before the end of a journal is an error.
//! * *Journaled* survives the death of any process, *synced* survives a power cut.
//! * One writer: the lock is taken before the file is read and goes away with the process.
//! * A checkpoint is a short cut through a journal and never more: its readers can do without it.
//! * A block of the store is whole, or it was given up and says so.
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(
        clippy::unwrap_used,
        clippy::indexing_slicing,
        clippy::cast_possible_truncation,
        clippy::arithmetic_side_effects
    )
)]

mod atomic_file;
mod checkpoint;
mod codec;
mod damage;
mod error;
mod follower;
mod framing;
mod inspect;
mod kind;
mod lock;
mod raw;
mod scan;
mod store;
mod store_view;
mod synced;
mod writer;

pub use atomic_file::{Durability, partial_path, sync_folder_of, write_atomically};
pub use checkpoint::{read_checkpoint, sealed_record, unsealed_record, write_checkpoint};
pub use codec::fingerprint;
pub use damage::{OnDamage, set_aside};
pub use error::{JournalError, let_syncs_fail};
pub use follower::Follower;
pub use framing::RECORD_HEADER_BYTES;
pub use inspect::{Ending, Inspection, inspect, inspect_framing};
pub use kind::RecordKind;
pub use lock::{end_holder, lock_file};
pub use raw::{Chain, FilePart, MAX_FRAMED_BYTES, checksum_in, decode};
pub use scan::Mark;
pub use store::{Slot, Store};
pub use store_view::StoreView;
pub use writer::{Journal, Opening, Recovered};
