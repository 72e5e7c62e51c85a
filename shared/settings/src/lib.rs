//! Every setting of Tessera in one typed, checked TOML file.
#![forbid(unsafe_code)]
