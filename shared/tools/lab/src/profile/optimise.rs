//! Optimisation alone.

use super::align::{ProfiledKeyframes, context};
use super::measure::{Meter, Options};
use super::recording::{Entry, Recorded, from_bytes};
use super::report::ProfileReport;
use tessera_journal::fingerprint;
use tessera_messages::Stage;
use tessera_outputs::ToolError;
use tessera_slam::{AlignRecord, FrameHistory, FrameRecord, Optimiser};
use tessera_surface::packed;

/// Answers each recorded request.
pub(super) fn profile(recorded: &Recorded, options: &Options) -> Result<ProfileReport, ToolError> {
    let mut meter = Meter::new(Stage::Optimise, options);
    for _ in 0..options.repeat {
        let context = context(recorded, &meter);
        let grid = context.grid;
        let (mut optimiser, mut keyframes) = (Optimiser::new(context), ProfiledKeyframes::default());
        for entry in &recorded.entries {
            match entry {
                Entry::Keyframe(surface) => {
                    let (vertices, features) = from_bytes(surface, grid.len())?;
                    keyframes.0.push((packed::rounded(&vertices), features));
                }
                Entry::Record(record) => optimiser.apply(record),
                Entry::Answer(expected) => {
                    let pending = optimiser.next_request();
                    let answer = pending.and_then(|request| {
                        let solve = || optimiser.solve(&request, &keyframes, recorded, &mut || ());
                        Some((request.request, meter.time(solve)?))
                    });
                    let Some((request, record)) = answer else {
                        return Err(ToolError::Stage("an answer is recorded where no request is".into()));
                    };
                    let found = fingerprint(record.correction())?;
                    meter.check(found, *expected, &format!("correction {request}"))?;
                    optimiser.apply_own(&record);
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
