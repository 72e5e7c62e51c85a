//! The surfaces of several runs as those of one map.

use std::borrow::Cow;
use std::ops::Range;
use tessera_features::Feature;
use tessera_slam::KeyframeSurfaces;
use tessera_surface::Vertex;

/// The surfaces of all runs' keyframes, by their numbers in the joint map.
#[derive(Default)]
pub(crate) struct JointSurfaces<'a>(Vec<(u32, &'a dyn KeyframeSurfaces)>);

impl<'a> JointSurfaces<'a> {
    /// Adds the surfaces of the next run, whose keyframes have these numbers in the joint map.
    pub(crate) fn add(&mut self, keyframes: Range<usize>, surfaces: &'a dyn KeyframeSurfaces) {
        if !keyframes.is_empty() {
            self.0.push((keyframes.start as u32, surfaces));
        }
    }

    /// The run that a keyframe is of, and its number there.
    fn of(&self, keyframe: u32) -> (&dyn KeyframeSurfaces, u32) {
        let place = self.0.partition_point(|(first, _)| *first <= keyframe).saturating_sub(1);
        let (first, surfaces) = self.0[place];
        (surfaces, keyframe - first)
    }
}

impl KeyframeSurfaces for JointSurfaces<'_> {
    fn vertices(&self, keyframe: u32) -> &[Vertex] {
        let (surfaces, id) = self.of(keyframe);
        surfaces.vertices(id)
    }

    fn vertices_once(&self, keyframe: u32) -> Cow<'_, [Vertex]> {
        let (surfaces, id) = self.of(keyframe);
        surfaces.vertices_once(id)
    }

    fn features(&self, keyframe: u32) -> &[Feature] {
        let (surfaces, id) = self.of(keyframe);
        surfaces.features(id)
    }

    fn features_once(&self, keyframe: u32) -> Cow<'_, [Feature]> {
        let (surfaces, id) = self.of(keyframe);
        surfaces.features_once(id)
    }
}
