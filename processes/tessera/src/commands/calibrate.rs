//! `tessera calibrate`: a camera file from the frames themselves.

use crate::arguments::CalibrateArguments;
use crate::exit::{CommandError, Exit};
use crate::progress::work_bar;
use crate::terminal::say_report;
use serde::Serialize;
use std::fmt::Write;
use std::path::Path;
use tessera_geometry::Camera;
use tessera_offline::{
    CalibrateError, CalibrateOptions, Calibrated, Method, Parameter, RawFrame, calibrate as solve,
};
use tessera_settings::Settings;
use tessera_sources::judge::FocalPosterior;
use tessera_sources::{Source, SourceOptions, SourceSpec, named_camera};

/// A parameter counts as held when more than this share of it lies in held directions.
const HELD_SHARE: f64 = 0.5;
/// Parts of a held direction below this weight are not named.
const NAMED_WEIGHT: f64 = 0.2;

/// Solves for the camera and writes the file.
pub(crate) fn calibrate(arguments: &CalibrateArguments) -> Result<Exit, CommandError> {
    let settings = Settings::load(arguments.config.as_deref(), &arguments.overrides)?;
    let options = CalibrateOptions { fixed: fixed(&arguments.fix)?, ..CalibrateOptions::default() };
    check_writable(&arguments.out)
        .map_err(|reason| CommandError::arguments(format!("--out {}: {reason}", arguments.out.display())))?;
    let source = open(arguments, &settings)?;
    let start = match &arguments.camera {
        Some(camera) => named_camera(camera)?,
        None => source.camera().clone(),
    };
    let (found, expected) = ((start.width, start.height), (source.camera().width, source.camera().height));
    if found != expected {
        return Err(CommandError::input(format!(
            "the start camera's images are {}x{} px, expected {}x{} as in {}",
            found.0, found.1, expected.0, expected.1, arguments.source
        )));
    }
    let bar = work_bar(arguments.quiet, None, "{pos} frames and iterations, {elapsed}");
    let mut read = |index: u64| read(&*source, index);
    let method =
        Method { surface: settings.surface, registration: settings.registration, mapping: settings.mapping };
    let result = solve(&start, &method, &options, &mut read, &mut || bar.inc(1));
    bar.finish_and_clear();
    let found = result.map_err(|error| match error {
        CalibrateError::Frame(error) => error,
        error => CommandError::input(format!("{}: {error}", arguments.source)),
    })?;
    let report = CalibrationReport::of(&found);
    let text = file_text(&arguments.source, &found, &report)?;
    std::fs::write(&arguments.out, text).map_err(|error| CommandError::write(&arguments.out, error))?;
    say_report(arguments.json, &report, || for_people(arguments, &report))
}

/// A scene is rendered with its own camera, whatever the start; a folder has no other.
fn open(arguments: &CalibrateArguments, settings: &Settings) -> Result<Box<dyn Source>, CommandError> {
    let spec = SourceSpec::parse(&arguments.source);
    let camera = match spec {
        SourceSpec::Folder(_) | SourceSpec::Recording(_) => arguments.camera.clone(),
        SourceSpec::Scene(_) | SourceSpec::External => None,
    };
    let options = SourceOptions {
        camera,
        frames: arguments.frames,
        simulation: settings.simulation.clone(),
        ..SourceOptions::default()
    };
    Ok(tessera_sources::open(&spec, &options)?)
}

fn read(source: &dyn Source, index: u64) -> Result<Option<RawFrame>, CommandError> {
    if source.n_frames().is_some_and(|n| index >= n) {
        return Ok(None);
    }
    Ok(Some(RawFrame::read(source, index)?))
}

/// Parameters by name.
fn fixed(names: &[String]) -> Result<Vec<Parameter>, CommandError> {
    let by_name = |name: &String| {
        Parameter::ALL.into_iter().find(|p| p.name() == name).ok_or_else(|| {
            let known = Parameter::ALL.map(Parameter::name).join(", ");
            CommandError::arguments(format!("--fix {name}: no such parameter, expected one of {known}"))
        })
    };
    names.iter().map(by_name).collect()
}

/// Whether a file can be written there, before work is done for it; else why not.
fn check_writable(path: &Path) -> Result<(), String> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    match (folder.is_dir(), path.is_dir()) {
        (true, false) => Ok(()),
        (true, true) => Err("it is a folder, expected a file to write".to_owned()),
        (false, _) => Err(format!("there is no folder {}", folder.display())),
    }
}

/// What came out, for `--json`.
#[derive(Debug, Serialize)]
struct CalibrationReport {
    camera: Camera,
    parameters: Vec<ParameterRow>,
    /// Combinations of parameters that the motion does not determine.
    held: Vec<Held>,
    /// What cannot be known from depth and colour at all.
    not_observable: &'static str,
    /// The focal length by surfaces and features over the start's; absent where features do not determine it.
    focal: Option<FocalPosterior>,
    is_converged: bool,
    n_passes: usize,
    n_frames: usize,
    n_untracked: usize,
    n_keyframes: usize,
    /// Root mean square normal residual of keyframe pairs, standard deviations of depth.
    residual_sigmas_before: f64,
    residual_sigmas_after: f64,
}

#[derive(Debug, Serialize)]
struct ParameterRow {
    name: &'static str,
    unit: &'static str,
    start: f64,
    value: f64,
    /// Absent where the motion does not determine the parameter.
    standard_deviation: Option<f64>,
}

#[derive(Debug, Serialize)]
struct Held {
    /// Its parts, in pixels of image motion.
    combination: Vec<(&'static str, f64)>,
    /// Pixels of image motion; absent where nothing at all is known.
    standard_deviation_px: Option<f64>,
}

impl CalibrationReport {
    fn of(found: &Calibrated) -> Self {
        let calibration = &found.calibration;
        let row = |e: &tessera_offline::Estimate| ParameterRow {
            name: e.parameter.name(),
            unit: e.parameter.unit(),
            start: e.start,
            value: e.value,
            standard_deviation: (e.held <= HELD_SHARE).then_some(e.std),
        };
        let held = calibration.held.iter().map(|direction| Held {
            combination: Parameter::ALL
                .iter()
                .zip(direction.weights.iter())
                .filter(|(_, weight)| weight.abs() > NAMED_WEIGHT)
                .map(|(parameter, weight)| (parameter.name(), *weight))
                .collect(),
            standard_deviation_px: direction.std_px.is_finite().then_some(direction.std_px),
        });
        let last = found.passes.last();
        Self {
            camera: calibration.camera.clone(),
            parameters: calibration.estimates.iter().map(row).collect(),
            held: held.collect(),
            not_observable: "the global scale of depth (units_per_metre) stays as it was",
            focal: found.focal.clone(),
            is_converged: found.is_converged,
            n_passes: found.passes.len(),
            n_frames: last.map_or(0, |p| p.n_frames),
            n_untracked: last.map_or(0, |p| p.n_untracked),
            n_keyframes: last.map_or(0, |p| p.n_keyframes),
            residual_sigmas_before: found.passes.first().map_or(f64::NAN, |p| p.residual_sigmas.0),
            residual_sigmas_after: calibration.residual_sigmas.1,
        }
    }

    /// One line for each parameter.
    fn lines(&self) -> Vec<String> {
        let line = |row: &ParameterRow| {
            let std = match row.standard_deviation {
                Some(std) => format!("+- {std:<10.6}"),
                None => "held        ".to_owned(),
            };
            format!("{:<15} {:>12.6} {std} {:<2} from {:.6}", row.name, row.value, row.unit, row.start)
        };
        self.parameters.iter().map(line).collect()
    }

    /// One line for each combination that was held.
    fn held_lines(&self) -> Vec<String> {
        let part = |(name, weight): &(&str, f64)| format!("{weight:+.2} {name}");
        let line = |held: &Held| {
            let parts = held.combination.iter().map(part).collect::<Vec<_>>().join(" ");
            match held.standard_deviation_px {
                Some(std) => format!("{parts} (known to {std:.0} px only)"),
                None => format!("{parts} (not seen at all)"),
            }
        };
        self.held.iter().map(line).collect()
    }
}

/// The camera file, with what is known of each value in its head.
fn file_text(source: &str, found: &Calibrated, report: &CalibrationReport) -> Result<String, CommandError> {
    let camera = toml::to_string(&found.calibration.camera);
    let camera = camera.map_err(|error| CommandError::stage(error.to_string()))?;
    let mut text =
        format!("# Calibrated by `tessera calibrate` from {} frames of {source}.\n", report.n_frames);
    for line in report.lines() {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "# {}", line.trim_end());
    }
    for line in report.held_lines() {
        let _ = writeln!(text, "# held: {line}");
    }
    let _ = writeln!(text, "# Not observable: {}.", report.not_observable);
    Ok(text + &camera)
}

fn for_people(arguments: &CalibrateArguments, report: &CalibrationReport) -> String {
    let mut text = format!(
        "{}: {} frames, {} not tracked, {} keyframes, {} passes{}\n",
        arguments.source,
        report.n_frames,
        report.n_untracked,
        report.n_keyframes,
        report.n_passes,
        if report.is_converged { "" } else { ", the camera still moved in the last one" }
    );
    for line in report.lines() {
        let _ = writeln!(text, "  {}", line.trim_end());
    }
    for line in report.held_lines() {
        let _ = writeln!(text, "  held at the start, this motion does not determine it: {line}");
    }
    let _ = writeln!(text, "  not observable: {}", report.not_observable);
    let stated_px = report.parameters.iter().find(|row| row.name == "fx").map(|row| row.start);
    if let (Some(focal), Some(stated_px)) = (report.focal.as_ref().filter(|focal| focal.is_wrong), stated_px)
    {
        let _ = writeln!(text, "  {}", focal.words(stated_px));
    }
    let _ = writeln!(
        text,
        "  residual {:.4} before, {:.4} after, standard deviations of depth",
        report.residual_sigmas_before, report.residual_sigmas_after
    );
    let _ = writeln!(text, "  written to {}", arguments.out.display());
    text
}
