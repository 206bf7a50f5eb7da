//! Comparison of the engine's status of process data with the logs of the devices, at all times and with any faults.
//!
//! Fresh inputs were written into a frame of the evaluated cycle by their SubDevice, byte for byte; outputs of a
//! complete cycle were taken by every SubDevice from a frame of this cycle. Both are read from the log of processed
//! logical datagrams that each simulated controller keeps.
//!
//! Where lost frames are sent again: devices that must not receive something twice in a cycle ([`crate::once`]) find it
//! in no second try. On request also: all tries of a cycle carry the same outputs, and outputs of an earlier cycle
//! never follow those of a later one.

use std::collections::VecDeque;

use ringcat::{Direction, DomainId, DomainState, DomainStatus, Freshness, SubDeviceId};
use ringcat_engine::exchange::Exchange;
use ringcat_engine::main_device::Directory;
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::controller::LogicalAccess;
use ringcat_sim::network::Network;

use crate::areas::{Area, areas_of};
use crate::once::{Declared, only_once};

/// Cycles with known frames, for the order of outputs in a device's log.
const REMEMBERED: usize = 8;

/// Marks of the frames sent in one cycle: byte 1 of the source address, and Idx.
pub type Departure = Vec<(u8, u8)>;

/// The frames of one cycle.
#[derive(Debug)]
struct Sent {
    first: Departure,
    /// Further tries.
    again: Departure,
}

impl Sent {
    fn holds(&self, access: &LogicalAccess) -> bool {
        self.first.contains(&access.frame) || self.again.contains(&access.frame)
    }
}

/// Compares fresh inputs and complete cycles with the logs of the devices.
#[derive(Debug)]
pub struct Truth {
    areas: Vec<Area>,
    /// Limit of cycles under way.
    under_way: usize,
    /// Departures of the last cycles of each domain, oldest first.
    departures: Vec<VecDeque<Sent>>,
    /// By SubDevice.
    declared: Vec<Declared>,
    proven: u64,
    /// Areas that a second try did not transfer, as it must not.
    spared: u64,
    /// Whether outputs of one cycle must be alike in all its tries, and in the order of cycles. The logs contain
    /// damaged frames too, and late ones.
    pub compares_outputs: bool,
}

impl Truth {
    /// For SubDevices with these declarations.
    pub fn new(declared: Vec<Declared>, domains: usize, under_way: usize) -> Truth {
        let departures = (0..domains).map(|_| VecDeque::new()).collect();
        Truth { areas: Vec::new(), under_way, departures, declared, proven: 0, spared: 0, compares_outputs: false }
    }

    /// Updates the devices of the SubDevices; absent SubDevices keep their device.
    pub fn follow(&mut self, directory: &Directory, devices: &[Option<DeviceIndex>]) {
        for (subdevice, device) in devices.iter().enumerate() {
            let Some(device) = *device else { continue };
            self.areas.retain(|area| area.subdevice != subdevice);
            self.areas.extend(areas_of(directory, subdevice, device).filter(|area| !area.in_image.is_empty()));
        }
    }

    /// Areas of process data that were found in a log.
    pub fn proven(&self) -> u64 {
        self.proven
    }

    /// Areas of cycles with second tries that were not transferred by these, because their SubDevice must not receive
    /// them twice.
    pub fn spared(&self) -> u64 {
        self.spared
    }

    /// Checks a domain after [`Exchange::process`].
    ///
    /// # Panics
    /// When inputs are fresh that the SubDevice did not write into a frame of the cycle.
    pub fn evaluate(&mut self, status: DomainStatus, domain: DomainId, exchange: &Exchange, network: &Network) {
        let Some(remembered) = self.departures.get(domain.0).filter(|_| !status.pending) else { return };
        let out = remembered.len().saturating_sub(self.under_way);
        let departures: Vec<&Sent> = remembered.iter().skip(out).collect();
        let is_of_cycle = |access: &LogicalAccess| departures.iter().any(|sent| sent.holds(access));
        let image = exchange.image(domain);
        let (mut proven, mut spared) = (0, 0);
        for area in self.areas.iter().filter(|area| area.domain == domain) {
            let controller = &network.device(area.device).controller;
            if !controller.logs_logical() {
                continue;
            }
            spared += u64::from(self.is_spared(area, remembered.back(), network));
            match area.direction {
                Direction::Inputs => {
                    if exchange.freshness(domain, SubDeviceId(area.subdevice)) != Freshness::Fresh {
                        continue;
                    }
                    let value = &image[area.in_image.clone()];
                    let is_own = |access: &LogicalAccess| {
                        access.read
                            && is_of_cycle(access)
                            && is_moved(area, access, false)
                            && bytes_of(area, access) == Some(value)
                    };
                    assert!(
                        controller.logical_accesses().any(is_own),
                        "inputs of SubDevice {} in domain {} are called fresh ({value:02x?}), device {} put none such \
                         into the frames {:02x?}; it answered last: {:02x?}",
                        area.subdevice,
                        domain.0,
                        area.device.0,
                        departures,
                        controller.logical_accesses().filter(|it| bytes_of(area, it).is_some()).collect::<Vec<_>>(),
                    );
                }
                Direction::Outputs => {
                    if self.compares_outputs {
                        assert_in_order(area, remembered, controller.logical_accesses());
                    }
                    if status.state != DomainState::Complete || status.wkc != status.expected {
                        continue;
                    }
                    let is_own =
                        |access: &LogicalAccess| access.written && is_of_cycle(access) && is_moved(area, access, true);
                    assert!(
                        controller.logical_accesses().any(is_own),
                        "domain {} is called complete, device {} took no outputs from {:02x?}",
                        domain.0,
                        area.device.0,
                        departures,
                    );
                }
            }
            proven += 1;
        }
        (self.proven, self.spared) = (self.proven + proven, self.spared + spared);
    }

    /// Checks that no second try of a cycle transferred an area that its device must not receive twice; whether there
    /// was such a try and the area is of that kind.
    fn is_spared(&self, area: &Area, sent: Option<&Sent>, network: &Network) -> bool {
        let device = network.device(area.device);
        let Some(sent) = sent.filter(|sent| !sent.again.is_empty()) else { return false };
        let is_spared = only_once(self.declared.get(area.subdevice), device, area);
        if is_spared {
            assert_spared(area, sent, device.controller.logical_accesses());
        }
        is_spared
    }

    /// Frames of the last cycle were sent again with these marks.
    pub fn send_again(&mut self, frames: &Departure) {
        for departures in &mut self.departures {
            if let Some(last) = departures.back_mut() {
                last.again.extend(frames);
            }
        }
    }

    /// A domain was sent with these frames, which include those of other domains.
    pub fn depart(&mut self, domain: DomainId, frames: &Departure) {
        let Some(departures) = self.departures.get_mut(domain.0).filter(|_| !frames.is_empty()) else { return };
        if departures.len() == REMEMBERED.max(self.under_way) {
            departures.pop_front();
        }
        departures.push_back(Sent { first: frames.clone(), again: Vec::new() });
    }
}

/// Whether the device transferred a whole area between a datagram and its memory.
fn is_moved(area: &Area, access: &LogicalAccess, write: bool) -> bool {
    let at = area.logical.checked_sub(access.address).and_then(|at| usize::try_from(at).ok());
    at.is_some_and(|at| access.has_moved(at..at + area.in_image.len(), write))
}

/// The data of an area in a datagram.
fn bytes_of<'a>(area: &Area, access: &'a LogicalAccess) -> Option<&'a [u8]> {
    let at = usize::try_from(area.logical.checked_sub(access.address)?).ok()?;
    access.data.get(at..at + area.in_image.len())
}

/// No second try transferred any byte of an area that its device must not receive twice.
fn assert_spared<'a>(area: &Area, sent: &Sent, accesses: impl Iterator<Item = &'a LogicalAccess>) {
    let write = area.direction == Direction::Outputs;
    for access in accesses.filter(|access| sent.again.contains(&access.frame)) {
        let first = u64::from(access.address);
        let (begin, end) = (u64::from(area.logical), u64::from(area.logical) + area.in_image.len() as u64);
        let overlaps = |at: usize, len: usize| first + (at as u64) < end && begin < first + (at + len) as u64;
        let moved = access.moved.iter().find(|moved| moved.write == write && overlaps(moved.at, moved.len));
        let (device, direction) = (area.device.0, area.direction);
        assert!(moved.is_none(), "device {device} must receive its {direction:?} once in a cycle: {access:02x?}");
    }
}

/// Outputs that a device took are those of their cycle in each try, and never of an earlier cycle after a later one.
fn assert_in_order<'a>(area: &Area, remembered: &VecDeque<Sent>, accesses: impl Iterator<Item = &'a LogicalAccess>) {
    let (device, mut last) = (area.device.0, None);
    for access in accesses.filter(|access| access.written && is_moved(area, access, true)) {
        let Some(cycle) = remembered.iter().position(|sent| sent.holds(access)) else { continue };
        let value = bytes_of(area, access);
        if let Some((last_cycle, last_value)) = last.replace((cycle, value)) {
            assert!(last_cycle <= cycle, "device {device} took outputs of an earlier cycle after those of a later one");
            assert!(last_cycle < cycle || last_value == value, "device {device} took different outputs in one cycle");
        }
    }
}
