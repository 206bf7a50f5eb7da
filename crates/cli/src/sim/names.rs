//! Devices and cables of a simulated segment by their names, as answers to orders have them.

use std::fmt::Write as _;

use ringcat::sim::cable::{CableId, DeviceIndex, Endpoint};
use ringcat::sim::network::Network;

/// An end of a cable: a device, or an interface of the host.
pub fn end_name(end: Endpoint, network: &Network) -> String {
    match end {
        Endpoint::Device(device, _) => describe_device(device, network),
        Endpoint::Host(link) => format!("the {link} interface"),
    }
}

/// A device by its number and its name.
pub fn describe_device(device: DeviceIndex, network: &Network) -> String {
    format!("{} \"{}\"", device.0, network.device(device).name())
}

/// A cable by what it joins.
pub fn describe_cable(cable: CableId, network: &Network) -> String {
    let mut text = String::from("cable between ");
    if let Some(spec) = network.cables().nth(cable.0) {
        // Writing into a String cannot fail.
        let _ = write!(text, "{} and {}", end_name(spec.a, network), end_name(spec.b, network));
    }
    text
}
