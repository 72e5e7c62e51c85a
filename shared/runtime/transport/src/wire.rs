//! Our messages in the clothes that iceoryx2 asks for.
//!
//! Trust: the processes of one user. Folders are 0700 and segments 0600, so that another user can neither
//! read nor write them (`tests/end_to_end/promises/isolation/strangers.rs`). A process of the same user could
//! write into a message behind its check, as it could write into this process by `ptrace`. Headers are
//! copied before they are checked; payloads are checked and used in place, and every bit pattern of them is
//! a value, so that a change behind the check spoils numbers of that run and no memory.
#![expect(unsafe_code, reason = "promises that our plain data may be shared between processes")]

use bytemuck::TransparentWrapper;
use iceoryx2::prelude::ZeroCopySend;
use tessera_messages::{Element, Message};

/// A message or header on the wire.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub(crate) struct Wire<T>(pub(crate) T);

// SAFETY: every `Message` is `Pod`: `repr(C)`, no pointers, any bit pattern is a value. That its writer, a
// process of the same user, leaves it alone once it is sent is trusted (above).
unsafe impl<T: Message> ZeroCopySend for Wire<T> {
    unsafe fn type_name() -> &'static str {
        T::NAME
    }
}

impl<T: Message> Default for Wire<T> {
    fn default() -> Self {
        Self(T::zeroed())
    }
}

/// An element of a payload on the wire.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub(crate) struct WireElement<E>(pub(crate) E);

// SAFETY: every `Element` is `Pod`: `repr(C)`, no pointers, any bit pattern is a value. Trusted as above.
unsafe impl<E: Element> ZeroCopySend for WireElement<E> {
    unsafe fn type_name() -> &'static str {
        E::NAME
    }
}

// SAFETY: the wrapper is `repr(transparent)` over its only field.
unsafe impl<E: Element> TransparentWrapper<E> for WireElement<E> {}
