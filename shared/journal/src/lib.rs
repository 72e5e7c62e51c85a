//! What lasts on disk: an append-only journal and a mapped store of keyframe surfaces.
