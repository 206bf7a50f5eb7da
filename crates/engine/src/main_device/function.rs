//! Which functions are refused in which role, as one table (protocol 9.11).
//!
//! The roles are the phases of the MainDevice. A further role is a further column of [`Row`]: each function needs an
//! entry then, because a row has no defaults. A role that may not send (9.11: INACTIVE) refuses what
//! [`Function::needs_the_bus`].

use super::states::MainDevicePhase;

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
    /// A scan that disturbs no SubDevice.
    Rescan,
    /// A check of all SubDevices as after a change of the segment.
    ForceTopologyChange,
    /// Loop control of a port.
    PortState,
    /// A SubDevice cut off by the ports of its neighbours, and these ports opened again.
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

/// Whether a function can be called in a role.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Permission {
    /// It does its work; without a SubDevice that answers it fails.
    Allowed,
    /// It is refused before anything is sent, and nothing changes.
    Refused,
}

/// The permissions of one function, a column per role.
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
            F::Status | F::OwnObjects | F::Events | F::Settings => false,
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
            F::SiiCompletion | F::Stop | F::SubDeviceInfo => ALWAYS,
            F::Status | F::OwnObjects | F::Events | F::Settings => ALWAYS,
            F::Scan | F::Activate => WITHOUT,
            F::Rescan | F::ForceTopologyChange | F::BlockedPorts | F::Statistics | F::Deactivate => ACTIVE,
        }
    }

    /// Whether it can be called while the MainDevice is in a phase.
    pub const fn permission(self, phase: MainDevicePhase) -> Permission {
        let Row { orphaned, idle, operation } = self.row();
        match phase {
            MainDevicePhase::Orphaned => orphaned,
            MainDevicePhase::Idle => idle,
            MainDevicePhase::Operation => operation,
        }
    }
}

impl super::MainDevice {
    /// Whether a function can be called now.
    pub fn permission(&self, function: Function) -> Permission {
        function.permission(self.phase())
    }
}
