//! The one crate that knows iceoryx2: services, waiting, liveness, clean-up.
