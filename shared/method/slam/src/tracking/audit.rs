//! The audit of colour: a frame's feature matches against its alignment by surfaces alone.
//!
//! A pose that follows wrong colour takes the data association of the surfaces along, which then
//! agrees. So some frames are aligned once more without features, and their matches are judged there.
//! A direction that the surfaces leave open, as those of a corridor or of one wall do, is not judged: their covariance
//! is large there.

use crate::estimation::colour_model::{AUDITED_EVERY, ColourRecord, ColourState};
use crate::map::records::State;
use crate::settings::WindowSettings;
use crate::tracking::alignment::Aligner;
use crate::tracking::input::TrackingInput;
use crate::tracking::observed::Observed;
use crate::tracking::prediction::{Prediction, Reference};
use crate::tracking::sight::Judged;
use crate::tracking::turn::turn;
use crate::tracking::window::Member;
use crate::tracking::window_alignment::{WindowAlignment, reference};

/// Frames that are all audited at first.
const ALL_UNTIL: u32 = 40;

/// Audit of a frame's colour; `None` where it is not due, or too few features match.
pub(crate) fn colour_record(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    aligned: &WindowAlignment,
    prediction: &Prediction,
    makes_keyframe: bool,
) -> Option<ColourRecord> {
    let colour = &input.map.state().colour;
    let is_due = colour.n_frames < ALL_UNTIL
        || !colour.is_trusted()
        || turn(input, AUDITED_EVERY, makes_keyframe).is_some();
    if !is_due || aligner.sight.n_features() == 0 || aligned.state != State::Tracking {
        return None;
    }
    let (members, references): (Vec<Member>, Vec<Reference<'_>>) =
        aligned.members.iter().filter_map(|member| Some((*member, reference(input, *member)?))).unzip();
    let guess = Prediction {
        world_from_camera: aligned.alignment.world_from_camera,
        is_known: false,
        first_distance_m: input.context.mapping.first_distance_m()[0],
        outer_iterations: WindowSettings::REFINING_ITERATIONS,
        ..*prediction
    };
    let alone = aligner.align(input.context, input.samples, &references, &guess);
    if !alone.is_solved {
        return None;
    }
    let (factor, parameters) = (aligner.independent_factor(), ColourState::prior_covariance());
    let mut sums = Observed::default();
    for ((member, reference), (origin, block)) in members.iter().zip(&references).zip(&alone.blocks) {
        if !matches!(member, Member::Keyframe(_)) {
            continue;
        }
        let target_from_query = reference.world_from_camera.inverse() * alone.world_from_camera;
        let judged = Judged {
            key: reference.key,
            target_from_query,
            origin: *origin,
            sums: block,
            factor,
            velocity: reference.velocity,
            parameters,
        };
        aligner.sight.judge(input.context, &judged, &mut sums);
    }
    sums.record()
}
