//! Addresses of the IP stack behind a SubDevice (protocol 6.5).

use alloc::vec::Vec;
use core::net::Ipv4Addr;

/// IP parameters behind a SubDevice; `None`: not set, or not reported.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct IpSettings {
    /// MAC address.
    pub mac: Option<[u8; 6]>,
    /// IP address.
    pub address: Option<Ipv4Addr>,
    /// Subnet mask.
    pub mask: Option<Ipv4Addr>,
    /// Default gateway.
    pub gateway: Option<Ipv4Addr>,
    /// DNS server.
    pub dns: Option<Ipv4Addr>,
    /// Name, at most 32 bytes.
    pub name: Option<Vec<u8>>,
}
