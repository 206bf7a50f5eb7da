//! SyncManagers as a network configuration file writes them (ETG.2100, protocol 8.1). Such a file overrides the SII.

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

/// A SyncManager as a configuration file writes it. Its registers are written as given; PDO assignment and mapping are
/// done by the file's own start-up commands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DeclaredSyncManager {
    /// Its number.
    pub index: u8,
    /// Its purpose.
    pub role: SyncManagerRole,
    /// Start, length, control and activate byte; the other two are left 0. A disabled SyncManager has no place in the
    /// process image.
    pub register: SyncManager,
    /// It is enabled on the way to OP only, and disabled when OP is left (commands of SO and OS in the file).
    pub op_only: bool,
    /// PDOs in its area, in order; they give the places of the entries. May be empty. The entries may need less than
    /// its length.
    pub pdos: Vec<PdoMapping>,
}

impl DeclaredSyncManager {
    /// Number, direction and length in bytes of its process data; `None` for mailboxes.
    pub fn area(&self) -> Option<(u8, Direction, u16)> {
        let length = if self.register.activate.enable { self.register.length } else { 0 };
        self.role.direction().map(|direction| (self.index, direction, length))
    }
}
