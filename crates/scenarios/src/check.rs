//! Checks, separate from the scenarios: results of each cycle, comparison of images with the data of the simulated
//! devices, and the number of events of a change.

use ringcat::{Direction, DomainId, DomainState, DomainStatus, Event, Freshness, Instant, SubDeviceId, TimedEvent};
use ringcat_engine::exchange::Exchange;
use ringcat_engine::main_device::Directory;
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::device::Device;
use ringcat_sim::network::Network;
use ringcat_sim::time::SimTime;
use ringcat_wire::al::{AlState, AlStatus};
use ringcat_wire::register::map;

use crate::areas::{Area, areas_of};

/// Result of a domain in one cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Delivery {
    /// Not evaluated: the domain was not due, or no frame was under way.
    None,
    /// Its frames were still under way.
    Pending,
    /// All SubDevices responded.
    Complete,
    /// All inputs are fresh except those of SubDevices that are absent or not in OP.
    WithoutAbsent,
    /// Data of a SubDevice that could have responded is missing, or a SubDevice processed a datagram twice.
    Incomplete,
    /// No SubDevice responded.
    Zero,
}

impl Delivery {
    /// Whether data of a SubDevice that could respond is missing.
    pub const fn is_incomplete(self) -> bool {
        matches!(self, Delivery::Incomplete | Delivery::Zero)
    }
}

/// One cycle of a domain.
#[derive(Clone, Debug)]
pub struct Evaluated {
    /// The domain.
    pub domain: DomainId,
    /// Begin of the cycle that evaluated it.
    pub at: Instant,
    /// Status of the engine.
    pub status: DomainStatus,
    /// Its result.
    pub delivery: Delivery,
    /// SubDevices with stale inputs.
    pub stale: Vec<usize>,
}

/// State when a domain's frames were sent.
#[derive(Debug)]
struct Flight {
    left_at: SimTime,
    /// The domain's image, with its outputs.
    image: Vec<u8>,
    /// Inputs of all devices.
    inputs: Vec<Vec<u8>>,
    /// Devices in OP.
    operating: Vec<bool>,
}

/// Compares images with devices, cycle by cycle: fresh inputs equal the device's inputs when the frame was sent,
/// outputs of a complete cycle equal those that the device latched.
#[derive(Debug)]
pub struct Mirror {
    areas: Vec<Area>,
    flights: Vec<Option<Flight>>,
    compared: u64,
    /// Frames of the cycle that is evaluated next were sent again: fresh inputs do not show that outputs were taken,
    /// because outputs of some devices are never repeated.
    pub was_sent_again: bool,
    /// Whether a difference to latched outputs is a failure.
    pub evaluates_latched: bool,
}

impl Mirror {
    /// A mirror for declared SubDevices; `devices` are their devices.
    pub fn new(directory: &Directory, devices: &[Option<DeviceIndex>], domains: usize) -> Mirror {
        let mut areas = Vec::new();
        for (subdevice, device) in devices.iter().enumerate() {
            areas.extend(device.iter().flat_map(|device| areas_of(directory, subdevice, *device)));
        }
        Mirror {
            areas,
            flights: (0..domains).map(|_| None).collect(),
            compared: 0,
            was_sent_again: false,
            evaluates_latched: true,
        }
    }

    /// Bytes compared so far.
    pub fn compared(&self) -> u64 {
        self.compared
    }

    /// Result of a domain that was sent before and is evaluated now. Compares the data if possible.
    ///
    /// # Panics
    /// When image and device differ.
    pub fn evaluate(
        &mut self,
        status: DomainStatus,
        domain: DomainId,
        exchange: &Exchange,
        network: &Network,
    ) -> Delivery {
        if status.pending {
            return Delivery::Pending;
        }
        let Some(flight) = self.flights.get_mut(domain.0).and_then(Option::take) else { return Delivery::None };
        let delivery = self.delivery(status, domain, exchange, network);
        let image = exchange.image(domain);
        for area in self.areas.iter().filter(|area| area.domain == domain) {
            let device = network.device(area.device);
            let (got, expected) = match area.direction {
                // Inputs are checked with the device's log, if it has one ([`crate::truth`]).
                Direction::Inputs
                    if !device.controller.logs_logical()
                        && exchange.freshness(domain, SubDeviceId(area.subdevice)) == Freshness::Fresh =>
                {
                    let inputs = &flight.inputs[area.device.0];
                    (image.get(area.in_image.clone()), inputs.get(area.in_device.clone()))
                }
                // If a SubDevice is missing, which is allowed for optional ones, only fresh inputs show that it is not
                // this one.
                Direction::Outputs
                    if ((delivery == Delivery::Complete && status.wkc == status.expected)
                        || !self.was_sent_again
                            && exchange.freshness(domain, SubDeviceId(area.subdevice)) == Freshness::Fresh)
                        && flight.operating[area.device.0]
                        && uses_outputs(device) =>
                {
                    (device.outputs().get(area.in_device.clone()), flight.image.get(area.in_image.clone()))
                }
                Direction::Inputs | Direction::Outputs => continue,
            };
            let (Some(got), Some(expected)) = (got, expected) else { continue };
            self.compared += got.len() as u64;
            if self.evaluates_latched {
                assert_eq!(got, expected, "{:?} of {} in domain {}", area.direction, device.name(), domain.0);
            }
        }
        delivery
    }

    /// SubDevices with stale inputs.
    pub fn stale(&self, domain: DomainId, exchange: &Exchange) -> Vec<usize> {
        let inputs = self.areas.iter().filter(|area| area.domain == domain && area.direction == Direction::Inputs);
        let stale = inputs.filter(|area| exchange.freshness(domain, SubDeviceId(area.subdevice)) != Freshness::Fresh);
        stale.map(|area| area.subdevice).collect()
    }

    fn delivery(&self, status: DomainStatus, domain: DomainId, exchange: &Exchange, network: &Network) -> Delivery {
        match status.state {
            DomainState::Complete => return Delivery::Complete,
            DomainState::Zero => return Delivery::Zero,
            DomainState::Incomplete if status.wkc > status.expected => return Delivery::Incomplete,
            DomainState::Incomplete => {}
        }
        let mut here = self.areas.iter().filter(|area| area.domain == domain);
        let all_fresh = here.all(|area| {
            let device = network.device(area.device);
            let absent = !device.controller.is_powered() || device.al_status().al_state() != Some(AlState::Op);
            absent
                || area.direction == Direction::Outputs
                || exchange.freshness(domain, SubDeviceId(area.subdevice)) == Freshness::Fresh
        });
        if all_fresh { Delivery::WithoutAbsent } else { Delivery::Incomplete }
    }

    /// Devices were changed by other means than frames before the frames were sent.
    pub fn look_again(&mut self, network: &Network) {
        for flight in self.flights.iter_mut().flatten().filter(|flight| flight.left_at == network.now()) {
            flight.inputs = network.devices().map(|device| device.inputs().to_vec()).collect();
        }
    }

    /// A domain's frames are sent now.
    pub fn depart(&mut self, domain: DomainId, exchange: &Exchange, network: &Network) {
        let image = exchange.image(domain).to_vec();
        let inputs = network.devices().map(|device| device.inputs().to_vec()).collect();
        let operating = network.devices().map(uses_outputs).collect();
        if let Some(flight) = self.flights.get_mut(domain.0) {
            *flight = Some(Flight { left_at: network.now(), image, inputs, operating });
        }
    }
}

/// Whether a device uses outputs: it is in OP and its application runs. A device without an application stays in OP
/// when its watchdog expires.
pub fn uses_outputs(device: &Device) -> bool {
    let in_op = device.al_status() == AlStatus::new(AlState::Op);
    let alive = !device.description.emulation || device.controller.register(map::WATCHDOG_STATUS, 2)[0] & 1 != 0;
    let steady = !device.application.is_hanging() && !device.application.is_changing_state();
    device.controller.is_powered() && in_op && alive && steady
}

/// Events about the ring, in order.
pub fn ring_events(events: &[TimedEvent]) -> Vec<&Event> {
    let of_ring = |event: &&Event| {
        matches!(event, Event::RingOpened { .. } | Event::BreakLocated { .. } | Event::RingClosed { .. })
    };
    events.iter().map(|timed| &timed.event).filter(of_ring).collect()
}

/// Events that report a fault of a SubDevice or its configuration.
pub fn troubles(events: &[TimedEvent]) -> Vec<&Event> {
    let of_subdevice = |event: &&Event| {
        matches!(
            event,
            Event::StateError { .. }
                | Event::Lost { .. }
                | Event::Returned { .. }
                | Event::ConfigurationFailed { .. }
                | Event::Unexpected { .. }
                | Event::Missing { .. }
                | Event::ScanFailed { .. }
        )
    };
    events.iter().map(|timed| &timed.event).filter(of_subdevice).collect()
}
