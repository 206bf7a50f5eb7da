//! SyncManagers as a network configuration file writes them (ETG.2100, protocol 8.1): such a file counts before the
//! SII.

use alloc::vec::Vec;

use ringcat_wire::register::SyncManager;

use super::pdo::PdoMapping;
use crate::info::Direction;

/// What a SyncManager is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SyncManagerRole {
    /// Mailbox that the MainDevice writes.
    MailboxOut,
    /// Mailbox that the MainDevice reads.
    MailboxIn,
    /// Process data that the SubDevice takes.
    Outputs,
    /// Process data that the SubDevice gives.
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

/// A SyncManager as a configuration file writes it. Its registers are written as they are; PDO assignment and mapping
/// are the matter of the file's own start-up commands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DeclaredSyncManager {
    /// Its number.
    pub index: u8,
    /// What it is for.
    pub role: SyncManagerRole,
    /// Start, length, control and activate byte; the other two are left 0. One that is not enabled has no place in the
    /// process image.
    pub register: SyncManager,
    /// It is switched on on the way to OP only, and off when OP is left (commands of SO and OS in the file).
    pub op_only: bool,
    /// PDOs in its area, in order: where entries lie. May be empty; with entries they need no more than its length.
    pub pdos: Vec<PdoMapping>,
}

impl DeclaredSyncManager {
    /// Bytes of process data with their direction; `None` for mailboxes.
    pub fn area(&self) -> Option<(u8, Direction, u16)> {
        let length = if self.register.activate.enable { self.register.length } else { 0 };
        self.role.direction().map(|direction| (self.index, direction, length))
    }
}
