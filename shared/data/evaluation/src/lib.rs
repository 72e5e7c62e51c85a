//! Errors of an estimated trajectory: ATE and RPE by the definitions in common use.
//!
//! Files in the TUM form (`timestamp tx ty tz qx qy qz qw`), association by time, rigid alignment,
//! the absolute trajectory error (ATE) of `evaluate_ate.py` and of evo, and the relative pose
//! error (RPE) of `evaluate_rpe.py`. Where the scripts have quirks, they are kept: a figure that
//! differs from theirs cannot be compared with any table.
//!
//! Times are whole nanoseconds (`i64`), so that no stamp loses digits on its way through. Only
//! the comparisons of the scripts are made in `f64` seconds, as the scripts do.
#![forbid(unsafe_code)]

mod align;
mod associate;
mod ate;
mod error;
mod evaluate;
mod lateral;
mod offset;
mod rpe;
mod statistics;
mod text;

pub use align::{Similarity, align_rigid, align_similarity};
pub use associate::{associate_evo, associate_tum};
pub use ate::{Ate, AteOptions, ape_evo, ate};
pub use error::EvaluationError;
pub use evaluate::{Coverage, Evaluation, EvaluationOptions, ScaleReport, TimeOffsetReport, evaluate};
pub use lateral::{LateralScale, lateral_scale};
pub use offset::{SEARCH_S, best_time_offset_s};
pub use rpe::{Rpe, RpeOptions, rpe};
pub use statistics::Statistics;
pub use text::file::{
    ReadError, Trajectory, TrajectoryError, TumRows, parse_tum, read_tum, read_tum_rows, write_tum,
    write_tum_row,
};
pub use text::forms::{TrajectoryFile, read_trajectory};
pub use text::plain::plain_text;
pub use text::stamp::{StampError, format_stamp, parse_stamp, stamp_seconds};
