use super::*;
use crate::SplitMix64;
use crate::factorisation::{PRODUCTS_OF_A_PART, SHARED_PRODUCTS};
use nalgebra::{DMatrix, DVector};

fn uniform(random: &mut SplitMix64) -> f64 {
    random.next_u64() as f64 / u64::MAX as f64 * 2.0 - 1.0
}

/// A random system of `n` poses, with the same as a dense matrix.
fn system(n: usize, pattern: &[(usize, usize)]) -> (Vec<Matrix6>, Vec<Matrix6>, DMatrix<f64>) {
    let (diagonal, blocks) = values(n, pattern);
    let mut dense = DMatrix::zeros(6 * n, 6 * n);
    for (i, block) in diagonal.iter().enumerate() {
        dense.view_mut((6 * i, 6 * i), (6, 6)).copy_from(block);
    }
    for (&(row, column), block) in pattern.iter().zip(&blocks) {
        dense.view_mut((6 * row, 6 * column), (6, 6)).copy_from(block);
        dense.view_mut((6 * column, 6 * row), (6, 6)).copy_from(&block.transpose());
    }
    (diagonal, blocks, dense)
}

/// The blocks of a random system of `n` poses.
fn values(n: usize, pattern: &[(usize, usize)]) -> (Vec<Matrix6>, Vec<Matrix6>) {
    let mut random = SplitMix64::for_frame(3, n as u64);
    let mut diagonal = vec![Matrix6::identity(); n];
    let mut blocks = Vec::new();
    for &(row, column) in pattern {
        let (a, b) =
            (Matrix6::from_fn(|_, _| uniform(&mut random)), Matrix6::from_fn(|_, _| uniform(&mut random)));
        diagonal[row] += a.transpose() * a;
        diagonal[column] += b.transpose() * b;
        blocks.push(a.transpose() * b);
    }
    (diagonal, blocks)
}

#[test]
fn it_solves_as_a_dense_factorisation_does_and_with_the_same_bits_everywhere() {
    for n in [2, 3, 17, 60] {
        let mut pattern: Vec<_> = (0..n).flat_map(|i| [(i, (i + 1) % n), (i, (i * 37 + 11) % n)]).collect();
        pattern.iter_mut().for_each(|p| *p = (p.0.max(p.1), p.0.min(p.1)));
        pattern.retain(|(a, b)| a != b);
        pattern.sort_unstable();
        pattern.dedup();
        let (diagonal, blocks, dense) = system(n, &pattern);
        let gradient: Vec<Vector6> = (0..n).map(|i| Vector6::from_fn(|k, _| (i + k) as f64 - 7.5)).collect();
        let solve = |arch| {
            let mut factor = BlockCholesky::new(n, &pattern, arch);
            // A factor is kept for other values: the second use is what counts.
            factor.factorise(&diagonal, &blocks, 9.0, &mut || ()).unwrap();
            factor.factorise(&diagonal, &blocks, 0.5, &mut || ()).unwrap();
            factor.solve(&gradient)
        };
        let found = solve(pulp::Arch::new());
        let damped = dense + DMatrix::identity(6 * n, 6 * n) * 0.5;
        let rhs = DVector::from_fn(6 * n, |r, _| -gradient[r / 6][r % 6]);
        let expected = damped.cholesky().unwrap().solve(&rhs);
        for (r, value) in expected.iter().enumerate() {
            assert!((found[r / 6][r % 6] - value).abs() < 1e-9 * expected.amax(), "{n} poses, row {r}");
        }
        assert_eq!(found, solve(pulp::Arch::Scalar));
        let mut factor = BlockCholesky::new(n, &pattern, pulp::Arch::new());
        factor.factorise(&diagonal, &blocks, 0.5, &mut || ()).unwrap();
        // Several right-hand sides: each as if it were alone.
        let sides: Vec<SMatrix<f64, 6, 3>> =
            gradient.iter().map(|g| SMatrix::from_columns(&[-g, g * 2.0, Vector6::zeros()])).collect();
        let solved = factor.solve_columns(&sides);
        let doubled = factor.solve_columns(&gradient.iter().map(|g| g * 2.0).collect::<Vec<_>>());
        for (pose, columns) in solved.iter().enumerate() {
            assert_eq!(columns.column(0), found[pose]);
            assert_eq!(columns.column(1), doubled[pose]);
            assert_eq!(columns.column(2), Vector6::zeros());
        }
    }
}

/// A trajectory of `n` poses along a ring with loop closures: subtrees of their own, and panels large
/// enough to be shared out.
fn ring(n: usize) -> Vec<(usize, usize)> {
    let near = (0..n).flat_map(|i| (1..12).map(move |gap| (i, (i + gap) % n)));
    let far = (0..n).step_by(20).map(|i| (i, (i * 37 + 11) % n));
    let mut pattern: Vec<_> = near.chain(far).map(|(a, b)| (a.max(b), a.min(b))).collect();
    pattern.retain(|(a, b)| a != b);
    pattern.sort_unstable();
    pattern.dedup();
    pattern
}

#[test]
fn a_large_system_has_the_same_bits_for_any_number_of_threads_and_instructions() {
    for n in [1000, 2500] {
        let pattern = ring(n);
        let (diagonal, blocks) = values(n, &pattern);
        let gradient: Vec<Vector6> = (0..n).map(|i| Vector6::from_fn(|k, _| (i + k) as f64 - 7.5)).collect();
        let solve = |n_threads, arch| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
            let mut factor = BlockCholesky::new(n, &pattern, arch);
            assert!(factor.subtrees.len() > 1);
            let is_shared = |panel: &usize| factor.panels.n_products(*panel) >= SHARED_PRODUCTS;
            assert!(factor.last.iter().any(is_shared));
            pool.install(|| factor.factorise(&diagonal, &blocks, 0.5, &mut || ())).unwrap();
            factor.solve(&gradient)
        };
        let found = solve(1, pulp::Arch::new());
        for (n_threads, arch) in [(2, pulp::Arch::new()), (5, pulp::Arch::new()), (3, pulp::Arch::Scalar)] {
            assert!(found == solve(n_threads, arch), "{n} poses, {n_threads} threads");
        }
        // It solves the system: no residual is left.
        let mut residual: Vec<Vector6> =
            (0..n).map(|i| diagonal[i] * found[i] + found[i] * 0.5 + gradient[i]).collect();
        for (&(row, column), block) in pattern.iter().zip(&blocks) {
            residual[row] += block * found[column];
            residual[column] += block.transpose() * found[row];
        }
        let largest = residual.iter().map(Vector6::amax).fold(0.0, f64::max);
        assert!(largest < 1e-8 * gradient[n - 1].amax(), "{n} poses: {largest}");
    }
}

#[test]
fn a_direction_without_information_is_refused() {
    let pattern = [(1, 0)];
    let (mut diagonal, blocks, _) = system(2, &pattern);
    let mut factor = BlockCholesky::new(2, &pattern, pulp::Arch::new());
    assert!(factor.factorise(&diagonal, &blocks, 0.0, &mut || ()).is_ok());
    diagonal[1] = Matrix6::zeros();
    assert_eq!(factor.factorise(&diagonal, &blocks, 0.0, &mut || ()), Err(NotPositiveDefinite));
    diagonal[1] = Matrix6::from_element(f64::NAN);
    assert_eq!(factor.factorise(&diagonal, &blocks, 0.0, &mut || ()), Err(NotPositiveDefinite));
}

#[test]
fn a_long_factorisation_says_that_it_lives() {
    // A dense matrix: column c takes c (n - c) products.
    let n = 120;
    let pattern: Vec<_> = (0..n).flat_map(|c| (c + 1..n).map(move |r| (r, c))).collect();
    let (diagonal, blocks, _) = system(n, &pattern);
    let mut factor = BlockCholesky::new(n, &pattern, pulp::Arch::new());
    let mut n_signs = 0;
    factor.factorise(&diagonal, &blocks, 1.0, &mut || n_signs += 1).unwrap();
    let n_products: usize = (0..n).map(|c| c * (n - c)).sum();
    assert_eq!(n_products, (0..factor.panels.n()).map(|panel| factor.panels.n_products(panel)).sum());
    assert!(n_signs >= 4 && n_signs + 1 >= n_products / (PRODUCTS_OF_A_PART + n), "{n_signs} signs");
}
