//! A submap that the camera had left before that was noticed (method 12.8): what of the working map goes
//! with which part.

use crate::map::keyframe::KeyframeState;
use crate::map::records::SplitRecord;
use nalgebra::Vector3;

/// Anchors again, within its own part, each culled keyframe that moved along with one of another part: with
/// the nearest one there. Where there is none it is active again.
pub(crate) fn anchor_within_parts(keyframes: &mut [KeyframeState], split: &SplitRecord) {
    let part = |id: u32| split.firsts().filter(|first| id >= *first).count();
    let centre = |k: &KeyframeState| Vector3::from(k.world_from_camera.translation_m);
    let is_across = |k: &KeyframeState| k.anchored_to.is_some_and(|anchor| part(anchor) != part(k.id));
    let anchors: Vec<(usize, Option<u32>)> = keyframes
        .iter()
        .enumerate()
        .filter(|(_, k)| is_across(k))
        .map(|(place, k)| {
            let beside = keyframes.iter().filter(|o| o.is_active() && part(o.id) == part(k.id));
            let of_submap = beside.filter(|o| o.submap == k.submap);
            let away = |o: &KeyframeState| (centre(o) - centre(k)).norm_squared();
            let nearest = of_submap.min_by(|a, b| away(a).total_cmp(&away(b)).then(a.id.cmp(&b.id)));
            (place, nearest.map(|o| o.id))
        })
        .collect();
    for (place, anchor) in anchors {
        keyframes[place].anchored_to = anchor;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::loops::test_wall::keyframe;

    #[test]
    fn a_culled_keyframe_stays_with_its_own_part() {
        let anchored =
            |id: u32, x_m: f64, to: u32| KeyframeState { anchored_to: Some(to), ..keyframe(id, 0, x_m) };
        let mut keyframes = vec![
            keyframe(0, 0, 0.0),
            keyframe(1, 0, 2.0),
            anchored(2, 1.8, 5),
            anchored(3, 1.8, 1),
            anchored(4, 1.9, 1),
            keyframe(5, 0, 1.8),
            anchored(6, 0.0, 0),
        ];
        anchor_within_parts(&mut keyframes, &SplitRecord { carried: Some(4), first: 5 });
        let anchors: Vec<Option<u32>> = keyframes.iter().map(|k| k.anchored_to).collect();
        // Keyframe 4 is alone in its part.
        assert_eq!(anchors, [None, None, Some(1), Some(1), None, None, Some(5)]);
    }
}
