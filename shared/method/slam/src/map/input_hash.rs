//! The name of an optimisation's input.

use crate::map::state::KeyframeState;
use std::fmt::Debug;

/// FNV-1a over numbers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fnv(u64);

impl Default for Fnv {
    fn default() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }
}

impl Fnv {
    pub(crate) fn eat(&mut self, bits: u64) {
        for byte in bits.to_le_bytes() {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }

    /// Takes in every field of a value: floating-point numbers are written so that they come back.
    pub(crate) fn eat_debug(&mut self, value: &impl Debug) {
        format!("{value:?}").bytes().for_each(|byte| self.eat(u64::from(byte)));
    }

    pub(crate) fn value(self) -> u64 {
        self.0
    }
}

/// FNV-1a over the ids and the bits of the poses of keyframes: names the input that a correction
/// was computed from.
pub(crate) fn input_hash(keyframes: &[KeyframeState]) -> u64 {
    let mut hash = Fnv::default();
    for k in keyframes {
        hash.eat(u64::from(k.id));
        let pose = &k.world_from_camera;
        pose.translation_m.iter().chain(&pose.rotation_xyzw).for_each(|v| hash.eat(v.to_bits()));
    }
    hash.value()
}
