//! The records of a run's journals, and which versions of them are read.
//!
//! A run that was recorded once stays readable. A change of the form of a record, or of anything in it:
//! 1. raises `version` here and names what `earlier` reads,
//! 2. keeps the form as it was in `record_versions/before_N.rs`, N being the new version: the changed types with
//!    their fields, and the conversion into those of today; types that did not change are used as they are,
//! 3. lets `TESSERA_UPDATE=1 cargo test --test end_to_end versions` write a run of the new version beside those of
//!    the earlier ones in `tests/data/runs`, each of which must still be read.
//!
//! Version 16 of both is the first that is read; records of runs before it are refused by name.

mod before_17;
mod before_18;
mod before_19;
mod before_20;

use tessera_journal::{RecordKind, decode};
use tessera_slam::{AlignRecord, OptimiseRecord};

/// The aligner's journal.
pub const ALIGN_JOURNAL: RecordKind<AlignRecord> = RecordKind {
    name: "align",
    version: 20,
    oldest: 16,
    earlier: |version, payload| match version {
        16 => before_17::align(payload),
        17 => before_18::align(payload),
        18 => before_19::align(payload),
        _ => before_20::align(payload),
    },
};
/// The optimiser's journal.
pub const OPTIMISE_JOURNAL: RecordKind<OptimiseRecord> =
    // Version 17 adds a kind of record behind those of version 16.
    RecordKind { name: "optimise", version: 17, oldest: 16, earlier: |_, payload| decode(payload) };
