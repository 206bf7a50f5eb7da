//! Result of a scan for a SubDevice: registers of its controller, and content of its SII (protocol 3.1, 4).

use alloc::rc::Rc;
use alloc::string::String;
use alloc::vec::Vec;

use ringcat_wire::address::{Position, RegisterAddress, StationAddress};
use ringcat_wire::register::{DlStatus, Features, Information, PortKind};
use ringcat_wire::sii::{
    CoeDetails, DcMode, FmmuUsage, GeneralFlags, Identity, MailboxLayout, MailboxProtocols, SiiSyncManager,
    SyncManagerKind,
};

use super::eeprom::AliasSource;
use super::extent::SiiExtent;
use super::pdo_source::PdoSource;
use super::warning::{InfoWarning, SiiProblem};
use crate::direction::Direction;

/// Type and features of a SubDevice's controller.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct ControllerInfo {
    /// TYPE.
    pub type_code: u8,
    /// REVISION.
    pub revision: u8,
    /// BUILD.
    pub build: u16,
    /// Number of FMMUs.
    pub fmmu_count: u8,
    /// Number of SyncManagers.
    pub sync_manager_count: u8,
    /// Process RAM in KiB, from 0x1000.
    pub ram_kib: u8,
    /// Kind of port 0..3.
    pub ports: [PortKind; 4],
    /// FEATURES.
    pub features: Features,
}

impl From<Information> for ControllerInfo {
    fn from(information: Information) -> ControllerInfo {
        ControllerInfo {
            type_code: information.controller_type,
            revision: information.revision,
            build: information.build,
            fmmu_count: information.fmmu_count,
            sync_manager_count: information.sync_manager_count,
            ram_kib: information.ram_kib,
            ports: information.port_descriptor.ports,
            features: information.features,
        }
    }
}

/// An entry of a PDO in the SII.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PdoEntryInfo {
    /// Index of the object; 0 is a gap.
    pub index: u16,
    /// Subindex of the object.
    pub sub_index: u8,
    /// Length in bits.
    pub bit_length: u8,
    /// CoE data type (protocol 6.3).
    pub data_type: u8,
    /// Name; empty if the SII contains none.
    pub name: String,
}

/// A PDO as the SII describes it.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct PdoInfo {
    /// Index of the PDO mapping object.
    pub index: u16,
    /// Outputs for a PDO that the SubDevice receives, inputs for one that it sends.
    pub direction: Direction,
    /// SyncManager to which it is assigned by default.
    pub sync_manager: Option<u8>,
    /// Name; empty if the SII contains none.
    pub name: String,
    /// Flags, raw.
    pub flags: u16,
    /// Its entries in order, gaps included.
    pub entries: Vec<PdoEntryInfo>,
}

impl PdoInfo {
    /// Sum of the bit lengths of its entries.
    pub fn bit_length(&self) -> u32 {
        self.entries.iter().map(|entry| u32::from(entry.bit_length)).sum()
    }
}

/// Registers of a controller that a scan reads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Readout {
    /// Position in the scan: the order of the processing units.
    pub position: Position,
    /// Station address that the scan gave.
    pub station: StationAddress,
    /// Register STATION_ALIAS (0x0012); 0 is none.
    pub alias: u16,
    /// Whether the alias is that of this register or of the SII.
    pub alias_source: AliasSource,
    /// Registers 0x0000..0x0009.
    pub information: Information,
    /// Register DL_STATUS.
    pub dl_status: DlStatus,
    /// Registers DC_RECEIVE_TIME of port 0..3, in nanoseconds of the local clock; `None` without a clock.
    pub receive_times: Option<[u32; 4]>,
}

/// Information about one SubDevice from a scan.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct SubDeviceInfo {
    /// Position in the scan: the order of the processing units.
    pub position: Position,
    /// Station address that the scan gave.
    pub station: StationAddress,
    /// How much of its SII is known: names are empty and there are no operation modes until they are.
    pub extent: SiiExtent,
    /// Alias, of the SII or of register STATION_ALIAS ([`AliasSource`]); 0 is none.
    pub alias: u16,
    /// Vendor, product, revision, serial number.
    pub identity: Identity,
    /// Explicit device identification, as set at its switches; `None` if it has none (protocol 5.3, 4.3).
    pub identification: Option<u16>,
    /// Words of its memory that declarations use to find SubDevices, as read last; without words that its memory does
    /// not have.
    pub data_words: Vec<DataWord>,
    /// The controller.
    pub controller: ControllerInfo,
    /// The controller copies AL control into AL status (device emulation): there is no application, and no acknowledge
    /// bit (protocol 3.4).
    pub device_emulation: bool,
    /// Register DL_STATUS at the time of the scan.
    pub dl_status: DlStatus,
    /// Receive times of port 0..3 in nanoseconds of the local clock.
    pub receive_times: Option<[u32; 4]>,
    /// Name of the SubDevice.
    pub name: String,
    /// Order code.
    pub order_code: String,
    /// Group.
    pub group: String,
    /// Image.
    pub image: String,
    /// Mailboxes in PREOP, SAFEOP and OP; `None` if it has none.
    pub mailbox: Option<MailboxLayout>,
    /// Mailboxes in BOOT; `None` if it has none.
    pub bootstrap: Option<MailboxLayout>,
    /// Mailbox protocols that it supports.
    pub protocols: MailboxProtocols,
    /// Its CoE features.
    pub coe: CoeDetails,
    /// Flags of the general category.
    pub flags: GeneralFlags,
    /// Physical address of the ID switch, valid if the flags announce identification in memory.
    pub id_switch_address: u16,
    /// Kind of port 0..3 in the SII, a nibble per port, raw (protocol 4.3).
    pub physical_ports: u16,
    /// Current from the EBUS in milliamperes; negative: it supplies current.
    pub ebus_current_ma: i16,
    /// SyncManagers, SM 0 first. If the SII contains no type, the type follows from the PDOs or the control byte.
    pub sync_managers: Vec<SiiSyncManager>,
    /// Purpose of each FMMU, FMMU 0 first.
    pub fmmu_usages: Vec<FmmuUsage>,
    /// PDOs of both directions. Of the SII outputs first, each direction in its order; PDOs of the dictionary behind
    /// them.
    pub pdos: Vec<PdoInfo>,
    /// Where the PDOs are known from.
    pub pdo_source: PdoSource,
    /// Operation modes of the distributed clock.
    pub dc_modes: Vec<DcMode>,
    /// Faults of the SII.
    pub warnings: Vec<InfoWarning>,
}

/// A word of the memory of a SubDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct DataWord {
    /// Physical address.
    pub register: RegisterAddress,
    /// Value.
    pub value: u16,
}

impl DataWord {
    /// A word with this value.
    pub const fn new(register: RegisterAddress, value: u16) -> DataWord {
        DataWord { register, value }
    }
}

/// Numbers of the SyncManagers of both mailboxes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct MailboxSyncManagers {
    /// SyncManager of the mailbox that the MainDevice writes.
    pub written: u8,
    /// SyncManager of the mailbox that the MainDevice reads.
    pub read: u8,
}

impl SubDeviceInfo {
    /// The value of a data word, if it was read.
    pub fn data_word(&self, register: RegisterAddress) -> Option<u16> {
        self.data_words.iter().find(|word| word.register == register).map(|word| word.value)
    }

    /// Whether the EEPROM was never written or cannot be read: nothing is known about the SubDevice.
    pub fn is_blank(&self) -> bool {
        self.warnings.iter().any(|it| matches!(it.problem, SiiProblem::Blank | SiiProblem::Unreadable))
    }

    /// Whether the SII is damaged: blank, truncated, or with a wrong checksum.
    pub fn is_doubtful(&self) -> bool {
        self.warnings.iter().any(|warning| warning.problem.is_grave())
    }

    /// Takes over the PDOs that were read before from the object dictionary of a SubDevice of this type. The SubDevice
    /// may have other PDOs now, unless these are the PDOs after power-on and the serial number shows that it is the
    /// same SubDevice: another SubDevice may have other modules, or other parameters in its memory. PDOs that are not
    /// certain are compared during the configuration.
    pub(crate) fn keep_dictionary(&mut self, known: &SubDeviceInfo) {
        let kind = |it: &SubDeviceInfo| (it.identity.vendor_id, it.identity.product_code);
        let is_read = self.pdo_source.is_of_dictionary();
        if is_read || known.pdo_source == PdoSource::Sii || kind(self) != kind(known) {
            return;
        }
        self.pdos.clone_from(&known.pdos);
        let is_the_same = self.identity.serial != 0 && self.identity == known.identity;
        self.pdo_source = match known.pdo_source {
            PdoSource::Dictionary if self.pdo_source.is_of_power_on() && is_the_same => PdoSource::Dictionary,
            PdoSource::Dictionary | PdoSource::Written if self.pdo_source.is_of_power_on() => PdoSource::Written,
            _ => PdoSource::Outdated,
        };
    }

    /// The same SubDevice with other ports, at another position; shared if nothing differs.
    pub(crate) fn seen_at(self: &Rc<SubDeviceInfo>, readout: &Readout) -> Rc<SubDeviceInfo> {
        let Readout { position, dl_status, receive_times, .. } = *readout;
        let alias = match readout.alias_source {
            AliasSource::Sii => self.alias,
            AliasSource::Register => readout.alias,
        };
        let is_same = (position, dl_status, alias) == (self.position, self.dl_status, self.alias);
        if is_same {
            return self.clone();
        }
        Rc::new(SubDeviceInfo { position, dl_status, receive_times, alias, ..(**self).clone() })
    }

    /// The PDO with this index.
    pub fn pdo(&self, index: u16) -> Option<&PdoInfo> {
        self.pdos.iter().find(|pdo| pdo.index == index)
    }

    /// PDOs that the SII assigns to a SyncManager, in its order.
    pub fn assigned_pdos(&self, sync_manager: u8) -> impl Iterator<Item = &PdoInfo> {
        self.pdos.iter().filter(move |pdo| pdo.sync_manager == Some(sync_manager))
    }

    /// SyncManagers of the mailboxes: from the SII if it contains both, otherwise 0 and 1 (protocol 3.11).
    pub fn mailbox_sync_managers(&self) -> MailboxSyncManagers {
        self.sync_managers_of(self.mailbox.as_ref())
    }

    /// SyncManagers of the mailboxes in BOOT. If SyncManagers in the SII start at the addresses of these mailboxes,
    /// they are used, otherwise those of PREOP.
    pub fn boot_sync_managers(&self) -> MailboxSyncManagers {
        self.sync_managers_of(self.bootstrap.as_ref())
    }

    fn sync_managers_of(&self, layout: Option<&MailboxLayout>) -> MailboxSyncManagers {
        let of = |kind, start: Option<u16>| {
            let all = || (0u8..).zip(&self.sync_managers).filter(move |(_, sm)| sm.kind == kind);
            all().find(|(_, sm)| Some(sm.start) == start).or_else(|| all().next()).map(|(index, _)| index)
        };
        let out = of(SyncManagerKind::MailboxOut, layout.map(|layout| layout.receive_offset));
        let both = out.zip(of(SyncManagerKind::MailboxIn, layout.map(|layout| layout.send_offset)));
        let (written, read) = both.unwrap_or((0, 1));
        MailboxSyncManagers { written, read }
    }

    /// Whether it supports LRW, by the features of the controller and by the SII.
    pub fn lrw_supported(&self) -> bool {
        !self.controller.features.lrw_unsupported && !self.flags.not_lrw()
    }
}
