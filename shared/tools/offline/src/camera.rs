//! A camera from the numbers that most users have.

use tessera_geometry::Camera;

/// A pinhole without distortion, `width` x `height` pixels; `[fx, fy, cx, cy]` in pixels, raw depth
/// divided by `units_per_metre` is metres. Further numbers can be set on what comes back.
pub fn pinhole((width, height): (u32, u32), [fx, fy, cx, cy]: [f64; 4], units_per_metre: f64) -> Camera {
    Camera {
        width,
        height,
        fx,
        fy,
        cx,
        cy,
        units_per_metre,
        distortion: [0.0; 5],
        readout_s: 0.0,
        depth_offset_m: 0.0,
        colour_registered: true,
    }
}
