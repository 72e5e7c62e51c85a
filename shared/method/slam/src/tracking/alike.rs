//! Keyframes that look like a new one, wherever they lie: loops that drift hides from the poses.

use crate::map::appearance::similarity;
use crate::map::detection;
use crate::map::state::KeyframeState;
use crate::pairs::matching::LEAST_OF_POSE;
use crate::tracking::input::{FrameSurface, TrackingInput};
use crate::tracking::sight::Sight;

/// Keyframes with which a new one, made of `frame`, may close a loop, the most alike first. The
/// optimiser verifies them.
pub(crate) fn alike(
    input: &TrackingInput<'_>,
    sight: &mut Sight,
    frame: &FrameSurface<'_>,
    code: &[u8],
) -> Vec<u32> {
    let settings = &input.context.mapping.loops;
    let closes_loop = |older: &KeyframeState| {
        input.map.contains(older) && detection::is_loop(settings, input.map, older, frame.index)
    };
    let mut alike = Vec::new();
    if input.context.mapping.features.enabled && input.context.is_colour_trusted {
        let n = input.context.mapping.relocalise.n_recognised as usize;
        // Of places in the simulated house the first wrong answer has ten words.
        alike = sight.recognise(input, frame.features, [n, LEAST_OF_POSE], closes_loop);
    }
    let older = input.map.active().filter(|older| closes_loop(older));
    let best = older
        .map(|older| (similarity(code, &older.place), older.id))
        // The first among equals.
        .fold((0.0, None), |best, next| if next.0 > best.0 { (next.0, Some(next.1)) } else { best });
    let by_ferns = best.1.filter(|id| best.0 >= settings.min_similarity && !alike.contains(id));
    alike.extend(by_ferns);
    alike
}
