//! The map as one tracking step sees it.

use crate::map::culling::LOOKED_BACK_NANOS;
use crate::map::state::{KeyframeState, TrackerState};

/// The tracker's state, and in front of it a keyframe that this step would make, as far as it has one
/// gauge with a submap: that of the camera by default. The state itself changes only
/// by records.
#[derive(Clone, Copy)]
pub(crate) struct MapView<'a> {
    state: &'a TrackerState,
    candidate: Option<&'a KeyframeState>,
    submap: u32,
}

impl<'a> From<&'a TrackerState> for MapView<'a> {
    fn from(state: &'a TrackerState) -> Self {
        Self { state, candidate: None, submap: state.submap }
    }
}

impl<'a> MapView<'a> {
    /// The same map with one keyframe more, whose id follows the last.
    pub(crate) fn with_candidate(self, candidate: &'a KeyframeState) -> Self {
        Self { candidate: Some(candidate), ..self }
    }

    /// The same map from another submap.
    pub(crate) fn in_submap(self, submap: u32) -> Self {
        Self { submap, ..self }
    }

    /// The submap that it is seen from.
    pub(crate) fn submap(&self) -> u32 {
        self.submap
    }

    /// Whether a keyframe's pose is in the gauge of this view.
    pub(crate) fn contains(&self, keyframe: &KeyframeState) -> bool {
        let submaps = &self.state.submaps;
        submaps.component(keyframe.submap) == submaps.component(self.submap)
    }

    /// All but keyframes: recent frames, counters, the pending request.
    pub(crate) fn state(&self) -> &'a TrackerState {
        self.state
    }

    /// All keyframes of one gauge, by id.
    pub(crate) fn keyframes(&self) -> impl DoubleEndedIterator<Item = &'a KeyframeState> + use<'a> {
        let view = *self;
        self.state.keyframes.iter().chain(self.candidate).filter(move |k| view.contains(k))
    }

    /// Keyframes of one gauge to which others may be aligned, by id.
    pub(crate) fn active(&self) -> impl Iterator<Item = &'a KeyframeState> + use<'a> {
        let view = *self;
        self.active_anywhere().filter(move |k| view.contains(k))
    }

    /// Keyframes of all submaps to which others may be aligned, by id.
    pub(crate) fn active_anywhere(&self) -> impl Iterator<Item = &'a KeyframeState> + use<'a> {
        self.state.active().chain(self.candidate.filter(|k| k.is_active()))
    }

    /// Number of keyframes of all submaps: the id of the next one.
    pub(crate) fn n_keyframes(&self) -> usize {
        self.state.keyframes.len() + usize::from(self.candidate.is_some())
    }

    /// A keyframe of any submap by its id.
    pub(crate) fn keyframe(&self, id: u32) -> Option<&'a KeyframeState> {
        let candidate = self.candidate.filter(|candidate| candidate.id == id);
        self.state.keyframes.get(id as usize).or(candidate)
    }

    /// The newest keyframe.
    pub(crate) fn last_keyframe(&self) -> Option<&'a KeyframeState> {
        self.keyframes().next_back()
    }

    /// The newest keyframe, if this run made it and others may be aligned to it: that of a component to which the camera
    /// comes back after hours may have been culled.
    pub(crate) fn last_own_keyframe(&self) -> Option<&'a KeyframeState> {
        self.last_keyframe().filter(|keyframe| self.is_own(keyframe) && keyframe.is_active())
    }

    /// Whether a keyframe has its surface at a time: of the culled ones those of the last seconds have it for sure.
    pub(crate) fn is_at_hand(&self, keyframe: &KeyframeState, now_nanos: i64) -> bool {
        let age_nanos = now_nanos.saturating_sub(keyframe.stamp_nanos);
        keyframe.is_active() || self.is_own(keyframe) && age_nanos <= LOOKED_BACK_NANOS
    }

    /// Whether this run made a keyframe.
    pub(crate) fn is_own(&self, keyframe: &KeyframeState) -> bool {
        self.state.is_own(keyframe)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::submaps::Submaps;
    use tessera_geometry::PoseBits;

    fn keyframe(id: u32, session: u32) -> KeyframeState {
        KeyframeState {
            id,
            session,
            submap: 0,
            frame_index: u64::from(id),
            stamp_nanos: 0,
            world_from_camera: PoseBits::IDENTITY,
            velocity: [0.0; 6],
            slot: crate::StoreSlot::default(),
            edges: Vec::new(),
            covariance: Vec::new(),
            up: None,
            place: Vec::new(),
            alike: Vec::new(),
            anchored_to: None,
        }
    }

    #[test]
    fn a_culled_keyframe_of_long_ago_is_not_looked_at() {
        let culled = KeyframeState { anchored_to: Some(0), stamp_nanos: 10_000_000_000, ..keyframe(1, 0) };
        let newest = KeyframeState { submap: 1, ..keyframe(2, 0) };
        let keyframes = vec![keyframe(0, 0), culled, newest];
        let state = TrackerState { keyframes, submaps: Submaps::apart(2), ..TrackerState::default() };
        let map = MapView::from(&state);
        assert_eq!(map.last_keyframe().map(|k| k.id), Some(1));
        assert!(map.last_own_keyframe().is_none());
        assert_eq!(map.in_submap(1).last_own_keyframe().map(|k| k.id), Some(2));
        let at_hand = |id: usize, seconds: i64| map.is_at_hand(&state.keyframes[id], seconds * 1_000_000_000);
        assert!(at_hand(1, 15) && !at_hand(1, 16) && at_hand(0, 1000));
        let later = TrackerState { session: 1, ..state.clone() };
        assert!(!MapView::from(&later).is_at_hand(&state.keyframes[1], 15_000_000_000), "of an earlier run");
    }

    #[test]
    fn a_candidate_is_the_last_keyframe_and_the_state_has_none_of_it() {
        let state = TrackerState {
            session: 1,
            keyframes: vec![keyframe(0, 0), keyframe(1, 0)],
            ..TrackerState::default()
        };
        let map = MapView::from(&state);
        assert_eq!((map.n_keyframes(), map.last_keyframe().map(|k| k.id)), (2, Some(1)));
        assert!(map.last_own_keyframe().is_none() && map.keyframe(2).is_none());
        let candidate = keyframe(2, 1);
        let with = map.with_candidate(&candidate);
        assert_eq!((with.n_keyframes(), with.last_own_keyframe().map(|k| k.id)), (3, Some(2)));
        assert_eq!(with.keyframe(2), Some(&candidate));
        assert_eq!(with.keyframes().map(|k| k.id).collect::<Vec<_>>(), [0, 1, 2]);
        assert_eq!((map.n_keyframes(), state.keyframes.len()), (2, 2));
    }
}
