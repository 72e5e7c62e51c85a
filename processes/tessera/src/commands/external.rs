//! `tessera run external`: the frames come from a camera's own program, and so do the camera's
//! numbers and whether anything may be lost.

use crate::arguments::{RunArguments, Speech};
use crate::commands::beside::with_company;
use crate::commands::new_plan::{new_plan, run_dir};
use crate::exit::{CommandError, Exit};
use crate::launch::launch;
use std::time::Duration;
use tessera_geometry::Camera;
use tessera_messages::{CameraFlow, CameraFrame, FrameShape, Kind, Stage};
use tessera_settings::Settings;
use tessera_sources::{named_camera, refuse_impossible_depth, summarise_image};
use tessera_stage::{AwakeDeadline, Lifeline, RunFiles};
use tessera_supervisor::SupervisorError;
use tessera_surface::Grid;
use tessera_transport::{Layout, Link, RunClaim, TransportError};

/// Time between two looks while nothing comes.
const LOOK: Duration = Duration::from_millis(20);

/// What the first image says of those that follow.
struct First {
    camera: Camera,
    ring_frames: u32,
}

/// Refuses options that make no sense for frames that come by themselves.
pub(super) fn check_arguments(settings: &Settings) -> Result<(), CommandError> {
    let wrong =
        |what| Err(CommandError::arguments(format!("{what} cannot be used with the source external")));
    match &settings.run {
        run if run.skip > 0 => wrong("--skip"),
        run if run.preload => wrong("--preload"),
        _ => Ok(()),
    }
}

/// Takes the name, waits for the camera's first image, and runs.
pub(super) fn start(arguments: &RunArguments, settings: &Settings, name: &str) -> Result<Exit, CommandError> {
    let run_dir = run_dir(arguments, name);
    if RunFiles::new(&run_dir).run_file().exists() {
        let exists = SupervisorError::RunExists { dir: run_dir, name: name.to_owned() };
        return Err(CommandError::Supervisor(exists));
    }
    let transport = |error: TransportError| CommandError::Supervisor(error.into());
    let claim = RunClaim::take(name, &run_dir).map_err(transport)?;
    let Some(first) = await_first(&claim, settings, arguments.speech)? else {
        return Ok(Exit::Interrupted);
    };
    let mut settings = settings.clone();
    let needed = 2 * settings.flow.window;
    settings.run.live |= first.ring_frames < needed;
    if !arguments.speech.quiet {
        let (Camera { width, height, .. }, ring) = (&first.camera, first.ring_frames);
        let mode = match ring {
            _ if !settings.run.live => format!("it keeps {ring} frames: none is lost"),
            0 => "live".to_owned(),
            _ => format!("live; it keeps {ring} frames, at least {needed} (twice flow.window) lose none"),
        };
        eprintln!("the camera is there: {width}x{height} px, {mode}");
    }
    // `run.frames` is a limit; how many there are is unknown.
    let plan = new_plan(arguments, &settings, name, first.camera, None)?;
    with_company(&plan, arguments, |when_seen| launch(&plan, Some(claim), None, arguments.speech, when_seen))
}

/// The first image that can be used; `None` where the run is interrupted.
fn await_first(claim: &RunClaim, settings: &Settings, speech: Speech) -> Result<Option<First>, CommandError> {
    let stage = |error: std::io::Error| CommandError::stage(format!("cannot listen to signals: {error}"));
    let lifeline = Lifeline::hold(false).map_err(stage)?;
    let given = settings.source().1.camera.as_deref().map(named_camera).transpose()?;
    let identity = &claim.entry.identity;
    let link = Link::open(identity, &camera_layout(settings), "waiting for a camera")?;
    let _services = link.hold_camera_services()?;
    let listener = link.listener(Stage::Sensor)?;
    let (images, flow) = (link.camera_subscriber()?, link.camera_flow_publisher()?);
    flow.send(CameraFlow { epoch: 1, send_from: 0, send_below: 1, finished: 0 })?;
    if !speech.quiet {
        eprintln!(
            "waiting for a camera: run {}, iceoryx2 configuration {} (docs/camera.md)",
            claim.entry.name,
            identity.config_file.display()
        );
    }
    let mut timeout = AwakeDeadline::after(Duration::from_secs_f64(settings.run.camera_timeout_s));
    let mut refused = None;
    while !timeout.is_over() {
        if lifeline.is_cut() {
            return Ok(None);
        }
        let Some(image) = images.receive()? else {
            flow.update()?;
            listener.wait(LOOK)?;
            continue;
        };
        match look_at(&image.header(), image.payload(), given.as_ref(), settings.run.force) {
            Ok(first) => return Ok(Some(first)),
            Err(reason) => refused = Some(reason),
        }
    }
    let seconds = settings.run.camera_timeout_s;
    let waited = format!("no camera came within {seconds} s (run.camera_timeout_s)");
    Err(CommandError::input(match refused {
        Some(reason) => format!("{waited}; what was sent is refused: {reason}"),
        None => format!(
            "{waited}: expected a program that sends to the service 'camera' of the run {} (docs/camera.md)",
            claim.entry.name
        ),
    }))
}

/// What an image says of the camera, or why it cannot be used.
fn look_at(
    header: &CameraFrame,
    payload: &[u16],
    given: Option<&Camera>,
    force: bool,
) -> Result<First, String> {
    let camera = match given {
        Some(camera) => camera.clone(),
        None => header.camera().map_err(|error| error.to_string())?.ok_or(
            "the header has no calibration (fx is 0), expected fx, fy, cx, cy and units_per_metre, or --camera FILE",
        )?,
    };
    let shape = FrameShape { width: camera.width, height: camera.height };
    let words = |refusal: tessera_messages::Refusal| refusal.to_string();
    if header.validate(shape).map_err(words)? == Kind::End {
        return Err("the end came before the first image".to_owned());
    }
    header.check_payload(shape, payload.len()).map_err(words)?;
    let depth = summarise_image(&payload[..shape.n_pixels()], &camera);
    refuse_impossible_depth(&depth, &camera, force).map_err(|error| error.to_string())?;
    Ok(First { camera, ring_frames: header.ring_frames })
}

/// Sizes of the camera's services, which do not depend on the images.
fn camera_layout(settings: &Settings) -> Layout {
    Layout {
        frame: FrameShape { width: 0, height: 0 },
        grid: Grid { width: 0, height: 0, step: 1 },
        window: settings.flow.window,
        recent: 0,
        ahead: settings.flow.window,
        live: settings.run.live,
        external: true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image() -> (CameraFrame, Vec<u16>) {
        let (fx, fy, cx, cy, units_per_metre) = (20.0, 20.0, 10.0, 8.0, 1000.0);
        let header = CameraFrame {
            width: 20,
            height: 16,
            fx,
            fy,
            cx,
            cy,
            units_per_metre,
            ring_frames: 8,
            ..CameraFrame::default()
        };
        (header, vec![1500; 320])
    }

    fn refusal(header: CameraFrame, payload: &[u16]) -> String {
        look_at(&header, payload, None, false).err().unwrap()
    }

    #[test]
    fn the_first_image_tells_the_camera() {
        let (header, payload) = image();
        let first = look_at(&header, &payload, None, false).unwrap();
        assert_eq!((first.camera.width, first.camera.units_per_metre, first.ring_frames), (20, 1000.0, 8));
    }

    #[test]
    fn what_is_missing_is_told() {
        let (header, payload) = image();
        let nameless = CameraFrame { fx: 0.0, ..header };
        assert!(refusal(nameless, &payload).contains("no calibration (fx is 0)"));
        assert!(refusal(CameraFrame { fy: f64::NAN, ..header }, &payload).contains("focal length fy is NaN"));
        assert!(refusal(CameraFrame { kind: 1, ..header }, &payload).contains("before the first image"));
        assert!(refusal(header, &payload[1..]).contains("payload length is 319, expected 320"));
        let metres = CameraFrame { units_per_metre: 5.0, ..header };
        assert!(refusal(metres, &payload).contains("median depth is 300.000 m"));
        let given = header.camera().unwrap().unwrap();
        assert!(look_at(&nameless, &payload, Some(&given), false).is_ok());
        let small = CameraFrame { width: 10, ..nameless };
        let error = look_at(&small, &payload, Some(&given), false).err().unwrap();
        assert!(error.contains("width is 10, expected 20"), "{error}");
    }
}
