//! Robots and a base: copies without and with a network, faults on purpose, maps of several runs.

mod copies;
mod corrections;
mod disturbed;
mod faults;
mod looking;
mod maps;
mod nonsense;
mod processes;
#[path = "../../../tests/requirements.rs"]
mod requirements;
mod robot;
mod run;
mod strangers;
mod travelled;
