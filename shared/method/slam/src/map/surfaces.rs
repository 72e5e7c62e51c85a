//! Access to the surfaces of keyframes.

use std::borrow::Cow;
use tessera_features::Feature;
use tessera_surface::Vertex;

/// Read access to the surfaces of keyframes, in place.
pub trait KeyframeSurfaces: Sync {
    /// Vertices of a keyframe, row by row; the grid is the same for all.
    fn vertices(&self, keyframe: u32) -> &[Vertex];

    /// The same for a single look: of many keyframes not all need stay at hand.
    fn vertices_once(&self, keyframe: u32) -> Cow<'_, [Vertex]> {
        self.vertices(keyframe).into()
    }

    /// Features of a keyframe's colour image; none where there is no colour.
    fn features(&self, _keyframe: u32) -> &[Feature] {
        &[]
    }

    /// The same for a single look: they need not stay at hand.
    fn features_once(&self, keyframe: u32) -> Cow<'_, [Feature]> {
        self.features(keyframe).into()
    }
}
