//! Requests that a cyclic thread makes and re-uses (Master Redundancy 5.8, IgH manual): no allocation, no lock, no
//! waiting.
//!
//! A request has its own memory of a size given at its creation. The cyclic side owns it while it is not busy: it may
//! change what it is about and its timeout, put in data, start it. The acyclic half takes it up, and gives it back with
//! a result. One file per kind; what they have in common is in `slot`.

mod register;
mod sdo;
mod slot;
mod soe;
mod voe;

pub use register::RegisterRequest;
pub use sdo::SdoRequest;
pub use slot::{Request, RequestFailure, RequestRefused, RequestState};
pub use soe::SoeRequest;
pub use voe::VoeHandler;

pub(crate) use slot::{Access, Order, Served, Subject};

/// Gives a kind of request what all have in common.
macro_rules! requests {
    ($($kind:ty),*) => {$(
        impl core::ops::Deref for $kind {
            type Target = Request;

            fn deref(&self) -> &Request {
                &self.request
            }
        }

        impl core::ops::DerefMut for $kind {
            fn deref_mut(&mut self) -> &mut Request {
                &mut self.request
            }
        }
    )*};
}

requests!(RegisterRequest, SdoRequest, SoeRequest, VoeHandler);
