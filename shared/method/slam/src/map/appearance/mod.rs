//! Recognises places: which keyframes look like this frame?
//!
//! Randomised ferns on a small image of depth and colour (Glocker, Shotton, Criminisi and Izadi,
//! TVCG 2015): each fern looks at one pixel and asks four yes-or-no questions; two images are
//! similar by the share of ferns that give the same four answers. A code is a pure function of
//! a surface, 256 bytes long, and is kept in the keyframe's record: nothing needs to be trained,
//! and the set of codes is a fold over records like everything else.
//!
//! An answer is a hint and no more: geometry decides.

mod ferns;
mod thumbnail;

pub use ferns::{Ferns, N_FERNS, PlaceCode, similarity};
