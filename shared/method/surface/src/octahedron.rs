//! Unit vectors as two integers, by the octahedral map (Meyer, Süßmuth, Sußner, Stamminger and
//! Greiner, "On Floating-Point Normal Vectors", 2010).

/// Steps from the centre of the map to its border: 0.1 to 0.2 degrees each.
const STEPS: f32 = 511.0;

/// Rounds to the nearest integer, halves away from zero.
#[inline(always)]
pub(crate) fn round(value: f32) -> i32 {
    (value + 0.5f32.copysign(value)) as i32
}

/// Place on the map, of the hemisphere towards the camera in its middle; `[0, 0]` for no normal.
#[inline(always)]
pub(crate) fn from_normal([x, y, z]: [f32; 3]) -> [i32; 2] {
    let length = x.abs() + y.abs() + z.abs();
    // NaN for no normal, and a cast makes 0 of it.
    let [u, v] = folded_where(z > 0.0, [x / length, y / length]);
    [round(u * STEPS), round(v * STEPS)]
}

/// The unit vector of a place on the map.
#[inline(always)]
pub(crate) fn to_normal([u, v]: [i32; 2]) -> [f32; 3] {
    let (u, v) = (u as f32 / STEPS, v as f32 / STEPS);
    let z = u.abs() + v.abs() - 1.0;
    let [x, y] = folded_where(z > 0.0, [u, v]);
    let length = (x * x + y * y + z * z).sqrt();
    [x / length, y / length, z / length]
}

/// Exchanges the inner and the outer half of the map where a place is there. Without a branch.
#[inline(always)]
fn folded_where(is_outer: bool, [u, v]: [f32; 2]) -> [f32; 2] {
    let folded = [(1.0 - v.abs()).copysign(u), (1.0 - u.abs()).copysign(v)];
    [if is_outer { folded[0] } else { u }, if is_outer { folded[1] } else { v }]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_directions_come_back() {
        for k in 0..2000 {
            // A spiral over the sphere.
            let z = k as f32 / 1000.0 - 1.0;
            let (radius, angle) = ((1.0 - z * z).sqrt(), 0.7 * k as f32);
            let normal = [radius * libm::cosf(angle), radius * libm::sinf(angle), z];
            let back = to_normal(from_normal(normal));
            let error = (0..3).map(|axis| (back[axis] - normal[axis]).abs()).fold(0.0, f32::max);
            assert!(error < 0.0035, "{normal:?} {back:?}");
            let once_more = to_normal(from_normal(back));
            assert_eq!(once_more, back);
        }
        assert_eq!(to_normal(from_normal([0.0, 0.0, -1.0])), [0.0, 0.0, -1.0]);
        assert!(to_normal([i32::MAX, i32::MIN]).iter().all(|number| number.is_finite()));
    }
}
