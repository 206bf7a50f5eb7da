//! Ethernet between both MainDevices of a ring, in acyclic master frames (protocol 9.12).
//!
//! The ACTIVE sends its frames and polls ([`sending`]); the INACTIVE takes them and fills the room of each poll on its
//! first pass ([`filling`]). Each MainDevice counts its frames in both roles: a frame that comes again, or behind a
//! later one, is dropped. Nothing is sent again (decision 0181). Nothing here waits, and only [`PartnerEthernet::new`]
//! allocates.

mod answers;
mod filling;
mod pace;
mod sending;
mod state;

pub(crate) use pace::EthernetDue;
pub(crate) use state::PartnerEthernet;

#[cfg(test)]
mod tests;
