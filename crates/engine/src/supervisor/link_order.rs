//! Order of a procedure to the link layer: disconnect a link, or reconnect it.
//!
//! The runtime fetches the order ([`super::Supervisor::take_link_order`]), carries it out if possible, and reports the
//! result. This is optional: an order that the runtime does not fetch counts as refused.

use crate::link::Link;

/// The current order, if there is one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum LinkOrder {
    #[default]
    None,
    /// Not fetched yet.
    Given { link: Link, disconnect: bool },
    /// It is being carried out.
    Fetched,
    /// It was carried out (true) or refused.
    Answered(bool),
}
