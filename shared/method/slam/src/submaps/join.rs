//! Joining submaps (method 12.8): a place of another submap that the camera sees while it is tracked in
//! its own, confirmed in several frames and verified like a loop closure.

use crate::evidence::pose_agreement::{FAR_VOLUME, UncertainPose};
use crate::evidence::sequential::{SequentialTest, TestVerdict};
use crate::map::cause::Cause;
use crate::map::detection::{self, Urgency};
use crate::map::records::{FrameRecord, JoinRecord, LoopVerdict, MapChange, SightingRecord};
use crate::map::state::{KeyframeState, TrackerState};
use crate::pairs::matchable::Matchable;
use crate::pairs::verification::{self, Tested};
use crate::settings::GlobalSettings;
use crate::submaps::contradiction;
use crate::tracking::acceptance;
use crate::tracking::alignment::Aligner;
use crate::tracking::covariance;
use crate::tracking::found_place::{self, Shown};
use crate::tracking::input::TrackingInput;
use crate::tracking::motion_model::place;
use crate::tracking::prediction::Prediction;
use crate::tracking::relocalise;
use crate::tracking::seen_pose;
use crate::tracking::sight::ENOUGH_FEATURES;
use crate::tracking::turn::turn;
use crate::tracking::window::Member;
use crate::tracking::window_alignment::{WindowAlignment, align_to, nearby_keyframes, reference};
use tessera_geometry::{Pose, PoseBits, Twist, Vector6, compose_normalised};
use tessera_graph::metric_covariance;
use tessera_registration::Sampler;

/// Frames of a turn: one look in each, so that no frame takes long, and neighbours in time see the same and
/// confirm little.
const TURN_FRAMES: u64 = 3;
/// Turns from one search by shape alone to the next, which tries many alignments.
const TURNS_BY_SHAPE: u64 = 6;

/// The record of a tracked frame with what it sees of other submaps, and with the join and its
/// optimisation once the evidence for it reaches its bound.
pub(crate) fn with_sighting(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    mut record: FrameRecord,
) -> FrameRecord {
    let state = input.map.state();
    if state.submaps.n_components() < 2 || record.change.split.is_some() {
        return record;
    }
    let is_other = |id: u32| input.map.keyframe(id).is_some_and(|k| !input.map.contains(k));
    let known = state.sighting.filter(|sighting| is_other(sighting.seen) && !is_other(sighting.own));
    let is_certain = |sighting: &SightingRecord| sighting.evidence_nats() >= SequentialTest::accepted_nats();
    let turn = turn(input, TURN_FRAMES, record.change.new_keyframe.is_some());
    let sighting = match (known, turn) {
        (Some(known), _) if is_certain(&known) => Some(known),
        (known, None) => known,
        (None, Some(turn)) if turn.is_multiple_of(2) => found(input, aligner, &record, turn),
        (None, Some(_)) => None,
        (Some(known), Some(turn)) if turn.is_multiple_of(2) => confirmed(input, aligner, &record, &known),
        (Some(known), Some(_)) => (!fits_elsewhere(input, aligner, &record, &known)).then_some(known),
    };
    // A pending correction was computed from the keyframes as they are.
    match sighting.filter(|sighting| is_certain(sighting) && state.pending.is_none()) {
        Some(certain) => joined(input, &certain, record),
        None => {
            record.change.sighting = sighting;
            record
        }
    }
}

/// A first sighting: the frame's place among the keyframes of all other submaps.
fn found(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    record: &FrameRecord,
    turn: u64,
) -> Option<SightingRecord> {
    let others: Vec<&KeyframeState> =
        input.map.active_anywhere().filter(|k| !input.map.contains(k)).collect();
    let found = if aligner.sight.n_features() >= ENOUGH_FEATURES && input.context.is_colour_trusted {
        let world_from_camera = Pose::from(&record.pose.world_from_camera);
        relocalise::glimpse(input, aligner, &others, |there, submap| {
            let other_from_own = there * world_from_camera.inverse();
            !is_known_refused(input.map.state(), &join_by(input, submap, &other_from_own))
        })?
    } else if turn.is_multiple_of(TURNS_BY_SHAPE) {
        relocalise::recognise(input, aligner, &others, (turn / TURNS_BY_SHAPE) as usize)?
    } else {
        return None;
    };
    sighting(input, record, &found, found.evidence_nats)
}

/// The sighting with what this frame shows of it; `None` where that speaks against the place. Another pose
/// begins anew.
fn confirmed(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    record: &FrameRecord,
    known: &SightingRecord,
) -> Option<SightingRecord> {
    let pose = Pose::from(&record.pose.world_from_camera);
    let expected = other_from_own(input, known)? * pose;
    let velocity = Twist::from_vector(&Vector6::from_column_slice(&record.pose.velocity));
    let found = seen_at(input, aligner, known.seen, &expected, velocity)?;
    let own = UncertainPose::read(&record.pose.world_from_camera, &record.pose.covariance)?;
    let is_same_pose = coincides(input, aligner, &found, (known, &expected), &own)?;
    let shown = found_place::shown(&input.in_submap(found.submap), aligner, &found)?;
    if !is_same_pose {
        let is_enough = shown.llr_nats() > found_place::least_nats(input);
        return is_enough.then(|| sighting(input, record, &found, shown.llr_nats()))?;
    }
    let test = SequentialTest { sum_nats: known.evidence_nats() };
    let test = match shown {
        Shown::SurfacesAlone => test.with(shown.llr_nats(), 1.0),
        Shown::Evidence(_) => {
            // A view is a new one from keyframe to keyframe, and a look again where time alone has passed.
            let (own, _) = own_from_camera(input, record)?;
            let before = reference(input, Member::Keyframe(known.own)).filter(|_| own != known.own);
            let novelty =
                before.map_or(0.0, |before| found_place::novelty_beside(input, aligner, &before, &pose));
            let last = input.map.state().recent.last().map_or(input.frame.stamp_nanos, |l| l.stamp_nanos);
            // It has every other turn.
            let step_nanos =
                input.frame.stamp_nanos.saturating_sub(last).saturating_mul(2 * TURN_FRAMES as i64);
            found_place::with_view(test, shown.llr_nats(), novelty, step_nanos)
        }
    };
    (test.sum_nats > 0.0).then(|| sighting(input, record, &found, test.sum_nats))?
}

/// The frame aligned to the keyframes of another submap about an expected pose; `None` unless the strict
/// tests pass.
pub(crate) fn seen_at(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    seen: u32,
    expected: &Pose,
    velocity: Twist,
) -> Option<WindowAlignment> {
    let other = input.in_submap(input.map.keyframe(seen)?.submap);
    let guess = Prediction { velocity, ..place(&other, expected) };
    let members = nearby_keyframes(&other, expected, usize::MAX);
    let found = align_to(&other, aligner, members, other.samples, &guess);
    acceptance::strict(&found.alignment).ok()?;
    Some(found)
}

/// Whether an alignment to another submap is where a sighting has it rather than anywhere in the region in which joins
/// are the same: both poses with the error of an alignment, and what both tracks drifted in since. `None` where that is
/// not known in every direction.
///
/// `own`: the view in its own submap; `expected`: in the gauge of the other one.
pub(crate) fn coincides(
    input: &TrackingInput<'_>,
    aligner: &Aligner,
    found: &WindowAlignment,
    (known, expected): (&SightingRecord, &Pose),
    own: &UncertainPose,
) -> Option<bool> {
    let a = &found.alignment;
    let alignment = metric_covariance(&a.information, aligner.metric_factor(input.context))?;
    let [own_then, seen_then] = [known.own, known.seen].map(|id| input.map.keyframe(id));
    let (own_then, seen_then, nearest) = (own_then?, seen_then?, found.keyframes(input.map).next()?);
    let [own_then, seen_then, nearest] = [own_then, seen_then, nearest].map(seen_pose::of_keyframe);
    let alignment = alignment + covariance::systematic(&input.map.state().colour, input.context, a);
    let found_pose = UncertainPose { pose: a.world_from_camera, covariance: alignment };
    let drift = UncertainPose::along_track(&own_then, own).covariance
        + UncertainPose::along_track(&seen_then, &nearest).carried_to(&(nearest.pose.inverse() * expected));
    let expected = UncertainPose { pose: *expected, covariance: alignment + drift };
    a.degenerate.is_empty().then(|| expected.coincidence_nats(&found_pose, FAR_VOLUME) > 0.0)
}

/// What an alignment to another submap says of the keyframes of both.
fn sighting(
    input: &TrackingInput<'_>,
    record: &FrameRecord,
    found: &WindowAlignment,
    evidence_nats: f64,
) -> Option<SightingRecord> {
    let seen = found.keyframes(input.map).next()?;
    let seen_from_camera = Pose::from(&seen.world_from_camera).inverse() * found.alignment.world_from_camera;
    let (own, own_from_camera) = own_from_camera(input, record)?;
    let seen_from_own = seen_from_camera * own_from_camera.inverse();
    let seen_from_own = PoseBits::from(&compose_normalised(&seen_from_own, &Twist::default()));
    Some(SightingRecord { seen: seen.id, own, seen_from_own, evidence_millinats: millinats(evidence_nats) })
}

/// As evidence is written down, rounded up: three thirds of a bound reach it.
pub(crate) fn millinats(evidence_nats: f64) -> u32 {
    libm::ceil(1e3 * evidence_nats.max(0.0)) as u32
}

/// A keyframe of the state and the frame's pose in it: the record's own, or the last one before it where
/// it makes a new one, as each frame of a fast camera does.
fn own_from_camera(input: &TrackingInput<'_>, record: &FrameRecord) -> Option<(u32, Pose)> {
    if record.change.new_keyframe.is_none() {
        return Some((record.pose.keyframe, Pose::from(&record.pose.keyframe_from_camera)));
    }
    let last = input.map.last_keyframe()?;
    let own_from_world = Pose::from(&last.world_from_camera).inverse();
    Some((last.id, own_from_world * Pose::from(&record.pose.world_from_camera)))
}

/// From the gauge of the camera's submap to that of the other one.
pub(crate) fn other_from_own(input: &TrackingInput<'_>, sighting: &SightingRecord) -> Option<Pose> {
    let [seen, own] = [sighting.seen, sighting.own].map(|id| input.map.keyframe(id));
    let [other_from_seen, own_from_own] =
        [seen?, own?].map(|keyframe| Pose::from(&keyframe.world_from_camera));
    Some(other_from_seen * Pose::from(&sighting.seen_from_own) * own_from_own.inverse())
}

/// The record with the join and a request to optimise both submaps together, where the keyframes
/// themselves agree; without the sighting where they do not.
fn joined(input: &TrackingInput<'_>, sighting: &SightingRecord, mut record: FrameRecord) -> FrameRecord {
    let verified = verified(input, sighting).and_then(|tested| Some((tested, join(input, sighting)?)));
    let Some((tested, join)) = verified else { return record };
    if is_known_refused(input.map.state(), &join) {
        return record;
    }
    match verdict(input, &record, sighting, &join) {
        TestVerdict::Accepted => {}
        TestVerdict::Undecided => {
            // Half of it anew, with the keyframes to come.
            let evidence_millinats = millinats(0.5 * SequentialTest::accepted_nats());
            record.change.sighting = Some(SightingRecord { evidence_millinats, ..*sighting });
            return record;
        }
        TestVerdict::Rejected => {
            record.causes.push(Cause::JoinRefused { moved: join.moved, kept: join.kept });
            record.change.refused = Some(join);
            return record;
        }
    }
    let settings = &input.context.mapping.loops;
    let n_keyframes = input.map.n_keyframes() as u32 + u32::from(record.change.new_keyframe.is_some());
    let request =
        detection::request(settings, input.map.state(), input.frame.index, n_keyframes, Urgency::AtOnce);
    record.causes.push(Cause::Joined {
        moved: join.moved,
        kept: join.kept,
        evidence_nats: sighting.evidence_nats(),
        overlap: tested.overlap,
        in_front: tested.in_front,
    });
    record.change = MapChange { join: Some(join), request, ..record.change };
    record
}

/// What the views of both components about the camera say of a join.
fn verdict(
    input: &TrackingInput<'_>,
    record: &FrameRecord,
    sighting: &SightingRecord,
    join: &JoinRecord,
) -> TestVerdict {
    let (context, state, keyframes) = (input.context, input.map.state(), input.surfaces.keyframes);
    let camera = Pose::from(&record.pose.world_from_camera);
    let is_moved = state.submaps.component(input.map.submap()) == join.moved;
    let there = if is_moved { Pose::from(&join.kept_from_moved) * camera } else { camera };
    let nats = contradiction::join_nats(context, state, keyframes, join, &there.translation.vector);
    contradiction::verdict(sighting.evidence_nats(), nats)
}

/// Whether the frame has its place elsewhere in the other component just as well: of rooms that look alike none
/// says which one it is.
fn fits_elsewhere(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    record: &FrameRecord,
    sighting: &SightingRecord,
) -> bool {
    let (Some(other_from_own), Some(seen)) =
        (other_from_own(input, sighting), input.map.keyframe(sighting.seen))
    else {
        return false;
    };
    let expected = other_from_own * Pose::from(&record.pose.world_from_camera);
    let other = input.map.in_submap(seen.submap);
    let apart_m = |pose: &Pose| (expected.translation.vector - pose.translation.vector).norm();
    let is_elsewhere =
        |k: &&KeyframeState| apart_m(&Pose::from(&k.world_from_camera)) > GlobalSettings::RADIUS_M;
    let elsewhere: Vec<&KeyframeState> = other.active().filter(is_elsewhere).collect();
    relocalise::glimpse(input, aligner, &elsewhere, |there, _| apart_m(there) > GlobalSettings::RADIUS_M)
        .is_some()
}

/// Whether the same join was refused, and too few keyframes were made since to tell anything else.
fn is_known_refused(state: &TrackerState, join: &JoinRecord) -> bool {
    let n = state.keyframes.len() as u32;
    let is_known =
        |(refused, from): &(JoinRecord, u32)| n < *from && contradiction::is_same_join(refused, join);
    state.refused.iter().any(is_known)
}

/// The tests of a loop between the camera's keyframe and the nearest one of the other submap; `None`
/// where they fail.
pub(crate) fn verified(input: &TrackingInput<'_>, sighting: &SightingRecord) -> Option<Tested> {
    let own = input.map.keyframe(sighting.own).filter(|own| own.is_active())?;
    let seen = input.map.keyframe(sighting.seen)?;
    let other_from_camera = other_from_own(input, sighting)? * Pose::from(&own.world_from_camera);
    let nearest = nearby_keyframes(&input.in_submap(seen.submap), &other_from_camera, 1);
    let Some(Member::Keyframe(nearest)) = nearest.first() else { return None };
    let nearest = input.map.keyframe(*nearest)?;
    let nearest_from_own = Pose::from(&nearest.world_from_camera).inverse() * other_from_camera;
    let mut sampler = Sampler::default();
    let [own, nearest] =
        [own, nearest].map(|k| Matchable::new(input.context, &mut sampler, k, input.surfaces.keyframes));
    let mut matcher = input.context.matcher();
    let tested = verification::test(&mut matcher, &own, &nearest, &nearest_from_own);
    let is_good = tested.verdict == LoopVerdict::Accepted && tested.overlap >= GlobalSettings::MIN_OVERLAP;
    is_good.then_some(tested)
}

/// The older component keeps its gauge.
pub(crate) fn join(input: &TrackingInput<'_>, sighting: &SightingRecord) -> Option<JoinRecord> {
    let seen = input.map.keyframe(sighting.seen)?;
    Some(join_by(input, seen.submap, &other_from_own(input, sighting)?))
}

/// The join of the camera's component with that of a submap, from the gauge of one to that of the other.
fn join_by(input: &TrackingInput<'_>, submap: u32, other_from_own: &Pose) -> JoinRecord {
    let submaps = &input.map.state().submaps;
    let [own, other] = [input.map.submap(), submap].map(|submap| submaps.component(submap));
    let motion = if other < own { *other_from_own } else { other_from_own.inverse() };
    let kept_from_moved = PoseBits::from(&compose_normalised(&motion, &Twist::default()));
    JoinRecord { kept: own.min(other), moved: own.max(other), kept_from_moved }
}
