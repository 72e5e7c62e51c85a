//! Robots and a base: copies without and with a network, faults on purpose, maps of several runs.

mod copies;
mod corrections;
mod faults;
mod maps;
mod processes;
mod proxy;
#[path = "../../../tests/requirements.rs"]
mod requirements;
mod robot;
mod run;
mod strangers;
