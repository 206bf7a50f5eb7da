//! Requests that a cyclic thread starts and reuses (Master Redundancy 5.8, IgH manual): no allocation, no lock, no
//! waiting.
//!
//! A request has memory of its own, with the size given at its creation. The cyclic side owns a request that is not
//! busy: it may change target, timeout and data, and start it. The acyclic half executes the request and returns it
//! with a result. One file per kind; the common part is in `slot`.

mod errors;
mod register;
mod retry;
mod sdo;
mod slot;
mod soe;
mod voe;

pub use register::RegisterRequest;
pub use retry::RetryRequest;
pub use sdo::SdoRequest;
pub use slot::{Request, RequestFailure, RequestRefused, RequestState};
pub use soe::SoeRequest;
pub use voe::{VoeHandler, VoeHeader};

pub(crate) use slot::{Access, AcyclicSide, Order, Subject};

/// Adds the common methods to a kind of request.
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
