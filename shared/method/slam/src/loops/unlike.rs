//! Whether two components that a join brings together look unlike where they see the same (method 12.8).
//!
//! Storeys of one building have the same walls, and rooms that are furnished alike: their surfaces agree. What
//! they do not share is how they look all along the way. So a join is refused where many keyframes stand beside
//! keyframes of the other component, look the same way, and share no features with them.

use crate::features::matching::{PairFinder, Reach};
use crate::features::sight::ENOUGH_FEATURES;
use crate::loops::matchable::Matchable;
use crate::loops::track_ends::at_track_ends;
use crate::loops::verification;
use crate::loops::view_limits::{ViewLimits, optical_axis};
use crate::map::context::Context;
use crate::map::records::JoinRecord;
use crate::map::state::{KeyframeState, TrackerState};
use crate::map::surfaces::KeyframeSurfaces;
use crate::settings::GlobalSettings;
use nalgebra::Vector3;
use tessera_geometry::{Pose, translation_rotation_norms};
use tessera_numerics::parallel::map_in_parts;
use tessera_registration::Sampler;

/// Views that may share features, and those that do wherever they show the same place.
const NEAR_VIEW: ViewLimits = ViewLimits { radius_m: 1.0, angle_rad: 35.0_f64.to_radians() };
const SAME_VIEW: ViewLimits = ViewLimits { radius_m: 0.5, angle_rad: 20.0_f64.to_radians() };

/// Which keyframes are looked at.
#[derive(Clone, Copy)]
pub(crate) struct Extent {
    /// So many at most.
    most_tested: usize,
    /// Those at the ends of their tracks say nothing against a join.
    doubts_ends: bool,
}

/// In a run, whose frames wait. Its camera is at the end of a track that has just begun.
pub(crate) const IN_RUN: Extent = Extent { most_tested: 100, doubts_ends: false };
/// In a base: of a place with a few keyframes that is another one, as a storey's lobby, all must be looked at to be
/// seen in a row.
pub(crate) const IN_BASE: Extent = Extent { most_tested: 1000, doubts_ends: true };
/// Features on which views of one place agree.
const MIN_AGREEING: usize = 12;
/// How far from where the join has them features of a pair may put it, metres and radians: beyond, they are of
/// another place that looks alike.
const DRIFTED_M: f64 = 1.5;
const DRIFTED_RAD: f64 = 30.0_f64.to_radians();
/// Views that share nothing in a join that is refused: at least so many, and this share of all. Right joins had
/// up to three or 6 %, those of two storeys 7 % and more.
const UNLIKE: usize = 4;
const UNLIKE_SHARE: f64 = 0.06;
/// Views in a row that share nothing and none of which shares anything: a place that is another one, however much
/// of the rest looks alike. A storey's lobby may have no more keyframes.
const UNLIKE_IN_A_ROW: usize = 3;

/// Views that must share features before a join is made, or half of the keyframes of the smaller component where
/// it has fewer than twice as many: a first look may be at what is the same on every storey.
const ENOUGH_ALIKE: usize = 15;

/// Views that say something from which on a few that share nothing refuse a join: of less, most must.
const FEW_LOOKS: usize = 20;

/// What the views of both components say of a join that brings them near each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Resemblance {
    /// Many share nothing.
    Unlike,
    /// Too few share features to tell.
    TooFew,
    Alike,
}

/// What the views of both components say; without colour they say nothing against it. The same for any number
/// of threads.
pub(crate) fn resemblance(
    context: &Context,
    state: &TrackerState,
    surfaces: &dyn KeyframeSurfaces,
    joined: &JoinRecord,
    extent: Extent,
) -> Resemblance {
    if !context.mapping.features.enabled || !context.is_colour_trusted {
        return Resemblance::Alike;
    }
    let n_of =
        |component: u32| state.active().filter(|k| state.submaps.component(k.submap) == component).count();
    let enough = ENOUGH_ALIKE.min(n_of(joined.moved).min(n_of(joined.kept)) / 2);
    let pairs = pairs(state, joined, extent);
    if pairs.len() < enough {
        return Resemblance::TooFew;
    }
    let looks = map_in_parts(
        &pairs,
        || (Sampler::default(), PairFinder::new(context), context.matcher()),
        |(sampler, finder, matcher), pair| {
            let sides = [pair.moved, pair.kept].map(|k| {
                Matchable::new(context, sampler, k, surfaces)
                    .with_features(context, surfaces.features_once(k.id))
            });
            let seen = [&sides[0], &sides[1]].map(|side| side.seen(context));
            if seen.iter().any(|seen| seen.features.len() < ENOUGH_FEATURES) {
                return PairLook::Featureless;
            }
            let seed = u64::from(pair.moved.id) << 32 | u64::from(pair.kept.id);
            let mut shares = |reach: Reach| {
                let found = finder.find(context, seen, &pair.kept_from_moved, reach, seed);
                found.is_some_and(|found| {
                    let apart = pair.kept_from_moved.inverse() * found.target_from_query;
                    let (apart_m, apart_rad) = translation_rotation_norms(&apart);
                    found.inliers.len() >= MIN_AGREEING && apart_m <= DRIFTED_M && apart_rad <= DRIFTED_RAD
                })
            };
            // Components have drifted in themselves: farther from the place than it would be looked for.
            if shares(Reach::LOOP) || shares(Reach::ANYWHERE) {
                return PairLook::Alike;
            }
            if pair.is_in_doubt {
                return PairLook::Elsewhere;
            }
            let mut violates = || {
                let settings = &context.mapping.global;
                let tested =
                    verification::test(settings, matcher, &sides[0], &sides[1], &pair.kept_from_moved);
                tested.in_front > GlobalSettings::MAX_IN_FRONT
            };
            if pair.is_same_view || violates() { PairLook::Unlike } else { PairLook::Elsewhere }
        },
        &mut || (),
    );
    judged(&independent(looks, &pairs), enough)
}

/// The looks, of which those that share nothing count once for each view: before a door that moves many keyframes are
/// made of one view.
fn independent(mut looks: Vec<PairLook>, pairs: &[JoinedViews<'_>]) -> Vec<PairLook> {
    let mut counted: Vec<(Vector3<f64>, Vector3<f64>)> = Vec::new();
    for (look, pair) in looks.iter_mut().zip(pairs).filter(|(look, _)| **look == PairLook::Unlike) {
        let pose = Pose::from(&pair.moved.world_from_camera);
        let (centre, axis) = (pose.translation.vector, optical_axis(&pose));
        let centres = counted.iter().enumerate().map(|(k, (centre, _))| (k, *centre));
        if SAME_VIEW.within(&centre, &axis, centres, |k| counted[k].1).is_empty() {
            counted.push((centre, axis));
        } else {
            *look = PairLook::Elsewhere;
        }
    }
    looks
}

/// What a pair of views says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum PairLook {
    Alike,
    Unlike,
    /// They need not share anything.
    Elsewhere,
    /// One of them has too few features to share any.
    Featureless,
}

fn judged(looks: &[PairLook], enough: usize) -> Resemblance {
    let n = |what: PairLook| looks.iter().filter(|look| **look == what).count();
    let (n_alike, n_unlike, n_featureless) =
        (n(PairLook::Alike), n(PairLook::Unlike), n(PairLook::Featureless));
    let is_place = longest_unlike(looks) >= UNLIKE_IN_A_ROW;
    let is_many =
        is_place || n_unlike >= UNLIKE && n_unlike as f64 >= UNLIKE_SHARE * (n_alike + n_unlike) as f64;
    if is_many && (n_alike + n_unlike >= FEW_LOOKS || n_unlike > n_alike) {
        Resemblance::Unlike
    } else if is_many || n_alike + n_featureless < enough {
        Resemblance::TooFew
    } else {
        Resemblance::Alike
    }
}

/// The longest row of views that share nothing, in the order of their keyframes; those that say nothing left out.
fn longest_unlike(looks: &[PairLook]) -> usize {
    let telling: Vec<PairLook> =
        looks.iter().copied().filter(|look| [PairLook::Alike, PairLook::Unlike].contains(look)).collect();
    let rows = telling.split(|look| *look == PairLook::Alike);
    rows.map(<[PairLook]>::len).max().unwrap_or(0)
}

/// A keyframe of the component that moves, and that of the other one whose view is the most like its own.
struct JoinedViews<'a> {
    moved: &'a KeyframeState,
    kept: &'a KeyframeState,
    kept_from_moved: Pose,
    is_same_view: bool,
    /// One of them may not be where its component has it.
    is_in_doubt: bool,
}

/// The pairs of all keyframes of the component that moves, in their order; evenly chosen where they are many.
fn pairs<'a>(state: &'a TrackerState, joined: &JoinRecord, extent: Extent) -> Vec<JoinedViews<'a>> {
    let ends = if extent.doubts_ends { at_track_ends(&state.keyframes) } else { Vec::new() };
    let is_in_doubt = |k: &KeyframeState| ends.get(k.id as usize) == Some(&true);
    let join = Pose::from(&joined.kept_from_moved);
    let of = |component: u32| {
        let is_of = move |k: &&KeyframeState| state.submaps.component(k.submap) == component;
        state.active().filter(is_of).map(|k| (k, Pose::from(&k.world_from_camera)))
    };
    let others: Vec<(&KeyframeState, Pose)> = of(joined.kept).collect();
    let axes: Vec<Vector3<f64>> = others.iter().map(|(_, pose)| optical_axis(pose)).collect();
    let beside = of(joined.moved).filter_map(|(moved, pose)| {
        let there = join * pose;
        let nearest = |limits: &ViewLimits| {
            let centres = others.iter().map(|(_, pose)| pose.translation.vector).enumerate();
            let near =
                limits.nearest(&there.translation.vector, &optical_axis(&there), centres, |at| axes[at]);
            near.first().map(|(_, at)| *at)
        };
        let same = nearest(&SAME_VIEW);
        let (kept, kept_pose) = &others[same.or_else(|| nearest(&NEAR_VIEW))?];
        let kept_from_moved = kept_pose.inverse() * there;
        let is_in_doubt = is_in_doubt(moved) || is_in_doubt(kept);
        Some(JoinedViews { moved, kept, kept_from_moved, is_same_view: same.is_some(), is_in_doubt })
    });
    let all: Vec<JoinedViews<'_>> = beside.collect();
    let step = all.len().div_ceil(extent.most_tested).max(1);
    all.into_iter().step_by(step).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::loops::test_wall::keyframe;
    use tessera_geometry::PoseBits;

    #[test]
    fn many_views_that_share_nothing_refuse_a_join() {
        // A is alike, U is unlike, a point says nothing.
        let looks = |text: &str| {
            let look = |letter| match letter {
                'A' => PairLook::Alike,
                'U' => PairLook::Unlike,
                _ => PairLook::Elsewhere,
            };
            judged(&text.chars().map(look).collect::<Vec<_>>(), 15)
        };
        let alike = |n: usize| "A".repeat(n);
        let scattered = |n: usize| "UA.A".repeat(n);
        assert_eq!((looks("...."), looks(&(alike(14) + "UAU"))), (Resemblance::TooFew, Resemblance::Alike));
        assert_eq!(looks(&(alike(13) + "U")), Resemblance::TooFew);
        assert_eq!(
            (looks(&alike(15)), looks(&(scattered(3) + &alike(84)))),
            (Resemblance::Alike, Resemblance::Alike)
        );
        assert_eq!(looks(&(scattered(4) + &alike(50))), Resemblance::Unlike, "four of 62");
        assert_eq!(looks(&(scattered(4) + &alike(60))), Resemblance::Alike, "four of 72");
        assert_eq!(looks("UUUU"), Resemblance::Unlike);
        assert_eq!(looks(&(scattered(4) + &alike(7))), Resemblance::TooFew, "a few at a door");
        assert_eq!(looks(&("UU..U".to_owned() + &alike(90))), Resemblance::Unlike, "a lobby is another one");
        assert_eq!(looks(&("UUAU".to_owned() + &alike(90))), Resemblance::Alike);
        assert_eq!(
            judged(&[PairLook::Featureless; 15], 15),
            Resemblance::Alike,
            "bare walls say nothing against it"
        );
    }

    #[test]
    fn each_view_has_the_one_of_the_other_component_that_is_most_like_it() {
        let mut state = TrackerState::default();
        state.submaps.extend_to(1);
        let made_in = |id: u32, submap: u32, x_m: f64| KeyframeState { submap, ..keyframe(id, 0, x_m) };
        state.keyframes = vec![
            made_in(0, 0, 0.0),
            made_in(1, 0, 0.3),
            made_in(2, 1, 10.1),
            made_in(3, 1, 11.0),
            made_in(4, 1, 12.0),
        ];
        let joined = JoinRecord {
            kept: 0,
            moved: 1,
            kept_from_moved: PoseBits::from(&Pose::translation(-10.0, 0.0, 0.0)),
        };
        let found: Vec<(u32, u32, bool)> =
            pairs(&state, &joined, IN_RUN).iter().map(|p| (p.moved.id, p.kept.id, p.is_same_view)).collect();
        assert_eq!(found, [(2, 0, true), (3, 1, false)], "the last one stands alone");
    }
}
