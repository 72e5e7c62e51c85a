//! What a base writes for others to look at: status, traffic, report.

use crate::base::report::{REPORT_FILE, page_of};
use crate::base::status::{STATUS_FILE, Status};
use crate::base::traffic::{TRAFFIC_FILE, Traffic};
use crate::error::FleetError;
use std::path::Path;
use std::time::{Duration, Instant};
use tessera_journal::{Durability, write_atomically};

/// Between two writings of the status.
const STATUS_EVERY: Duration = Duration::from_millis(500);
/// Between two writings of the traffic, which is larger.
const TRAFFIC_EVERY: Duration = Duration::from_secs(5);

/// What was written last, and when.
pub(crate) struct ShownFiles {
    begun: Instant,
    status_at: Option<Instant>,
    traffic: Traffic,
    traffic_at: Option<Instant>,
    /// The map that the report has.
    reported: u64,
}

impl Default for ShownFiles {
    fn default() -> Self {
        let traffic = Traffic::default();
        Self { begun: Instant::now(), status_at: None, traffic, traffic_at: None, reported: 0 }
    }
}

impl ShownFiles {
    /// Whether the status is so old that it should be written anew.
    pub(crate) fn is_due(&self) -> bool {
        self.status_at.is_none_or(|at| at.elapsed() >= STATUS_EVERY)
    }

    /// Writes the status, and what it is time for beside it; everything where the base is over.
    ///
    /// # Errors
    /// Where something cannot be written.
    pub(crate) fn show(&mut self, base: &Path, status: &Status, is_over: bool) -> Result<(), FleetError> {
        let write = |name: &str, bytes: &[u8]| {
            let path = base.join(name);
            write_atomically(&path, Durability::Scratch, |writer| writer.write_all(bytes))
                .map_err(FleetError::io("write", &path))
        };
        write(STATUS_FILE, &serde_json::to_vec_pretty(status)?)?;
        self.status_at = Some(Instant::now());
        self.traffic.note(self.begun.elapsed().as_secs_f64(), &status.runs);
        if is_over || self.traffic_at.is_none_or(|at| at.elapsed() >= TRAFFIC_EVERY) {
            write(TRAFFIC_FILE, &serde_json::to_vec(&self.traffic)?)?;
            self.traffic_at = Some(Instant::now());
        }
        if is_over || status.mapped != self.reported {
            self.reported = status.mapped;
            write(REPORT_FILE, page_of(base, status, &self.traffic).as_bytes())?;
        }
        Ok(())
    }
}
