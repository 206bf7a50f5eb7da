//! A simulated segment from an ENI, to test a file without hardware.
//!
//! Each simulated SubDevice follows the file: identity, ports, SyncManagers, mailbox, PDOs, a clock where the file has
//! DC, and the objects that its start-up commands write. Data that the file does not contain, such as the name in the
//! SII or the behaviour of a drive, has simple defaults: inputs repeat the outputs.

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
    device::make_names_unique(eni, &mut devices);
    let plugged_into: Vec<_> = configuration.subdevices.iter().map(|facts| facts.plugged_into).collect();
    let cables = cables::plug(&mut devices, &plugged_into, ring);
    Segment {
        name: eni.main_device.name.clone(),
        options: NetworkOptions::default(),
        devices,
        cables,
        faults: Vec::new(),
    }
}
