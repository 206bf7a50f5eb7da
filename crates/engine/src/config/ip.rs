//! Addresses of the IP stack behind a SubDevice (protocol 6.5).

use alloc::vec::Vec;
use core::net::Ipv4Addr;

/// IP parameters behind a SubDevice; `None`: not set, or not reported.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
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

impl IpSettings {
    /// Sets [`IpSettings::mac`].
    #[must_use]
    pub fn with_mac(mut self, mac: impl Into<Option<[u8; 6]>>) -> IpSettings {
        self.mac = mac.into();
        self
    }

    /// Sets [`IpSettings::address`].
    #[must_use]
    pub fn with_address(mut self, address: impl Into<Option<Ipv4Addr>>) -> IpSettings {
        self.address = address.into();
        self
    }

    /// Sets [`IpSettings::mask`].
    #[must_use]
    pub fn with_mask(mut self, mask: impl Into<Option<Ipv4Addr>>) -> IpSettings {
        self.mask = mask.into();
        self
    }

    /// Sets [`IpSettings::gateway`].
    #[must_use]
    pub fn with_gateway(mut self, gateway: impl Into<Option<Ipv4Addr>>) -> IpSettings {
        self.gateway = gateway.into();
        self
    }

    /// Sets [`IpSettings::dns`].
    #[must_use]
    pub fn with_dns(mut self, dns: impl Into<Option<Ipv4Addr>>) -> IpSettings {
        self.dns = dns.into();
        self
    }

    /// Sets [`IpSettings::name`].
    #[must_use]
    pub fn with_name(mut self, name: impl Into<Option<Vec<u8>>>) -> IpSettings {
        self.name = name.into();
        self
    }
}
