//! The name of an optimisation's input.

use crate::map::state::KeyframeState;

/// FNV-1a over the ids and the bits of the poses of keyframes: names the input that a correction
/// was computed from.
pub(crate) fn input_hash(keyframes: &[KeyframeState]) -> u64 {
    let mut hash = 0xcbf2_9ce4_8422_2325u64;
    let mut eat = |bits: u64| {
        for byte in bits.to_le_bytes() {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    };
    for k in keyframes {
        eat(u64::from(k.id));
        let pose = &k.world_from_camera;
        pose.translation_m.iter().chain(&pose.rotation_xyzw).for_each(|v| eat(v.to_bits()));
    }
    hash
}
