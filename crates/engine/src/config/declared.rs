//! SyncManagers from a network configuration file (ETG.2100, protocol 8.1). Such a file overrides the SII.

use alloc::vec::Vec;

use ringcat_wire::register::SyncManager;

use super::pdo::PdoMapping;
use crate::info::Direction;

/// Purpose of a SyncManager.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SyncManagerRole {
    /// Mailbox that the MainDevice writes.
    MailboxOut,
    /// Mailbox that the MainDevice reads.
    MailboxIn,
    /// Process data that the SubDevice receives.
    Outputs,
    /// Process data that the SubDevice sends.
    Inputs,
}

impl SyncManagerRole {
    /// Direction of process data; `None` for mailboxes.
    pub const fn direction(self) -> Option<Direction> {
        match self {
            SyncManagerRole::MailboxOut | SyncManagerRole::MailboxIn => None,
            SyncManagerRole::Outputs => Some(Direction::Outputs),
            SyncManagerRole::Inputs => Some(Direction::Inputs),
        }
    }
}

/// A SyncManager from a configuration file. Its registers are written as given; PDO assignment and mapping are part of
/// the start-up commands of the file.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub struct DeclaredSyncManager {
    /// Its number.
    pub index: u8,
    /// Its purpose.
    pub role: SyncManagerRole,
    /// Start, length, control and activate byte; status and PDI control are written as 0. A disabled SyncManager has no
    /// place in the process image.
    pub register: SyncManager,
    /// It is enabled before OP is requested, and disabled when OP is left (commands of SO and OS in the file).
    pub op_only: bool,
    /// PDOs in its area, in order: they determine the places of the entries. May be empty; the entries may be shorter
    /// than its length.
    pub pdos: Vec<PdoMapping>,
}

/// Process data of a declared SyncManager.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct DeclaredArea {
    /// Number of the SyncManager.
    pub sync_manager: u8,
    /// Direction.
    pub direction: Direction,
    /// Bytes; 0 if the SyncManager is disabled.
    pub length: u16,
}

impl DeclaredSyncManager {
    /// A SyncManager without PDOs.
    pub const fn new(index: u8, role: SyncManagerRole, register: SyncManager) -> DeclaredSyncManager {
        DeclaredSyncManager { index, role, register, op_only: false, pdos: Vec::new() }
    }

    /// Sets [`DeclaredSyncManager::op_only`].
    #[must_use]
    pub const fn with_op_only(mut self, op_only: bool) -> DeclaredSyncManager {
        self.op_only = op_only;
        self
    }

    /// Sets [`DeclaredSyncManager::pdos`].
    #[must_use]
    pub fn with_pdos(mut self, pdos: Vec<PdoMapping>) -> DeclaredSyncManager {
        self.pdos = pdos;
        self
    }

    /// Its process data; `None` for mailboxes.
    pub fn area(&self) -> Option<DeclaredArea> {
        let length = if self.register.activate.enable { self.register.length } else { 0 };
        self.role.direction().map(|direction| DeclaredArea { sync_manager: self.index, direction, length })
    }
}
