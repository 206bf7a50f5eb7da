//! The same as keys of JSON.

use std::time::Duration;

use ringcat::config::eni::{Eni, Port};
use ringcat::config::{Configuration, ImageArea};
use ringcat::{ConfigAddress, DeclaredSyncManager, ReferenceClock, SubDeviceConfig, SubDeviceId};

use super::words::{action, role, side};
use crate::json::eni;

/// Everything, with the details.
pub(super) fn json(model: &Eni, configuration: &Configuration) -> eni::EniFile {
    let declaration = &configuration.declaration;
    let subdevices = (0..declaration.subdevices.len()).filter_map(|index| subdevice(index, configuration));
    let tasks = declaration.domains.iter().map(|domain| {
        let members = domain
            .members
            .iter()
            .map(|member| eni::Member { subdevice: member.subdevice.0, sync_managers: member.sync_managers.clone() });
        eni::Task { cycle_ns: ns(domain.period), members: members.collect() }
    });
    let lrw = declaration.explicit_lrw.iter().map(|lrw| eni::Lrw {
        name: lrw.name.clone(),
        logical: lrw.logical.0,
        length: lrw.length,
        subdevices: lrw.subdevices.iter().map(|subdevice| subdevice.0).collect(),
    });
    let clocks = declaration.clocks.as_ref().map(|clocks| {
        let reference = match clocks.reference {
            ReferenceClock::Declared(index) => Some(index.0),
            _ => None,
        };
        eni::Clocks { reference, bus_shift: clocks.bus_shift }
    });
    let notices = configuration.notices.iter().map(|notice| eni::Notice {
        subject: notice.subject.clone(),
        reason: notice.reason.clone(),
        line: notice.place.map(|place| place.line),
        column: notice.place.map(|place| place.column),
        times: notice.times,
        subdevices: notice.subdevices.clone(),
    });
    eni::EniFile {
        name: model.main_device.name.clone(),
        version: model.version.clone(),
        made_by: model.made_by.clone(),
        cycle_ns: configuration.cycle.map(ns),
        subdevices: subdevices.collect(),
        groups: configuration.groups.clone(),
        tasks: tasks.collect(),
        lrw: lrw.collect(),
        clocks,
        image: image(configuration),
        not_followed: notices.collect(),
    }
}

fn ns(time: Duration) -> u64 {
    time.as_nanos() as u64
}

fn subdevice(index: usize, configuration: &Configuration) -> Option<eni::SubDevice> {
    let (config, facts) = configuration.subdevice(SubDeviceId(index))?;
    let startup = config.startup.iter().map(|command| eni::StartupCommand {
        transition: command.transition.to_string(),
        action: action(&command.action),
        comment: command.comment.clone(),
        limit_ns: command.limit.map(ns),
    });
    Some(eni::SubDevice {
        name: facts.name.clone(),
        station: facts.station,
        address: address(config),
        group: config.group.map(|group| group.0),
        vendor_id: config.expected.vendor_id,
        product_code: config.expected.product_code,
        revision: config.expected.revision,
        serial: config.expected.serial,
        connected_to: facts.plugged_into.map(connected_to),
        sync_managers: config.declared.as_ref().map(|declared| declared.iter().map(sync_manager).collect()),
        watchdog: eni::Watchdog {
            divider: config.watchdog_divider,
            outputs: config.watchdog_intervals,
            pdi: config.pdi_watchdog_intervals,
        },
        sync: config.sync.map(Into::into),
        startup: startup.collect(),
    })
}

fn sync_manager(sm: &DeclaredSyncManager) -> eni::SyncManager {
    let pdos = sm.pdos.iter().map(|pdo| {
        let entries = pdo.entries.iter().flatten().map(|entry| eni::Entry {
            index: entry.index,
            sub_index: entry.sub_index,
            bits: entry.bit_length,
        });
        eni::Pdo { index: pdo.index, entries: entries.collect() }
    });
    eni::SyncManager {
        index: sm.index,
        role: role(sm.role),
        start: sm.register.start,
        length: sm.register.length,
        control: sm.register.control.bits(),
        enabled: sm.register.activate.enable,
        op_only: sm.op_only,
        pdos: pdos.collect(),
    }
}

fn connected_to((subdevice, port): (usize, Port)) -> eni::DeclaredPort {
    let port = match port {
        Port::A => 0,
        Port::B => 1,
        Port::C => 2,
        Port::D => 3,
    };
    eni::DeclaredPort { subdevice, port }
}

fn address(config: &SubDeviceConfig) -> eni::Address {
    let none = eni::Address::default();
    match config.address {
        ConfigAddress::Position(position) => eni::Address { position: Some(position), ..none },
        ConfigAddress::Alias { alias, offset } => eni::Address { alias: Some(alias), offset: Some(offset), ..none },
        ConfigAddress::Identification { value, offset } => {
            eni::Address { identification: Some(value), offset: Some(offset), ..none }
        }
        ConfigAddress::DataWord { register, value, offset } => {
            eni::Address { identification: Some(value), data_word: Some(register.0), offset: Some(offset), ..none }
        }
        _ => none,
    }
}

fn image(configuration: &Configuration) -> eni::Image {
    let image = &configuration.image;
    let area = |area: &ImageArea| eni::Area {
        subdevice: area.subdevice,
        image: side(area.direction),
        sync_manager: area.sync_manager,
        bit_offset: area.bit_offset,
        image_bit: area.image_bit,
        bits: area.bits,
    };
    let variables = image.variables.iter().map(|variable| eni::Variable {
        name: variable.name.clone(),
        data_type: variable.data_type.clone(),
        image: side(variable.direction),
        image_bit: variable.image_bit,
        bits: variable.bits,
        subdevice: variable.subdevice,
    });
    let copies = image.copies.iter().filter_map(|copy| {
        let (source, target) = (image.areas.get(copy.source_area)?, image.areas.get(copy.target_area)?);
        Some(eni::Copied {
            input_bit: source.image_bit + copy.source_bit,
            output_bit: target.image_bit + copy.target_bit,
            bits: copy.bits,
        })
    });
    eni::Image {
        input_bytes: image.inputs_len,
        output_bytes: image.outputs_len,
        areas: image.areas.iter().map(area).collect(),
        variables: variables.collect(),
        copies: copies.collect(),
    }
}
