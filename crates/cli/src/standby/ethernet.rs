//! The network interface of `ringcat standby` that leads to the other MainDevice.

use std::time::Duration;

use clap::Args;
use ringcat::standby::{PartnerInterface, PartnerTraffic};
use ringcat::wire::frame::MacAddress;
use ringcat::{Instant, SupervisorThread};

use super::event_report::EventReport;
use crate::failure::Failure;
use crate::numbers::number;
use crate::output::say;

/// Pause before an interface that another program has removed is made again.
const AGAIN: Duration = Duration::from_millis(500);

/// Its options.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Ethernet to the other MainDevice")]
pub struct EthernetArguments {
    /// Make a network interface NAME that leads to the other MainDevice
    ///
    /// Its MTU is 1400, its address is made of that of --main. The administrator gives it an IP address. Frames pass in
    /// acyclic frames of the ACTIVE, in any state of the SubDevices, if the other one has this option as well. Needs
    /// cap_net_admin.
    #[arg(long, value_name = "NAME", requires = "declaration")]
    tap: Option<String>,
    /// Most acyclic frames with Ethernet per cycle
    #[arg(long, value_name = "N", default_value = "4", value_parser = number(1_u8..=16, 4), requires = "tap")]
    max_acyclic: u8,
}

impl EthernetArguments {
    /// Acyclic master frames per cycle; 0 without an interface.
    pub fn max_acyclic(&self) -> u8 {
        if self.tap.is_some() { self.max_acyclic } else { 0 }
    }

    /// Makes the interface.
    pub fn start(&self, supervisor: &SupervisorThread, main: MacAddress) -> Result<Option<Ethernet>, Failure> {
        let Some(name) = &self.tap else { return Ok(None) };
        let mac = PartnerInterface::address(main);
        let made = supervisor.start_partner_interface(name, mac);
        let interface = made.map_err(|error| Failure::new(format!("--tap {name}: {error}")))?;
        Ok(Some(Ethernet { name: name.clone(), mac, interface, is_up: false, again_at: None }))
    }
}

/// The interface. It is removed when this is dropped.
pub struct Ethernet {
    name: String,
    mac: [u8; 6],
    interface: PartnerInterface,
    is_up: bool,
    /// Another program has removed it: it is made again then.
    again_at: Option<Instant>,
}

impl Ethernet {
    /// Prints what has changed. An interface that another program has removed is made again.
    pub fn report(&mut self, supervisor: &SupervisorThread, events: &EventReport, now: Instant) {
        let (name, status) = (&self.name, self.interface.status());
        if std::mem::replace(&mut self.is_up, status.is_up) != status.is_up {
            events.say(
                now,
                &match status.is_up {
                    true => format!("{name}: frames can pass"),
                    false => format!("{name}: no carrier, the other MainDevice does not answer"),
                },
            );
        }
        match self.again_at {
            None if status.is_removed => {
                events.say(now, &format!("{name}: removed by another program"));
                self.again_at = Some(now + AGAIN);
            }
            Some(at) if now >= at => match supervisor.start_partner_interface(name, self.mac) {
                Ok(interface) => {
                    events.say(now, &format!("{name}: created again; it needs its IP address again"));
                    (self.interface, self.again_at, self.is_up) = (interface, None, false);
                }
                // Its name may be taken for a moment.
                Err(_) => self.again_at = Some(now + AGAIN),
            },
            _ => {}
        }
    }

    /// Prints its counters.
    pub fn summary(&self) {
        let traffic = self.interface.status().traffic;
        say!("{}: {}", self.name, in_line(&traffic));
    }
}

/// The counters in a line.
fn in_line(traffic: &PartnerTraffic) -> String {
    let dropped = traffic.refused_length + traffic.refused_full + traffic.dropped_down + traffic.overflowed;
    format!(
        "{} frames ({} bytes) sent, {} frames ({} bytes) received, {} missed, {dropped} dropped",
        traffic.sent, traffic.sent_bytes, traffic.received, traffic.received_bytes, traffic.missed
    )
}
