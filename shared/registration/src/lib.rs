//! Surface-to-surface alignment: correspondences, multi-edge graphs, Levenberg-Marquardt.
#![forbid(unsafe_code)]
