//! Reconstruction alone.

use super::measure::{Meter, Options};
use super::recording::{Entry, Recorded, feature_extractor, to_bytes};
use super::report::ProfileReport;
use tessera_journal::fingerprint;
use tessera_messages::Stage;
use tessera_numerics::Step;
use tessera_outputs::ToolError;
use tessera_surface::{Reconstructor, Vertex};

/// Makes the surface of each recorded frame.
pub(super) fn profile(recorded: &Recorded, options: &Options) -> Result<ProfileReport, ToolError> {
    let wrong = |error: &dyn std::fmt::Display| ToolError::Input(error.to_string());
    let n_pixels = recorded.camera.width as usize * recorded.camera.height as usize;
    let mut images = Vec::new();
    for (index, entry) in recorded.entries.iter().enumerate() {
        let Entry::Image { depth, colour, expected } = entry else { continue };
        let n_colour = colour.as_ref().map_or(3 * n_pixels, |colour| colour.len());
        if depth.len() != 2 * n_pixels || n_colour != 3 * n_pixels {
            return Err(ToolError::Input(format!("frame {index} has not the camera's {n_pixels} pixels")));
        }
        let depth: Vec<u16> = bytemuck::pod_collect_to_vec(depth.as_slice());
        images.push((depth, colour.as_ref(), *expected));
    }
    let mut meter = Meter::new(Stage::Reconstruct, options);
    for _ in 0..options.repeat {
        let mut reconstructor = Reconstructor::new(&recorded.camera, &recorded.settings.surface)
            .map_err(|error| wrong(&error))?;
        let steps = meter.steps();
        reconstructor.steps = steps.clone();
        let mut extractor = feature_extractor(recorded);
        let mut surface = vec![Vertex::default(); reconstructor.grid().len()];
        for (index, (depth, colour, expected)) in images.iter().enumerate() {
            let colour = colour.map(|colour| colour.as_slice());
            let features = meter.time(|| {
                steps.enter(Step::Features);
                let features = extractor.extract(colour);
                reconstructor.reconstruct(depth, colour, &mut surface);
                features
            });
            meter.check(
                fingerprint(&to_bytes(&surface, &features))?,
                *expected,
                &format!("frame {index}"),
            )?;
        }
    }
    Ok(meter.report(options))
}
