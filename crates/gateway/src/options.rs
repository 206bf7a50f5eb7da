//! Where the gateway listens, and for how many clients.

use std::net::{Ipv4Addr, SocketAddr};

use ringcat_wire::mailbox::gateway::PORT;

/// Where the gateway listens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GatewayOptions {
    /// Address and port, of UDP and TCP; port 0 is any that is free.
    pub address: SocketAddr,
    /// TCP connections at a time.
    pub connections: usize,
}

impl Default for GatewayOptions {
    /// This host only, the port of ETG.8200, 32 connections.
    fn default() -> GatewayOptions {
        GatewayOptions { address: SocketAddr::from((Ipv4Addr::LOCALHOST, PORT)), connections: 32 }
    }
}
