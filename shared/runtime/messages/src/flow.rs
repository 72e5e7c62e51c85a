//! What the alignment tells the sensor: how far it is and what it needs again.

use crate::message::{Message, Refusal};
use bytemuck::{Pod, Zeroable};
use tessera_surface::Effort;

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
    /// How much work new frames get: rungs below full effort, 0 in lossless mode.
    pub effort: u64,
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
        let is_effort = Effort::from_rung(self.effort).is_some();
        if self.acknowledged < self.resend_from || self.finished > 1 || !is_effort {
            return Err(Refusal::Value {
                index: self.acknowledged,
                what: "flow",
                found: format!("{self:?}"),
                rule: "acknowledged at or above resend_from, finished 0 or 1, effort 0 to 3",
            });
        }
        Ok(())
    }

    /// How much work new frames get.
    pub fn effort(&self) -> Effort {
        Effort::from_rung(self.effort).unwrap_or_default()
    }
}
