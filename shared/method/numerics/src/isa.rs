//! Selection of vector instructions.

use serde::{Deserialize, Serialize};

/// A set of vector instructions.
///
/// Every algorithm has the same bits on each: the choice is a matter of speed and of diagnosis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Isa {
    /// The widest that the machine has.
    #[default]
    Auto,
    /// What every machine of the architecture has.
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
        write!(f, "isa is {wanted}, and the widest set of this machine is {found}: expected {found}")?;
        let narrower = Isa::NAMED.into_iter().filter(|isa| isa != found && isa.arch_if_there().is_some());
        narrower.into_iter().try_for_each(|isa| write!(f, ", {isa}"))?;
        write!(f, " or auto")
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
    /// All sets with a name of their own.
    const NAMED: [Isa; 4] = [Isa::Baseline, Isa::Avx2, Isa::Avx512, Isa::Neon];

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

    /// The set by its own name: [`Isa::Auto`] becomes the widest that the machine has.
    ///
    /// # Errors
    /// Where the machine lacks it.
    pub fn resolve(self) -> Result<Self, IsaMissing> {
        let found = Self::of_machine();
        match self {
            Isa::Auto => Ok(found),
            wanted if wanted.arch_if_there().is_some() => Ok(wanted),
            wanted => Err(IsaMissing { wanted, found }),
        }
    }

    /// What loops are dispatched to: this set, or the widest of a machine that lacks it.
    pub fn arch(self) -> pulp::Arch {
        self.arch_if_there().unwrap_or_default()
    }

    /// `None` where the machine lacks the set.
    fn arch_if_there(self) -> Option<pulp::Arch> {
        match self {
            Isa::Auto => Some(pulp::Arch::new()),
            Isa::Baseline => Some(pulp::Arch::Scalar),
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            Isa::Avx2 => pulp::x86::V3::try_new().map(pulp::Arch::V3),
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            Isa::Avx512 => pulp::x86::V4::try_new().map(pulp::Arch::V4),
            #[cfg(target_arch = "aarch64")]
            Isa::Neon => pulp::aarch64::Neon::try_new().map(pulp::Arch::Neon),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_machine_has_its_own_set_all_narrower_ones_and_the_baseline() {
        let found = Isa::of_machine();
        assert_eq!(Isa::Auto.resolve(), Ok(found));
        assert_eq!(Isa::Baseline.resolve(), Ok(Isa::Baseline));
        if found == Isa::Avx512 {
            assert_eq!(Isa::Avx2.resolve(), Ok(Isa::Avx2));
        }
        for isa in Isa::NAMED.into_iter().filter(|isa| isa.resolve().is_ok()) {
            assert_eq!(isa.resolve(), Ok(isa));
            assert_eq!(
                isa.arch_if_there().map(|arch| format!("{arch:?}")),
                Some(format!("{:?}", isa.arch()))
            );
        }
        let other = if found == Isa::Neon { Isa::Avx2 } else { Isa::Neon };
        let refused = other.resolve().unwrap_err().to_string();
        assert!(refused.contains(&format!("isa is {other}")) && refused.contains(&found.to_string()));
        assert!(refused.contains("baseline or auto") || refused.contains("avx2 or auto"), "{refused}");
        // Another machine's set: the widest of this one.
        assert_eq!(format!("{:?}", other.arch()), format!("{:?}", found.arch()));
    }
}
