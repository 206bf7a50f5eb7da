//! `Slave`: the parts of a SubDevice.

use ringcat_engine::config::ConfigAddress;
use ringcat_wire::address::Position;

use super::details::SubDeviceDetails;
use super::error::ExportError;
use super::init_commands::{self, Own};
use super::layout::Layout;
use super::order::{Section, order, place};
use super::{clocks, mailbox, process_data};
use crate::configuration::Configuration;
use crate::eni::{HotConnect, Place, PreviousPort, SubDevice};
use crate::xml::one_line;

pub(super) fn subdevice(
    whole: &Configuration,
    index: usize,
    details: &SubDeviceDetails,
    layout: &Layout,
) -> Result<SubDevice, ExportError> {
    let (config, facts) = (&whole.declaration.subdevices[index], &whole.subdevices[index]);
    let order = order(&config.startup).ok_or_else(|| {
        let reason = "commands to registers and commands of mailbox protocols alternate: an ENI has each kind in a \
                      list of its own. At PS the commands that assign PDOs are among those of CoE, after those \
                      without `after_pdos`";
        ExportError::of(whole, index, "start-up commands", reason).at("startup")
    })?;
    let station = facts.station.unwrap_or_default();
    let auto_increment = auto_increment(whole, index);
    let own = Own { station, auto_increment, place: place(&order, Section::Registers) };
    let init_commands = match &config.declared {
        Some(declared) => init_commands::complete(config, declared, layout.fmmus(index), own),
        None => init_commands::raw(config, own),
    };
    let expected = &config.expected;
    let revision = expected.revision.or(expected.minimum_revision);
    Ok(SubDevice {
        name: facts.name.clone(),
        station: facts.station,
        auto_increment: Some(auto_increment),
        physics: one_line(&details.physics),
        vendor_id: Some(expected.vendor_id.or(details.vendor_id).unwrap_or_default()),
        product_code: Some(expected.product_code.or(details.product_code).unwrap_or_default()),
        revision: Some(revision.or(details.revision).unwrap_or_default()),
        serial: Some(expected.serial.or(details.serial).unwrap_or_default()),
        process_data: process_data::of_subdevice(whole, index, details)?,
        mailbox: mailbox::mailbox(config, facts, details, &order),
        init_commands,
        previous_ports: previous_port(whole, index).into_iter().collect(),
        hot_connect: hot_connect(whole, index, auto_increment),
        clock: clocks::of_subdevice(whole, index),
        ..SubDevice::default()
    })
}

/// `AutoIncAddr`: with groups SubDevices count in the order of the file.
fn auto_increment(whole: &Configuration, index: usize) -> u16 {
    let counted = u16::try_from(index).unwrap_or(u16::MAX);
    let position = match whole.declaration.subdevices[index].address {
        ConfigAddress::Position(position) if whole.groups.is_empty() => position,
        _ => counted,
    };
    Position(position).auto_increment()
}

fn previous_port(whole: &Configuration, index: usize) -> Option<PreviousPort> {
    let (previous, port) = whole.subdevices[index].plugged_into?;
    let station = whole.subdevices.get(previous)?.station;
    Some(PreviousPort { place: Place::default(), selected: true, port, station })
}

/// `HotConnect` at the head of a group.
fn hot_connect(whole: &Configuration, index: usize, auto_increment: u16) -> Option<HotConnect> {
    let configs = &whole.declaration.subdevices;
    let group = configs[index].group?;
    if index > 0 && configs[index - 1].group == Some(group) {
        return None;
    }
    let members = configs[index..].iter().take_while(|config| config.group == Some(group)).count();
    let identify = match configs[index].address {
        ConfigAddress::Alias { alias, .. } => init_commands::alias(auto_increment, alias),
        ConfigAddress::Identification { value, .. } => init_commands::identification(auto_increment, value),
        ConfigAddress::DataWord { register, value, .. } => init_commands::data_word(auto_increment, register, value),
        _ => Vec::new(),
    };
    let name = whole.groups.get(group.0).cloned().unwrap_or_default();
    let members = u16::try_from(members).unwrap_or(u16::MAX);
    Some(HotConnect { place: Place::default(), name, members, identify })
}
