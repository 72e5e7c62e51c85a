//! `tessera ablate`: what each part of the method is worth, on any sequences.

use crate::arguments::AblateArguments;
use crate::exit::{CommandError, Exit};
use crate::progress::work_bar;
use crate::terminal::say;
use std::path::Path;
use tessera_lab::ablation::{AblationPlan, Peers, Tables, columns, ground_truth, markdown, measure};
use tessera_sources::{Source, SourceOptions, SourceSpec};

/// Preset of the whole system.
const WHOLE: &str = "default";

/// Runs all columns on all sequences and prints the tables.
pub(crate) fn ablate(arguments: &AblateArguments) -> Result<Exit, CommandError> {
    let internal = |error: &dyn std::fmt::Display| CommandError::stage(error.to_string());
    let plan = AblationPlan {
        columns_base: arguments.config.clone(),
        whole_base: WHOLE.to_owned(),
        overrides: arguments.overrides.clone(),
        seeds: arguments.seeds,
    };
    // All that can be wrong is told before hours of work: settings and sources.
    plan.settings()?;
    let sources = arguments
        .sequences
        .iter()
        .map(|sequence| Ok((label(sequence), open(arguments, sequence)?)))
        .collect::<Result<Vec<_>, CommandError>>()?;
    let peers = Peers::built_in().map_err(|error| internal(&error))?;
    // What others reach on all frames says nothing of a part.
    let peers = arguments.frames.is_none().then_some(&peers);
    let total: u64 = sources.iter().map(|(_, source)| source.n_frames().unwrap_or(0)).sum();
    let template = "{bar:20} {pos}/{len} frames, {eta} left, {wide_msg}";
    let bar = work_bar(arguments.quiet, Some(total * plan.seeds), template);
    let mut rows = Vec::new();
    for (name, source) in &sources {
        bar.set_message(name.clone());
        if !arguments.quiet && bar.is_hidden() {
            eprintln!("{name}: {} frames", source.n_frames().unwrap_or(0));
        }
        rows.push(measure(name, &**source, &plan, peers, &mut |n| bar.inc(n))?);
    }
    bar.finish_and_clear();
    let tables = Tables::new([&plan.columns_base, &plan.whole_base], plan.seeds, &columns(), rows);
    if arguments.json {
        say(&serde_json::to_string_pretty(&tables).map_err(|error| internal(&error))?);
    } else {
        say(&markdown(&tables));
    }
    Ok(Exit::Done)
}

fn open(arguments: &AblateArguments, sequence: &str) -> Result<Box<dyn Source>, CommandError> {
    let options = SourceOptions {
        camera: arguments.camera.clone(),
        frames: arguments.frames,
        ..SourceOptions::default()
    };
    let source = tessera_sources::open(&SourceSpec::parse(sequence), &options)?;
    ground_truth(sequence, &*source)?;
    Ok(source)
}

/// The last part of a path, or the scene's name.
fn label(sequence: &str) -> String {
    let path = Path::new(sequence);
    let path = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    path.file_name().map_or(sequence.to_owned(), |name| name.to_string_lossy().into_owned())
}
