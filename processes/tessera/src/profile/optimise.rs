//! Optimisation alone.

use super::align::{Keyframes, context};
use super::measure::{Meter, Options};
use super::recording::{Entry, Recorded, to_vertices};
use super::report::Report;
use crate::exit::CommandError;
use tessera_journal::fingerprint;
use tessera_mapping::{AlignRecord, FrameHistory, FrameRecord, OptimiseRecord, Optimiser};
use tessera_messages::Stage;

/// Answers each recorded request.
pub(crate) fn profile(recorded: &Recorded, options: &Options) -> Result<Report, CommandError> {
    let mut meter = Meter::new(Stage::Optimise, options);
    for _ in 0..options.repeat {
        let context = context(recorded, &meter);
        let grid = context.grid;
        let (mut optimiser, mut keyframes) = (Optimiser::new(context), Keyframes::default());
        for entry in &recorded.entries {
            match entry {
                Entry::Keyframe(surface) => keyframes.0.push(to_vertices(surface, grid.len())?),
                Entry::Record(record) => optimiser.apply(record),
                Entry::Answer(expected) => {
                    let pending = optimiser.next_request();
                    let answer = pending.and_then(|request| {
                        let solve = || optimiser.solve(&request, &keyframes, recorded, &mut || ());
                        Some((request.request, meter.time(solve)?))
                    });
                    let Some((request, correction)) = answer else {
                        return Err(CommandError::Stage("an answer is recorded where no request is".into()));
                    };
                    meter.check(fingerprint(&correction)?, *expected, &format!("correction {request}"))?;
                    optimiser.apply_own(&OptimiseRecord::Correction(Box::new(correction)));
                }
                _ => {}
            }
        }
    }
    Ok(meter.report(options))
}

impl FrameHistory for Recorded {
    /// The final request comes behind the last frame: no other one looks at them.
    fn visit(&self, take: &mut dyn FnMut(&FrameRecord)) {
        for entry in &self.entries {
            if let Entry::Record(record) = entry
                && let AlignRecord::Frame(frame) = &**record
            {
                take(frame);
            }
        }
    }
}
