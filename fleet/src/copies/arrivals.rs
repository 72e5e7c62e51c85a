//! The base's own journal: which runs came in which order, and what was made of them. The one map is a
//! function of it and of the runs.

use crate::error::FleetError;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::time::Duration;
use tessera_journal::{Journal, RecordKind};

/// What the journal calls itself.
const KIND: RecordKind<FleetRecord> = RecordKind::only("fleet2", 16);
/// Its name in the base's folder.
pub const FLEET_JOURNAL: &str = "fleet.journal";
/// How long a base waits for one that is ending.
const WAIT: Duration = Duration::from_millis(500);
/// Runs of a base, at most.
pub const MAX_RUNS: usize = 256;
/// The robot whose runs are added from disk.
pub const DISK: &str = "disk";

/// One record.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum FleetRecord {
    /// A run that was not here before.
    Arrived(Arrival),
    /// A map that is made of the runs as they are now.
    Mapped(Mapped),
}

/// A run, as it came.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Arrival {
    /// Its robot.
    pub robot: String,
    /// Its name there.
    pub run: String,
    /// Its identity.
    pub identity: u64,
    /// Where it was added from; `None`: over the network.
    pub origin: Option<PathBuf>,
    /// How much of it is copied.
    pub form: CopyForm,
}

/// How much of a run a base copies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum CopyForm {
    /// The run directory, byte for byte.
    Whole,
    /// The journals byte for byte, and the surfaces of keyframes that the run keeps, in the form in which
    /// they travel.
    Kept,
}

/// How much of a run: what a map and an answer are functions of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Extent {
    /// Bytes of its aligner's journal.
    pub align_bytes: u64,
    /// Surfaces of it, the first ones that came; 0 of a whole copy, which has all.
    pub n_surfaces: u64,
}

impl Arrival {
    /// Its folder at the base.
    pub fn folder(&self, base: &Path) -> PathBuf {
        let name = format!("{}-{:08x}", self.run, self.identity & u64::from(u32::MAX));
        base.join("robots").join(&self.robot).join(name)
    }
}

/// What a map is made of.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Mapped {
    /// 1, 2, 3, …
    pub number: u64,
    /// How much of each run, in the order of their arrival.
    pub extents: Vec<Extent>,
}

/// The journal and what it says.
pub struct Arrivals {
    journal: Journal<FleetRecord>,
    /// Runs in the order in which they came.
    pub runs: Vec<Arrival>,
    /// The last map that was begun.
    pub mapped: Mapped,
}

impl Arrivals {
    /// Opens or creates the journal of a base; there is one base of a folder at a time.
    ///
    /// # Errors
    /// Where another base has it, or it is something else.
    pub fn open(base: &Path) -> Result<Self, FleetError> {
        let (mut runs, mut mapped) = (Vec::new(), Mapped::default());
        let path = base.join(FLEET_JOURNAL);
        let (journal, _) = Journal::open(&path, KIND, WAIT, |record| {
            match record {
                FleetRecord::Arrived(arrival) => runs.push(arrival),
                FleetRecord::Mapped(last) => mapped = last,
            }
            Ok(())
        })?;
        Ok(Self { journal, runs, mapped })
    }

    /// The number of a run among all.
    pub fn find(&self, identity: u64) -> Option<usize> {
        self.runs.iter().position(|run| run.identity == identity)
    }

    /// Writes down that a run has come; answers its number.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub fn arrive(&mut self, arrival: Arrival) -> Result<usize, FleetError> {
        self.journal.append(&FleetRecord::Arrived(arrival.clone()), true)?;
        let number = self.runs.len();
        self.runs.push(arrival);
        Ok(number)
    }

    /// Writes down what the next map is made of.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub fn begin_map(&mut self, extents: Vec<Extent>) -> Result<Mapped, FleetError> {
        let mapped = Mapped { number: self.mapped.number.saturating_add(1), extents };
        self.journal.append(&FleetRecord::Mapped(mapped.clone()), true)?;
        self.mapped = mapped.clone();
        Ok(mapped)
    }
}
