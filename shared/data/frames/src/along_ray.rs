//! Depth that is the distance along the ray, as renderers write it, and images that look like it or like
//! the inverse of depth.
#![expect(
    clippy::arithmetic_side_effects,
    clippy::indexing_slicing,
    clippy::cast_possible_truncation,
    reason = "pixels within an image of the camera's size"
)]

use tessera_geometry::Camera;

/// Lengths of the rays of all pixels with z = 1.
#[derive(Clone, Debug)]
pub struct RayLengths(Vec<f32>);

impl RayLengths {
    /// Those of a camera.
    pub fn new(camera: &Camera) -> Self {
        let (width, height) = (camera.width as usize, camera.height as usize);
        let pixel = |at: usize| camera.ray((at / width) as f64, (at % width) as f64).norm() as f32;
        Self((0..width * height).map(pixel).collect())
    }

    /// Turns distances along the ray into depth along the optical axis.
    pub fn to_depth(&self, raw: &mut [u16]) {
        for (raw, length) in raw.iter_mut().zip(&self.0) {
            if *raw != 0 && *raw != u16::MAX {
                *raw = (f32::from(*raw) / length).round() as u16;
            }
        }
    }
}

// Fitted on eight frames of each of six recordings of four cameras, as they are and with distances along
// the ray: no window of the first speaks for distances, and 5 to 53 of the second do, but none of a
// time-of-flight camera with a view of 44 degrees. For the inverse of depth, on the same frames: none of the
// first, and 9 to 85 of its inverse in 16 bits or eighths of a pixel, but none of a D435.
/// Parts of the width and height that a window takes, and every how many pixels it is sampled.
const WINDOW: usize = 5;
const SAMPLE: usize = 4;
/// Share of a window's pixels that must be measured.
const MEASURED: f64 = 0.8;
/// Relative deviation from a plane below which a window shows one.
const PLANE: f64 = 0.005;
/// Share of the other reading's deviation at which one is clearly better.
const CLEARLY: f64 = 0.7;
/// Windows that must speak for another reading, and how many times as many as against.
const LEAST_WINDOWS: usize = 3;
const MANY_TIMES: usize = 4;

/// Windows that show a plane by one of two readings alone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Votes {
    n_for_other: usize,
    n_for_depth: usize,
}

impl Votes {
    /// Counts a window by its deviations from a plane; of what lies within `rounding` none is the better.
    fn add(&mut self, of_other: f64, of_depth: f64, rounding: f64) {
        let is_better = |one: f64, other: f64| one < PLANE && one < CLEARLY * other && other > rounding;
        self.n_for_other += usize::from(is_better(of_other, of_depth));
        self.n_for_depth += usize::from(is_better(of_depth, of_other));
    }

    /// "N of M places that show a plane", where most speak for the other reading.
    fn most(&self) -> Option<String> {
        let Self { n_for_other, n_for_depth } = *self;
        (n_for_other >= LEAST_WINDOWS && n_for_other >= MANY_TIMES * n_for_depth.max(1)).then(|| {
            format!("planes bend: in {n_for_other} of {} places that show one", n_for_other + n_for_depth)
        })
    }
}

/// Whether planes of some images bend as they do where something else is read as depth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Bent {
    distance: Votes,
    inverse: Votes,
}

impl Bent {
    /// Looks at windows of an image: the inverse of a plane's depth is linear in the pixel.
    pub fn add(&mut self, raw: &[u16], camera: &Camera) {
        let (width, height) = (camera.width as usize, camera.height as usize);
        let (w, h) = (width / WINDOW, height / WINDOW);
        for row in (0..=height - h).step_by((h / 2).max(1)) {
            for column in (0..=width - w).step_by((w / 2).max(1)) {
                let mut samples: Vec<[f64; 5]> = Vec::new();
                let mut n = 0;
                for r in (row..row + h).step_by(SAMPLE) {
                    for c in (column..column + w).step_by(SAMPLE) {
                        n += 1;
                        let value = raw[r * width + c];
                        if value != 0 && value != u16::MAX {
                            let length = camera.ray(r as f64, c as f64).norm();
                            let (value, inverse) = (f64::from(value), 1.0 / f64::from(value));
                            let (u, v) =
                                ((c - column) as f64 / w as f64 - 0.5, (r - row) as f64 / h as f64 - 0.5);
                            samples.push([u, v, inverse, inverse * length, value]);
                        }
                    }
                }
                if (samples.len() as f64) < MEASURED * n as f64 || samples.len() < 12 {
                    continue;
                }
                let off = |reading: usize| off_plane(samples.iter().map(|s| [s[0], s[1], s[reading]]));
                let of_depth = off(2);
                // Root mean square of the rounding to whole numbers, of the mean value.
                let mean = samples.iter().map(|sample| sample[4]).sum::<f64>() / samples.len() as f64;
                let rounding = 1.0 / (f64::sqrt(12.0) * mean);
                self.distance.add(off(3), of_depth, rounding);
                self.inverse.add(off(4), of_depth, rounding);
            }
        }
    }

    /// A sentence where most planes say so.
    pub fn doubt(&self) -> Option<String> {
        let distance = self.distance.most().map(|most| {
            format!("{most}, depth is flat only if it is the distance along the ray: depth = \"distance\" in the camera file reads it so")
        });
        let inverse = || {
            let most = self.inverse.most()?;
            Some(format!(
                "{most}, values are flat only if they are the inverse of depth (disparity): write depth instead, focal length times baseline over disparity"
            ))
        };
        distance.or_else(inverse)
    }
}

/// Root mean square deviation from `a u + b v + c`, relative to the mean.
fn off_plane(samples: impl Iterator<Item = [f64; 3]> + Clone) -> f64 {
    let mut m = nalgebra::Matrix3::<f64>::zeros();
    let mut t = nalgebra::Vector3::<f64>::zeros();
    let (mut sum, mut n) = (0.0, 0.0);
    for [u, v, q] in samples.clone() {
        let x = nalgebra::Vector3::new(u, v, 1.0);
        m += x * x.transpose();
        t += x * q;
        (sum, n) = (sum + q, n + 1.0);
    }
    let Some(plane) = m.lu().solve(&t) else { return f64::INFINITY };
    let squares: f64 = samples.map(|[u, v, q]| (plane.x * u + plane.y * v + plane.z - q).powi(2)).sum();
    (squares / n).sqrt() / (sum / n)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Camera {
        Camera::pinhole((160, 120), [130.0, 130.0, 79.5, 59.5], 5000.0)
    }

    /// A corner of a room: a wall, a floor.
    fn corner(camera: &Camera) -> Vec<u16> {
        let n = (camera.width * camera.height) as usize;
        (0..n)
            .map(|at| {
                let ray =
                    camera.ray((at / camera.width as usize) as f64, (at % camera.width as usize) as f64);
                let wall = 2.0 / (1.0 + 0.3 * ray.x);
                let floor = if ray.y > 0.0 { 1.2 / ray.y } else { f64::INFINITY };
                (5000.0 * wall.min(floor)).round().min(60_000.0) as u16
            })
            .collect()
    }

    #[test]
    fn distances_become_depth_again() {
        let camera = camera();
        let depth = corner(&camera);
        let mut raw: Vec<u16> = depth.clone();
        for (at, raw) in raw.iter_mut().enumerate() {
            let ray = camera.ray((at / 160) as f64, (at % 160) as f64);
            *raw = (f64::from(*raw) * ray.norm()).round() as u16;
        }
        raw[5] = 0;
        raw[6] = u16::MAX;
        let mut bent = Bent::default();
        bent.add(&raw, &camera);
        assert!(bent.doubt().unwrap().contains("depth = \"distance\""));
        RayLengths::new(&camera).to_depth(&mut raw);
        assert_eq!((raw[5], raw[6]), (0, u16::MAX));
        assert!(raw.iter().zip(&depth).skip(7).all(|(a, b)| a.abs_diff(*b) <= 1));
        let mut flat = Bent::default();
        flat.add(&raw, &camera);
        assert_eq!(flat.doubt(), None);
    }

    #[test]
    fn a_wall_that_is_faced_straight_on_is_flat_by_both_readings() {
        let mut bent = Bent::default();
        (990..1010).for_each(|raw| bent.add(&vec![raw; 160 * 120], &camera()));
        assert_eq!(bent.doubt(), None);
    }

    #[test]
    fn the_inverse_of_depth_is_named() {
        let camera = camera();
        let depth = corner(&camera);
        // Of a whole range of 16 bits, and disparities of a stereo camera with an offset.
        for (top, offset) in [(3e8, 0.0), (3e7, 1000.0)] {
            let inverse: Vec<u16> =
                depth.iter().map(|raw| (offset + top / f64::from(*raw)).round() as u16).collect();
            let mut bent = Bent::default();
            bent.add(&inverse, &camera);
            let doubt = bent.doubt().unwrap();
            assert!(doubt.contains("the inverse of depth (disparity)"), "{doubt}");
        }
    }

    #[test]
    fn what_shows_no_plane_says_nothing() {
        let camera = camera();
        let bumps: Vec<u16> = (0..160 * 120).map(|at: u32| 5000 + (at * 7919 % 4001) as u16).collect();
        let mut bent = Bent::default();
        bent.add(&bumps, &camera);
        assert_eq!(bent.doubt(), None);
    }
}
