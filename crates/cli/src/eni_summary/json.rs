//! The same for programs.

use ringcat::config::eni::Eni;
use ringcat::config::{Configuration, ImageArea};
use ringcat::{ConfigAddress, ReferenceClock, SubDeviceConfig};
use serde_json::{Value, json};

use super::words::{action, role, side};

/// Everything, with the details.
pub(super) fn json(model: &Eni, configuration: &Configuration) -> Value {
    let declaration = &configuration.declaration;
    let subdevices = (0..declaration.subdevices.len()).filter_map(|index| subdevice(index, configuration));
    let tasks = declaration.domains.iter().map(|domain| {
        let members = domain
            .members
            .iter()
            .map(|member| json!({ "subdevice": member.subdevice, "sync_managers": member.sync_managers }));
        json!({ "period_ns": domain.period.as_nanos() as u64, "members": members.collect::<Value>() })
    });
    let lrw = declaration.explicit_lrw.iter().map(
        |lrw| json!({ "name": lrw.name, "logical": lrw.logical.0, "length": lrw.length, "subdevices": lrw.subdevices }),
    );
    let clocks = declaration.clocks.as_ref().map(|clocks| {
        let reference = match clocks.reference {
            ReferenceClock::Declared(index) => Some(index),
            ReferenceClock::FirstWithClock | ReferenceClock::FirstConfigured => None,
        };
        json!({ "reference": reference, "bus_shift": clocks.bus_shift })
    });
    let notices = configuration.notices.iter().map(|notice| {
        json!({
            "subject": notice.subject,
            "reason": notice.reason,
            "line": notice.place.map(|place| place.line),
            "column": notice.place.map(|place| place.column),
            "times": notice.times,
            "subdevices": notice.subdevices,
        })
    });
    json!({
        "name": model.main_device.name,
        "version": model.version,
        "made_by": model.made_by,
        "cycle_ns": configuration.cycle.map(|cycle| cycle.as_nanos() as u64),
        "subdevices": subdevices.collect::<Value>(),
        "groups": configuration.groups,
        "tasks": tasks.collect::<Value>(),
        "lrw": lrw.collect::<Value>(),
        "clocks": clocks,
        "image": image(configuration),
        "not_followed": notices.collect::<Value>(),
    })
}

fn subdevice(index: usize, configuration: &Configuration) -> Option<Value> {
    let (config, facts) = configuration.subdevice(index)?;
    let sync_managers = config.declared.as_ref().map(|declared| {
        let one = |sm: &ringcat::DeclaredSyncManager| {
            let pdos = sm.pdos.iter().map(|pdo| {
                let entries = pdo.entries.iter().flatten().map(
                    |entry| json!({ "index": entry.index, "sub_index": entry.sub_index, "bits": entry.bit_length }),
                );
                json!({ "index": pdo.index, "entries": entries.collect::<Value>() })
            });
            json!({
                "index": sm.index,
                "role": role(sm.role),
                "start": sm.register.start,
                "length": sm.register.length,
                "control": sm.register.control.bits(),
                "enabled": sm.register.activate.enable,
                "op_only": sm.op_only,
                "pdos": pdos.collect::<Value>(),
            })
        };
        declared.iter().map(one).collect::<Value>()
    });
    let startup = config.startup.iter().map(|command| {
        json!({
            "transition": command.transition.to_string(),
            "action": action(&command.action),
            "comment": command.comment,
            "limit_ms": command.limit.map(|limit| limit.as_millis() as u64),
        })
    });
    let sync = config.sync.map(|signals| {
        json!({
            "assign_activate": signals.assign_activate,
            "sync0_cycle_ns": signals.sync0_cycle_ns,
            "sync0_shift_ns": signals.sync0_shift_ns,
            "sync1_after_sync0_ns": signals.sync1_register_ns(),
        })
    });
    Some(json!({
        "name": facts.name,
        "station": facts.station,
        "address": address(config),
        "group": config.group,
        "vendor_id": config.expected.vendor_id,
        "product_code": config.expected.product_code,
        "revision": config.expected.revision,
        "serial": config.expected.serial,
        "plugged_into": facts.plugged_into.map(plugged_into),
        "sync_managers": sync_managers,
        "watchdog": {
            "divider": config.watchdog_divider,
            "outputs": config.watchdog_intervals,
            "pdi": config.pdi_watchdog_intervals,
        },
        "sync": sync,
        "startup": startup.collect::<Value>(),
    }))
}

fn plugged_into((other, port): (usize, impl std::fmt::Debug)) -> Value {
    json!({ "subdevice": other, "port": format!("{port:?}") })
}

fn address(config: &SubDeviceConfig) -> Value {
    match config.address {
        ConfigAddress::Position(position) => json!({ "position": position }),
        ConfigAddress::Alias { alias, offset } => json!({ "alias": alias, "offset": offset }),
        ConfigAddress::Identification { value, offset } => json!({ "identification": value, "offset": offset }),
    }
}

fn image(configuration: &Configuration) -> Value {
    let image = &configuration.image;
    let area = |area: &ImageArea| {
        json!({
            "subdevice": area.subdevice,
            "image": side(area.direction),
            "sync_manager": area.sync_manager,
            "bit_offset": area.bit_offset,
            "image_bit": area.image_bit,
            "bits": area.bits,
        })
    };
    let variables = image.variables.iter().map(|variable| {
        json!({
            "name": variable.name,
            "type": variable.data_type,
            "image": side(variable.direction),
            "image_bit": variable.image_bit,
            "bits": variable.bits,
            "subdevice": variable.subdevice,
        })
    });
    let copies = image.copies.iter().filter_map(|copy| {
        let (source, target) = (image.areas.get(copy.source_area)?, image.areas.get(copy.target_area)?);
        Some(json!({
            "input_bit": source.image_bit + copy.source_bit,
            "output_bit": target.image_bit + copy.target_bit,
            "bits": copy.bits,
        }))
    });
    json!({
        "input_bytes": image.inputs_len,
        "output_bytes": image.outputs_len,
        "areas": image.areas.iter().map(area).collect::<Value>(),
        "variables": variables.collect::<Value>(),
        "copies": copies.collect::<Value>(),
    })
}
