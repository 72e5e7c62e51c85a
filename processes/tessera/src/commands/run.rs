//! `tessera run`: the four processes from the first frame to the outputs.

use crate::arguments::RunArguments;
use crate::commands::beside::with_company;
use crate::commands::external;
use crate::commands::new_plan::{new_plan, run_dir};
use crate::commands::resume::{Resumption, resume_in};
use crate::commands::several::several;
use crate::exit::{CommandError, Exit};
use crate::launch::launch;
use crate::run_folder;
use crate::terminal::say_error;
use crate::terminal::say_to_people;
use crate::viewer::Recording;
use std::path::Path;
use tessera_settings::Settings;
use tessera_sources::{
    CAMERA_NAMES, Source, SourceSpec, doubt_units, odd_camera, refuse_impossible_depth, summarise_depth,
};
use tessera_stage::RunFiles;
use tessera_supervisor::{SupervisorError, update_map};
use tessera_transport::{TransportError, check_name};

/// Frames looked at before the start, to notice wrong depth units.
const FRAMES_LOOKED_AT: u64 = 5;
/// Fresh names tried at most.
const MOST_NAMES: u32 = 10_000;

/// Runs a source to its end, or several one after the other.
pub(crate) fn run(arguments: &RunArguments) -> Result<Exit, CommandError> {
    if arguments.sources.len() > 1 {
        return several(arguments);
    }
    let settings = settings(arguments)?;
    if settings.is_external() {
        external::check_arguments(&settings)?;
        return under_a_name(arguments, &settings, |name| external::start(arguments, &settings, name));
    }
    let (spec, mut options) = settings.source();
    options.fps = arguments.topics.fps;
    let source = tessera_sources::open(&spec, &options)?;
    let mut warnings = source.warnings().to_vec();
    warnings.extend(odd_camera(source.camera()));
    warnings.extend(doubt_up(&settings, &*source));
    for warning in &warnings {
        say_error(&format!("warning: {spec}: {warning}"));
    }
    let depth = summarise_depth(&*source, FRAMES_LOOKED_AT)?;
    if depth.median_m.is_none() {
        say_error(&format!(
            "warning: {spec}: no depth in any of the {} frames looked at",
            depth.frames.len()
        ));
    }
    refuse_impossible_depth(&depth, source.camera(), settings.run.force)
        .map_err(|error| CommandError::input(format!("{spec}: {error}")))?;
    let units = doubt_units(&depth, source.camera());
    let doubts: Vec<String> = source.doubts().iter().cloned().chain(units).chain(depth.doubts()).collect();
    for doubt in &doubts {
        say_error(&format!("warning: {spec}: {doubt}"));
    }
    let told = (doubts.as_slice(), warnings.as_slice());
    under_a_name(arguments, &settings, |name| start(arguments, &settings, &*source, told, name))
}

/// Words where the world is to be levelled by gravity, and nothing measured it.
fn doubt_up(settings: &Settings, source: &dyn Source) -> Option<String> {
    let is_asked = settings.mapping.world_up.is_gravity() && settings.run.map.is_empty();
    let imu = source.description().into_iter().find(|(name, _)| *name == "imu");
    let is_measured = imu.is_some_and(|(_, words)| words.contains("accelerometer"));
    (is_asked && !is_measured).then(|| {
        "mapping.world_up is gravity, and no accelerometer was recorded: the floor that the first image shows levels the world, or nothing does".to_owned()
    })
}

/// Starts under the name asked for, or under the first fresh one after the source; with a recording
/// for Rerun beside it where that is asked for.
fn under_a_name(
    arguments: &RunArguments,
    settings: &Settings,
    start: impl Fn(&str) -> Result<Exit, CommandError>,
) -> Result<Exit, CommandError> {
    let recording = arguments.rerun.as_deref().map(Recording::start).transpose()?;
    let exit = under_a_free_name(arguments, settings, start)?;
    if let Some(recording) = recording {
        recording.finish();
    }
    Ok(exit)
}

fn under_a_free_name(
    arguments: &RunArguments,
    settings: &Settings,
    start: impl Fn(&str) -> Result<Exit, CommandError>,
) -> Result<Exit, CommandError> {
    if let Some(name) = &arguments.name {
        check_name(name).map_err(|error| CommandError::arguments(error.to_string()))?;
        let run_dir = run_dir(arguments, name);
        if arguments.hold && RunFiles::new(&run_dir).run_file().exists() {
            let faults = arguments.faults.as_deref();
            let how = Resumption { hold: true, drop_damaged: false, faults };
            return resume_in(&run_dir, arguments.speech, how);
        }
        return start(name);
    }
    let label = run_folder::label(&settings.run.source);
    for number in 1..=MOST_NAMES {
        let name = format!("{label}-{number}");
        match start(&name) {
            // The name is in use: the next one, unless the folder was asked for.
            Err(CommandError::Supervisor(SupervisorError::RunExists { .. })) if arguments.out.is_none() => {}
            Err(CommandError::Supervisor(SupervisorError::Transport(TransportError::NameInUse {
                ..
            }))) => {}
            ended => return ended,
        }
    }
    Err(CommandError::arguments(format!(
        "all names {label}-1 to {label}-{MOST_NAMES} are taken, expected --name NAME"
    )))
}

/// The settings of the run: file and `--set` first, then the arguments that have a flag of their own.
pub(crate) fn settings(arguments: &RunArguments) -> Result<Settings, CommandError> {
    let mut settings = Settings::load(arguments.config.as_deref(), &arguments.overrides)?;
    settings.mapping.global.refine_camera |= arguments.refine_camera;
    settings.mapping.only_localise |= arguments.only_localise;
    let run = &mut settings.run;
    if let Some(source) = arguments.sources.first() {
        run.source.clone_from(source);
    }
    if let Some(camera) = &arguments.camera {
        run.camera.clone_from(camera);
    }
    if let Some(topic) = &arguments.topics.depth_topic {
        run.depth_topic.clone_from(topic);
    }
    if let Some(topic) = &arguments.topics.color_topic {
        run.color_topic.clone_from(topic);
    }
    if let Some(map) = &arguments.map {
        run.map = run_folder::find(map)?.display().to_string();
    }
    if let Some(at) = &arguments.at {
        run.at.clone_from(at);
    }
    run.skip = arguments.skip.unwrap_or(run.skip);
    run.frames = arguments.frames.unwrap_or(run.frames);
    run.base_wait_s = arguments.optimise.map_or(run.base_wait_s, |at| at.base_wait_s(run.base_wait_s));
    run.live |= arguments.live;
    run.force |= arguments.force;
    run.preload |= arguments.preload;
    if arguments.frames == Some(0) {
        return Err(CommandError::arguments("--frames is 0, expected at least 1".to_owned()));
    }
    settings.check()?;
    let isa = arguments.isa.unwrap_or(settings.run.isa);
    settings.set_isa(isa.resolve().map_err(|error| CommandError::arguments(error.to_string()))?);
    // Absolute, so that the stages and a later `resume` find them from anywhere.
    let run = &mut settings.run;
    run.source = SourceSpec::parse(&run.source).to_string();
    let is_file = !run.camera.is_empty() && !CAMERA_NAMES.contains(&run.camera.as_str());
    if is_file && let Ok(path) = std::path::absolute(&run.camera) {
        run.camera = path.display().to_string();
    }
    if !run.map.is_empty()
        && let Ok(path) = std::path::absolute(&run.map)
    {
        run.map = path.display().to_string();
    }
    Ok(settings)
}

fn start(
    arguments: &RunArguments,
    settings: &Settings,
    source: &dyn Source,
    (doubts, warnings): (&[String], &[String]),
    name: &str,
) -> Result<Exit, CommandError> {
    let mut plan = new_plan(arguments, settings, name, source.camera().clone(), source.n_frames())?;
    plan.stamp_sigma_s = source.pairing().stamp_sigma_s();
    plan.doubts = doubts.to_vec();
    plan.warnings = warnings.to_vec();
    let exit = with_company(&plan, arguments, |when_seen| {
        launch(&plan, None, source.ground_truth(), arguments.speech, when_seen)
    })?;
    if arguments.map_update && exit == Exit::Done {
        let map = Path::new(&settings.run.map);
        update_map(map, &plan.run_dir)?;
        if !arguments.speech.quiet && !arguments.speech.json {
            say_to_people(&format!(
                "the extended map is in {}, the map before in {}",
                map.display(),
                plan.run_dir.display()
            ));
        }
    }
    Ok(exit)
}
