//! What a procedure asks of the link layer itself, which is outside: to take a link down, and to bring it back.
//!
//! The runtime fetches the order ([`super::Supervisor::take_link_order`]), carries it out where it can, and says
//! whether it could. Nobody has to: an order that nobody fetches counts as refused.

use crate::link::Link;

/// The order under way, if there is one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum LinkOrder {
    #[default]
    None,
    /// Nobody has fetched it yet.
    Given { link: Link, disconnect: bool },
    /// It is being carried out.
    Fetched,
    /// It was carried out or refused.
    Answered(bool),
}
