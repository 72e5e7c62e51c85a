//! Times of a stage: the distribution of each phase and of each named step.

use crate::message::{Message, Refusal};
use crate::stage::Stage;
use bytemuck::{Pod, Zeroable};
use tessera_numerics::Step;

/// A part of the time between two frames (or requests), whatever the stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Phase {
    /// Nothing to do before this frame.
    Waiting,
    /// From the sender's last write to being taken up here, in a queue or on the way.
    Transport,
    /// The pure step.
    Computing,
    /// Making the result durable, and handing it on.
    Publishing,
    /// What a frame means for the map, behind a pose that was handed on ahead.
    Mapping,
}

impl Phase {
    /// All phases in the order of time.
    pub const ALL: [Phase; 5] =
        [Phase::Waiting, Phase::Transport, Phase::Computing, Phase::Publishing, Phase::Mapping];

    /// Name for people and for metrics.
    pub fn name(self) -> &'static str {
        match self {
            Phase::Waiting => "waiting",
            Phase::Transport => "transport",
            Phase::Computing => "computing",
            Phase::Publishing => "publishing",
            Phase::Mapping => "mapping",
        }
    }
}

/// Rows of [`StageTimes`]: the phases, then the steps; the rest is free.
pub const TIME_ROWS: usize = 32;
const _: () = assert!(Phase::ALL.len() + Step::ALL.len() <= TIME_ROWS, "each has its row");

/// Distribution of the time that one phase or step took in a frame (or request), nanoseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct TimeRow {
    /// Frames in which it took any time.
    pub n: u64,
    /// Over all of them.
    pub sum: u64,
    /// Median.
    pub p50: u64,
    /// 90th percentile.
    pub p90: u64,
    /// 99th percentile.
    pub p99: u64,
    /// Longest.
    pub max: u64,
}

/// Where the time of one process went since it started.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct StageTimes {
    /// [`Stage::number`].
    pub stage: u32,
    /// Process id.
    pub pid: u32,
    /// [`Phase::ALL`], then [`Step::ALL`].
    pub rows: [TimeRow; TIME_ROWS],
}

impl Message for StageTimes {
    const NAME: &'static str = "tessera.StageTimes.v3";
}

impl StageTimes {
    /// Row of a phase.
    pub fn phase_row(phase: Phase) -> usize {
        phase as usize
    }

    /// Row of a step.
    pub fn step_row(step: Step) -> usize {
        Phase::ALL.len().saturating_add(step.number())
    }

    /// Checks the number that stands for the stage.
    ///
    /// # Errors
    /// A [`Refusal`] that names the value.
    pub fn validate(&self) -> Result<Stage, Refusal> {
        Stage::from_number(self.stage).ok_or_else(|| Refusal::Value {
            index: 0,
            what: "stage",
            found: self.stage.to_string(),
            rule: "a number this version knows",
        })
    }

    /// The rows that hold something, by name: phases first, then steps.
    pub fn named(&self) -> impl Iterator<Item = (&'static str, &TimeRow)> {
        let names = Phase::ALL.map(Phase::name).into_iter().chain(Step::ALL.map(Step::name));
        names.zip(&self.rows).filter(|(_, row)| row.n > 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_row_has_one_name() {
        let mut times = StageTimes { stage: 2, ..StageTimes::default() };
        times.rows[StageTimes::phase_row(Phase::Computing)].n = 1;
        times.rows[StageTimes::step_row(Step::Search)].n = 2;
        let named: Vec<(&str, u64)> = times.named().map(|(name, row)| (name, row.n)).collect();
        assert_eq!(named, [("computing", 1), ("search", 2)]);
        assert_eq!(times.validate(), Ok(Stage::Align));
        let refused = StageTimes { stage: 7, ..times }.validate().unwrap_err().to_string();
        assert!(refused.contains("stage is 7"), "{refused}");
    }
}
