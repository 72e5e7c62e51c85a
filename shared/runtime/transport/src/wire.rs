//! Our messages in the clothes that iceoryx2 asks for.
#![expect(unsafe_code, reason = "promises that our plain data may be shared between processes")]

use bytemuck::TransparentWrapper;
use iceoryx2::prelude::ZeroCopySend;
use tessera_messages::{Element, Message};

/// A message or header on the wire.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub(crate) struct Wire<T>(pub(crate) T);

// SAFETY: every `Message` is `Pod`: `repr(C)`, no pointers, any bit pattern is a value.
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

// SAFETY: every `Element` is `Pod`: `repr(C)`, no pointers, any bit pattern is a value.
unsafe impl<E: Element> ZeroCopySend for WireElement<E> {
    unsafe fn type_name() -> &'static str {
        E::NAME
    }
}

// SAFETY: the wrapper is `repr(transparent)` over its only field.
unsafe impl<E: Element> TransparentWrapper<E> for WireElement<E> {}
