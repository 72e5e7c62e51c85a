use super::*;
use crate::loops::test_wall::{Walls, context, keyframe};
use crate::map::context::Context;
use tessera_registration::BrightnessUse;

/// The keyframes of these ids and sessions, the first one fixed, each 1 cm beside the one before.
fn vertices<'a>(context: &Context, keyframes: &[KeyframeState], walls: &'a Walls) -> Vec<WindowPose<'a>> {
    let mut sampler = Sampler::default();
    let vertex = |k: &KeyframeState| WindowPose {
        id: k.id,
        session: k.session,
        submap: k.submap,
        is_fixed: k.id < 2,
        matchable: Matchable::new(context, &mut sampler, k, walls),
    };
    keyframes.iter().map(vertex).collect()
}

#[test]
fn pairs_use_intensity_when_asked() {
    let keyframes = [keyframe(0, 0, 0.0), keyframe(1, 0, 0.01), keyframe(2, 0, 0.02)];
    // The information along the wall, of each pair at the true poses.
    let along_the_wall = |intensity: BrightnessUse| -> Vec<f64> {
        let context = context(intensity);
        let walls = Walls::seen_by(&context, &keyframes);
        let vertices = vertices(&context, &keyframes, &walls);
        let queries = vertices[2].matchable.queries.clone();
        let poses: Vec<Pose> =
            [0, 1, 2, 2].map(|k: usize| Pose::from(&keyframes[k].world_from_camera)).to_vec();
        let mut matcher = context.matcher();
        searches(&vertices, &queries, MatchLimits::new(0.1, 1.0))
            .iter()
            .map(|search| search.find(&context, &mut matcher, &poses))
            .map(|pair| {
                assert_eq!(pair.weight, 1.0);
                pair.block.linearise(&(poses[pair.target].inverse() * poses[pair.query])).0[(0, 0)]
            })
            .collect()
    };
    let off = along_the_wall(BrightnessUse::Off);
    let always = along_the_wall(BrightnessUse::Always);
    assert_eq!(off.len(), 3, "frame to the free one, the free one to both fixed ones");
    for (off, always) in off.iter().zip(&always) {
        assert!(*always > 1.2 * off, "{always} with intensity, {off} without");
    }
    // A wall is degenerate: there the intensity is asked for as well.
    assert_eq!(along_the_wall(BrightnessUse::WhereFree), always);
}

#[test]
fn what_is_searched_is_not_fixed_on_both_sides() {
    let keyframes = [
        keyframe(0, 0, 0.0),
        keyframe(1, 0, 0.0),
        keyframe(2, 0, 0.0),
        keyframe(3, 1, 0.0),
        keyframe(5, 1, 0.0),
    ];
    let context = context(BrightnessUse::Off);
    let mut all = keyframes.to_vec();
    all.insert(4, keyframe(4, 1, 0.0));
    let walls = Walls::seen_by(&context, &all);
    let vertices = vertices(&context, &keyframes, &walls);
    let queries = Queries::default();
    let found = searches(&vertices, &queries, MatchLimits::new(0.1, 1.0));
    let frame = vertices.len();
    assert!(found.iter().all(|s| (s.query, s.target) != (1, 0) && (s.query != frame || s.target >= 2)));
    assert_eq!(found.len(), 3 * 2 + 3 + 3);
    // Keyframe 3 is of another run, and 5 does not follow 3.
    let consecutive: Vec<_> =
        found.iter().filter(|s| s.is_consecutive).map(|s| (s.query, s.target)).collect();
    assert_eq!(consecutive, [(2, 1)]);
}

#[test]
fn consecutive_keyframes_count_however_little_they_overlap() {
    let keyframes = [keyframe(0, 0, 0.0), keyframe(1, 0, 0.01), keyframe(2, 0, 0.02)];
    let mut context = context(BrightnessUse::Off);
    context.mapping.global.min_overlap = 2.0;
    let walls = Walls::seen_by(&context, &keyframes);
    let vertices = vertices(&context, &keyframes, &walls);
    let queries = Queries::default();
    let poses: Vec<Pose> = keyframes.iter().map(|k| Pose::from(&k.world_from_camera)).collect();
    let mut matcher = context.matcher();
    for search in searches(&vertices, &queries, MatchLimits::new(0.1, 1.0)) {
        if search.query < poses.len() {
            let pair = search.find(&context, &mut matcher, &poses);
            let expected = if (pair.query, pair.target) == (2, 1) { 1.0 } else { 0.0 };
            assert_eq!(pair.weight, expected, "{} {}", pair.query, pair.target);
        }
    }
}
