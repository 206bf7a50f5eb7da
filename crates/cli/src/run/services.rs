//! Optional services beside process data: network interfaces for EoE, the mailbox gateway.

use std::net::{IpAddr, SocketAddr};

use clap::Args;
use ringcat::eoe::{Ethernet, EthernetInterface, EthernetOptions};
use ringcat::gateway::{Gateway, GatewayOptions};
use ringcat::wire::mailbox::gateway::PORT;
use ringcat::{Address, SubDeviceId, SupervisorThread};
use ringcat_link::interface;

use crate::failure::Failure;
use crate::interfaces::InterfaceArguments;
use crate::json::run;
use crate::numbers::number;
use crate::output::{say, warn};

/// Their options.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Mailboxes")]
pub struct ServiceArguments {
    /// Make a network interface for each SubDevice with Ethernet over EtherCAT
    ///
    /// Their names are eoeXsY with this MainDevice's number X and the position Y, or eoeXaY with the alias Y. Needs
    /// cap_net_admin. With --master the daemon makes them.
    #[arg(long, conflicts_with = "master")]
    eoe: bool,
    /// Number of this MainDevice in the names of these interfaces
    #[arg(long, value_name = "NUMBER", default_value_t = 0, value_parser = number(0..=u16::MAX, 1))]
    index: u16,
    /// Open the mailbox gateway (ETG.8200, UDP and TCP)
    ///
    /// On 127.0.0.1:34980 where no address is given. It has no password: every program that reaches it may change
    /// SubDevices.
    #[arg(
        long,
        value_name = "ADDR[:PORT]",
        num_args = 0..=1,
        default_missing_value = "127.0.0.1",
        value_parser = address
    )]
    gateway: Option<SocketAddr>,
}

/// An address with the usual port or another one.
fn address(text: &str) -> Result<SocketAddr, String> {
    let with_port = text.parse().ok();
    let address = with_port.or_else(|| Some(SocketAddr::new(text.parse::<IpAddr>().ok()?, PORT)));
    address.ok_or_else(|| format!("expected an address such as 127.0.0.1 or 192.168.1.5:34980, got {text:?}"))
}

impl ServiceArguments {
    /// Starts the services of the options.
    pub fn start(
        &self,
        supervisor: &SupervisorThread,
        interfaces: &InterfaceArguments,
    ) -> Result<RunServices, Failure> {
        let mut services = RunServices { ethernet: None, gateway: None };
        if self.eoe {
            let main = interface::list().into_iter().find(|found| found.name == interfaces.links.main);
            let main = main.map(|found| found.mac).unwrap_or_default();
            services.ethernet = Some(supervisor.start_ethernet(EthernetOptions::new(self.index, main))?);
        }
        if let Some(address) = self.gateway {
            let gateway = supervisor.start_gateway(GatewayOptions::at(address))?;
            say!("mailbox gateway on {} (UDP and TCP)", gateway.address());
            if !address.ip().is_loopback() {
                warn(format_args!(
                    "the mailbox gateway has no password: every program that reaches {address} may change SubDevices"
                ));
            }
            services.gateway = Some(gateway);
        }
        Ok(services)
    }
}

/// The services that run; they end when this is dropped.
#[derive(Debug)]
pub struct RunServices {
    ethernet: Option<Ethernet>,
    gateway: Option<Gateway>,
}

impl RunServices {
    /// What has happened since the last call.
    pub fn lines(&self) -> Vec<String> {
        let events = self.ethernet.iter().flat_map(Ethernet::take_events);
        events.map(|event| event.to_string()).collect()
    }

    /// The network interfaces for EoE, as keys of JSON.
    pub fn json_ethernet(&self) -> Vec<run::Ethernet> {
        let interfaces = self.ethernet.iter().flat_map(Ethernet::interfaces);
        let json = |EthernetInterface { name, subdevice, status, refused, .. }: EthernetInterface| {
            // A run declares all SubDevices.
            let Address::Declared(SubDeviceId(subdevice)) = subdevice.subdevice else { return None };
            Some(run::Ethernet {
                interface: name,
                subdevice,
                sent_frames: status.counters.tx_frames,
                sent_bytes: status.counters.tx_bytes,
                dropped_frames: status.counters.tx_dropped,
                received_frames: status.counters.rx_frames,
                received_bytes: status.counters.rx_bytes,
                incomplete_frames: status.counters.rx_lost + status.counters.malformed,
                overrun_frames: status.counters.rx_overruns,
                refused_frames: refused,
            })
        };
        interfaces.filter_map(json).collect()
    }

    /// The mailbox gateway, as keys of JSON.
    pub fn json_gateway(&self) -> Option<run::Gateway> {
        let counters = self.gateway.as_ref()?.counters();
        let relay = counters.relay;
        Some(run::Gateway {
            connections: counters.connections,
            closed_connections: counters.ended,
            messages: relay.messages,
            answers: relay.answers,
            refused_messages: relay.refused + relay.malformed,
            unanswered_messages: relay.unanswered,
            ended_transfers: relay.ended,
        })
    }

    /// Prints what passed, for the summary.
    pub fn account(&self) {
        if let Some(ethernet) = &self.ethernet {
            let interfaces = ethernet.interfaces();
            if interfaces.is_empty() {
                say!("  EoE: no network interface");
            }
            for EthernetInterface { name, subdevice, status, refused, .. } in interfaces {
                let counters = status.counters;
                say!(
                    "  {name} ({}): to it {} frames, {} bytes, {} dropped; from it {} frames, \
                     {} bytes; {} incomplete, {} overrun, {refused} not taken by the host",
                    subdevice.subdevice,
                    counters.tx_frames,
                    counters.tx_bytes,
                    counters.tx_dropped,
                    counters.rx_frames,
                    counters.rx_bytes,
                    counters.rx_lost + counters.malformed,
                    counters.rx_overruns,
                );
            }
        }
        if let Some(gateway) = &self.gateway {
            let counters = gateway.counters();
            let relay = counters.relay;
            say!(
                "  gateway: {} connections, {} ended by us; {} messages, {} answered, \
                 {} refused, {} without an answer, {} transfers ended",
                counters.connections,
                counters.ended,
                relay.messages,
                relay.answers,
                relay.refused + relay.malformed,
                relay.unanswered,
                relay.ended,
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: gateway
    #[test]
    fn an_address_for_the_gateway_may_leave_out_the_port() {
        assert_eq!(address("127.0.0.1"), Ok(SocketAddr::from(([127, 0, 0, 1], 34_980))));
        assert_eq!(address("10.0.0.1:5000"), Ok(SocketAddr::from(([10, 0, 0, 1], 5000))));
        assert_eq!(address("::1").map(|address| address.port()), Ok(PORT));
        assert!(address("nowhere").is_err());
    }
}
