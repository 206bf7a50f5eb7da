//! Which functions are refused in which role and phase, as one table (protocol 9.11).
//!
//! In: a function, the role of the MainDevice, and its phase. Out: whether it is allowed, or the error that names
//! function, role and reason. Functions are checked where they start, and nowhere else: `MainDevice::permit` for all,
//! and the mailbox where a conversation begins. A further phase is a further column of `Row`, a further role a
//! further arm of [`Function::permission`]: each function needs an entry then, because neither has a default.

mod control;
#[cfg(feature = "standby")]
mod partner;

use core::fmt;

#[cfg(feature = "standby")]
pub(crate) use control::Taken;
pub use control::{Requester, RoleCause, RoleControl, RoleRequest};
#[cfg(feature = "standby")]
pub use partner::Partner;

/// What the MainDevice does as a whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum MainDevicePhase {
    /// No link has a carrier: nothing can be sent.
    Orphaned,
    /// No application is active.
    Idle,
    /// An application is active.
    Operation,
}

/// Role of the MainDevice on its segment (protocol 9.6, 9.11).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum MainDeviceRole {
    /// It controls the segment.
    #[default]
    Active,
    /// Another MainDevice controls the segment: functions that need the bus are refused, and nothing runs.
    Inactive,
}

impl fmt::Display for MainDeviceRole {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            MainDeviceRole::Active => "ACTIVE",
            MainDeviceRole::Inactive => "INACTIVE",
        })
    }
}

macro_rules! functions {
    ($($(#[$doc:meta])* $name:ident,)*) => {
        /// A function of the MainDevice, or a group of functions that are refused together.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[non_exhaustive]
        pub enum Function {
            $($(#[$doc])* $name,)*
        }

        impl Function {
            /// All of them.
            pub const ALL: &[Function] = &[$(Function::$name,)*];
        }
    };
}

functions! {
    /// SDO transfers of a SubDevice, in calls, and while active in requests of a cyclic thread. Both reach SubDevices
    /// without a declaration, with idle operation.
    SdoTransfer,
    /// SDO information: object lists and descriptions.
    ObjectDictionary,
    /// PDOs by mailbox.
    PdoByMailbox,
    /// FoE.
    FileTransfer,
    /// SoE, procedure commands included.
    SoeAccess,
    /// AoE.
    AoeAccess,
    /// VoE.
    VendorMessage,
    /// Mailbox messages that the application or a gateway client composes.
    RawMailbox,
    /// Ethernet frames through mailboxes.
    Ethernet,
    /// A state of one SubDevice.
    SubDeviceState,
    /// A state of all.
    StateOfAll,
    /// AL control without the sequence of states.
    ForcedState,
    /// Datagrams of the application.
    RawDatagrams,
    /// Ethernet debug messages.
    DebugMessage,
    /// Registers and memory, read and written.
    Registers,
    /// EEPROM: read, written, the alias, reloaded.
    Eeprom,
    /// Owner of the EEPROM: read and assigned.
    EepromOwner,
    /// A scan that puts all SubDevices into INIT.
    Scan,
    /// A scan that disturbs no SubDevice; without an application with idle operation only.
    Rescan,
    /// A check of all SubDevices as after a change of the segment.
    ForceTopologyChange,
    /// Loop control of a port.
    PortState,
    /// A declared SubDevice cut off by the ports of its neighbours, and these ports opened again.
    BlockedPorts,
    /// Reset of a controller.
    ControllerReset,
    /// Ports of all SubDevices: links, receive times, error counters.
    PortReport,
    /// Error counters of a declared SubDevice: read, cleared.
    Statistics,
    /// Data that the scan left out of the SIIs.
    SiiCompletion,
    /// A declaration is activated.
    Activate,
    /// A declaration that follows the ACTIVE MainDevice; in role INACTIVE only.
    Follow,
    /// The application ends, the scan is kept.
    Deactivate,
    /// All SubDevices are stopped.
    Stop,
    /// Data of the scan: identity, mailboxes, PDOs.
    SubDeviceInfo,
    /// Presence, states, ring, clocks, as last seen.
    Status,
    /// Objects of the MainDevice itself.
    OwnObjects,
    /// Events, their clients, snapshots.
    Events,
    /// Interval of error counters, log levels, retries.
    Settings,
}

/// Whether a function can be called in a role and a phase.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Permission {
    /// It does its work; without a SubDevice that answers it fails.
    Allowed,
    /// It is refused before anything is sent, and nothing changes.
    Refused,
}

/// Why a function is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Denial {
    /// It needs the bus, which another MainDevice controls.
    NeedsTheBus,
    /// It needs another MainDevice that controls the bus.
    NothingToFollow,
    /// An application is active.
    InOperation,
    /// No application is active.
    WithoutApplication,
}

/// A function was called in a role or a phase in which it is refused. Nothing was sent, and nothing has changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct NotPermitted {
    /// The function.
    pub function: Function,
    /// The role of the MainDevice.
    pub role: MainDeviceRole,
    /// The reason.
    pub denial: Denial,
}

impl fmt::Display for NotPermitted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let NotPermitted { function, role, denial } = self;
        let reason = match denial {
            Denial::NeedsTheBus => "it needs the bus, which another MainDevice controls",
            Denial::NothingToFollow => "this MainDevice controls the bus itself",
            Denial::InOperation => "an application is active",
            Denial::WithoutApplication => "no application is active",
        };
        write!(f, "{function:?} is refused in role {role}: {reason}")
    }
}

impl core::error::Error for NotPermitted {}

/// The permissions of one function in role ACTIVE, a column per phase.
struct Row {
    orphaned: Permission,
    idle: Permission,
    operation: Permission,
}

impl Function {
    /// Whether it sends frames to SubDevices: it then needs the role that controls the bus (protocol 9.11).
    pub const fn needs_the_bus(self) -> bool {
        use Function as F;
        match self {
            F::SdoTransfer | F::ObjectDictionary | F::PdoByMailbox | F::FileTransfer | F::SoeAccess => true,
            F::AoeAccess | F::VendorMessage | F::RawMailbox | F::Ethernet => true,
            F::SubDeviceState | F::StateOfAll | F::ForcedState | F::RawDatagrams | F::DebugMessage => true,
            F::Registers | F::Eeprom | F::EepromOwner | F::Scan | F::Rescan | F::ForceTopologyChange => true,
            F::PortState | F::BlockedPorts | F::ControllerReset | F::PortReport | F::Statistics => true,
            F::SiiCompletion | F::Activate | F::Deactivate | F::Stop | F::SubDeviceInfo => true,
            F::Status | F::OwnObjects | F::Events | F::Settings | F::Follow => false,
        }
    }

    const fn row(self) -> Row {
        use Permission::{Allowed, Refused};
        const ALWAYS: Row = Row { orphaned: Allowed, idle: Allowed, operation: Allowed };
        const ACTIVE: Row = Row { orphaned: Refused, idle: Refused, operation: Allowed };
        const WITHOUT: Row = Row { orphaned: Allowed, idle: Allowed, operation: Refused };
        use Function as F;
        match self {
            F::SdoTransfer | F::ObjectDictionary | F::PdoByMailbox | F::FileTransfer | F::SoeAccess => ALWAYS,
            F::AoeAccess | F::VendorMessage | F::RawMailbox | F::Ethernet => ALWAYS,
            F::SubDeviceState | F::StateOfAll | F::ForcedState | F::RawDatagrams | F::DebugMessage => ALWAYS,
            F::Registers | F::Eeprom | F::EepromOwner | F::PortState | F::ControllerReset | F::PortReport => ALWAYS,
            F::SiiCompletion | F::Rescan | F::Stop | F::SubDeviceInfo | F::BlockedPorts => ALWAYS,
            F::Status | F::OwnObjects | F::Events | F::Settings => ALWAYS,
            F::Scan | F::Activate | F::Follow => WITHOUT,
            F::ForceTopologyChange | F::Statistics | F::Deactivate => ACTIVE,
        }
    }

    /// Whether it can be called in a role, while the MainDevice is in a phase.
    pub const fn permission(self, role: MainDeviceRole, phase: MainDevicePhase) -> Permission {
        let Row { orphaned, idle, operation } = self.row();
        match (role, phase) {
            (MainDeviceRole::Inactive, _) if self.needs_the_bus() => Permission::Refused,
            (MainDeviceRole::Active, _) if matches!(self, Function::Follow) => Permission::Refused,
            (MainDeviceRole::Active | MainDeviceRole::Inactive, MainDevicePhase::Orphaned) => orphaned,
            (MainDeviceRole::Active | MainDeviceRole::Inactive, MainDevicePhase::Idle) => idle,
            (MainDeviceRole::Active | MainDeviceRole::Inactive, MainDevicePhase::Operation) => operation,
        }
    }

    /// Whether the role alone allows it.
    ///
    /// # Errors
    /// [`NotPermitted`].
    pub fn check_role(self, role: MainDeviceRole) -> Result<(), NotPermitted> {
        match role {
            MainDeviceRole::Inactive if self.needs_the_bus() => {
                Err(NotPermitted { function: self, role, denial: Denial::NeedsTheBus })
            }
            MainDeviceRole::Active if self == Function::Follow => {
                Err(NotPermitted { function: self, role, denial: Denial::NothingToFollow })
            }
            MainDeviceRole::Active | MainDeviceRole::Inactive => Ok(()),
        }
    }

    /// Whether role and phase allow it.
    ///
    /// # Errors
    /// [`NotPermitted`].
    pub fn check(self, role: MainDeviceRole, phase: MainDevicePhase) -> Result<(), NotPermitted> {
        self.check_role(role)?;
        let denial = match self.permission(role, phase) {
            Permission::Allowed => return Ok(()),
            Permission::Refused if phase == MainDevicePhase::Operation => Denial::InOperation,
            Permission::Refused => Denial::WithoutApplication,
        };
        Err(NotPermitted { function: self, role, denial })
    }
}
