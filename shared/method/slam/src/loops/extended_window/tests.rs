use super::*;
use crate::loops::test_wall::{Walls, context, keyframe};
use crate::map::context::Context;

/// The keyframes of these ids and sessions, the first one fixed, each 1 cm beside the one before.
fn vertices<'a>(context: &Context, keyframes: &[KeyframeState], walls: &'a Walls) -> Vec<WindowPose<'a>> {
    let mut sampler = Sampler::default();
    let vertex = |k: &KeyframeState| {
        let matchable = Matchable::new(context, &mut sampler, k, walls);
        let (vertices, is_fixed) = (matchable.vertices(), k.id < 2);
        WindowPose { id: k.id, session: k.session, submap: k.submap, is_fixed, matchable, vertices }
    };
    keyframes.iter().map(vertex).collect()
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
    let context = context();
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
    let mut context = context();
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
