//! Builds segments in code: lines, rings and branches.

use core::time::Duration;

use super::{Network, NetworkOptions};
pub use crate::cable::DEFAULT_CABLE_DELAY;

use crate::cable::{CableSpec, DeviceIndex, Endpoint, Host, HostLink};
use crate::device::Device;
use crate::frame::Port;
use crate::segment::SegmentError;

/// Devices and cables of a segment under construction.
///
/// Devices are numbered in the order of addition: first those of the line or ring, then those of each branch.
#[derive(Debug)]
pub struct SegmentBuilder {
    devices: Vec<Device>,
    cables: Vec<CableSpec>,
    options: NetworkOptions,
    delay: Duration,
}

impl SegmentBuilder {
    /// An empty segment.
    pub fn new() -> SegmentBuilder {
        SegmentBuilder {
            devices: Vec::new(),
            cables: Vec::new(),
            options: NetworkOptions::default(),
            delay: DEFAULT_CABLE_DELAY,
        }
    }

    /// Devices in a line from the main link: in at port 0, out at port 1.
    pub fn line(devices: Vec<Device>) -> SegmentBuilder {
        SegmentBuilder::new().chain(Endpoint::Host(HostLink::Main), devices)
    }

    /// As [`SegmentBuilder::line`], with port 1 of the last device on the redundant link.
    pub fn ring(devices: Vec<Device>) -> SegmentBuilder {
        let line = SegmentBuilder::line(devices);
        let end = line.devices.len().checked_sub(1).map(|last| Endpoint::Device(DeviceIndex(last), Port::B));
        let end = end.unwrap_or(Endpoint::Host(HostLink::Main));
        line.cable(end, Endpoint::Host(HostLink::Redundant))
    }

    /// Devices between two MainDevices: the line begins at the main link of `near` and ends at the redundant link of
    /// the other one; a cable joins the redundant link of `near` with the main link of the other one (protocol 9.1).
    pub fn ring_of_two(devices: Vec<Device>, near: Host) -> SegmentBuilder {
        let begin = Endpoint::Host(near.main());
        let line = SegmentBuilder::new().chain(begin, devices);
        let end = line.devices.len().checked_sub(1).map(|last| Endpoint::Device(DeviceIndex(last), Port::B));
        let far = near.other();
        line.cable(end.unwrap_or(begin), Endpoint::Host(far.redundant()))
            .cable(Endpoint::Host(far.main()), Endpoint::Host(near.redundant()))
    }

    /// Devices in a line from a port of a device.
    #[must_use]
    pub fn branch(self, at: DeviceIndex, port: Port, devices: Vec<Device>) -> SegmentBuilder {
        self.chain(Endpoint::Device(at, port), devices)
    }

    /// Adds a device without any cable.
    #[must_use]
    pub fn device(mut self, device: Device) -> SegmentBuilder {
        self.devices.push(device);
        self
    }

    /// Adds a cable.
    #[must_use]
    pub fn cable(mut self, a: Endpoint, b: Endpoint) -> SegmentBuilder {
        self.cables.push(CableSpec { a, b, delay: self.delay });
        self
    }

    /// Sets the delay of all cables, existing and future ones.
    #[must_use]
    pub fn cable_delay(mut self, delay: Duration) -> SegmentBuilder {
        self.delay = delay;
        for cable in &mut self.cables {
            cable.delay = delay;
        }
        self
    }

    /// The options of the segment.
    #[must_use]
    pub fn options(mut self, options: NetworkOptions) -> SegmentBuilder {
        self.options = options;
        self
    }

    /// Builds the segment.
    ///
    /// # Errors
    /// As [`Network::new`].
    pub fn build(self) -> Result<Network, SegmentError> {
        Network::new(self.devices, self.cables, self.options)
    }

    fn chain(mut self, mut from: Endpoint, devices: Vec<Device>) -> SegmentBuilder {
        for device in devices {
            let index = DeviceIndex(self.devices.len());
            self.devices.push(device);
            self = self.cable(from, Endpoint::Device(index, Port::A));
            from = Endpoint::Device(index, Port::B);
        }
        self
    }
}

impl Default for SegmentBuilder {
    fn default() -> Self {
        SegmentBuilder::new()
    }
}
