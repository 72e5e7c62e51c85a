//! Views that may see the same: near each other in distance and angle together.

use nalgebra::Vector3;
use tessera_geometry::Pose;

/// How far two views may be apart.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ViewLimits {
    /// Distance of the camera centres, metres.
    pub(crate) radius_m: f64,
    /// Angle between the optical axes, radians.
    pub(crate) angle_rad: f64,
}

/// Views that look at the same: a pair is aligned from where the map has it, and shares features.
pub(crate) const SAME_VIEW: ViewLimits = ViewLimits { radius_m: 0.7, angle_rad: 25.0_f64.to_radians() };

impl ViewLimits {
    /// The views within the limits of one with this centre and optical axis, nearest first, each
    /// with its score `distance / radius + angle / limit`. `others` yields names and centres in the
    /// world; `axis_of` is asked for those within the radius only: most keyframes of a long run are
    /// far away, and must cost nothing.
    pub(crate) fn nearest<Name: Copy + Ord>(
        &self,
        centre: &Vector3<f64>,
        axis: &Vector3<f64>,
        others: impl Iterator<Item = (Name, Vector3<f64>)>,
        axis_of: impl Fn(Name) -> Vector3<f64>,
    ) -> Vec<(f64, Name)> {
        let least_dot = self.least_dot();
        let mut near: Vec<(f64, Name)> = others
            .filter(|(_, other)| (other - centre).norm_squared() <= self.radius_m * self.radius_m)
            .filter(|(name, _)| axis_of(*name).dot(axis) >= least_dot)
            .filter_map(|(name, other)| {
                let (apart_sq, dot) = ((other - centre).norm_squared(), axis_of(name).dot(axis));
                Some((self.score(apart_sq, dot)?, name))
            })
            .collect();
        near.sort_by(by_score);
        near
    }

    /// Whether two views, `world_from_camera` each, are within the limits.
    pub(crate) fn hold(&self, a: &Pose, b: &Pose) -> bool {
        let apart_sq = (b.translation.vector - a.translation.vector).norm_squared();
        let dot = optical_axis(b).dot(&optical_axis(a));
        apart_sq <= self.radius_m * self.radius_m && self.score(apart_sq, dot).is_some()
    }

    /// The cosine below which views look elsewhere: most do, which takes no arc cosine to tell.
    pub(crate) fn least_dot(&self) -> f64 {
        libm::cos(self.angle_rad.min(std::f64::consts::PI)) - 1e-9
    }

    /// The score of a view by the squared distance of both and the cosine between their axes; `None` where that is
    /// beyond the limit.
    pub(crate) fn score(&self, apart_sq: f64, dot: f64) -> Option<f64> {
        let angle_rad = libm::acos(dot.clamp(-1.0, 1.0));
        (angle_rad <= self.angle_rad).then(|| self.sum(apart_sq, angle_rad))
    }

    /// What a score cannot be below: a chord is no longer than its arc.
    pub(crate) fn least_score(&self, apart_sq: f64, dot: f64) -> f64 {
        self.sum(apart_sq, (2.0 - 2.0 * dot).max(0.0).sqrt()) - 1e-9
    }

    fn sum(&self, apart_sq: f64, angle_rad: f64) -> f64 {
        apart_sq.sqrt() / self.radius_m.max(1e-9) + angle_rad / self.angle_rad.max(1e-9)
    }
}

/// At most `n` views, the nearest of those that were offered, nearest first.
pub(crate) struct Nearest<Name> {
    n: usize,
    views: Vec<(f64, Name)>,
}

impl<Name: Ord> Nearest<Name> {
    pub(crate) fn new(n: usize) -> Self {
        Self { n, views: Vec::with_capacity(n + 1) }
    }

    /// Whether a view may be among them that has no smaller score.
    pub(crate) fn admits(&self, score: f64) -> bool {
        self.views.len() < self.n || self.views.last().is_some_and(|last| score <= last.0)
    }

    pub(crate) fn offer(&mut self, score: f64, name: Name) {
        let view = (score, name);
        let place = self.views.partition_point(|nearer| by_score(nearer, &view).is_lt());
        if place < self.n {
            self.views.insert(place, view);
            self.views.truncate(self.n);
        }
    }

    pub(crate) fn names(&self) -> impl Iterator<Item = &Name> {
        self.views.iter().map(|(_, name)| name)
    }
}

fn by_score<Name: Ord>(a: &(f64, Name), b: &(f64, Name)) -> std::cmp::Ordering {
    a.0.total_cmp(&b.0).then_with(|| a.1.cmp(&b.1))
}

/// The optical axis, a unit vector in the world.
pub(crate) fn optical_axis(world_from_camera: &Pose) -> Vector3<f64> {
    world_from_camera.rotation * Vector3::z()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_geometry::{Twist, exp};

    #[test]
    fn views_come_nearest_first_within_both_limits() {
        let limits = ViewLimits { radius_m: 1.0, angle_rad: 0.5 };
        // x in metres and yaw in radians of each view.
        let views = [(0.9, 0.0), (0.2, 0.2), (0.2, 0.6), (1.1, 0.0), (-0.2, 0.2), (0.0, 0.1)];
        let axis = |yaw: f64| {
            let turn = Twist { rho: Vector3::zeros(), phi: Vector3::new(0.0, yaw, 0.0) };
            optical_axis(&exp(&turn))
        };
        let others = views.iter().enumerate().map(|(name, (x, _))| (name, Vector3::new(*x, 0.0, 0.0)));
        let found = limits.nearest(&Vector3::zeros(), &Vector3::z(), others, |name| axis(views[name].1));
        let names: Vec<usize> = found.iter().map(|(_, name)| *name).collect();
        assert_eq!(names, [5, 1, 4, 0]);
        assert!((found[1].0 - 0.6).abs() < 1e-9 && (found[0].0 - 0.2).abs() < 1e-9);
    }
}
