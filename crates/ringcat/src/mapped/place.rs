//! Places of process data with their types.

use std::marker::PhantomData;

use ringcat_engine::exchange::Entry;

use crate::value::Number;

/// Process data that a SubDevice sends.
#[derive(Debug, PartialEq, Eq)]
pub struct Input<T> {
    entry: Entry,
    number: PhantomData<fn() -> T>,
}

/// Process data that a SubDevice receives.
#[derive(Debug, PartialEq, Eq)]
pub struct Output<T> {
    entry: Entry,
    number: PhantomData<fn() -> T>,
}

/// An [`Input`] or an [`Output`]: what can be read.
pub trait Mapped {
    /// Its type.
    type Number: Number;

    /// Its place in a domain's image.
    fn entry(&self) -> Entry;
}

macro_rules! mapped {
    ($($name:ident)*) => {$(
        impl<T> $name<T> {
            pub(super) const fn new(entry: Entry) -> $name<T> {
                $name { entry, number: PhantomData }
            }
        }

        impl<T> Clone for $name<T> {
            fn clone(&self) -> $name<T> {
                *self
            }
        }

        impl<T> Copy for $name<T> {}

        impl<T: Number> Mapped for $name<T> {
            type Number = T;

            fn entry(&self) -> Entry {
                self.entry
            }
        }
    )*};
}

mapped! { Input Output }
