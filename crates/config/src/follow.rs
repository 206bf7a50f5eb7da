//! From the model of an ENI to a [`Configuration`]: the file determines the configuration, RingCAT determines how to
//! apply it (docs/decisions/0022).
//!
//! The commands of a SubDevice are classified by register. Commands for tasks of the MainDevice (addresses, AL control,
//! EEPROM, FMMUs, delays and offsets of clocks) are compared with the rest of the file and not sent. SyncManagers,
//! watchdogs and SYNC signals become declarations. The remaining commands are sent unchanged or listed in the notices.

mod areas;
mod assignment;
mod bus;
mod clocks;
mod cyclic;
mod files;
mod groups;
mod identity;
mod image;
mod mail;
mod messages;
mod names;
mod notices;
mod register_commands;
mod registers;
mod subdevice;
mod sync_managers;
mod transitions;
mod whole_bus;

pub(crate) use identity::{HIGH_WORD, LOW_WORD};
pub(crate) use subdevice::states;

use ringcat_engine::main_device::Declaration;

use crate::configuration::{Configuration, DeclaredRings, SubDeviceFacts};
use crate::eni::{Eni, EniError};
use notices::Notices;

/// Converts a file into the configuration of the engine.
///
/// An error names a setting that would result in a wrong network: a contradiction in the file, or something that
/// RingCAT cannot do. [`Configuration::notices`] lists settings that are only not followed.
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
    names::note_duplicates(eni, &mut notices);
    let facts = eni.subdevices.iter().zip(&bus.plugged_into).map(|(subdevice, plugged_into)| SubDeviceFacts {
        name: subdevice.name.clone(),
        station: subdevice.station,
        plugged_into: *plugged_into,
        net_id: subdevice.mailbox.as_ref().and_then(|mailbox| mailbox.net_id),
    });
    let mut declaration = Declaration::default().with_clocks(clocks);
    declaration.subdevices = configs;
    declaration.domains = cyclic.domains;
    declaration.explicit_lrw = cyclic.explicit_lrw;
    let subdevices = facts.collect();
    let (cycle, notices) = (cyclic.cycle, notices.into_list(eni));
    Ok(Configuration { declaration, subdevices, groups, image, cycle, notices, rings: DeclaredRings::default() })
}
