//! Comparison of the engine's status of process data with the logs of the devices, at all times and with any faults.
//!
//! Fresh inputs were written into a frame of the evaluated cycle by their SubDevice, byte for byte; outputs of a
//! complete cycle were taken by every SubDevice from a frame of this cycle. Both are read from the log of processed
//! logical datagrams that each simulated controller keeps.

use std::collections::VecDeque;

use ringcat::{Direction, DomainId, DomainState, DomainStatus, Freshness};
use ringcat_engine::exchange::Exchange;
use ringcat_engine::main_device::Directory;
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::controller::LogicalAccess;
use ringcat_sim::network::Network;

use crate::areas::{Area, areas_of};

/// Marks of the frames sent in one cycle: byte 1 of the source address, and Idx.
pub type Departure = Vec<(u8, u8)>;

/// Compares fresh inputs and complete cycles with the logs of the devices.
#[derive(Debug)]
pub struct Truth {
    areas: Vec<Area>,
    /// Limit of cycles under way.
    under_way: usize,
    /// Departures of the last cycles of each domain, oldest first.
    departures: Vec<VecDeque<Departure>>,
    proven: u64,
    /// Whether outputs of one cycle must be alike in all its tries. The logs contain damaged frames too.
    pub compares_outputs: bool,
}

impl Truth {
    /// For declared SubDevices; `devices` are their devices.
    pub fn new(directory: &Directory, devices: &[Option<DeviceIndex>], domains: usize, under_way: usize) -> Truth {
        let departures = vec![VecDeque::new(); domains];
        let mut truth = Truth { areas: Vec::new(), under_way, departures, proven: 0, compares_outputs: false };
        truth.follow(directory, devices);
        truth
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

    /// Checks a domain after [`Exchange::process`].
    ///
    /// # Panics
    /// When inputs are fresh that the SubDevice did not write into a frame of the cycle.
    pub fn judge(&mut self, status: DomainStatus, domain: DomainId, exchange: &Exchange, network: &Network) {
        let Some(departures) = self.departures.get(domain.0).filter(|_| !status.pending) else { return };
        let is_of_cycle = |access: &LogicalAccess| departures.iter().flatten().any(|frame| *frame == access.frame);
        let image = exchange.image(domain);
        for area in self.areas.iter().filter(|area| area.domain == domain) {
            let controller = &network.device(area.device).controller;
            if !controller.logs_logical() {
                continue;
            }
            match area.direction {
                Direction::Inputs => {
                    if exchange.freshness(domain, area.subdevice) != Freshness::Fresh {
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
                        let taken = controller.logical_accesses();
                        let taken = taken.filter(|it| it.written && is_of_cycle(it) && is_moved(area, it, true));
                        assert_alike(area, domain, taken.filter_map(|access| bytes_of(area, access)));
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
            self.proven += 1;
        }
    }

    /// Frames of the last cycle were sent again with these marks.
    pub fn send_again(&mut self, frames: &Departure) {
        for departures in &mut self.departures {
            if let Some(last) = departures.back_mut() {
                last.extend(frames);
            }
        }
    }

    /// A domain was sent with these frames, which include those of other domains.
    pub fn depart(&mut self, domain: DomainId, frames: &Departure) {
        let Some(departures) = self.departures.get_mut(domain.0).filter(|_| !frames.is_empty()) else { return };
        if departures.len() == self.under_way {
            departures.pop_front();
        }
        departures.push_back(frames.clone());
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

/// All tries of a cycle carry the same outputs.
fn assert_alike<'a>(area: &Area, domain: DomainId, mut values: impl Iterator<Item = &'a [u8]>) {
    let first = values.next();
    let (device, number) = (area.device.0, domain.0);
    assert!(
        values.all(|value| Some(value) == first),
        "device {device} took different outputs in one cycle of domain {number}",
    );
}
