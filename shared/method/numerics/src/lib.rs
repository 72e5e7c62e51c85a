//! Numerical tools of the method that know nothing of surfaces: vector instructions, the random
//! generator, the sparse Cholesky factorisation of 6x6 blocks, parallel maps with a fixed order,
//! checked setting ranges, codes of small integers, memory asked for ahead and the named
//! steps of the work on a frame.
//!
//! Every result has the same bits for any number of threads and any set of vector instructions.
#![deny(unsafe_code)]

mod bits;
mod block6;
mod block_cholesky;
mod elimination;
mod factorisation;
mod isa;
mod jackknife;
pub mod lanes;
mod panels;
pub mod parallel;
mod prefetch;
mod random;
mod range;
mod rice;
mod steps;
mod variant;

pub use bits::{Bits, WORD};
pub use block_cholesky::BlockCholesky;
pub use block6::NotPositiveDefinite;
pub use isa::{Isa, IsaMissing};
pub use jackknife::jackknife_sigma;
pub use prefetch::prefetch;
pub use random::{SplitMix64, mix};
pub use range::{SettingError, check_range};
pub use rice::{RiceReader, RiceWriter, unzigzag, zigzag};
pub use steps::*;
pub use variant::MethodVariant;
