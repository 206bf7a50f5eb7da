//! Address of the gateway and its number of clients.

use std::net::{Ipv4Addr, SocketAddr};

use ringcat_wire::mailbox::gateway::PORT;

/// Address of the gateway and its number of clients.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct GatewayOptions {
    /// Address and port, for UDP and TCP; port 0 is any free port.
    pub address: SocketAddr,
    /// TCP connections at a time.
    pub connections: usize,
}

impl GatewayOptions {
    /// Listens at this address and port; port 0 is any that is free.
    pub fn at(address: SocketAddr) -> GatewayOptions {
        GatewayOptions { address, ..GatewayOptions::default() }
    }

    /// The same options with this limit of TCP connections at a time.
    #[must_use]
    pub const fn with_connections(mut self, connections: usize) -> GatewayOptions {
        self.connections = connections;
        self
    }
}

impl Default for GatewayOptions {
    /// This host only, the port of ETG.8200, 32 connections.
    fn default() -> GatewayOptions {
        GatewayOptions { address: SocketAddr::from((Ipv4Addr::LOCALHOST, PORT)), connections: 32 }
    }
}
