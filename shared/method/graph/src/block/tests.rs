//! A pair's statistics beside the direct sums over its matches.

use super::*;
use tessera_geometry::{Twist, adjoint, compose_normalised, exp, hat};
use tessera_numerics::SplitMix64;

struct Match {
    a: Vector3<f64>,
    b: Vector3<f64>,
    omega: Matrix3<f64>,
}

fn uniform(random: &mut SplitMix64) -> f64 {
    random.next_u64() as f64 / u64::MAX as f64 * 2.0 - 1.0
}

fn matches(n: usize) -> Vec<Match> {
    let mut random = SplitMix64::for_frame(7, 1);
    let mut vector = || Vector3::new(uniform(&mut random), uniform(&mut random), uniform(&mut random));
    (0..n)
        .map(|_| {
            let (a, d, m) = (vector() * 2.0, vector() * 0.02, vector());
            let m = m.normalize();
            Match { a, b: a + d, omega: Matrix3::identity() * 0.5 + m * m.transpose() * 499.5 }
        })
        .collect()
}

fn direct(matches: &[Match], t: &Pose) -> (Matrix6, Vector6, f64) {
    let r = t.rotation.to_rotation_matrix().into_inner();
    let (mut h, mut g, mut f) = (Matrix6::zeros(), Vector6::zeros(), 0.0);
    for m in matches {
        let e = m.b - (r * m.a + t.translation.vector);
        let mut j = nalgebra::Matrix3x6::zeros();
        j.fixed_view_mut::<3, 3>(0, 0).copy_from(&-r);
        j.fixed_view_mut::<3, 3>(0, 3).copy_from(&(r * hat(&m.a)));
        h += j.transpose() * m.omega * j;
        g += j.transpose() * m.omega * e;
        f += e.dot(&(m.omega * e));
    }
    (h, g, f)
}

fn block(matches: &[Match], origin: &Pose) -> PairBlock {
    PairBlock::new(origin, &sums(matches, origin))
}

/// The block as it is stored.
fn quadratic(matches: &[Match], origin: &Pose) -> PairBlock {
    let numbers = Quadratic::of(origin, &sums(matches, origin)).to_numbers();
    PairBlock::quadratic(origin, Quadratic::from_numbers(&numbers).unwrap(), matches.len() as u32)
}

fn sums(matches: &[Match], origin: &Pose) -> BlockSums {
    let mut sums = BlockSums { n: matches.len() as u32, ..Default::default() };
    for m in matches {
        let e = m.b - origin.rotation * m.a - origin.translation.vector;
        let tilde = [m.a.x, m.a.y, m.a.z, 1.0];
        let o = &m.omega;
        let upper = [o[(0, 0)], o[(0, 1)], o[(0, 2)], o[(1, 1)], o[(1, 2)], o[(2, 2)]];
        let mut at = 0;
        for k in 0..4 {
            for l in k..4 {
                for u in upper {
                    sums.q[at] += tilde[k] * tilde[l] * u;
                    at += 1;
                }
            }
            let oe = o * e;
            for c in 0..3 {
                sums.l[3 * k + c] += tilde[k] * oe[c];
            }
        }
        sums.c += e.dot(&(o * e));
    }
    sums
}

#[test]
fn the_statistics_equal_direct_sums_away_from_their_origin() {
    let matches = matches(400);
    let origin = exp(&Twist { rho: Vector3::new(0.1, -0.2, 0.05), phi: Vector3::new(0.02, 0.3, -0.1) });
    let there = compose_normalised(
        &origin,
        &Twist { rho: Vector3::new(0.03, 0.01, -0.02), phi: Vector3::new(-0.05, 0.02, 0.04) },
    );
    let block = block(&matches, &origin);
    let (h, g, f) = block.linearise(&there);
    let (dh, dg, df) = direct(&matches, &there);
    assert!((h - dh).norm() < 1e-9 * dh.norm());
    assert!((g - dg).norm() < 1e-9 * dg.norm());
    assert!((f - df).abs() < 1e-9 * df && (block.cost(&there) - df).abs() < 1e-9 * df);
}

#[test]
fn the_stored_statistics_are_the_exact_ones_near_their_origin_and_bounded_far_away() {
    let matches = matches(400);
    let origin = exp(&Twist { rho: Vector3::new(0.1, -0.2, 0.05), phi: Vector3::new(0.02, 0.3, -0.1) });
    let [exact, stored] = [block(&matches, &origin), quadratic(&matches, &origin)];
    let ((h, g, f), (sh, sg, sf)) = (exact.linearise(&origin), stored.linearise(&origin));
    assert!(
        (h - sh).norm() < 1e-6 * h.norm() && (g - sg).norm() < 1e-6 * g.norm() && (f - sf).abs() < 1e-6 * f
    );
    // The pose that both ask for where the matches fit, 14 mm and 0.7 degrees away: apart by the square of that.
    let [exact, stored] = [block(&matches, &Pose::identity()), quadratic(&matches, &Pose::identity())];
    let asked = |block: &PairBlock, at: &Pose| {
        let (h, g, _) = block.linearise(at);
        compose_normalised(at, &Twist::from_vector(&h.try_inverse().map(|inverse| -inverse * g).unwrap()))
    };
    let near = Twist { rho: Vector3::new(0.01, 0.005, -0.008), phi: Vector3::new(-0.01, 0.005, 0.003) };
    let near = compose_normalised(&Pose::identity(), &near);
    let apart = asked(&exact, &near).inverse() * asked(&stored, &near);
    let (metres, radians) = tessera_geometry::translation_rotation_norms(&apart);
    assert!(metres < 3e-4 && radians < 2e-4, "{metres} m, {radians} rad");
    let cost = |turn: f64| {
        let far = Twist { rho: Vector3::new(2.0, 0.0, 1.0), phi: Vector3::new(0.0, turn, 0.0) };
        stored.cost(&compose_normalised(&Pose::identity(), &far))
    };
    assert!(cost(3.0) < cost(1.5), "beyond a right angle it grows no more");
    assert_eq!(Quadratic::from_numbers(&[0.0; 27]), None);
}

#[test]
fn the_gradient_is_that_of_the_cost() {
    let matches = matches(100);
    check_gradient(&block(&matches, &Pose::identity()));
    check_gradient(&quadratic(&matches, &Pose::identity()));
}

fn check_gradient(block: &PairBlock) {
    let at = exp(&Twist { rho: Vector3::new(0.1, -0.2, 0.05), phi: Vector3::new(0.02, 0.3, -0.1) });
    let (_, g, f) = block.linearise(&at);
    for k in 0..6 {
        let mut d = Vector6::zeros();
        d[k] = 1e-6;
        let plus = block.cost(&compose_normalised(&at, &Twist::from_vector(&d)));
        let minus = block.cost(&compose_normalised(&at, &Twist::from_vector(&-d)));
        // F has no factor one half, so its slope is 2 g.
        assert!(((plus - minus) / 2e-6 - 2.0 * g[k]).abs() < 1e-6 * f, "direction {k}");
    }
}

#[test]
fn the_targets_side_follows_from_the_querys_by_the_adjoint() {
    // J_j = -J_i Ad(T_ji), checked on the cost: moving the target by d is moving the query
    // by -Ad(T_ji) d, to first order.
    let matches = matches(100);
    let world_from_i = exp(&Twist { rho: Vector3::new(0.5, 0.1, 0.0), phi: Vector3::new(0.2, 0.1, 0.3) });
    let world_from_j = exp(&Twist { rho: Vector3::new(0.4, 0.2, 0.1), phi: Vector3::new(0.1, 0.2, 0.3) });
    let j_from_i = world_from_j.inverse() * world_from_i;
    let block = block(&matches, &Pose::identity());
    let (_, g_i, f) = block.linearise(&j_from_i);
    let g_j = -adjoint(&j_from_i.inverse()).transpose() * g_i;
    for k in 0..6 {
        let mut d = Vector6::zeros();
        d[k] = 1e-6;
        let cost = |d: &Vector6| {
            let moved = compose_normalised(&world_from_j, &Twist::from_vector(d));
            block.cost(&(moved.inverse() * world_from_i))
        };
        assert!(((cost(&d) - cost(&-d)) / 2e-6 - 2.0 * g_j[k]).abs() < 1e-6 * f, "direction {k}");
    }
}

#[test]
fn the_displacement_of_matches_is_the_cost_of_moving_those_that_fit() {
    let mut sums = BlockSums::default();
    for m in &matches(40) {
        sums.add(&m.a, &Vector3::zeros(), &m.omega);
    }
    let moved = exp(&Twist { rho: [0.01, -0.02, 0.005].into(), phi: [0.01, 0.0, -0.02].into() });
    let block = PairBlock::new(&Pose::identity(), &sums);
    assert!((block.displacement(&moved) - block.cost(&moved)).abs() < 1e-9 * block.cost(&moved));
    assert_eq!(block.displacement(&Pose::identity()), 0.0);
    let quadratic = PairBlock::quadratic(&Pose::identity(), Quadratic::of(&Pose::identity(), &sums), 40);
    assert!((quadratic.displacement(&moved) / block.displacement(&moved) - 1.0).abs() < 0.1);
}
