//! What `config --json` prints.

use std::net::Ipv4Addr;

use ringcat_control::tool::{DeclaredLine, DeclaredSyncManager, IdnLine, IpParameters, SdoLine, SyncLine};
use serde::{Serialize, Serializer};

use super::pdos::{PdoList, pdos};
use super::values::{Direction, Hex, List, state};
use crate::hex;
use crate::selection::Slave;

/// What an application has declared.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Config<'a> {
    /// Number of the master
    pub master: u32,
    /// The selected SubDevices that the active application has declared, by alias and position; none without one
    pub declared: List<'a, DeclaredLine, &'a [Slave], Declared<'a>>,
}

/// A declared SubDevice.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Declared<'a> {
    /// Alias; 0: the position counts from the beginning of the bus
    pub alias: u16,
    /// Position, or position behind the alias
    pub position: u16,
    /// Expected vendor ID; 0: any
    pub vendor_id: u32,
    /// Expected product code; 0: any
    pub product_code: u32,
    /// The SubDevice on the bus; null where it is absent
    pub attached: Option<Attached>,
    /// Divider of the watchdog, register 0x0400; null where it is not written
    pub watchdog_divider: Option<u16>,
    /// Intervals of the watchdog of process data, register 0x0420; null where they are not written
    pub watchdog_intervals: Option<u16>,
    /// SyncManagers with PDOs, or with settings of their own
    pub sync_managers: List<'a, DeclaredSyncManager, (), SyncManager<'a>>,
    /// SDOs that are written at each start
    pub sdos: List<'a, SdoLine, (), Sdo<'a>>,
    /// IDNs that are written at each start
    pub idns: List<'a, IdnLine, (), Idn<'a>>,
    /// Whether the EEPROM is assigned to the PDI
    pub sii_to_pdi: bool,
    /// Pause in PREOP before SAFEOP, in milliseconds
    pub wait_before_safeop_ms: u64,
    /// IP parameters; null without
    pub ip: Option<Ip<'a>>,
    /// SYNC signals; null without
    pub sync: Option<Sync>,
}

/// The SubDevice on the bus.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Attached {
    /// Its position on the bus, from 0
    pub position: u16,
    /// `INIT`, `PREOP`, `BOOT`, `SAFEOP` or `OP`; null where it does not answer, or reports none of them
    pub state: Option<&'static str>,
    /// Whether it reports an error or does not answer
    pub error: bool,
}

/// A SyncManager.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SyncManager<'a> {
    /// Number of the SyncManager
    pub sync_manager: u8,
    /// `outputs` if the MainDevice writes it, `inputs` if it reads it
    pub direction: Direction,
    /// Whether its watchdog is enabled; null: as the SII says
    pub watchdog: Option<bool>,
    /// Its PDOs
    pub pdos: PdoList<'a>,
}

/// An SDO that is written at each start.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Sdo<'a> {
    /// Index of the object
    pub index: u16,
    /// Sub-index of the entry; null: the whole object, by complete access
    pub subindex: Option<u8>,
    /// Length of all data, in bytes
    pub length_bytes: u32,
    /// The first 1,024 of these bytes, in hexadecimal digits
    pub data: Hex<'a>,
}

/// An IDN that is written at each start.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Idn<'a> {
    /// Drive behind the SubDevice, 0 to 7
    pub drive: u8,
    /// Number of the IDN; bit 15: it is specific to the product (`P`)
    pub idn: u16,
    /// Length of all data, in bytes
    pub length_bytes: u32,
    /// The first 1,024 of these bytes, in hexadecimal digits
    pub data: Hex<'a>,
}

/// IP parameters.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Ip<'a> {
    /// MAC address; null where it is not set
    #[cfg_attr(test, schemars(with = "Option<String>"))]
    pub mac_address: Option<Mac<'a>>,
    /// IPv4 address; null where it is not set
    #[cfg_attr(test, schemars(with = "Option<String>"))]
    pub ip_address: Option<Address>,
    /// Subnet mask; null where it is not set
    #[cfg_attr(test, schemars(with = "Option<String>"))]
    pub subnet_mask: Option<Address>,
    /// IPv4 address of the gateway; null where it is not set
    #[cfg_attr(test, schemars(with = "Option<String>"))]
    pub default_gateway: Option<Address>,
    /// IPv4 address of the DNS server; null where it is not set
    #[cfg_attr(test, schemars(with = "Option<String>"))]
    pub dns_address: Option<Address>,
    /// Name, with U+FFFD for what is not UTF-8; null where it is not set
    #[cfg_attr(test, schemars(with = "Option<String>"))]
    pub hostname: Option<Name<'a>>,
}

/// SYNC signals.
#[derive(Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Sync {
    /// AssignActivate word: the value of registers 0x0980 and 0x0981
    pub assign_activate: u16,
    /// Cycle of SYNC0, in nanoseconds
    pub sync0_cycle_ns: u32,
    /// Shift of SYNC0, in nanoseconds
    pub sync0_shift_ns: i32,
    /// Cycle of SYNC1, in nanoseconds
    pub sync1_cycle_ns: u32,
    /// Shift of SYNC1, in nanoseconds
    pub sync1_shift_ns: i32,
}

impl<'a> Config<'a> {
    /// What is declared, and the SubDevices on the bus.
    pub fn new(master: u32, all: &'a [DeclaredLine], slaves: &'a [Slave]) -> Config<'a> {
        Config { master, declared: List { all, context: slaves, make: Declared::new } }
    }
}

impl<'a> Declared<'a> {
    fn new(_: usize, line: &'a DeclaredLine, slaves: &'a [Slave]) -> Declared<'a> {
        let ([vendor_id, product_code], [watchdog_divider, watchdog_intervals]) = (line.identity, line.watchdog);
        Declared {
            alias: line.alias,
            position: line.position,
            vendor_id,
            product_code,
            attached: line.found.map(|position| attached(position, slaves)),
            watchdog_divider,
            watchdog_intervals,
            sync_managers: List { all: &line.sync_managers, context: (), make: sync_manager },
            sdos: List { all: &line.sdos, context: (), make: sdo },
            idns: List { all: &line.idns, context: (), make: idn },
            sii_to_pdi: line.sii_to_pdi,
            wait_before_safeop_ms: line.wait_before_safeop_ms,
            ip: line.ip.as_ref().map(ip),
            sync: line.clock.as_ref().map(sync),
        }
    }
}

fn attached(position: u16, slaves: &[Slave]) -> Attached {
    let slave = slaves.iter().find(|slave| slave.line.position == position);
    let status = slave.and_then(|slave| slave.line.status);
    Attached { position, state: state(status), error: slave.is_none_or(Slave::has_error) }
}

fn sdo(_: usize, line: &SdoLine, _: ()) -> Sdo<'_> {
    Sdo { index: line.index, subindex: line.sub_index, length_bytes: line.length, data: Hex(&line.data) }
}

fn idn(_: usize, line: &IdnLine, _: ()) -> Idn<'_> {
    Idn { drive: line.drive, idn: line.idn, length_bytes: line.length, data: Hex(&line.data) }
}

fn sync_manager(_: usize, own: &DeclaredSyncManager, _: ()) -> SyncManager<'_> {
    SyncManager {
        sync_manager: own.index,
        direction: Direction::of(own.is_output),
        watchdog: own.watchdog,
        pdos: pdos(&own.pdos),
    }
}

fn ip(ip: &IpParameters) -> Ip<'_> {
    Ip {
        mac_address: ip.mac.as_ref().map(Mac),
        ip_address: ip.address.map(Address),
        subnet_mask: ip.mask.map(Address),
        default_gateway: ip.gateway.map(Address),
        dns_address: ip.dns.map(Address),
        hostname: ip.name.as_deref().map(Name),
    }
}

/// As `02:00:00:00:00:01`.
pub struct Mac<'a>(&'a [u8; 6]);
/// As `192.168.0.1`.
pub struct Address(Ipv4Addr);
/// Text that may be no UTF-8.
pub struct Name<'a>(&'a [u8]);

impl Serialize for Mac<'_> {
    fn serialize<Z: Serializer>(&self, serializer: Z) -> Result<Z::Ok, Z::Error> {
        serializer.serialize_str(&hex::mac(self.0))
    }
}

impl Serialize for Address {
    fn serialize<Z: Serializer>(&self, serializer: Z) -> Result<Z::Ok, Z::Error> {
        serializer.serialize_str(&self.0.to_string())
    }
}

impl Serialize for Name<'_> {
    fn serialize<Z: Serializer>(&self, serializer: Z) -> Result<Z::Ok, Z::Error> {
        serializer.serialize_str(&String::from_utf8_lossy(self.0))
    }
}

fn sync(line: &SyncLine) -> Sync {
    let ([sync0_cycle_ns, sync1_cycle_ns], [sync0_shift_ns, sync1_shift_ns]) = (line.cycles_ns, line.shifts_ns);
    let assign_activate = line.assign_activate;
    Sync { assign_activate, sync0_cycle_ns, sync0_shift_ns, sync1_cycle_ns, sync1_shift_ns }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: daemon, json
    #[test]
    fn ip_parameters_are_text_and_what_is_not_set_is_null() {
        let name = Some(vec![b'a', 0xFF, b'"']);
        let given = IpParameters { address: Some([10, 0, 0, 7].into()), name, ..IpParameters::default() };
        let wanted = "{\"mac_address\":null,\"ip_address\":\"10.0.0.7\",\"subnet_mask\":null,\"default_gateway\":null,\
                      \"dns_address\":null,\"hostname\":\"a\u{fffd}\\\"\"}";
        assert_eq!(serde_json::to_string(&ip(&given)).expect("it is JSON"), wanted);
    }

    // covers: daemon, json
    #[test]
    fn a_declared_subdevice_that_does_not_answer_has_no_state() {
        let line = DeclaredLine { found: Some(3), ..DeclaredLine::default() };
        let attached = Declared::new(0, &line, &[]).attached.expect("it was found");
        assert_eq!((attached.position, attached.state, attached.error), (3, None, true));
    }
}
