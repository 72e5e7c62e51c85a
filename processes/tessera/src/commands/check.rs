//! `tessera check`: what a source is, before it is run.

use crate::arguments::CheckArguments;
use crate::exit::{CommandError, Exit};
use crate::terminal::{say, say_to_people};
use std::fmt::Write;
use tessera_sources::{CheckReport, SourceOptions, SourceSpec};

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
    if arguments.json {
        let json = serde_json::to_string_pretty(&report);
        say(&json.map_err(|error| CommandError::stage(error.to_string()))?);
    } else {
        say_to_people(&for_people(&spec.to_string(), &report));
    }
    Ok(Exit::Done)
}

fn for_people(source: &str, report: &CheckReport) -> String {
    let mut text = format!("{source}\n");
    let camera = &report.camera;
    let frames = report.n_frames.map_or("without an end".to_owned(), |n| n.to_string());
    let depth = report.depth.median_m.map_or("none".to_owned(), |m| format!("{m:.3} m"));
    let truth = match report.ground_truth_poses {
        0 => "none".to_owned(),
        n => format!("{n} poses over {:.1} % of the frames", 100.0 * report.ground_truth_share),
    };
    for (name, value) in &report.description {
        // Writing to a String cannot fail, here and below.
        let _ = writeln!(text, "  {name:<16} {value}");
    }
    let lines = [
        ("frames", format!("{frames} in {:.1} s", report.duration_s)),
        ("images", format!("{}x{} px", camera.width, camera.height)),
        ("focal length", format!("{} x {} px", camera.fx, camera.fy)),
        ("principal point", format!("{} x {} px", camera.cx, camera.cy)),
        (
            "field of view",
            format!("{:.1} x {:.1} degrees", report.horizontal_fov_deg, report.vertical_fov_deg),
        ),
        (
            "distortion",
            if camera.is_distorted() { format!("{:?}", camera.distortion) } else { "none".into() },
        ),
        ("rolling shutter", format!("{:.1} ms", 1e3 * camera.readout_s)),
        ("depth units", format!("{} a metre", camera.units_per_metre)),
        ("median depth", depth),
        ("valid pixels", format!("{:.1} %", 100.0 * report.depth.valid_share)),
        ("pairs", pairs(report)),
        ("gaps", gaps(report)),
        ("ground truth", truth),
    ];
    for (name, value) in lines {
        let _ = writeln!(text, "  {name:<16} {value}");
    }
    for warning in &report.warnings {
        let _ = writeln!(text, "  warning: {warning}");
    }
    text
}

fn pairs(report: &CheckReport) -> String {
    format!(
        "{} of {} depth and {} colour images, at most {:.1} ms apart",
        report.n_pairs,
        report.n_depth,
        report.n_colour,
        1e3 * report.largest_pair_difference_s
    )
}

fn gaps(report: &CheckReport) -> String {
    let gaps = &report.gaps;
    let median = 1e3 * gaps.median_interval_s;
    if gaps.n_gaps == 0 {
        return format!("none, a frame each {median:.1} ms");
    }
    format!(
        "{} among intervals of {median:.1} ms, the longest {:.1} ms after frame {}",
        gaps.n_gaps,
        1e3 * gaps.longest_s,
        gaps.longest_after_frame
    )
}
