//! The one crate that knows iceoryx2: which services there are, how to open them, how to wait,
//! and how to clean up after the dead.
//!
//! Bulk data is written once, in place, into shared memory by its producer ([`Loan`]) and read in
//! place by its consumer ([`Received`]). Every data service overflows rather than blocks: the
//! window of the flow is what keeps anything from being lost, never a blocked send.
#![deny(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(
        clippy::unwrap_used,
        clippy::indexing_slicing,
        clippy::cast_possible_truncation,
        clippy::arithmetic_side_effects
    )
)]

mod cleanup;
mod error;
mod guest;
mod identity;
mod layout;
mod link;
mod locator;
mod messages;
mod node;
mod nodes;
mod patience;
mod ports;
mod reach;
mod reader;
mod registry;
mod slices;
mod space;
mod sweeper;
mod wake;
mod wire;
mod writer;

pub use cleanup::{Cleaned, remove_everything};
pub use error::TransportError;
pub use guest::Guest;
pub use identity::RunIdentity;
pub use layout::{Layout, Service};
pub use link::{CameraServices, HeldServices, Link};
pub use locator::{is_loopback, locators_in};
pub use messages::{Publisher, Subscriber};
pub use nodes::{LivingNode, living_nodes};
pub use registry::{
    Registered, RunClaim, RunEntry, check_name, living_runs, registered_runs, remove_unnamed,
};
pub use slices::{Loan, Received, SlicePublisher, SliceSubscriber};
pub use space::{check_space, shared_memory_in_use};
pub use sweeper::Sweeper;
pub use wake::{Listener, Notifier};
