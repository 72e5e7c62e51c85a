//! What a base writes for others to look at: status, traffic, report.

use crate::base::report::write_report;
use crate::base::status::Status;
use crate::base::traffic::Traffic;
use crate::error::FleetError;
use std::path::Path;
use std::time::{Duration, Instant};

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
        status.write(base)?;
        self.status_at = Some(Instant::now());
        self.traffic.note(self.begun.elapsed().as_secs_f64(), &status.runs);
        if is_over || self.traffic_at.is_none_or(|at| at.elapsed() >= TRAFFIC_EVERY) {
            self.traffic.write(base)?;
            self.traffic_at = Some(Instant::now());
        }
        if is_over || status.mapped != self.reported {
            self.reported = status.mapped;
            write_report(base, status, &self.traffic)?;
        }
        Ok(())
    }
}
