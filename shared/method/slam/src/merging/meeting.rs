//! Places that the maps of several runs share (method 12.9).
//!
//! Each keyframe is looked for in the components before its own as a lost camera is; what is found there
//! must be confirmed by other keyframes of its component, and the keyframes themselves must pass the tests
//! of a loop closure. Nothing else joins two maps. A place that looks like another one of either map joins
//! nothing, and what else both saw there must not contradict the join.

use crate::evidence::pose_agreement::{FAR_M, apart_m};
use crate::evidence::sequential::{SequentialTest, TestVerdict};
use crate::map::appearance::Ferns;
use crate::map::context::Context;
use crate::map::map_view::MapView;
use crate::map::placement::apply_join;
use crate::map::records::{JoinRecord, SightingRecord};
use crate::map::state::{KeyframeState, TrackerState};
use crate::map::surfaces::KeyframeSurfaces;
use crate::merging::known_looks::{ComponentHashes, KnownLooks};
use crate::merging::looked_again::{LookedAgain, looked_again};
use crate::settings::GlobalSettings;
use crate::submaps::contradiction;
use crate::submaps::join;
use crate::tracking::alignment::Aligner;
use crate::tracking::found_place;
use crate::tracking::input::{FrameSurface, MIN_SAMPLES, Surfaces, TrackingInput};
use crate::tracking::relocalise;
use crate::tracking::window::Member;
use serde::{Deserialize, Serialize};
use tessera_geometry::{Pose, PoseBits, Twist, Vector6, compose_normalised, translation_rotation_norms};
use tessera_registration::{Sample, Sampler};
use tessera_surface::SurfaceView;

/// Two components that were joined because both saw a place.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Meeting {
    /// The component whose gauge stays, and that which moved into it.
    pub kept: u32,
    /// The component that moved.
    pub moved: u32,
    /// Keyframe of the component that moved.
    pub own: u32,
    /// Keyframe of the other one near which it stands.
    pub seen: u32,
    /// Keyframes that say so, each by the strict tests.
    pub n_confirmed: u32,
    /// Smaller share of queries with a match, of both directions.
    pub overlap: f64,
    /// Larger share of queries in view that float in front of what the other saw.
    pub in_front: f64,
}

/// What one map leaves to the next: what keyframes saw, and what that joined.
#[derive(Debug, Default)]
pub(crate) struct KnownMeetings {
    pub(crate) seen: KnownLooks<Option<SightingRecord>>,
    pub(crate) joined: KnownLooks<LookOutcome>,
}

/// What came of what a keyframe saw.
#[derive(Clone, Copy, Debug)]
pub(crate) enum LookOutcome {
    /// It is not certain.
    Nothing,
    /// A join that what both components saw contradicts.
    Contradicted(JoinRecord),
    /// A join.
    Joined(Meeting, JoinRecord),
}

/// Joins the components of a state that share places, the younger into the older, until no more are
/// found. The same answer for the same keyframes in the same order.
pub(crate) fn join_all(
    context: &Context,
    state: &mut TrackerState,
    surfaces: &dyn KeyframeSurfaces,
    known: &mut KnownMeetings,
    progress: &mut dyn FnMut(),
) -> Vec<Meeting> {
    known.seen.begin();
    known.joined.begin();
    let mut looker = Looker::new(context, state);
    let mut hashes = ComponentHashes::of(state);
    let mut meetings = Vec::new();
    let mut id = 0;
    while (id as usize) < state.keyframes.len() && state.submaps.n_components() > 1 {
        progress();
        match looker.meeting(state, surfaces, (known, &hashes), id) {
            Some((meeting, joined)) => {
                apply_join(&mut state.keyframes, &mut state.submaps, &joined);
                meetings.push(meeting);
                hashes = ComponentHashes::of(state);
                looker.contradicted.clear();
                // A component that has grown may see more.
                id = 0;
            }
            None => id += 1,
        }
    }
    meetings
}

/// Looks at one keyframe after the other; holds the buffers and what was looked for in vain.
struct Looker {
    context: Context,
    aligner: Aligner,
    ferns: Ferns,
    sampler: Sampler,
    samples: Vec<Sample>,
    /// By keyframe: how many keyframes it was looked for among, in vain.
    in_vain: Vec<usize>,
    /// Joins that what both saw contradicts, since the last one that holds.
    contradicted: Vec<JoinRecord>,
}

impl Looker {
    fn new(context: &Context, state: &TrackerState) -> Self {
        let context = context.with_colour(&state.colour, &state.noise);
        let mut aligner = Aligner::new(&context);
        aligner.sight.holds_admitted_only = true;
        Self {
            aligner,
            ferns: Ferns::default(),
            sampler: Sampler::default(),
            samples: Vec::new(),
            in_vain: vec![0; state.keyframes.len()],
            contradicted: Vec::new(),
            context,
        }
    }

    /// What a keyframe sees of the components before its own, where that is certain.
    fn meeting(
        &mut self,
        state: &TrackerState,
        surfaces: &dyn KeyframeSurfaces,
        (known, hashes): (&mut KnownMeetings, &ComponentHashes),
        id: u32,
    ) -> Option<(Meeting, JoinRecord)> {
        let own = state.keyframes.get(id as usize).filter(|k| k.is_active())?;
        let component = |k: &KeyframeState| state.submaps.component(k.submap);
        let before = |k: &&KeyframeState| k.is_active() && component(k) < component(own);
        let others: Vec<&KeyframeState> = state.keyframes.iter().filter(before).collect();
        // Components only grow: the same number is the same keyframes.
        if others.len() == self.in_vain[id as usize] {
            return None;
        }
        let outcome = if others.is_empty() {
            LookOutcome::Nothing
        } else {
            let colour = (&state.colour, self.context.cameras.colours(own.session));
            let beside = neighbours(state, own).first().copied();
            let seen = hashes.seen(&colour, (own, beside), component(own));
            let seen = known.seen.of(seen, || self.first_sighting(state, surfaces, own, &others));
            let joined = hashes.joined(&colour, own, component(own));
            seen.map_or(LookOutcome::Nothing, |sighting| {
                known.joined.of(joined, || self.judged(state, surfaces, own, sighting))
            })
        };
        self.in_vain[id as usize] = others.len();
        match outcome {
            LookOutcome::Joined(meeting, joined) => return Some((meeting, joined)),
            LookOutcome::Contradicted(joined) => self.contradicted.push(joined),
            LookOutcome::Nothing => {}
        }
        None
    }

    /// What comes of a sighting.
    fn judged(
        &mut self,
        state: &TrackerState,
        surfaces: &dyn KeyframeSurfaces,
        own: &KeyframeState,
        sighting: SightingRecord,
    ) -> LookOutcome {
        let Some((meeting, joined, place_nats)) = self.confirmed(state, surfaces, own, sighting) else {
            return LookOutcome::Nothing;
        };
        // Neighbours say the same: one test is enough for them.
        let is_known = self.contradicted.iter().any(|known| contradiction::is_same_join(known, &joined));
        let verdict = match is_known {
            true => TestVerdict::Rejected,
            false => {
                let pose = Pose::from(&own.world_from_camera);
                let is_moved = state.submaps.component(own.submap) == joined.moved;
                let there = if is_moved { Pose::from(&joined.kept_from_moved) * pose } else { pose };
                let place = there.translation.vector;
                let nats = contradiction::join_nats(&self.context, state, surfaces, &joined, &place);
                contradiction::verdict(place_nats, nats)
            }
        };
        match verdict {
            TestVerdict::Undecided => LookOutcome::Nothing,
            TestVerdict::Accepted => LookOutcome::Joined(meeting, joined),
            TestVerdict::Rejected => LookOutcome::Contradicted(joined),
        }
    }

    fn first_sighting(
        &mut self,
        state: &TrackerState,
        surfaces: &dyn KeyframeSurfaces,
        own: &KeyframeState,
        others: &[&KeyframeState],
    ) -> Option<SightingRecord> {
        self.look(state, surfaces, own, |input, aligner| recognised(input, aligner, own, others))?
    }

    /// Whether a keyframe fits a place of a component apart from `expected`, its pose there, just as well: of
    /// rooms that look alike none says which one it is.
    fn fits_elsewhere(
        &mut self,
        state: &TrackerState,
        surfaces: &dyn KeyframeSurfaces,
        keyframe: &KeyframeState,
        (component, expected): (u32, &Pose),
    ) -> bool {
        let is_elsewhere = |k: &&KeyframeState| {
            let apart = translation_rotation_norms(&(expected.inverse() * Pose::from(&k.world_from_camera)));
            k.is_active()
                && state.submaps.component(k.submap) == component
                && apart.0 > GlobalSettings::RADIUS_M
        };
        let elsewhere: Vec<&KeyframeState> = state.keyframes.iter().filter(is_elsewhere).collect();
        if elsewhere.is_empty() {
            return false;
        }
        // Looks among the keyframes of one component take turns with those among all before it.
        self.aligner.sight.places_used = 1 + component;
        let fits = self.look(state, surfaces, keyframe, |input, aligner| {
            let sighting = recognised(input, aligner, keyframe, &elsewhere)?;
            let found = join::other_from_own(input, &sighting)? * Pose::from(&keyframe.world_from_camera);
            Some(apart_m(expected, &found) > FAR_M && join::verified(input, &sighting).is_some())
        });
        self.aligner.sight.places_used = 0;
        fits.flatten() == Some(true)
    }

    /// The join, where enough neighbours of the keyframe see the same, none of them something else,
    /// and the pair passes the tests of a loop.
    fn confirmed(
        &mut self,
        state: &TrackerState,
        surfaces: &dyn KeyframeSurfaces,
        own: &KeyframeState,
        sighting: SightingRecord,
    ) -> Option<(Meeting, JoinRecord, f64)> {
        let (n_confirmed, test) = self.gathered(state, surfaces, own, &sighting)?;
        // What surrounds the place is asked once the views tell half of what is needed.
        if 2.0 * test.sum_nats < SequentialTest::accepted_nats() {
            return None;
        }
        let found = self.look(state, surfaces, own, |input, _| {
            let tested = join::verified(input, &sighting)?;
            let joined = join::join(input, &sighting)?;
            let other_from_own = join::other_from_own(input, &sighting)?;
            let meeting = Meeting {
                kept: joined.kept,
                moved: joined.moved,
                own: sighting.own,
                seen: sighting.seen,
                n_confirmed,
                overlap: tested.overlap,
                in_front: tested.in_front,
            };
            Some((meeting, joined, other_from_own))
        });
        let (meeting, joined, other_from_own) = found.flatten()?;
        let seen = state.keyframes.get(sighting.seen as usize)?;
        let component = |k: &KeyframeState| state.submaps.component(k.submap);
        let own_in_other = other_from_own * Pose::from(&own.world_from_camera);
        let seen_in_own = other_from_own.inverse() * Pose::from(&seen.world_from_camera);
        let is_ambiguous = self.fits_elsewhere(state, surfaces, own, (component(seen), &own_in_other))
            || self.fits_elsewhere(state, surfaces, seen, (component(own), &seen_in_own));
        (!is_ambiguous).then_some((meeting, joined, test.sum_nats))
    }

    /// The evidence of a keyframe and of its neighbours for what it sees, and how many of them tell; `None` where one
    /// has another place there.
    fn gathered(
        &mut self,
        state: &TrackerState,
        surfaces: &dyn KeyframeSurfaces,
        own: &KeyframeState,
        sighting: &SightingRecord,
    ) -> Option<(u32, SequentialTest)> {
        let mut test = SequentialTest { sum_nats: sighting.evidence_nats() };
        let mut counted = vec![own.id];
        for neighbour in neighbours(state, own) {
            if test.verdict() != TestVerdict::Undecided {
                break;
            }
            let shown = self.look(state, surfaces, neighbour, |input, aligner| {
                looked_again(input, aligner, neighbour, sighting, &counted)
            });
            match shown.flatten() {
                Some(LookedAgain::Shows { nats, novelty }) => {
                    let apart = |id: &u32| {
                        let stamp_nanos = state.keyframes.get(*id as usize).map_or(0, |k| k.stamp_nanos);
                        neighbour.stamp_nanos.saturating_sub(stamp_nanos).saturating_abs()
                    };
                    let step_nanos = counted.iter().map(apart).min().unwrap_or(0);
                    test = found_place::with_view(test, nats, novelty, step_nanos);
                    counted.push(neighbour.id);
                }
                Some(LookedAgain::ElsewhereThere) => return None,
                // It looks at something else, which tells nothing.
                None => {}
            }
        }
        Some((counted.len() as u32, test))
    }

    /// Has a keyframe looked at as a frame of its own submap; `None` with too little to look at.
    fn look<T>(
        &mut self,
        state: &TrackerState,
        surfaces: &dyn KeyframeSurfaces,
        keyframe: &KeyframeState,
        what: impl FnOnce(&TrackingInput<'_>, &mut Aligner) -> T,
    ) -> Option<T> {
        let context = &*self.context.of(keyframe.session);
        let surface = SurfaceView { grid: context.grid, vertices: surfaces.vertices(keyframe.id) };
        let registration = &self.context.registration;
        self.sampler.draw(&surface, keyframe.frame_index, registration, &mut self.samples);
        if self.samples.len() < MIN_SAMPLES {
            return None;
        }
        let frame = FrameSurface {
            features: surfaces.features(keyframe.id),
            ..FrameSurface::new(keyframe.frame_index, keyframe.stamp_nanos, surface)
        };
        let velocity = Twist::from_vector(&Vector6::from_column_slice(&keyframe.velocity));
        self.aligner.sight.begin(context, &frame, None, &velocity);
        let input = TrackingInput {
            context,
            map: MapView::from(state).in_submap(keyframe.submap),
            ferns: &self.ferns,
            frame: &frame,
            samples: &self.samples,
            surfaces: Surfaces { recent: &[], keyframes: surfaces },
            view_before: neighbours(state, keyframe).first().map(|k| Member::Keyframe(k.id)),
        };
        Some(what(&input, &mut self.aligner))
    }
}

/// What a keyframe sees among these keyframes.
fn recognised(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    own: &KeyframeState,
    others: &[&KeyframeState],
) -> Option<SightingRecord> {
    let found = relocalise::recognise(input, aligner, others, own.id as usize)?;
    let seen = found.keyframes(input.map).next()?;
    let seen_from_own = Pose::from(&seen.world_from_camera).inverse() * found.alignment.world_from_camera;
    let seen_from_own = PoseBits::from(&compose_normalised(&seen_from_own, &Twist::default()));
    let evidence_millinats = join::millinats(found.evidence_nats);
    Some(SightingRecord { seen: seen.id, own: own.id, seen_from_own, evidence_millinats })
}

/// Keyframes of the same component that are asked to confirm what one sees, the nearest in the order of their making
/// first.
fn neighbours<'a>(state: &'a TrackerState, own: &KeyframeState) -> Vec<&'a KeyframeState> {
    let component = |k: &KeyframeState| state.submaps.component(k.submap);
    let is_neighbour = |k: &&KeyframeState| k.is_active() && k.id != own.id && component(k) == component(own);
    let mut found: Vec<&KeyframeState> = state.keyframes.iter().filter(is_neighbour).collect();
    found.sort_by_key(|k| (k.id.abs_diff(own.id), k.id));
    found.truncate(GlobalSettings::NEIGHBOURS);
    found
}
