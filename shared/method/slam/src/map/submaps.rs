//! Submaps: a camera that is lost for long begins another map with its own gauge, which is joined to
//! the others once the same place is seen from both (method 12.8).
//!
//! A keyframe keeps the submap that it was made in: its chain of odometry. Joined submaps are one
//! component and have one gauge; what lies in different components has no common frame, so that a
//! distance between them means nothing.

use crate::map::keyframe::KeyframeState;
use serde::{Deserialize, Serialize};

/// Frames, or submaps, of one record that are listed one by one at most: the frames of two days at 60 Hz.
pub(crate) const MOST_LISTED: u32 = 2 * 86_400 * 60;

/// The components of all submaps.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Submaps {
    /// By submap: its component, named by the first submap in it.
    components: Vec<u32>,
}

impl Submaps {
    /// Number of submaps.
    pub fn n(&self) -> u32 {
        self.components.len() as u32
    }

    /// So many submaps, each apart.
    pub(crate) fn apart(n: u32) -> Self {
        Self { components: (0..n).collect() }
    }

    /// The component of a submap.
    pub fn component(&self, submap: u32) -> u32 {
        self.components.get(submap as usize).copied().unwrap_or(submap)
    }

    /// The first `n` submaps: those of the run that a joint map begins with.
    pub(crate) fn first(&self, n: u32) -> Self {
        Self { components: self.components.iter().take(n as usize).copied().collect() }
    }

    /// Whether each component is named by the first submap in it.
    pub fn is_consistent(&self) -> bool {
        let is_named = |(component, submap): (&u32, u32)| {
            *component <= submap && self.components.get(*component as usize) == Some(component)
        };
        self.components.iter().zip(0..).all(is_named)
    }

    /// Number of components: submaps that are apart.
    pub fn n_components(&self) -> u32 {
        self.components.iter().zip(0..).filter(|(component, submap)| **component == *submap).count() as u32
    }

    /// Submaps up to this one exist, each apart until it is joined. A journal is untrusted input: beyond
    /// [`MOST_LISTED`] no memory is taken.
    pub(crate) fn extend_to(&mut self, submap: u32) {
        let (n, submap) = (self.components.len() as u32, submap.min(MOST_LISTED - 1));
        self.components.extend(n..=submap);
    }

    /// Makes one component of those of two submaps.
    pub(crate) fn join(&mut self, a: u32, b: u32) {
        let [a, b] = [a, b].map(|submap| self.component(submap));
        let joined = a.min(b);
        self.components.iter_mut().filter(|c| **c == a || **c == b).for_each(|c| *c = joined);
    }

    /// Takes over an optimisation's answer about the submaps that it knew.
    pub(crate) fn judge(&mut self, judged: &Self) {
        for (own, judged) in self.components.iter_mut().zip(&judged.components) {
            *own = *judged;
        }
    }

    /// Components that were part of another one before.
    pub(crate) fn apart_since(&self, before: &Self) -> Vec<u32> {
        let is_apart =
            |submap: &u32| self.component(*submap) == *submap && before.component(*submap) != *submap;
        (0..self.n()).filter(is_apart).collect()
    }

    /// Where keyframes belong, in their order.
    pub(crate) fn origins(&self, keyframes: &[KeyframeState]) -> Vec<Origin> {
        let origin = |k: &KeyframeState| Origin {
            session: k.session,
            submap: k.submap,
            component: self.component(k.submap),
        };
        keyframes.iter().map(origin).collect()
    }
}

/// Where a keyframe belongs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Origin {
    /// The run that made it.
    pub session: u32,
    /// Its chain of odometry in that run.
    pub submap: u32,
    /// The gauge that its pose is in.
    pub component: u32,
}

/// The places of the first keyframe of each component: the origins of the gauges.
pub(crate) fn gauges(origins: &[Origin]) -> Vec<bool> {
    let first = |place: usize| origins[..place].iter().all(|o| o.component != origins[place].component);
    (0..origins.len()).map(first).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::test_wall::keyframe;

    fn submaps(components: &[u32]) -> Submaps {
        Submaps { components: components.to_vec() }
    }

    #[test]
    fn submaps_are_joined_and_come_apart_again() {
        let mut found = Submaps::default();
        assert_eq!((found.n(), found.n_components(), found.component(0)), (0, 0, 0));
        found.extend_to(3);
        found.extend_to(2);
        assert_eq!((found.n(), found.n_components()), (4, 4));
        let mut hostile = found.clone();
        hostile.extend_to(u32::MAX);
        assert_eq!((hostile.n(), hostile.component(u32::MAX)), (MOST_LISTED, u32::MAX));
        found.join(3, 2);
        found.join(0, 3);
        assert_eq!(found, submaps(&[0, 1, 0, 0]));
        assert_eq!((found.n_components(), found.component(3)), (2, 0));
        // An optimisation that knew the first three.
        let before = found.clone();
        found.judge(&submaps(&[0, 1, 2]));
        assert_eq!(found, submaps(&[0, 1, 2, 0]));
        assert_eq!((found.apart_since(&before), before.apart_since(&found)), (vec![2], vec![]));
        assert_eq!(found.first(2), submaps(&[0, 1]));
        assert!(found.is_consistent() && Submaps::default().is_consistent());
        for wrong in [&[1, 1][..], &[0, 0, 1], &[0, 7]] {
            assert!(!submaps(wrong).is_consistent(), "{wrong:?}");
        }
    }

    #[test]
    fn each_component_has_one_gauge() {
        let made_in = |id: u32, submap: u32| KeyframeState { submap, ..keyframe(id, 0, 0.0) };
        let keyframes = [made_in(0, 0), made_in(1, 1), made_in(2, 2), made_in(3, 3)];
        let origins = submaps(&[0, 0, 2, 2]).origins(&keyframes);
        assert_eq!(gauges(&origins), [true, false, true, false]);
    }
}
