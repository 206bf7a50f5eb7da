//! From the model of an ENI to a [`Configuration`]: the file is the authority about what is configured, RingCAT decides
//! how it gets there (docs/decisions/0022).
//!
//! The commands of a SubDevice are classified by register. Those that a MainDevice sends by itself (addresses, AL
//! control, EEPROM, FMMUs, delays and offsets of clocks) are held against the rest of the file and not sent;
//! SyncManagers, watchdogs and SYNC signals become declarations; what is left is sent as it is, or named in the
//! notices.

mod areas;
mod assignment;
mod bus;
mod clocks;
mod cyclic;
mod groups;
mod identity;
mod image;
mod mail;
mod messages;
mod notices;
mod registers;
mod subdevice;
mod sync_managers;
mod transitions;

use ringcat_engine::main_device::Declaration;

use crate::configuration::{Configuration, SubDeviceFacts};
use crate::eni::{Eni, EniError};
use notices::Notices;

/// Turns a file into what the engine needs.
///
/// An error names what would make a wrong network: contradictions in the file, or what RingCAT cannot do. What is
/// merely not followed is in [`Configuration::notices`].
pub fn follow(eni: &Eni) -> Result<Configuration, EniError> {
    let mut notices = Notices::default();
    let bus = bus::Bus::of(eni, &mut notices)?;
    let mut configs = Vec::with_capacity(eni.subdevices.len());
    let mut mappings = Vec::new();
    for index in 0..eni.subdevices.len() {
        let (config, mapping) = subdevice::follow(eni, index, &bus, &mut notices)?;
        configs.push(config);
        mappings.push(mapping);
    }
    let groups = groups::follow(eni, &bus, &mut configs)?;
    let cyclic = cyclic::follow(eni, &bus, &mappings, &mut notices)?;
    let image = image::follow(eni, &mappings, &cyclic.covers, &mut notices)?;
    let clocks = clocks::of_segment(eni, &configs, &cyclic);
    let facts = eni.subdevices.iter().zip(&bus.plugged_into).map(|(subdevice, plugged_into)| SubDeviceFacts {
        name: subdevice.name.clone(),
        station: subdevice.station,
        plugged_into: *plugged_into,
        net_id: subdevice.mailbox.as_ref().and_then(|mailbox| mailbox.net_id),
    });
    let declaration = Declaration {
        subdevices: configs,
        domains: cyclic.domains,
        clocks,
        explicit_lrw: cyclic.explicit_lrw,
        ..Declaration::default()
    };
    let subdevices = facts.collect();
    Ok(Configuration { declaration, subdevices, groups, image, cycle: cyclic.cycle, notices: notices.into_list(eni) })
}
