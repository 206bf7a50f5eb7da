//! What `slaves --verbose --json` prints of one SubDevice, and the names that the text has too.

use ringcat_control::tool::{ClockFeatures, Description, PortLine, PortsLine};
use serde::Serialize;

use super::values::{Bits, List};

/// Kinds of ports.
pub const PORT_KINDS: [&str; 4] = ["N/A", "N/C", "EBUS", "MII"];
/// Mailbox protocols by bit.
const PROTOCOLS: [&str; 6] = ["AoE", "EoE", "CoE", "FoE", "SoE", "VoE"];
/// CoE details by bit.
pub const COE_DETAILS: [&str; 6] = [
    "Enable SDO",
    "Enable SDO Info",
    "Enable PDO Assign",
    "Enable PDO Configuration",
    "Enable Upload at startup",
    "Enable SDO complete access",
];
/// Flags by bit.
pub const FLAGS: [&str; 2] = ["Enable SafeOp", "Enable notLRW"];

/// Names of mailbox protocols.
pub fn protocols(details: &Description) -> Bits {
    Bits { names: &PROTOCOLS, bits: details.protocols }
}

/// What is known of a SubDevice beside its line in a list.
pub struct Known {
    /// Its SII and its controller.
    pub description: Description,
    /// Its controller has a register of the system time.
    pub has_clock: bool,
    /// Its ports.
    pub ports: PortsLine,
}

/// The clock of a controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Clock {
    /// It has none.
    None,
    /// It measures delays only.
    Delays,
    /// Of 32 bits.
    Bits32,
    /// Of 64 bits.
    Bits64,
}

impl Clock {
    /// That of a controller with these features; `has_clock`: it has a register of the system time.
    pub fn of(features: &ClockFeatures, has_clock: bool) -> Clock {
        match (features.dc, has_clock, features.dc_64) {
            (false, ..) => Clock::None,
            (true, false, _) => Clock::Delays,
            (true, true, false) => Clock::Bits32,
            (true, true, true) => Clock::Bits64,
        }
    }
}

/// What else is known of a SubDevice.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Details<'a> {
    /// Bit 0 of register 0x0008, as in the text
    pub fmmu_bit_operation: bool,
    /// Distributed clock: `none`, `delays` where it measures delays only, `bits32` or `bits64`
    pub clock: Clock,
    /// Propagation delay from the reference clock, in nanoseconds, 0 while it is not known; null where none is measured
    pub delay_ns: Option<i64>,
    /// Its four ports
    pub ports: List<'a, PortLine, bool, Port>,
    /// Mailbox protocols: `AoE`, `EoE`, `CoE`, `FoE`, `SoE`, `VoE`
    pub protocols: Bits,
    /// Mailboxes in BOOT; null where its SII has none
    pub bootstrap_mailboxes: Option<Mailboxes>,
    /// Mailboxes in the other states; null where its SII has none
    pub mailboxes: Option<Mailboxes>,
    /// General category of its SII; null where it has none
    pub general: Option<General<'a>>,
}

/// A port.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Port {
    /// Number of the port, 0 to 3
    pub port: usize,
    /// `N/A` not implemented, `N/C` not configured, `EBUS` or `MII`; null for another number
    pub kind: Option<&'static str>,
    /// Whether it has a link
    pub link: bool,
    /// Whether its loop is closed
    pub loop_closed: bool,
    /// Whether it receives a signal
    pub signal: bool,
    /// Position of the SubDevice behind an open port with a link; null where there is none
    pub neighbour: Option<u16>,
    /// Receive time by the local clock, in nanoseconds; null without a link, and where none is measured
    pub received_ns: Option<u32>,
    /// Delay to the neighbour, in nanoseconds, 0 while it is not known; null without a link, and where none is measured
    pub delay_ns: Option<u64>,
}

/// Both mailboxes.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Mailboxes {
    /// Address of the mailbox that the MainDevice writes
    pub receive_address: u16,
    /// Its length, in bytes
    pub receive_bytes: u16,
    /// Address of the mailbox that the MainDevice reads
    pub send_address: u16,
    /// Its length, in bytes
    pub send_bytes: u16,
}

impl Mailboxes {
    fn of([(receive_address, receive_bytes), (send_address, send_bytes)]: [(u16, u16); 2]) -> Mailboxes {
        Mailboxes { receive_address, receive_bytes, send_address, send_bytes }
    }
}

/// The general category of an SII.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct General<'a> {
    /// Name of its group
    pub group: &'a str,
    /// Name of its image
    pub image: &'a str,
    /// CoE details that are enabled, by their names in the text
    pub coe_details: Bits,
    /// Flags that are set, by their names in the text
    pub flags: Bits,
    /// Current from the EBUS in milliamperes; negative: it supplies current
    pub current_ma: i16,
}

impl<'a> Details<'a> {
    /// The details of a SubDevice.
    pub fn new(known: &'a Known) -> Details<'a> {
        let Known { description: details, has_clock, ports } = known;
        let features = &details.features;
        let general = || General {
            group: &details.group,
            image: &details.image,
            coe_details: Bits { names: &COE_DETAILS, bits: details.coe.into() },
            flags: Bits { names: &FLAGS, bits: details.flags.into() },
            current_ma: details.current_ma,
        };
        Details {
            fmmu_bit_operation: features.fmmu_bytes,
            clock: Clock::of(features, *has_clock),
            delay_ns: features.dc.then_some(ports.delay_ns),
            ports: List { all: &ports.ports, context: features.dc, make: port },
            protocols: protocols(details),
            bootstrap_mailboxes: details.bootstrap.map(Mailboxes::of),
            mailboxes: details.mailbox.map(Mailboxes::of),
            general: details.has_general.then(general),
        }
    }
}

fn port(port: usize, line: &PortLine, is_measured: bool) -> Port {
    let [link, loop_closed, signal] = line.link;
    let is_measured = is_measured && link;
    Port {
        port,
        kind: PORT_KINDS.get(usize::from(line.kind)).copied(),
        link,
        loop_closed,
        signal,
        neighbour: line.neighbour,
        received_ns: is_measured.then_some(line.received_ns),
        delay_ns: is_measured.then_some(line.delay_ns.unsigned_abs()),
    }
}
