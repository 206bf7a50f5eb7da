//! All that is known of a SubDevice, as `slaves --verbose` prints it.

use ringcat_control::tool::{ClockFeatures, Description, PortLine, PortsLine};

use crate::append::append;
use crate::json::details::{COE_DETAILS, Clock, FLAGS, PORT_KINDS, protocols};
use crate::selection::Slave;

/// Bit of CoE.
const COE: u16 = 4;

/// The block of one SubDevice.
pub fn details(master: u32, slave: &Slave, details: &Description, has_clock: bool, ports: &PortsLine) -> String {
    let line = &slave.line;
    let mut text = format!("=== Master {master}, Slave {} ===\n", line.position);
    if line.alias != 0 {
        append!(text, "Alias: {}\n", line.alias);
    }
    let device = if line.is_redundant { "Backup" } else { "Main" };
    append!(text, "Device: {device}\nState: {}\nFlag: {}\nIdentity:\n", slave.state(), slave.flag());
    let [vendor, product, revision, serial] = line.identity;
    append!(text, "  Vendor Id:       0x{vendor:08x}\n  Product code:    0x{product:08x}\n");
    append!(text, "  Revision number: 0x{revision:08x}\n  Serial number:   0x{serial:08x}\n");
    text += &data_link(&details.features, has_clock, ports);
    text += &port_table(&details.features, ports);
    text += &mailboxes(details);
    if details.has_general {
        text += &general(slave, details);
    }
    text
}

fn yes(is: bool) -> &'static str {
    if is { "yes" } else { "no" }
}

fn data_link(features: &ClockFeatures, has_clock: bool, ports: &PortsLine) -> String {
    let clock = match Clock::of(features, has_clock) {
        Clock::None => "no",
        Clock::Delays => "yes, delay measurement only",
        Clock::Bits64 => "yes, 64 bit",
        Clock::Bits32 => "yes, 32 bit",
    };
    let mut text = format!("DL information:\n  FMMU bit operation: {}\n", yes(features.fmmu_bytes));
    append!(text, "  Distributed clocks: {clock}\n");
    if features.dc {
        append!(text, "  DC system time transmission delay: {} ns\n", ports.delay_ns);
    }
    text
}

fn port_table(features: &ClockFeatures, ports: &PortsLine) -> String {
    let mut text = "Port  Type  Link  Loop    Signal  NextSlave".to_owned();
    text += if features.dc { "  RxTime [ns]  Diff [ns]   NextDc [ns]\n" } else { "\n" };
    let first = ports.ports[0].received_ns;
    for (number, port) in ports.ports.iter().enumerate() {
        text += &port_row(number, port);
        if features.dc && port.link[0] {
            let difference = port.received_ns.wrapping_sub(first);
            append!(text, "  {:>11}  {difference:>10}  {:>10}", port.received_ns, port.delay_ns.unsigned_abs());
        } else if features.dc {
            append!(text, "  {:>11}  {:>10}  {:>10}", '-', '-', '-');
        }
        text.push('\n');
    }
    text
}

fn port_row(number: usize, port: &PortLine) -> String {
    let [link, is_closed, signal] = port.link;
    let (link, closed) = (if link { "up" } else { "down" }, if is_closed { "closed" } else { "open" });
    let next = port.neighbour.map_or("-".to_owned(), |position| position.to_string());
    let kind = PORT_KINDS.get(usize::from(port.kind)).unwrap_or(&"???");
    format!("{number:>4}  {kind:<4}  {link:<4}  {closed:<6}  {:<6}  {next:>9}", yes(signal))
}

fn mailboxes(details: &Description) -> String {
    let names: Vec<&str> = protocols(details).set().collect();
    if names.is_empty() {
        return String::new();
    }
    let both = |mailboxes: Option<[(u16, u16); 2]>| {
        let [(rx, rx_bytes), (tx, tx_bytes)] = mailboxes.unwrap_or_default();
        format!("RX: 0x{rx:04x}/{rx_bytes}, TX: 0x{tx:04x}/{tx_bytes}")
    };
    let mut text = format!("Mailboxes:\n  Bootstrap {}\n", both(details.bootstrap));
    append!(text, "  Standard  {}\n  Supported protocols: {}\n", both(details.mailbox), names.join(", "));
    text
}

fn general(slave: &Slave, details: &Description) -> String {
    let mut text = format!("General:\n  Group: {}\n  Image name: {}\n", details.group, details.image);
    append!(text, "  Order number: {}\n  Device name: {}\n", slave.line.order, slave.line.name);
    let bits = |title: &str, names: &[&str], value: u8| {
        let line = |(bit, name): (usize, &&str)| format!("    {name}: {}\n", yes(value >> bit & 1 != 0));
        format!("  {title}:\n{}", names.iter().enumerate().map(line).collect::<String>())
    };
    if details.protocols & COE != 0 {
        text += &bits("CoE details", &COE_DETAILS, details.coe);
    }
    text += &bits("Flags", &FLAGS, details.flags);
    text + &format!("  Current consumption: {} mA\n", details.current_ma)
}
