//! Symmetric 6x6 matrices as the 21 numbers of their upper triangle, row by row: as they are journaled.

use crate::Matrix6;

fn places() -> impl Iterator<Item = (usize, usize)> {
    (0..6).flat_map(|row| (row..6).map(move |column| (row, column)))
}

/// The upper triangle of a symmetric matrix, 21 numbers.
pub fn upper_triangle(m: &Matrix6) -> Vec<f64> {
    places().map(|(row, column)| m[(row, column)]).collect()
}

/// The symmetric matrix of an upper triangle; zero for anything but 21 numbers.
pub fn from_upper_triangle(numbers: &[f64]) -> Matrix6 {
    let mut m = Matrix6::zeros();
    if numbers.len() == 21 {
        for ((row, column), value) in places().zip(numbers) {
            m[(row, column)] = *value;
            m[(column, row)] = *value;
        }
    }
    m
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_upper_triangle_fills_both_sides() {
        let upper: Vec<f64> = (0..21).map(f64::from).collect();
        let full = from_upper_triangle(&upper);
        assert_eq!((full[(0, 5)], full[(5, 0)], full[(1, 1)], full[(5, 5)]), (5.0, 5.0, 6.0, 20.0));
        assert_eq!(upper_triangle(&full), upper);
        assert_eq!(from_upper_triangle(&[]), Matrix6::zeros());
    }
}
