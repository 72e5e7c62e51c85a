//! Flow control from the aligner to the sensor: frames acknowledged, and frames needed again.

use crate::message::{Message, Refusal};
use bytemuck::{Pod, Zeroable};
use tessera_surface::WorkloadLevel;

/// The window's lower end. Published on every change and on every time-out, newest wins.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Flow {
    /// Rises whenever frames are asked for again; nanoseconds of the monotonic clock, so that it
    /// also rises from one incarnation of the aligner to the next.
    pub epoch: u64,
    /// First index that this epoch needs.
    pub resend_from: u64,
    /// Every index below is durable or not needed again: the sensor sends while
    /// `index - acknowledged < window`. Never above the first index that is not journaled.
    pub acknowledged: u64,
    /// 1: the end of the source is journaled, nothing more is needed.
    pub finished: u64,
    /// Workload level of new frames, 0 (full) to 3; 0 in lossless mode.
    pub workload: u64,
}

impl Message for Flow {
    const NAME: &'static str = "tessera.Flow.v2";
}

impl Flow {
    /// Checks that the numbers fit each other.
    ///
    /// # Errors
    /// A [`Refusal`] where the acknowledgement lies below what was asked for.
    pub fn validate(&self) -> Result<(), Refusal> {
        let is_workload = WorkloadLevel::from_level(self.workload).is_some();
        if self.acknowledged < self.resend_from || self.finished > 1 || !is_workload {
            return Err(Refusal::Value {
                index: self.acknowledged,
                what: "flow",
                found: format!("{self:?}"),
                rule: "acknowledged at or above resend_from, finished 0 or 1, workload 0 to 3",
            });
        }
        Ok(())
    }

    /// How much work new frames get.
    pub fn workload(&self) -> WorkloadLevel {
        WorkloadLevel::from_level(self.workload).unwrap_or_default()
    }
}
