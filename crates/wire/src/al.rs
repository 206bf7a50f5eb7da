//! The EtherCAT state machine in registers: AL control, AL status, AL status codes, allowed transitions (protocol 3.4,
//! 5.1, 5.3, 5.5).

use core::fmt;

/// State of the EtherCAT state machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum AlState {
    /// INIT: registers only.
    Init = 1,
    /// PREOP: mailbox.
    PreOp = 2,
    /// BOOT: firmware update.
    Boot = 3,
    /// SAFEOP: inputs valid, outputs in the safe state.
    SafeOp = 4,
    /// OP: inputs and outputs.
    Op = 8,
}

impl AlState {
    /// All states in the order of their codes.
    pub const ALL: [AlState; 5] = [AlState::Init, AlState::PreOp, AlState::Boot, AlState::SafeOp, AlState::Op];

    /// The state of a state nibble; `None` for a code that is no state, such as the OR of several states.
    pub const fn from_code(code: u8) -> Option<AlState> {
        match code {
            1 => Some(AlState::Init),
            2 => Some(AlState::PreOp),
            3 => Some(AlState::Boot),
            4 => Some(AlState::SafeOp),
            8 => Some(AlState::Op),
            _ => None,
        }
    }

    /// The state nibble.
    pub const fn code(self) -> u8 {
        self as u8
    }
}

impl fmt::Display for AlState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            AlState::Init => "INIT",
            AlState::PreOp => "PREOP",
            AlState::Boot => "BOOT",
            AlState::SafeOp => "SAFEOP",
            AlState::Op => "OP",
        })
    }
}

/// Whether a SubDevice in state `from` may be requested to change to `to` (protocol 5.1). Requesting the current state
/// is allowed.
pub const fn transition_allowed(from: AlState, to: AlState) -> bool {
    use AlState::{Boot, Init, Op, PreOp, SafeOp};
    match from {
        Init => matches!(to, Init | PreOp | Boot),
        PreOp => matches!(to, Init | PreOp | SafeOp),
        Boot => matches!(to, Init | Boot),
        SafeOp => matches!(to, Init | PreOp | SafeOp | Op),
        Op => matches!(to, Init | PreOp | SafeOp | Op),
    }
}

const STATE_MASK: u16 = 0x000F;
const BIT_4: u16 = 0x0010;
const BIT_5: u16 = 0x0020;
const RESERVED_MASK: u16 = 0xFFC0;

const fn flag(set: bool, mask: u16) -> u16 {
    if set { mask } else { 0 }
}

/// Register AL_CONTROL (0x0120): the state requested by the MainDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct AlControl {
    /// Requested state: the nibble on the wire.
    pub state: u8,
    /// Acknowledge the error of AL status.
    pub acknowledge: bool,
    /// Requests the device identification in the AL status code.
    pub identification: bool,
    /// Bits 15:6, not shifted.
    pub reserved: u16,
}

impl AlControl {
    /// Bytes of the register.
    pub const LEN: usize = 2;
    /// Value after a reset.
    pub const RESET: u16 = 0x0001;

    /// A plain request for a state.
    pub const fn new(state: AlState) -> AlControl {
        AlControl { state: state.code(), acknowledge: false, identification: false, reserved: 0 }
    }

    /// A request for a state that acknowledges an error.
    pub const fn with_acknowledge(state: AlState) -> AlControl {
        AlControl { state: state.code(), acknowledge: true, identification: false, reserved: 0 }
    }

    /// From the register's value.
    pub const fn from_bits(bits: u16) -> AlControl {
        AlControl {
            state: (bits & STATE_MASK) as u8,
            acknowledge: bits & BIT_4 != 0,
            identification: bits & BIT_5 != 0,
            reserved: bits & RESERVED_MASK,
        }
    }

    /// The register's value. States above 15 lose their upper bits.
    pub const fn bits(self) -> u16 {
        self.state as u16 & STATE_MASK
            | flag(self.acknowledge, BIT_4)
            | flag(self.identification, BIT_5)
            | self.reserved & RESERVED_MASK
    }

    /// The requested state, if the nibble is a state.
    pub const fn al_state(self) -> Option<AlState> {
        AlState::from_code(self.state)
    }

    /// From the register's bytes.
    pub const fn decode(bytes: &[u8; Self::LEN]) -> AlControl {
        Self::from_bits(u16::from_le_bytes(*bytes))
    }

    /// To the register's bytes.
    pub const fn encode(&self) -> [u8; Self::LEN] {
        self.bits().to_le_bytes()
    }
}

/// Register AL_STATUS (0x0130): the current state of the SubDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct AlStatus {
    /// Current state: the nibble on the wire; after a broadcast read the OR of all SubDevices.
    pub state: u8,
    /// The SubDevice refused a request or left its state; AL_STATUS_CODE contains the reason.
    pub error: bool,
    /// The device identification is in AL_STATUS_CODE.
    pub identification: bool,
    /// Bits 15:6, not shifted.
    pub reserved: u16,
}

impl AlStatus {
    /// Bytes of the register.
    pub const LEN: usize = 2;
    /// Value after a reset.
    pub const RESET: u16 = 0x0001;

    /// A state without error.
    pub const fn new(state: AlState) -> AlStatus {
        AlStatus { state: state.code(), error: false, identification: false, reserved: 0 }
    }

    /// A state with the error bit.
    pub const fn with_error(state: AlState) -> AlStatus {
        AlStatus { state: state.code(), error: true, identification: false, reserved: 0 }
    }

    /// From the register's value.
    pub const fn from_bits(bits: u16) -> AlStatus {
        AlStatus {
            state: (bits & STATE_MASK) as u8,
            error: bits & BIT_4 != 0,
            identification: bits & BIT_5 != 0,
            reserved: bits & RESERVED_MASK,
        }
    }

    /// The register's value. States above 15 lose their upper bits.
    pub const fn bits(self) -> u16 {
        self.state as u16 & STATE_MASK
            | flag(self.error, BIT_4)
            | flag(self.identification, BIT_5)
            | self.reserved & RESERVED_MASK
    }

    /// The current state, if the nibble is a state.
    pub const fn al_state(self) -> Option<AlState> {
        AlState::from_code(self.state)
    }

    /// From the register's bytes.
    pub const fn decode(bytes: &[u8; Self::LEN]) -> AlStatus {
        Self::from_bits(u16::from_le_bytes(*bytes))
    }

    /// To the register's bytes.
    pub const fn encode(&self) -> [u8; Self::LEN] {
        self.bits().to_le_bytes()
    }
}

impl fmt::Display for AlStatus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.al_state() {
            Some(state) => write!(f, "{state}")?,
            None => write!(f, "state {:#x}", self.state)?,
        }
        if self.error { f.write_str("+ERROR") } else { Ok(()) }
    }
}

/// Register AL_STATUS_CODE (0x0134): the reason for which a SubDevice refused a request or left its state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct AlStatusCode(pub u16);

macro_rules! al_status_codes {
    ($($name:ident = $code:literal, $text:literal;)*) => {
        impl AlStatusCode {
            $(
                #[doc = concat!(stringify!($code), ": ", $text, ".")]
                pub const $name: AlStatusCode = AlStatusCode($code);
            )*

            /// The codes that have a name, in ascending order (protocol 5.5).
            pub const ALL: &'static [AlStatusCode] = &[$(AlStatusCode::$name),*];

            /// The meaning of the code; `None` if the standard does not define it (see
            /// [`AlStatusCode::is_vendor_specific`]).
            pub const fn name(self) -> Option<&'static str> {
                match self {
                    $(AlStatusCode::$name => Some($text),)*
                    _ => None,
                }
            }
        }
    };
}

al_status_codes! {
    NO_ERROR = 0x0000, "no error";
    UNSPECIFIED = 0x0001, "unspecified error";
    NO_MEMORY = 0x0002, "no memory";
    INVALID_DEVICE_SETUP = 0x0003, "invalid device setup";
    INVALID_REVISION = 0x0004, "invalid revision";
    SII_FIRMWARE_MISMATCH = 0x0006, "SII does not match firmware";
    FIRMWARE_UPDATE_FAILED = 0x0007, "firmware update failed, old firmware runs";
    LICENSE_ERROR = 0x000E, "license error";
    INVALID_STATE_CHANGE = 0x0011, "invalid state change requested";
    UNKNOWN_STATE = 0x0012, "unknown state requested";
    BOOT_NOT_SUPPORTED = 0x0013, "BOOT not supported";
    NO_VALID_FIRMWARE = 0x0014, "no valid firmware";
    INVALID_MAILBOX_CONFIGURATION_BOOT = 0x0015, "invalid mailbox configuration (BOOT)";
    INVALID_MAILBOX_CONFIGURATION_PREOP = 0x0016, "invalid mailbox configuration (PREOP)";
    INVALID_SYNC_MANAGER_CONFIGURATION = 0x0017, "invalid SM configuration";
    NO_VALID_INPUTS = 0x0018, "no valid inputs";
    NO_VALID_OUTPUTS = 0x0019, "no valid outputs";
    SYNCHRONISATION_ERROR = 0x001A, "synchronisation error";
    SYNC_MANAGER_WATCHDOG = 0x001B, "SM watchdog";
    INVALID_SYNC_MANAGER_TYPES = 0x001C, "invalid SM types";
    INVALID_OUTPUT_CONFIGURATION = 0x001D, "invalid output configuration";
    INVALID_INPUT_CONFIGURATION = 0x001E, "invalid input configuration";
    INVALID_WATCHDOG_CONFIGURATION = 0x001F, "invalid watchdog configuration";
    NEEDS_COLD_START = 0x0020, "needs cold start";
    NEEDS_INIT = 0x0021, "needs INIT";
    NEEDS_PREOP = 0x0022, "needs PREOP";
    NEEDS_SAFEOP = 0x0023, "needs SAFEOP";
    INVALID_INPUT_MAPPING = 0x0024, "invalid input mapping";
    INVALID_OUTPUT_MAPPING = 0x0025, "invalid output mapping";
    INCONSISTENT_SETTINGS = 0x0026, "inconsistent settings";
    FREE_RUN_NOT_SUPPORTED = 0x0027, "free run not supported";
    SYNCHRONOUS_MODE_NOT_SUPPORTED = 0x0028, "synchronous mode not supported";
    FREE_RUN_NEEDS_THREE_BUFFERS = 0x0029, "free run needs three-buffer mode";
    BACKGROUND_WATCHDOG = 0x002A, "background watchdog";
    NO_VALID_INPUTS_AND_OUTPUTS = 0x002B, "no valid inputs and outputs";
    FATAL_SYNC_ERROR = 0x002C, "fatal sync error";
    NO_SYNC = 0x002D, "no sync";
    CYCLE_TIME_TOO_SMALL = 0x002E, "cycle time too small";
    INVALID_DC_SYNC_CONFIGURATION = 0x0030, "invalid DC SYNC configuration";
    INVALID_DC_LATCH_CONFIGURATION = 0x0031, "invalid DC latch configuration";
    PLL_ERROR = 0x0032, "PLL error";
    DC_SYNC_IO_ERROR = 0x0033, "DC sync IO error";
    DC_SYNC_TIMEOUT = 0x0034, "DC sync timeout";
    DC_INVALID_SYNC_CYCLE_TIME = 0x0035, "DC invalid sync cycle time";
    DC_SYNC0_CYCLE_TIME = 0x0036, "DC SYNC0 cycle time";
    DC_SYNC1_CYCLE_TIME = 0x0037, "DC SYNC1 cycle time";
    MAILBOX_AOE = 0x0041, "mailbox AoE";
    MAILBOX_EOE = 0x0042, "mailbox EoE";
    MAILBOX_COE = 0x0043, "mailbox CoE";
    MAILBOX_FOE = 0x0044, "mailbox FoE";
    MAILBOX_SOE = 0x0045, "mailbox SoE";
    MAILBOX_VOE = 0x004F, "mailbox VoE";
    EEPROM_NO_ACCESS = 0x0050, "EEPROM no access";
    EEPROM_ERROR = 0x0051, "EEPROM error";
    EXTERNAL_HARDWARE_NOT_READY = 0x0052, "external hardware not ready";
    RESTARTED_LOCALLY = 0x0060, "restarted locally";
    DEVICE_IDENTIFICATION_UPDATED = 0x0061, "device identification value updated";
    MODULES_DO_NOT_MATCH = 0x0070, "detected modules do not match";
    SUPPLY_VOLTAGE_LOW = 0x0080, "supply voltage too low";
    SUPPLY_VOLTAGE_HIGH = 0x0081, "supply voltage too high";
    TEMPERATURE_LOW = 0x0082, "temperature too low";
    TEMPERATURE_HIGH = 0x0083, "temperature too high";
    APPLICATION_CONTROLLER_AVAILABLE = 0x00F0, "application controller available";
}

impl AlStatusCode {
    /// Bytes of the register.
    pub const LEN: usize = 2;

    /// Whether the code belongs to the vendor's range (0x8000 and above).
    pub const fn is_vendor_specific(self) -> bool {
        self.0 >= 0x8000
    }

    /// From the register's bytes.
    pub const fn decode(bytes: &[u8; Self::LEN]) -> AlStatusCode {
        AlStatusCode(u16::from_le_bytes(*bytes))
    }

    /// To the register's bytes.
    pub const fn encode(&self) -> [u8; Self::LEN] {
        self.0.to_le_bytes()
    }
}

impl fmt::Display for AlStatusCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:#06x} ", self.0)?;
        f.write_str(match self.name() {
            Some(name) => name,
            None if self.is_vendor_specific() => "vendor specific",
            None => "unknown code",
        })
    }
}

#[cfg(test)]
mod tests;
