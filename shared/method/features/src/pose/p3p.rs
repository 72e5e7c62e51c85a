//! Perspective three-point problem: distances of three points of known mutual distances along three
//! known bearings.
//!
//! After Persson and Nordberg 2018 ("Lambda Twist"): with distances `l = (l1, l2, l3)` and
//! `|li yi - lj yj|^2 = aij`, two differences of these equations are conics `l^T D1 l = l^T D2 l = 0`.
//! A member of their pencil is degenerate; it is split into two lines (Richter-Gebert 2011, section
//! 11.1), and each line meets another conic in at most two points.

use nalgebra::{Matrix3, Vector3};

/// Up to four triples of distances.
pub(crate) type Distances = [Option<[f64; 3]>; 4];

/// Distances along unit `bearings` to three points with the mutual distances of `points`.
pub(crate) fn solve(bearings: &[Vector3<f64>; 3], points: &[Vector3<f64>; 3]) -> Distances {
    let between = |i: usize, j: usize| (points[i] - points[j]).norm_squared();
    let scale_sq = between(0, 1).max(between(0, 2)).max(between(1, 2));
    let mut solutions = [None; 4];
    if !(scale_sq > 0.0) {
        return solutions;
    }
    let a = [between(0, 1), between(0, 2), between(1, 2)].map(|a| a / scale_sq);
    let b = [(0, 1), (0, 2), (1, 2)].map(|(i, j)| bearings[i].dot(&bearings[j]));
    let m = [
        Matrix3::new(1.0, -b[0], 0.0, -b[0], 1.0, 0.0, 0.0, 0.0, 0.0),
        Matrix3::new(1.0, 0.0, -b[1], 0.0, 0.0, 0.0, -b[1], 0.0, 1.0),
        Matrix3::new(0.0, 0.0, 0.0, 0.0, 1.0, -b[2], 0.0, -b[2], 1.0),
    ];
    let (d1, d2) = (m[0] * a[2] - m[2] * a[0], m[1] * a[2] - m[2] * a[1]);
    let Some((degenerate, other)) = degenerate_member(&d1, &d2) else { return solutions };
    let Some(lines) = split(&degenerate) else { return solutions };
    let mut next = 0;
    for direction in lines.iter().flat_map(|line| meet(line, &other)).flatten() {
        if let Some(l) = polished(&direction, &m, &a) {
            solutions[next] = Some(l.map(|l| l * scale_sq.sqrt()));
            next += 1;
        }
    }
    solutions
}

fn adjugate(m: &Matrix3<f64>) -> Matrix3<f64> {
    let c = |i: usize, j: usize| {
        let (r, s) = ((i + 1) % 3, (i + 2) % 3);
        let (u, v) = ((j + 1) % 3, (j + 2) % 3);
        m[(r, u)] * m[(s, v)] - m[(r, v)] * m[(s, u)]
    };
    Matrix3::from_fn(|i, j| c(j, i))
}

/// A member `A + g B` of the pencil with determinant zero that splits into real lines, and a member
/// that is not near it.
fn degenerate_member(d1: &Matrix3<f64>, d2: &Matrix3<f64>) -> Option<(Matrix3<f64>, Matrix3<f64>)> {
    // The larger determinant leads the cubic.
    let (a, b) = if d2.determinant().abs() >= d1.determinant().abs() { (d1, d2) } else { (d2, d1) };
    let lead = b.determinant();
    if !(lead.abs() > 0.0) {
        return None;
    }
    let trace = |p: &Matrix3<f64>, q: &Matrix3<f64>| (adjugate(p) * q).trace();
    let roots = cubic_roots([a.determinant() / lead, trace(a, b) / lead, trace(b, a) / lead]);
    let members = roots.into_iter().flatten().map(|g| (a + b * g, g));
    // Real lines: the adjugate is negative semidefinite; the most negative is the best conditioned.
    let reality = |m: &Matrix3<f64>| {
        let adjugate = adjugate(m);
        (0..3).fold(0.0f64, |most, i| most.max(-adjugate[(i, i)])) / m.norm_squared()
    };
    let (member, g) = members.max_by(|p, q| reality(&p.0).total_cmp(&reality(&q.0)))?;
    Some((member, if g.abs() > 1.0 { *a } else { *b }))
}

/// Real roots of `x^3 + c[2] x^2 + c[1] x + c[0]`, each after two Newton steps.
fn cubic_roots(c: [f64; 3]) -> [Option<f64>; 3] {
    let shift = c[2] / 3.0;
    let p = c[1] - c[2] * shift;
    let q = shift * (2.0 * shift * shift - c[1]) + c[0];
    let (third, half) = (p / 3.0, q / 2.0);
    let discriminant = half * half + third * third * third;
    let polished = |x: f64| {
        let mut x = x - shift;
        for _ in 0..2 {
            let value = ((x + c[2]) * x + c[1]) * x + c[0];
            let slope = (3.0 * x + 2.0 * c[2]) * x + c[1];
            if slope.abs() > 1e-12 {
                x -= value / slope;
            }
        }
        x.is_finite().then_some(x)
    };
    if discriminant > 0.0 {
        let root = discriminant.sqrt();
        let u = if half > 0.0 { -libm::cbrt(half + root) } else { libm::cbrt(root - half) };
        let x = if u == 0.0 { 0.0 } else { u - third / u };
        [polished(x), None, None]
    } else {
        let radius = 2.0 * (-third).max(0.0).sqrt();
        let cosine =
            if radius > 0.0 { (-4.0 * q / (radius * radius * radius)).clamp(-1.0, 1.0) } else { 1.0 };
        let angle = libm::acos(cosine) / 3.0;
        [0.0, 1.0, 2.0].map(|k| polished(radius * libm::cos(angle - k * std::f64::consts::TAU / 3.0)))
    }
}

/// The two real lines of a degenerate conic.
fn split(conic: &Matrix3<f64>) -> Option<[Vector3<f64>; 2]> {
    let b = -adjugate(conic);
    let i = (0..3).max_by(|&i, &j| b[(i, i)].total_cmp(&b[(j, j)]))?;
    if !(b[(i, i)] > 0.0) {
        return None;
    }
    let p = b.column(i) / b[(i, i)].sqrt();
    let c = conic + tessera_geometry::hat(&p);
    let (row, column) = (0..9).map(|k| (k / 3, k % 3)).max_by(|&i, &j| c[i].abs().total_cmp(&c[j].abs()))?;
    Some([c.row(row).transpose(), c.column(column).into_owned()])
}

/// Intersection of a line with a conic.
fn meet(line: &Vector3<f64>, conic: &Matrix3<f64>) -> [Option<Vector3<f64>>; 2] {
    let axis = Vector3::ith(line.iamin(), 1.0);
    let u = line.cross(&axis).normalize();
    let v = line.cross(&u).normalize();
    let (a, b, c) = (u.dot(&(conic * u)), u.dot(&(conic * v)), v.dot(&(conic * v)));
    let discriminant = b * b - a * c;
    if !(discriminant >= 0.0) {
        return [None; 2];
    }
    let q = -(b + discriminant.sqrt().copysign(b));
    [Some(u * q + v * a), Some(u * c + v * q)]
}

/// Distances of this direction: all positive, at the scale of the points, after two Newton steps.
fn polished(direction: &Vector3<f64>, m: &[Matrix3<f64>; 3], a: &[f64; 3]) -> Option<[f64; 3]> {
    let direction = if direction.sum() < 0.0 { -direction } else { *direction };
    let total: f64 = m.iter().map(|m| direction.dot(&(m * direction))).sum();
    if !(direction.min() > 0.0 && total > 0.0) {
        return None;
    }
    let mut l = direction * (a.iter().sum::<f64>() / total).sqrt();
    for _ in 0..2 {
        let residual = Vector3::from_fn(|k, _| l.dot(&(m[k] * l)) - a[k]);
        let jacobian = Matrix3::from_rows(&[0, 1, 2].map(|k| (m[k] * l * 2.0).transpose()));
        if let Some(inverse) = jacobian.try_inverse() {
            l -= inverse * residual;
        }
    }
    let worst = (0..3).fold(0.0f64, |worst, k| worst.max((l.dot(&(m[k] * l)) - a[k]).abs()));
    (l.min() > 0.0 && worst < 1e-6).then(|| l.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_numerics::SplitMix64;

    #[test]
    fn the_true_distances_are_among_the_solutions() {
        let mut random = SplitMix64::new(11);
        let (mut n_found, mut n_solutions) = (0, 0);
        for _ in 0..1000 {
            let points: [Vector3<f64>; 3] = std::array::from_fn(|_| {
                Vector3::new(random.unit() * 2.0 - 1.0, random.unit() * 2.0 - 1.0, 1.0 + 3.0 * random.unit())
            });
            let found = solve(&points.map(|p| p.normalize()), &points);
            n_solutions += found.iter().flatten().count();
            let is_truth = |l: &[f64; 3]| (0..3).all(|k| (l[k] - points[k].norm()).abs() < 1e-6);
            n_found += usize::from(found.iter().flatten().any(is_truth));
        }
        assert!(n_found >= 995, "{n_found} of 1000");
        assert!(n_solutions > 1000 && n_solutions < 4000, "{n_solutions}");
    }

    #[test]
    fn points_in_one_place_have_no_solution() {
        let one = Vector3::new(0.1, 0.2, 1.0);
        assert_eq!(solve(&[one.normalize(); 3], &[one; 3]), [None; 4]);
    }
}
