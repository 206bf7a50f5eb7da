//! All of what an application has declared of a SubDevice, as `config --verbose` prints it.

use std::fmt::Write;
use std::net::Ipv4Addr;

use ringcat_control::tool::{DeclaredLine, DeclaredSyncManager, IpParameters, MOST_STARTUP};
use ringcat_wire::mailbox::soe::Idn;

use crate::append::append;
use crate::hex;

/// The block of one declared SubDevice; `attached` is its position and state.
pub fn details(indent: &str, line: &DeclaredLine, attached: &Option<(u16, String)>) -> String {
    let [vendor, product] = line.identity;
    let mut text = format!("Alias: {}\nPosition: {}\n", line.alias, line.position);
    append!(text, "Vendor Id: 0x{vendor:08x}\nProduct code: 0x{product:08x}\n");
    text += &match attached {
        Some((position, state)) => format!("Attached slave: {position} ({state})\n"),
        None => "Attached slave: none\n".to_owned(),
    };
    let number = |value: Option<u16>| value.map_or("(Default)".to_owned(), |value| value.to_string());
    let [divider, intervals] = line.watchdog.map(number);
    append!(text, "Watchdog divider: {divider}\nWatchdog intervals: {intervals}\n");
    line.sync_managers.iter().for_each(|own| text += &sync_manager(own));
    text += "SDO configuration:\n";
    for sdo in &line.sdos {
        let entry = sdo.sub_index.map_or(" C".to_owned(), |sub_index| format!(":{sub_index:02x}"));
        append!(text, "  0x{:04x}{entry}, {} byte\n{}", sdo.index, sdo.length, data(&sdo.data, sdo.length));
    }
    text += if line.sdos.is_empty() { "  None.\n" } else { "" };
    text += "IDN configuration:\n";
    for idn in &line.idns {
        let name = Idn(idn.idn);
        append!(
            text,
            "  Drive {}, {}, {} byte\n{}",
            idn.drive,
            idn_name(name),
            idn.length,
            data(&idn.data, idn.length)
        );
    }
    text += if line.idns.is_empty() { "  None.\n" } else { "" };
    text += &flags(line);
    if let Some(ip) = &line.ip {
        text += &ip_parameters(ip);
    }
    if let Some(clock) = &line.clock {
        append!(text, "DC configuration:\n  AssignActivate: 0x{:04x}\n", clock.assign_activate);
        text += "         Cycle [ns]   Shift [ns]\n";
        for (number, (cycle, shift)) in (0..).zip(clock.cycles_ns.into_iter().zip(clock.shifts_ns)) {
            append!(text, "  SYNC{number}  {cycle:>11}  {shift:>11}\n");
        }
    }
    text.lines().map(|line| format!("{indent}{line}\n")).chain(["\n".to_owned()]).collect()
}

fn sync_manager(own: &DeclaredSyncManager) -> String {
    let direction = if own.is_output { "Output" } else { "Input" };
    let watchdog = match own.watchdog {
        None => "Default",
        Some(true) => "Enable",
        Some(false) => "Disable",
    };
    let mut text = format!("SM{}, Dir: {direction}, Watchdog: {watchdog}\n", own.index);
    for pdo in &own.pdos {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "  PDO 0x{:04x}", pdo.index);
        for entry in &pdo.entries {
            let (index, sub_index) = (entry.index, entry.sub_index);
            let _ = writeln!(text, "    PDO entry 0x{index:04x}:{sub_index:02x}, {:>2} bit", entry.bits);
        }
    }
    text
}

fn data(bytes: &[u8], length: u32) -> String {
    let more = if length as usize > MOST_STARTUP { "    ...\n" } else { "" };
    hex::lines("    ", bytes) + more
}

/// `S-0-0100` or `P-0-0150`.
fn idn_name(idn: Idn) -> String {
    let kind = if idn.0 & 0x8000 == 0 { 'S' } else { 'P' };
    format!("{kind}-{}-{:04}", idn.0 >> 12 & 7, idn.0 & 0x0FFF)
}

fn flags(line: &DeclaredLine) -> String {
    let mut text = "Feature flags:\n".to_owned();
    if line.sii_to_pdi {
        text += "  AssignToPdi: 1\n";
    }
    if line.wait_before_safeop_ms != 0 {
        append!(text, "  WaitBeforeSAFEOPms: {}\n", line.wait_before_safeop_ms);
    }
    if !line.sii_to_pdi && line.wait_before_safeop_ms == 0 {
        text += "  None.\n";
    }
    text
}

fn ip_parameters(ip: &IpParameters) -> String {
    let mac = ip.mac.map(|mac| hex::mac(&mac));
    let address = |address: Option<Ipv4Addr>| address.map(|it| it.to_string());
    let name = ip.name.as_ref().map(|name| String::from_utf8_lossy(name).into_owned());
    let lines = [
        ("MAC address", mac),
        ("IP address", address(ip.address)),
        ("Subnet mask", address(ip.mask)),
        ("Default gateway", address(ip.gateway)),
        ("DNS server address", address(ip.dns)),
        ("Hostname", name),
    ];
    let given = lines.into_iter().filter_map(|(key, value)| Some(format!("  {key}: {}\n", value?)));
    "EoE IP parameters:\n".to_owned() + &given.collect::<String>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ringcat_control::tool::{IdnLine, SdoLine, SyncLine};

    // covers: daemon
    #[test]
    fn everything_that_is_declared_is_listed() {
        let line = DeclaredLine {
            alias: 1000,
            identity: [2, 3],
            watchdog: [Some(2498), None],
            sdos: vec![
                SdoLine { index: 0x8000, sub_index: Some(6), length: 2, data: vec![0x34, 0x12] },
                SdoLine { index: 0x8001, sub_index: None, length: 1025, data: vec![0; 1] },
            ],
            idns: vec![IdnLine { drive: 0, idn: 0x8096, length: 2, data: vec![1, 2] }],
            wait_before_safeop_ms: 5,
            ip: Some(IpParameters { mac: Some([2, 0, 0, 0, 0, 1]), ..IpParameters::default() }),
            clock: Some(SyncLine { assign_activate: 0x300, cycles_ns: [1_000_000, 0], shifts_ns: [4400, 0] }),
            ..DeclaredLine::default()
        };
        let text = details("", &line, &Some((1, "OP".to_owned())));
        for part in [
            "Attached slave: 1 (OP)\nWatchdog divider: 2498\nWatchdog intervals: (Default)\nSDO configuration:\n",
            "  0x8000:06, 2 byte\n    34 12 \n  0x8001 C, 1025 byte\n    00 \n    ...\nIDN configuration:\n",
            "  Drive 0, P-0-0150, 2 byte\n    01 02 \nFeature flags:\n  WaitBeforeSAFEOPms: 5\n",
            "EoE IP parameters:\n  MAC address: 02:00:00:00:00:01\nDC configuration:\n  AssignActivate: 0x0300\n",
            "         Cycle [ns]   Shift [ns]\n  SYNC0      1000000         4400\n",
            "  SYNC1            0            0\n\n",
        ] {
            assert!(text.contains(part), "{part}\nis not in\n{text}");
        }
    }
}
