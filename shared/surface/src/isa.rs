//! Which vector instructions are used.

use serde::{Deserialize, Serialize};

/// A set of vector instructions.
///
/// Plain loops give the same bits on each. faer's factorisations, which solve for the camera, do
/// not, so that a run names the set that it began with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Isa {
    /// The widest that the machine has.
    #[default]
    Auto,
    /// What every machine of the architecture has: the same bits on all machines, but for the
    /// factorisations that solve for the camera.
    Baseline,
    /// AVX2 and FMA on x86-64.
    Avx2,
    /// AVX-512 (F, BW, CD, DQ, VL) on x86-64.
    Avx512,
    /// NEON on aarch64.
    Neon,
}

/// The machine lacks the instructions that were asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IsaMissing {
    /// What was asked for.
    pub wanted: Isa,
    /// The widest that there is.
    pub found: Isa,
}

impl std::fmt::Display for IsaMissing {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { wanted, found } = self;
        write!(f, "isa is {wanted}, and this machine has {found}: expected {found}, baseline or auto")
    }
}

impl std::error::Error for IsaMissing {}

impl std::fmt::Display for Isa {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Isa::Auto => "auto",
            Isa::Baseline => "baseline",
            Isa::Avx2 => "avx2",
            Isa::Avx512 => "avx512",
            Isa::Neon => "neon",
        })
    }
}

impl Isa {
    /// The widest that this machine has; never [`Isa::Auto`].
    pub fn of_machine() -> Self {
        match pulp::Arch::new() {
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            pulp::Arch::V3(_) => Isa::Avx2,
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            pulp::Arch::V4(_) => Isa::Avx512,
            #[cfg(target_arch = "aarch64")]
            pulp::Arch::Neon(_) => Isa::Neon,
            _ => Isa::Baseline,
        }
    }

    /// The set by its own name: [`Isa::Auto`] becomes what the machine has.
    ///
    /// # Errors
    /// Where the machine lacks it.
    pub fn resolve(self) -> Result<Self, IsaMissing> {
        let found = Self::of_machine();
        match self {
            Isa::Auto => Ok(found),
            Isa::Baseline => Ok(Isa::Baseline),
            wanted if wanted == found => Ok(wanted),
            wanted => Err(IsaMissing { wanted, found }),
        }
    }

    /// What loops are dispatched to.
    pub fn arch(self) -> pulp::Arch {
        if self == Isa::Baseline { pulp::Arch::Scalar } else { pulp::Arch::new() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_machine_has_its_own_set_and_the_baseline() {
        let found = Isa::of_machine();
        assert_eq!(Isa::Auto.resolve(), Ok(found));
        assert_eq!(Isa::Baseline.resolve(), Ok(Isa::Baseline));
        let other = if found == Isa::Neon { Isa::Avx2 } else { Isa::Neon };
        let refused = other.resolve().unwrap_err().to_string();
        assert!(refused.contains(&format!("isa is {other}")) && refused.contains(&found.to_string()));
    }
}
