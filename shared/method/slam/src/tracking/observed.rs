//! Residuals of one frame's feature matches at the relative poses of its surfaces, by which colour is audited.

use crate::estimation::colour_model::{ColourModel, ColourRecord, ColourState, MIN_PAIRS, PRIOR_SIGMAS};
use crate::map::context::Context;
use nalgebra::{Matrix2, Matrix2x6, Vector2, Vector3};
use tessera_features::Correspondence;
use tessera_geometry::{Matrix6, Pose, Twist};

/// Deviations of lag and ratio ([`PRIOR_SIGMAS`]) that count as all of what is allowed.
const IMPLAUSIBLE_SIGMAS: f64 = 4.0;
/// Residual that is allowed at rest, pixels, more of it by the length of the motion in the image, and
/// by the standard deviation that the pose has there: weak surfaces judge nothing.
const ALLOWED_PX: f64 = 2.0;
const ALLOWED_SHARE: f64 = 0.1;
const ALLOWED_SIGMAS: f64 = 1.5;
/// Rounds of weighting in the fit of lag and ratio.
const ROUNDS: u32 = 4;

/// A match's residual with its slopes, how far the match moves in the image, and the standard deviation
/// of where the pose puts it, pixels.
struct MatchRow {
    residual_px: Vector2<f64>,
    by_lag: Vector2<f64>,
    by_ratio: Vector2<f64>,
    motion_px: f64,
    sigma_px: f64,
}

/// One frame's sums over its matches.
pub(crate) struct Observed<'a> {
    model: &'a ColourModel,
    focal_px: f64,
    scale_px: f64,
    covariance: Matrix6,
    record: ColourRecord,
    rows: Vec<MatchRow>,
    /// Rows of ended pairs.
    n_ended: usize,
    /// Of each pair with enough matches.
    medians_px: Vec<f64>,
}

impl<'a> Observed<'a> {
    /// `covariance`: of the frame's pose by the surfaces, metric, in the tangent of its camera.
    pub(crate) fn new(context: &'a Context, state: &ColourState, covariance: Matrix6) -> Self {
        let camera = &context.camera;
        Self {
            model: &context.colour,
            focal_px: camera.focal_px(),
            scale_px: 2.0 * state.residual_px.max(1.0),
            covariance,
            record: ColourRecord::default(),
            rows: Vec::new(),
            n_ended: 0,
            medians_px: Vec::new(),
        }
    }

    /// Adds a match between frames whose relative pose is known; `velocities` of query and target.
    pub(crate) fn add(&mut self, c: &Correspondence, target_from_query: &Pose, velocities: [&Twist; 2]) {
        let Some(row) = self.row(c, target_from_query, velocities) else { return };
        self.record.n_pairs += 1;
        self.rows.push(row);
    }

    fn row(&self, c: &Correspondence, target_from_query: &Pose, velocities: [&Twist; 2]) -> Option<MatchRow> {
        let a = c.query.point.as_ref()?.position_m;
        let b = target_from_query.rotation * a + target_from_query.translation.vector;
        if !(b.z > 0.1) {
            return None;
        }
        let (x, y) = (b.x / b.z, b.y / b.z);
        // Of `(x/z, y/z)` by the point.
        let project = |d: &Vector3<f64>| Vector2::new(d.x - x * d.z, d.y - y * d.z) / b.z;
        let [query, target] = velocities;
        let turned = |d: Vector3<f64>| target_from_query.rotation * d;
        let by_lag =
            project(&turned(query.phi.cross(&a) + query.rho)) - project(&(target.phi.cross(&b) + target.rho));
        let inverse = -1.0 / self.model.focal_ratio;
        let ray_b = Vector2::from(c.target.ray);
        let by_ratio = project(&turned(Vector3::new(a.x, a.y, 0.0) * inverse)) - ray_b * inverse;
        let by_pose = Matrix2x6::from_columns(&std::array::from_fn::<_, 6, _>(|k| {
            let e = Vector3::ith(k % 3, self.focal_px);
            project(&turned(if k < 3 { e } else { e.cross(&a) }))
        }));
        let variance = (by_pose * self.covariance * by_pose.transpose()).trace();
        let residual_px = (Vector2::new(x, y) - ray_b) * self.focal_px;
        Some(MatchRow {
            residual_px,
            by_lag: by_lag * self.focal_px,
            by_ratio: by_ratio * self.focal_px,
            motion_px: (ray_b - Vector2::from(c.query.ray)).norm() * self.focal_px,
            sigma_px: variance.max(0.0).sqrt(),
        })
    }

    /// Ends a pair.
    pub(crate) fn end_pair(&mut self) {
        let of_pair = &self.rows[self.n_ended..];
        if of_pair.len() >= MIN_PAIRS as usize {
            self.medians_px.push(median(of_pair.iter().map(|row| row.residual_px.norm())));
        }
        self.n_ended = self.rows.len();
    }

    /// The frame's record; none without a match.
    pub(crate) fn record(self) -> Option<ColourRecord> {
        let n = self.medians_px.len() as f64;
        let residual_px = self.medians_px.iter().sum::<f64>() / n;
        (n > 0.0).then(|| ColourRecord { residual_px, disagreement: self.disagreement(), ..self.record })
    }

    fn allowed_px(&self) -> f64 {
        let of = |value: fn(&MatchRow) -> f64| median(self.rows.iter().map(value));
        ALLOWED_PX + ALLOWED_SHARE * of(|row| row.motion_px) + ALLOWED_SIGMAS * of(|row| row.sigma_px)
    }

    /// Residual that this frame's own best lag and ratio leave, in units of what is allowed. Implausible
    /// ones count as well: colour of another scene may fit them for a moment.
    fn disagreement(&self) -> f64 {
        let [lag_prior, ratio_prior] = PRIOR_SIGMAS.map(|sigma| sigma.powi(-2));
        let prior = Matrix2::new(lag_prior, 0.0, 0.0, ratio_prior);
        let mut x = Vector2::zeros();
        for _ in 0..ROUNDS {
            let (mut h, mut g) = (prior * self.rows.len() as f64, Vector2::zeros());
            for row in &self.rows {
                let weight = self.weight(&row.left_px(&x));
                let slope = [row.by_lag, row.by_ratio];
                h += Matrix2::from_fn(|i, j| weight * slope[i].dot(&slope[j]));
                g += Vector2::from_fn(|i, _| weight * slope[i].dot(&row.residual_px));
            }
            x = h.cholesky().map_or(x, |factor| -factor.solve(&g));
        }
        let left_px = median(self.rows.iter().map(|row| row.left_px(&x).norm()));
        let implausible = x.dot(&(prior * x)) / (IMPLAUSIBLE_SIGMAS * IMPLAUSIBLE_SIGMAS);
        ((left_px / self.allowed_px()).powi(2) + implausible).sqrt()
    }

    fn weight(&self, residual_px: &Vector2<f64>) -> f64 {
        1.0 / (1.0 + residual_px.norm_squared() / (self.scale_px * self.scale_px))
    }
}

impl MatchRow {
    /// The residual with a lag in seconds and a ratio less one, both beside those in effect.
    fn left_px(&self, x: &Vector2<f64>) -> Vector2<f64> {
        self.residual_px + self.by_lag * x[0] + self.by_ratio * x[1]
    }
}

/// The upper median; NaN of nothing.
fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    let middle = values.len() / 2;
    if values.is_empty() {
        return f64::NAN;
    }
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
