//! Cables between simulated devices: as in `PreviousPort`, otherwise to the previous device in the file.

use ringcat_config::eni::Port as FilePort;
use ringcat_sim::cable::{CableSpec, DeviceIndex, Endpoint, HostLink};
use ringcat_sim::description::DeviceDescription;
use ringcat_sim::frame::Port;
use ringcat_sim::network::builder::DEFAULT_CABLE_DELAY;
use ringcat_wire::register::PortKind;

/// Ports to the next SubDevices, in the order in which free ports are used.
const FURTHER: [Port; 3] = [Port::B, Port::D, Port::C];

/// Devices, used ports and cables so far.
struct Plan<'a> {
    devices: &'a mut [DeviceDescription],
    taken: Vec<[bool; 4]>,
    cables: Vec<CableSpec>,
}

/// All cables: cable n ends at SubDevice n, the last one closes the ring. Devices also get the ports that the file uses
/// without declaring them.
pub(super) fn plug(
    devices: &mut [DeviceDescription],
    plugged_into: &[Option<(usize, FilePort)>],
    ring: bool,
) -> Vec<CableSpec> {
    let count = devices.len();
    let mut plan = Plan { taken: vec![[false; 4]; count], devices, cables: Vec::new() };
    for index in 0..count {
        let named = plugged_into.get(index).copied().flatten().filter(|(previous, _)| *previous < index);
        let named = named.map(|(previous, port)| (previous, of_file(port)));
        let from = match (named.filter(|(previous, port)| plan.is_free(*previous, *port)), index) {
            (Some((previous, port)), _) => plan.take(previous, port),
            (None, 0) => Endpoint::Host(HostLink::Main),
            (None, _) => plan.further(index, named.map_or(index - 1, |(previous, _)| previous)),
        };
        let to = plan.take(index, Port::A);
        plan.join(from, to);
    }
    if ring && count > 0 {
        let end = plan.end_of_ring();
        plan.join(end, Endpoint::Host(HostLink::Redundant));
    }
    plan.cables
}

const fn of_file(port: FilePort) -> Port {
    match port {
        FilePort::A => Port::A,
        FilePort::B => Port::B,
        FilePort::C => Port::C,
        FilePort::D => Port::D,
    }
}

impl Plan<'_> {
    fn is_free(&self, device: usize, port: Port) -> bool {
        !self.taken[device][port.index()]
    }

    fn has(&self, device: usize, port: Port) -> bool {
        self.devices[device].ports[port.index()] != PortKind::NotImplemented
    }

    fn take(&mut self, device: usize, port: Port) -> Endpoint {
        if !self.has(device, port) {
            self.devices[device].ports[port.index()] = PortKind::Mii;
        }
        self.taken[device][port.index()] = true;
        Endpoint::Device(DeviceIndex(device), port)
    }

    fn join(&mut self, a: Endpoint, b: Endpoint) {
        self.cables.push(CableSpec { a, b, delay: DEFAULT_CABLE_DELAY });
    }

    /// A free port of a device, or of the nearest device before it; port B of the previous device where none is free.
    fn further(&mut self, index: usize, wanted: usize) -> Endpoint {
        let all = std::iter::once(wanted).chain((0..index).rev());
        let mut ports = all.flat_map(|device| FURTHER.map(|port| (device, port)));
        let found = ports.find(|(device, port)| self.has(*device, *port) && self.is_free(*device, *port));
        let any = || (0..index).rev().flat_map(|device| FURTHER.map(|port| (device, port)));
        let found = found.or_else(|| any().find(|(device, port)| self.is_free(*device, *port)));
        let (device, port) = found.unwrap_or((index - 1, Port::B));
        self.take(device, port)
    }

    /// The port for the cable to the host: the last free port that is not EBUS, otherwise the last free port.
    fn end_of_ring(&mut self) -> Endpoint {
        let count = self.devices.len();
        let free: Vec<(usize, Port)> = (0..count)
            .rev()
            .flat_map(|device| FURTHER.map(|port| (device, port)))
            .filter(|(device, port)| self.is_free(*device, *port))
            .collect();
        let mii = |(device, port): &&(usize, Port)| self.devices[*device].ports[port.index()] == PortKind::Mii;
        let there = |(device, port): &&(usize, Port)| self.has(*device, *port);
        let found = free.iter().find(mii).or_else(|| free.iter().find(there)).or(free.first());
        let (device, port) = found.copied().unwrap_or((count - 1, Port::B));
        self.take(device, port)
    }
}
