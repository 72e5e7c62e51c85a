//! Evidence for the decisions about the map: whether two poses agree, whether two views show the same place, and
//! whether there is enough of it.
//!
//! Three quantities: a squared Mahalanobis distance ([`pose_agreement`]), a log-likelihood ratio of one aligned pair
//! of views ([`same_place`]), and a sequential test over views that are independent ([`sequential`]).

pub(crate) mod contradiction;
pub(crate) mod pose_agreement;
pub(crate) mod same_place;
pub(crate) mod same_place_table;
pub(crate) mod sequential;
