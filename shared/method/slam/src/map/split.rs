//! A submap that the camera had left before that was noticed (method 12.8): what of the working map goes
//! with which part.

use crate::map::placement::{HasPlacement, Placement};
use crate::map::records::SplitRecord;
use nalgebra::Vector3;

/// Anchors again, within its own part, each culled keyframe that moved along with one of another part: with
/// the nearest one there. Where there is none it is active again.
pub(crate) fn anchor_within_parts<K: HasPlacement>(keyframes: &mut [K], split: &SplitRecord) {
    let part = |id: u32| split.firsts().filter(|first| id >= *first).count();
    let all: Vec<(u32, Placement)> = (0..).zip(keyframes.iter().map(HasPlacement::placement)).collect();
    let centre = |k: &Placement| Vector3::from(k.world_from_camera.translation_m);
    for (id, culled) in &all {
        if culled.anchored_to.is_none_or(|anchor| part(anchor) == part(*id)) {
            continue;
        }
        let beside = all.iter().filter(|(other, k)| k.anchored_to.is_none() && part(*other) == part(*id));
        let of_submap = beside.filter(|(_, k)| k.submap == culled.submap);
        let away = |k: &Placement| (centre(k) - centre(culled)).norm_squared();
        let nearest = of_submap.min_by(|(a, k), (b, l)| away(k).total_cmp(&away(l)).then(a.cmp(b)));
        let anchored_to = nearest.map(|(other, _)| *other);
        keyframes[*id as usize].set_placement(Placement { anchored_to, ..*culled });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::keyframe::KeyframeState;
    use crate::map::test_wall::keyframe;

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
