//! The details of each SubDevice: SyncManagers, PDOs, start-up commands, places in the image.

use ringcat::config::eni::Eni;
use ringcat::config::{Configuration, ObjectNames};
use ringcat::{SubDeviceId, SyncSignals};

use super::words::{action, one_line, role, side, time};

/// Lines for all SubDevices, then the variables of the image.
pub(super) fn lines(model: &Eni, configuration: &Configuration) -> Vec<String> {
    let mut lines = Vec::new();
    for index in 0..model.subdevices.len() {
        lines.push(String::new());
        of_subdevice(index, model, configuration, &mut lines);
    }
    if !configuration.image.variables.is_empty() {
        lines.push(String::new());
        lines.push("variables: image, first bit, bits, type, name".to_owned());
    }
    for variable in &configuration.image.variables {
        let (side, name) = (side(variable.direction), one_line(&variable.name));
        let kind = one_line(&variable.data_type);
        lines.push(format!("  {side:<7}  {:>6}  {:>5}  {kind:<8} {name}", variable.image_bit, variable.bits));
    }
    let image = &configuration.image;
    if !image.copies.is_empty() {
        lines.push(String::new());
        lines.push("copies: bits, from bit of the inputs, to bit of the outputs".to_owned());
    }
    for copy in &image.copies {
        let (source, target) = (image.areas[copy.source_area], image.areas[copy.target_area]);
        let (from, to) = (source.image_bit + copy.source_bit, target.image_bit + copy.target_bit);
        lines.push(format!("  {:>4}  {from:>6}  {to:>6}", copy.bits));
    }
    lines
}

fn of_subdevice(index: usize, model: &Eni, configuration: &Configuration, lines: &mut Vec<String>) {
    let Some((config, facts)) = configuration.subdevice(SubDeviceId(index)) else { return };
    lines.push(format!("SubDevice {index} \"{}\"", one_line(&facts.name)));
    if let Some((other, port)) = facts.plugged_into {
        lines.push(format!("  plugged into SubDevice {other} port {port:?}"));
    }
    let protocols = model.subdevices[index].mailbox.as_ref().map(|mailbox| mailbox.protocols.join(", "));
    if let Some(protocols) = protocols.filter(|protocols| !protocols.is_empty()) {
        lines.push(format!("  mailbox protocols: {}", one_line(&protocols)));
    }
    let mut names = ObjectNames::default();
    names.add_eni(&model.subdevices[index]);
    match &config.declared {
        None => lines.push("  SyncManagers as its SII says".to_owned()),
        Some(declared) => {
            for sm in declared {
                let (start, length, control) = (sm.register.start, sm.register.length, sm.register.control.bits());
                let off = match (sm.register.activate.enable, sm.op_only) {
                    (true, false) => "",
                    (true, true) => ", on in OP only",
                    (false, _) => ", off",
                };
                let role = role(sm.role);
                lines.push(format!(
                    "  SyncManager {:>2}  {role:<8} {start:#06x}  {length:>5} bytes, control {control:#04x}{off}",
                    sm.index
                ));
                for pdo in &sm.pdos {
                    let name = names.object(pdo.index).map(|name| format!(" \"{}\"", one_line(name)));
                    let name = name.unwrap_or_default();
                    let bits: u32 = pdo.entries.iter().flatten().map(|entry| u32::from(entry.bit_length)).sum();
                    let entries = pdo.entries.as_ref().map_or(0, Vec::len);
                    lines.push(format!("    PDO {:#06x}{name}  {bits} bits, {entries} entries", pdo.index));
                }
            }
        }
    }
    let watchdogs = [
        ("divider", config.watchdog_divider),
        ("outputs", config.watchdog_intervals),
        ("PDI", config.pdi_watchdog_intervals),
    ];
    for (what, value) in watchdogs {
        if let Some(value) = value {
            lines.push(format!("  watchdog {what} {value}"));
        }
    }
    if let Some(signals) = &config.sync {
        lines.push(format!("  {}", sync(signals)));
    }
    for area in configuration.image.areas.iter().filter(|area| area.subdevice == index) {
        let (side, bits, bit) = (side(area.direction), area.bits, area.image_bit);
        lines.push(format!("  {bits} bits of {side} from byte {} bit {} of the image", bit / 8, bit % 8));
    }
    for command in &config.startup {
        let comment = command.comment.as_ref().map(|text| format!("  \"{}\"", one_line(text))).unwrap_or_default();
        lines.push(format!("  {}: {}{comment}", command.transition, action(&command.action)));
    }
}

fn sync(signals: &SyncSignals) -> String {
    let span = |ns: u32| time(std::time::Duration::from_nanos(ns.into()));
    let (cycle, shift) = (span(signals.sync0_cycle_ns), signals.sync0_shift_ns);
    let first =
        format!("SYNC0 every {cycle}, {shift} ns after the cycle (activation {:#06x})", signals.assign_activate);
    match signals.sync1_register_ns() {
        0 => first,
        later => format!("{first}, SYNC1 {later} ns after SYNC0"),
    }
}
