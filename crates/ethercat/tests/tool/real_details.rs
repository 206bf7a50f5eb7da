//! What `slaves --verbose` showed of real SubDevices.

use ringcat::sim::description::{DcDescription, DeviceDescription};
use ringcat::wire::register::PortKind;
use ringcat::wire::sii::{CoeDetails, General, GeneralFlags, MailboxLayout, MailboxProtocols, SiiHeader};

use crate::real_bus::{Shown, Strings, number};

/// Bits by the texts of their lines.
const COE: [(&str, u8); 6] = [
    ("Enable SDO", CoeDetails::SDO),
    ("Enable SDO Info", CoeDetails::SDO_INFORMATION),
    ("Enable PDO Assign", CoeDetails::PDO_ASSIGN),
    ("Enable PDO Configuration", CoeDetails::PDO_CONFIGURATION),
    ("Enable Upload at startup", CoeDetails::UPLOAD_AT_STARTUP),
    ("Enable SDO complete access", CoeDetails::COMPLETE_ACCESS),
];
const FLAGS: [(&str, u8); 2] =
    [("Enable SafeOp", GeneralFlags::ENABLE_SAFEOP), ("Enable notLRW", GeneralFlags::NOT_LRW)];
const PROTOCOLS: [(&str, u16); 6] = [
    ("AoE", MailboxProtocols::AOE),
    ("EoE", MailboxProtocols::EOE),
    ("CoE", MailboxProtocols::COE),
    ("FoE", MailboxProtocols::FOE),
    ("SoE", MailboxProtocols::SOE),
    ("VoE", MailboxProtocols::VOE),
];
const PORTS: [(&str, PortKind); 4] = [
    ("N/A", PortKind::NotImplemented),
    ("N/C", PortKind::NotConfigured),
    ("EBUS", PortKind::Ebus),
    ("MII", PortKind::Mii),
];

/// What only these outputs show of a SubDevice.
#[derive(Default)]
pub struct Details {
    group: String,
    image: String,
    coe: u8,
    flags: u8,
    current_ma: i16,
    protocols: u16,
    bootstrap: MailboxLayout,
    standard: MailboxLayout,
    ports: Vec<PortKind>,
    has_clock: bool,
}

/// Address and size of both mailboxes: `RX: 0x1000/128, TX: 0x1080/128`.
fn layout(line: &str) -> MailboxLayout {
    let place = |name: &str| {
        let (_, rest) = line.split_once(name).expect("a mailbox");
        let (start, size) = rest.split(',').next().and_then(|place| place.split_once('/')).expect("two numbers");
        (number(start) as u16, number(size) as u16)
    };
    let ((receive_offset, receive_size), (send_offset, send_size)) = (place("RX: "), place("TX: "));
    MailboxLayout { receive_offset, receive_size, send_offset, send_size }
}

/// The SubDevices that it shows, and blank ones before them.
pub fn slaves(text: &str) -> Vec<Shown> {
    let mut all: Vec<Shown> = Vec::new();
    for line in text.lines() {
        if let Some(position) = line.strip_prefix("=== Master 0, Slave ") {
            let position = number(position.trim_end_matches(" ===")) as usize;
            all.resize_with(position + 1, Shown::default);
            all[position].details = Some(Details::default());
        }
        let Some(own) = all.last_mut() else { continue };
        match line.trim().split_once(':') {
            Some((key, value)) => own.take(key, value.trim()),
            None => own.take_port(line),
        }
    }
    all
}

impl Shown {
    fn take(&mut self, key: &str, value: &str) {
        let Shown { alias, identity, name, order, details, .. } = self;
        let Some(details) = details else { return };
        match key {
            "Alias" => *alias = number(value) as u16,
            "Vendor Id" => identity[0] = number(value),
            "Product code" => identity[1] = number(value),
            "Revision number" => identity[2] = number(value),
            "Order number" => *order = value.to_owned(),
            "Device name" => *name = value.to_owned(),
            "Group" => details.group = value.to_owned(),
            "Image name" => details.image = value.to_owned(),
            "Current consumption" => details.current_ma = value.trim_end_matches(" mA").parse().expect("a number"),
            "Distributed clocks" => details.has_clock = value == "yes, 64 bit",
            "Bootstrap RX" => details.bootstrap = layout(&format!("RX: {value}")),
            "Standard  RX" => details.standard = layout(&format!("RX: {value}")),
            "Supported protocols" => {
                let bit = |name: &str| PROTOCOLS.iter().find(|it| it.0 == name).expect("a protocol").1;
                details.protocols = value.split(", ").map(bit).sum();
            }
            key => {
                let bit = |all: &[(&str, u8)]| all.iter().find(|it| it.0 == key && value == "yes").map_or(0, |it| it.1);
                details.coe |= bit(&COE);
                details.flags |= bit(&FLAGS);
            }
        }
    }

    fn take_port(&mut self, line: &str) {
        let kind = line.split_whitespace().nth(1);
        if let (Some(details), Some((_, kind))) = (&mut self.details, PORTS.iter().find(|it| Some(it.0) == kind)) {
            details.ports.push(*kind);
        }
    }
}

impl Details {
    pub fn change_header(&self, header: &mut SiiHeader) {
        (header.bootstrap_mailbox, header.standard_mailbox) = (self.bootstrap, self.standard);
        header.protocols = MailboxProtocols(self.protocols);
    }

    pub fn change_general(&self, general: &mut General, strings: &mut Strings) {
        (general.group, general.image) = (strings.number(&self.group), strings.number(&self.image));
        (general.coe, general.flags) = (CoeDetails(self.coe), GeneralFlags(self.flags));
        general.ebus_current_ma = self.current_ma;
    }

    pub fn change_controller(&self, device: &mut DeviceDescription) {
        if let Ok(ports) = self.ports.clone().try_into() {
            device.ports = ports;
        }
        let clock = || DcDescription { wide: true, modes: Vec::new(), minimum_cycle_ns: 0 };
        device.dc = self.has_clock.then(clock);
    }
}

/// What is compared of a line, and why the rest is not; nothing if it is the whole line.
pub fn compared(line: &str) -> (&str, Option<&'static str>) {
    const DELAY: &str = "  DC system time transmission delay: ";
    let is_port = line.strip_prefix("   ").is_some_and(|rest| rest.starts_with(|it: char| it.is_ascii_digit()));
    if line.starts_with(DELAY) {
        (DELAY, Some("the delay is that of the cables of that bus"))
    } else if line.get(4..5) == Some("*") && is_port {
        (&line[..4], Some("a newer version marks the upstream port; links and times are those of that bus"))
    } else if is_port {
        (line.get(..10).unwrap_or(line), Some("links, neighbours and times are those of that bus"))
    } else {
        (line, None)
    }
}
