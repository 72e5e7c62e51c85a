//! Eight numbers at a time: loops over fixed arrays become vector instructions on each machine,
//! and the lanes and their order are the same on all.

use std::array::from_fn;
use std::ops::{Add, Div, Mul, Sub};

/// How many numbers go at once.
pub const LANES: usize = 8;

/// A number, or eight of them: formulas are written once for both.
pub trait Real:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// The same value everywhere.
    fn splat(value: f32) -> Self;
}

impl Real for f32 {
    #[inline(always)]
    fn splat(value: f32) -> Self {
        value
    }
}

/// Eight numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lanes(pub [f32; LANES]);

impl Lanes {
    /// Eight zeros.
    pub const ZERO: Self = Self([0.0; LANES]);

    /// The numbers from `at` on.
    #[inline(always)]
    pub fn load(from: &[f32], at: usize) -> Self {
        let run = &from[at..at + LANES];
        Self(from_fn(|l| run[l]))
    }

    /// Writes the numbers to `to[at..at + LANES]`.
    #[inline(always)]
    pub fn store(self, to: &mut [f32], at: usize) {
        to[at..at + LANES].copy_from_slice(&self.0);
    }

    /// Applies `f` to each number.
    #[inline(always)]
    pub fn map(self, f: impl Fn(f32) -> f32) -> Self {
        Self(from_fn(|l| f(self.0[l])))
    }

    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        Self(from_fn(|l| f(self.0[l], other.0[l])))
    }

    /// Square root, rounded as IEEE 754 asks on every machine.
    #[inline(always)]
    pub fn sqrt(self) -> Self {
        self.map(f32::sqrt)
    }

    /// This where `keep` is set, 0 elsewhere, whatever stands there.
    #[inline(always)]
    pub fn only(self, keep: [bool; LANES]) -> Self {
        Self(from_fn(|l| if keep[l] { self.0[l] } else { 0.0 }))
    }
}

impl Real for Lanes {
    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self([value; LANES])
    }
}

impl Add for Lanes {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }
}

impl Sub for Lanes {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }
}

impl Mul for Lanes {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }
}

impl Div for Lanes {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self.zip(other, |a, b| a / b)
    }
}

/// `a . b`.
#[inline(always)]
pub fn dot<T: Real>(a: [T; 3], b: [T; 3]) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `a x b`.
#[inline(always)]
pub fn cross<T: Real>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// `factor v`. Written out by coordinate: `map` over an array would go through memory.
#[inline(always)]
pub fn scale<T: Real>(factor: T, v: [T; 3]) -> [T; 3] {
    [factor * v[0], factor * v[1], factor * v[2]]
}

/// `a + b`.
#[inline(always)]
pub fn add<T: Real>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// `a - b`.
#[inline(always)]
pub fn sub<T: Real>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// The rotation in the first nine numbers of `m`, applied to a direction.
#[inline(always)]
pub fn rotate<T: Real>(m: &[f32; 12], v: [T; 3]) -> [T; 3] {
    let m = |k: usize| T::splat(m[k]);
    [
        m(0) * v[0] + m(1) * v[1] + m(2) * v[2],
        m(3) * v[0] + m(4) * v[1] + m(5) * v[2],
        m(6) * v[0] + m(7) * v[1] + m(8) * v[2],
    ]
}

/// The rotation in the first nine numbers of `m` and the translation in the last three.
#[inline(always)]
pub fn transform<T: Real>(m: &[f32; 12], v: [T; 3]) -> [T; 3] {
    add(rotate(m, v), [T::splat(m[9]), T::splat(m[10]), T::splat(m[11])])
}
