//! A difference, and what is compared.

use std::fmt;

use ringcat_engine::config::IdentityField;
use ringcat_engine::declared::SubDeviceId;
use ringcat_engine::info::SubDeviceInfo;
use ringcat_engine::{JunctionError, Topology};
use ringcat_wire::address::Position;
use ringcat_wire::sii::{CoeDetails, MailboxProtocols};

/// A difference between a network and a file.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Difference {
    /// Index in the file; `None` for a SubDevice that is not in it.
    pub subdevice: Option<SubDeviceId>,
    /// Position on the bus; `None` for a SubDevice that was not found.
    pub position: Option<Position>,
    /// The kind.
    pub kind: DifferenceKind,
    /// The network cannot be activated with this difference.
    pub prevents_op: bool,
    /// The difference, as text for the operator.
    pub text: String,
}

/// Kind of a difference.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum DifferenceKind {
    /// A SubDevice of the file was not found.
    Missing,
    /// A SubDevice is not in the file.
    Additional,
    /// A SubDevice is at another place.
    Order,
    /// Several SubDevices have the alias, identification or data word by which the file finds one.
    Ambiguous,
    /// Another device: vendor or product.
    Device,
    /// Another revision.
    Revision,
    /// Another serial number.
    Serial,
    /// Another explicit device identification.
    Identification,
    /// Other PDOs.
    Pdos,
    /// Other mailboxes.
    Mailbox,
    /// Other mailbox protocols, or other features of CoE.
    Protocols,
    /// Another address or control byte of a SyncManager with process data.
    SyncManager,
    /// Other ports.
    Ports,
    /// The process data of the file cannot be set up.
    ProcessData,
    /// Another firmware version.
    Firmware,
    /// Another cabling.
    Cable,
    /// Other modules in the slots of a SubDevice.
    Modules,
    /// Distributed clocks that the network cannot have as declared.
    Clocks,
    /// A ring that the network does not have.
    Ring,
}

impl DifferenceKind {
    /// A word for programs.
    pub const fn word(self) -> &'static str {
        match self {
            DifferenceKind::Missing => "missing",
            DifferenceKind::Additional => "additional",
            DifferenceKind::Order => "order",
            DifferenceKind::Ambiguous => "ambiguous",
            DifferenceKind::Device => "device",
            DifferenceKind::Revision => "revision",
            DifferenceKind::Serial => "serial",
            DifferenceKind::Identification => "identification",
            DifferenceKind::Pdos => "pdos",
            DifferenceKind::Mailbox => "mailbox",
            DifferenceKind::Protocols => "protocols",
            DifferenceKind::SyncManager => "sync manager",
            DifferenceKind::Ports => "ports",
            DifferenceKind::ProcessData => "process data",
            DifferenceKind::Firmware => "firmware",
            DifferenceKind::Cable => "cable",
            DifferenceKind::Modules => "modules",
            DifferenceKind::Clocks => "clocks",
            DifferenceKind::Ring => "ring",
        }
    }

    pub(super) const fn of_field(field: IdentityField) -> DifferenceKind {
        match field {
            IdentityField::Revision | IdentityField::MinimumRevision | IdentityField::RevisionBits => {
                DifferenceKind::Revision
            }
            IdentityField::Serial => DifferenceKind::Serial,
            IdentityField::Identification => DifferenceKind::Identification,
            _ => DifferenceKind::Device,
        }
    }
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

/// Properties of a SubDevice that a file states and an activation does not compare.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct StatedProperties {
    /// Vendor and product, also where they are not compared.
    pub device: Option<(u32, u32)>,
    /// Revision, also where it is not compared.
    pub revision: Option<u32>,
    /// Mailboxes: start and length of the one that the MainDevice writes, and of the one that it reads.
    pub mailbox: Option<[(u16, u16); 2]>,
    /// The same in BOOT.
    pub boot_mailbox: Option<[(u16, u16); 2]>,
    /// Mailbox protocols.
    pub protocols: Option<MailboxProtocols>,
    /// Complete access, and whether PDO assignment and mapping can be written; the other bits are not compared.
    pub coe: Option<CoeDetails>,
    /// SyncManagers with process data.
    pub sync_managers: Vec<StatedSyncManager>,
    /// Kind of its ports, a letter each as in a network file; empty if they are not compared.
    pub ports: String,
    /// Version of the firmware (object 0x100A); empty if it is not compared.
    pub firmware: String,
    /// It has modules in slots (object 0xF050): its EEPROM lists only the PDOs of the head. Start-up commands for
    /// 0xF030 show this as well.
    pub modular: bool,
}

/// A SyncManager that a file states as the EEPROM describes it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct StatedSyncManager {
    /// Its number.
    pub number: u8,
    /// Its address.
    pub start: Option<u16>,
    /// Its control byte.
    pub control: Option<u8>,
}

/// A network that was found.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct FoundNetwork<'a> {
    /// The SubDevices of the scan.
    pub subdevices: &'a [SubDeviceInfo],
    /// Their cables.
    pub topology: &'a Topology,
    /// Versions of their firmware, in the same order; `None` or too short where they were not read.
    pub firmware: &'a [Option<String>],
    /// Idents of the modules in their slots (object 0xF050), in the same order; `None` or too short where they were not
    /// read.
    pub modules: &'a [Option<Vec<u32>>],
    /// Whether there is a redundant link.
    pub has_redundant: bool,
    /// A ring behind a junction that does not close as declared: the result of a test on the bus.
    pub not_closed: Option<JunctionError>,
}

impl<'a> FoundNetwork<'a> {
    /// A network on one link, without firmware versions, modules and tests of rings.
    pub const fn new(subdevices: &'a [SubDeviceInfo], topology: &'a Topology) -> FoundNetwork<'a> {
        let (firmware, modules) = (&[], &[]);
        FoundNetwork { subdevices, topology, firmware, modules, has_redundant: false, not_closed: None }
    }

    /// Sets [`FoundNetwork::firmware`].
    #[must_use]
    pub const fn with_firmware(mut self, firmware: &'a [Option<String>]) -> FoundNetwork<'a> {
        self.firmware = firmware;
        self
    }

    /// Sets [`FoundNetwork::modules`].
    #[must_use]
    pub const fn with_modules(mut self, modules: &'a [Option<Vec<u32>>]) -> FoundNetwork<'a> {
        self.modules = modules;
        self
    }

    /// Sets [`FoundNetwork::has_redundant`].
    #[must_use]
    pub const fn with_redundant(mut self, has_redundant: bool) -> FoundNetwork<'a> {
        self.has_redundant = has_redundant;
        self
    }

    /// Sets [`FoundNetwork::not_closed`].
    #[must_use]
    pub const fn with_not_closed(mut self, not_closed: Option<JunctionError>) -> FoundNetwork<'a> {
        self.not_closed = not_closed;
        self
    }
}
