//! Coordinates in arrays of their own, for loops that handle many points at once.

use tessera_numerics::lanes::Lanes;

/// Three coordinates, each in an array of its own.
#[derive(Clone, Debug, Default)]
pub(crate) struct Columns3 {
    pub(crate) x: Vec<f32>,
    pub(crate) y: Vec<f32>,
    pub(crate) z: Vec<f32>,
}

impl Columns3 {
    #[inline(always)]
    pub(crate) fn at(&self, i: usize) -> [f32; 3] {
        [self.x[i], self.y[i], self.z[i]]
    }

    #[inline(always)]
    pub(crate) fn set(&mut self, i: usize, [x, y, z]: [f32; 3]) {
        (self.x[i], self.y[i], self.z[i]) = (x, y, z);
    }

    pub(crate) fn resize(&mut self, n: usize) {
        self.x.resize(n, 0.0);
        self.y.resize(n, 0.0);
        self.z.resize(n, 0.0);
    }

    /// Eight points from `at` on.
    #[inline(always)]
    pub(crate) fn load(&self, at: usize) -> [Lanes; 3] {
        [Lanes::load(&self.x, at), Lanes::load(&self.y, at), Lanes::load(&self.z, at)]
    }

    #[inline(always)]
    pub(crate) fn store(&mut self, at: usize, v: [Lanes; 3]) {
        v[0].store(&mut self.x, at);
        v[1].store(&mut self.y, at);
        v[2].store(&mut self.z, at);
    }
}
