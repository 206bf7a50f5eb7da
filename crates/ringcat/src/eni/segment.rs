//! A simulated segment from an ENI, so that an owner of a file can try it without hardware.
//!
//! Each SubDevice is what the file says of it: identity, ports, SyncManagers, mailbox, PDOs, a clock where the file has
//! DC, and the objects that its start-up commands write. What the file does not know, such as the name in the SII or
//! the behaviour of a drive, is plain: inputs are what the outputs were.

mod cables;
mod device;
mod objects;

use ringcat_config::Configuration;
use ringcat_config::eni::Eni;
use ringcat_sim::network::NetworkOptions;
use ringcat_sim::segment::Segment;

/// The segment of a file. With `ring` the last free port is connected to the redundant interface.
pub fn segment(eni: &Eni, configuration: &Configuration, ring: bool) -> Segment {
    let mut devices: Vec<_> = eni
        .subdevices
        .iter()
        .zip(&configuration.declaration.subdevices)
        .map(|(subdevice, config)| device::describe(subdevice, config))
        .collect();
    device::tell_apart(eni, &mut devices);
    let plugged_into: Vec<_> = configuration.subdevices.iter().map(|facts| facts.plugged_into).collect();
    let cables = cables::plug(&mut devices, &plugged_into, ring);
    Segment { name: eni.main_device.name.clone(), options: NetworkOptions::default(), devices, cables }
}
