//! The IP parameters of an EoE device.

use core::net::Ipv4Addr;

/// The current addresses.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Addresses {
    /// MAC address.
    pub mac: [u8; 6],
    /// IP address; unspecified until one is set.
    pub address: Ipv4Addr,
    /// Subnet mask.
    pub mask: Ipv4Addr,
    /// Default gateway.
    pub gateway: Ipv4Addr,
    /// DNS server.
    pub dns: Ipv4Addr,
    /// Name.
    pub name: Vec<u8>,
}

impl Addresses {
    /// Whether MAC and IP address are unicast (or no IP address is set) and the mask consists of ones followed by
    /// zeros.
    pub(super) fn are_valid(&self) -> bool {
        let mac = self.mac[0] & 0x01 == 0 && self.mac != [0; 6];
        let unicast = |address: Ipv4Addr| !address.is_multicast() && !address.is_broadcast();
        let mask = u32::from(self.mask);
        mac && unicast(self.address) && unicast(self.gateway) && mask.leading_ones() + mask.trailing_zeros() == 32
    }

    /// Bits of the network part.
    pub fn prefix(&self) -> u8 {
        u32::from(self.mask).leading_ones() as u8
    }
}
