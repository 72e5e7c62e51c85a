//! `tessera check`: what a source is, before it is run.

use crate::arguments::CheckArguments;
use crate::exit::{CommandError, Exit};
use crate::terminal::say_report;
use tessera_sources::{SourceOptions, SourceSpec};

/// Frames looked at, spread over the source.
const FRAMES_LOOKED_AT: u64 = 20;

/// Prints what can be said of a source, warnings last.
pub(crate) fn check(arguments: &CheckArguments) -> Result<Exit, CommandError> {
    let spec = SourceSpec::parse(&arguments.source);
    let options = SourceOptions {
        camera: arguments.camera.clone(),
        depth_topic: arguments.topics.depth_topic.clone(),
        color_topic: arguments.topics.color_topic.clone(),
        fps: arguments.topics.fps,
        ..SourceOptions::default()
    };
    let source = tessera_sources::open(&spec, &options)?;
    let report = tessera_sources::check(&*source, FRAMES_LOOKED_AT)?;
    say_report(arguments.json, &report, || format!("{spec}\n{}", report.for_people()))
}
