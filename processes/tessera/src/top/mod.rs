//! A run as it goes on, looked at again and again without disturbing it.

mod metrics;
mod snapshot;
mod view;
mod watcher;

pub(crate) use metrics::metrics;
pub(crate) use view::draw;
pub(crate) use watcher::Watcher;
