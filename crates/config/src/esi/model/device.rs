//! A device: identity, registers, process data, clock modes, EEPROM.

use super::dictionary::Profile;
use super::mailbox::Mailbox;
use super::names::Names;
use super::pdo::Pdo;
use super::slots::Slots;

/// How a value of the bus is compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Check {
    /// Not stated.
    #[default]
    Unstated,
    /// Not compared.
    None,
    /// Equal.
    Equal,
}

/// How the revision on the bus is compared with the configured one (protocol ES-26).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum RevisionCheck {
    /// Not stated: not compared.
    #[default]
    Unstated,
    /// `NONE`.
    None,
    /// `EQ`: equal.
    Equal,
    /// `EQ_OR_G`: equal or greater.
    EqualOrGreater,
    /// `LW_EQ`: low words equal.
    LowEqual,
    /// `LW_EQ_HW_EQ_OR_G`: low words equal, high word equal or greater.
    LowEqualHighEqualOrGreater,
    /// `HW_EQ`: high words equal.
    HighEqual,
    /// `HW_EQ_LW_EQ_OR_G`: high words equal, low word equal or greater.
    HighEqualLowEqualOrGreater,
}

/// `Device`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Device {
    /// Line in the file.
    pub line: u32,
    /// Ports as written: a letter each of Y, K, H or blank.
    pub physics: String,
    /// It has no controller, for example a power supply.
    pub is_invisible: bool,
    /// `Type`.
    pub kind: String,
    /// Vendor of the file.
    pub vendor_id: u32,
    /// Product code.
    pub product_code: u32,
    /// Revision.
    pub revision: u32,
    /// Serial number.
    pub serial: Option<u32>,
    /// Comparison of the product code.
    pub check_product: Check,
    /// Comparison of the revision.
    pub check_revision: RevisionCheck,
    /// Comparison of the serial number.
    pub check_serial: Check,
    /// LRW is not supported.
    pub use_lrd_lwr: bool,
    /// Descriptions that lists of devices do not show any more.
    pub hides: Vec<OtherIdentity>,
    /// Identities that work in its place.
    pub alternatives: Vec<OtherIdentity>,
    /// Further SubDevices in the same housing.
    pub subdevices: Vec<SubDeviceOf>,
    /// Name.
    pub name: Names,
    /// Key of its group.
    pub group: String,
    /// Electrical data, ports, time limits, identification.
    pub info: Info,
    /// Profiles with their dictionaries.
    pub profiles: Vec<Profile>,
    /// FMMUs in order.
    pub fmmus: Vec<Fmmu>,
    /// SyncManagers in order, virtual ones included.
    pub sync_managers: Vec<SyncManager>,
    /// Sync units in order.
    pub sync_units: Vec<SyncUnit>,
    /// PDOs from the MainDevice, in document order.
    pub rx_pdos: Vec<Pdo>,
    /// PDOs to the MainDevice, in document order.
    pub tx_pdos: Vec<Pdo>,
    /// Mailbox.
    pub mailbox: Option<Mailbox>,
    /// Distributed clock.
    pub clock: Option<ClockSettings>,
    /// Slots of a modular device.
    pub slots: Option<Slots>,
    /// Registers of the controller.
    pub controller: Controller,
    /// EEPROM.
    pub eeprom: Option<Eeprom>,
    /// Name of an image of old editions (`Image16x14`).
    pub image: String,
}

/// Another identity.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct OtherIdentity {
    /// Text.
    pub text: String,
    /// Product code; `None`: that of the device.
    pub product_code: Option<u32>,
    /// Revision.
    pub revision: Option<u32>,
}

/// A SubDevice in the same housing.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SubDeviceOf {
    /// Its identity.
    pub identity: OtherIdentity,
    /// Index of the SubDevice before it.
    pub previous_device: Option<u16>,
    /// Port of the SubDevice before it.
    pub previous_port: Option<u8>,
}

/// `Info`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Info {
    /// Current from the E-bus in milliamperes; negative = supplied.
    pub ebus_current_ma: Option<i32>,
    /// Time limits of state changes.
    pub state_times: StateTimes,
    /// Time limit of a mailbox request in milliseconds.
    pub request_timeout_ms: Option<u32>,
    /// Time limit of a mailbox response in milliseconds.
    pub response_timeout_ms: Option<u32>,
    /// SAFEOP is possible without synchronisation.
    pub safeop_without_sync: bool,
    /// Process RAM in bytes.
    pub ram_bytes: Option<u32>,
    /// SyncManagers of the controller.
    pub sync_manager_count: Option<u8>,
    /// FMMUs of the controller.
    pub fmmu_count: Option<u8>,
    /// Ports A to D.
    pub ports: Vec<PortSettings>,
    /// The identification switch is read through the AL status code.
    pub identification_al_status: bool,
    /// Address of the identification switch.
    pub identification_address: Option<u16>,
}

/// Time limits of state changes in milliseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StateTimes {
    /// INIT to PREOP.
    pub preop_ms: Option<u32>,
    /// PREOP to SAFEOP, SAFEOP to OP.
    pub safeop_op_ms: Option<u32>,
    /// Back to INIT.
    pub back_to_init_ms: Option<u32>,
    /// OP to SAFEOP.
    pub back_to_safeop_ms: Option<u32>,
}

/// Kind of a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PortKind {
    /// `MII`.
    Mii,
    /// `EBUS`.
    Ebus,
    /// `NONE`, or another word.
    None,
}

/// A port.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PortSettings {
    /// Kind.
    pub kind: PortKind,
    /// Label on the housing.
    pub label: String,
}

/// Use of an FMMU.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FmmuRole {
    /// `Outputs`.
    Outputs,
    /// `Inputs`.
    Inputs,
    /// `MBoxState`.
    MailboxState,
    /// Another word.
    Unused,
}

/// An FMMU.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fmmu {
    /// Use.
    pub role: FmmuRole,
    /// SyncManager.
    pub sync_manager: Option<u8>,
    /// Sync unit.
    pub sync_unit: Option<u8>,
}

/// Role of a SyncManager.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SyncManagerRole {
    /// `MBoxOut`.
    MailboxOut,
    /// `MBoxIn`.
    MailboxIn,
    /// `Outputs`.
    Outputs,
    /// `Inputs`.
    Inputs,
    /// Another word.
    Unused,
}

/// A SyncManager.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SyncManager {
    /// Line in the file.
    pub line: u32,
    /// Role.
    pub role: SyncManagerRole,
    /// Smallest size in bytes.
    pub min_size: Option<u16>,
    /// Largest size in bytes.
    pub max_size: Option<u16>,
    /// Size in bytes; for process data only a hint.
    pub default_size: Option<u16>,
    /// Physical start address.
    pub start: Option<u16>,
    /// Control byte, register 0x0804.
    pub control: Option<u8>,
    /// Enabled.
    pub enable: bool,
    /// It exists in tools only.
    pub is_virtual: bool,
    /// Enabled in OP only.
    pub op_only: bool,
    /// Its assignment is fixed.
    pub fixed_assignment: bool,
}

/// A sync unit.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SyncUnit {
    /// Name.
    pub name: String,
    /// It needs datagrams of its own.
    pub separate: bool,
    /// It needs frames of its own.
    pub separate_frame: bool,
    /// The device tolerates that a frame of a cycle is sent twice.
    pub frame_repeat: bool,
}

/// `Dc`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ClockSettings {
    /// Line in the file.
    pub line: u32,
    /// It can be the reference clock though it has no mode.
    pub potential_reference: bool,
    /// It prefers to be the reference clock.
    pub external_reference: bool,
    /// Offsets and delays are written, SYNC registers are not.
    pub time_loop_only: bool,
    /// Registers of 32 bits.
    pub is_32_bit: bool,
    /// Operation modes; the first is the default.
    pub modes: Vec<OpMode>,
}

/// A time that may be given by a factor (protocol ES-61, ES-62).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ScaledTime {
    /// Nanoseconds.
    pub ns: i32,
    /// Factor; `None` or 0: the time counts.
    pub factor: Option<i32>,
}

/// An operation mode of the clock.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct OpMode {
    /// Line in the file.
    pub line: u32,
    /// Name.
    pub name: String,
    /// Description.
    pub description: String,
    /// Value of the registers 0x0980:0x0981.
    pub assign_activate: u16,
    /// Cycle of SYNC0.
    pub cycle_0: ScaledTime,
    /// Shift of SYNC0.
    pub shift_0: ScaledTime,
    /// The shift of SYNC0 refers to inputs.
    pub shift_0_for_inputs: bool,
    /// Cycle of SYNC1.
    pub cycle_1: ScaledTime,
    /// Shift of SYNC1.
    pub shift_1: ScaledTime,
    /// PDOs of the mode by SyncManager.
    pub sync_managers: Vec<OpModeSyncManager>,
}

/// PDOs of a SyncManager in an operation mode.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct OpModeSyncManager {
    /// Number of the SyncManager.
    pub number: u8,
    /// PDO indices with their oversampling factors.
    pub pdos: Vec<(u16, Option<u32>)>,
}

/// `ESC`: registers that are written where the file gives them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Controller {
    /// Watchdog divider.
    pub reg_0400: Option<u16>,
    /// PDI watchdog.
    pub reg_0410: Option<u16>,
    /// Process data watchdog.
    pub reg_0420: Option<u16>,
}

/// `Eeprom`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Eeprom {
    /// Line in the file.
    pub line: u32,
    /// The EEPROM is assigned to the PDI.
    pub assign_to_pdi: bool,
    /// A whole image instead of the parts.
    pub data: Option<Vec<u8>>,
    /// Size in bytes.
    pub byte_size: Option<u32>,
    /// The first words.
    pub config_data: Vec<u8>,
    /// Mailboxes in BOOT.
    pub bootstrap: Option<Vec<u8>>,
    /// Further categories.
    pub categories: Vec<EepromCategory>,
}

/// A category of the EEPROM.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EepromCategory {
    /// Line in the file.
    pub line: u32,
    /// Number.
    pub number: u16,
    /// Content.
    pub content: EepromContent,
}

/// Content of a category.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum EepromContent {
    /// Bytes.
    Data(Vec<u8>),
    /// Characters.
    Text(String),
    /// A number of 16 bits.
    U16(u16),
    /// A number of 32 bits.
    U32(u32),
}

impl EepromContent {
    /// The bytes in the image, without padding.
    pub fn bytes(&self) -> Vec<u8> {
        match self {
            EepromContent::Data(data) => data.clone(),
            EepromContent::Text(text) => text.as_bytes().to_vec(),
            EepromContent::U16(number) => number.to_le_bytes().to_vec(),
            EepromContent::U32(number) => number.to_le_bytes().to_vec(),
        }
    }
}
