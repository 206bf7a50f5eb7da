//! The plan of one SubDevice: SyncManagers, areas of process data, and their mapping.

use alloc::vec::Vec;

use ringcat_wire::address::{RegisterAddress, StationAddress};
use ringcat_wire::register::SyncManager;
use ringcat_wire::sii::MailboxLayout;

use super::error::PlanWarning;
use super::sdos::PdoPlan;
use crate::info::Direction;

/// A SyncManager to write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct SmPlan {
    /// Its number.
    pub index: u8,
    /// Its registers.
    pub register: SyncManager,
}

/// An entry of a PDO and its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct MappedEntry {
    /// Index of the object; 0 is a gap.
    pub index: u16,
    /// Subindex of the object.
    pub sub_index: u8,
    /// First bit, counted from the start of the area.
    pub bit_offset: u32,
    /// Length in bits.
    pub bit_length: u8,
}

/// A PDO in an area.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct MappedPdo {
    /// Index of the PDO mapping object.
    pub index: u16,
    /// Its entries in order, gaps included.
    pub entries: Vec<MappedEntry>,
}

/// The process data of one SyncManager.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct AreaPlan {
    /// The SyncManager.
    pub sync_manager: u8,
    /// Its direction.
    pub direction: Direction,
    /// First physical byte.
    pub physical: u16,
    /// Length in bytes; 0 if the SyncManager is disabled and needs no FMMU.
    pub length: u16,
    /// Registers of the SyncManager.
    pub register: SyncManager,
    /// Enabled before OP is requested, not before SAFEOP (protocol 4.4).
    pub op_only: bool,
    /// Its PDOs; none if the SII contains only a length.
    pub pdos: Vec<MappedPdo>,
}

/// Values to write to a SubDevice.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct SubDevicePlan {
    /// Its station address.
    pub station: StationAddress,
    /// Mailbox SyncManagers for PREOP, first that of the mailbox that the MainDevice writes. None or two.
    pub mailbox: Vec<SmPlan>,
    /// Mailbox SyncManagers for BOOT. None or two.
    pub bootstrap: Vec<SmPlan>,
    /// Process data areas by SyncManager number. Each area has an FMMU unless its length is 0.
    pub process_data: Vec<AreaPlan>,
    /// SyncManagers of the controller to disable before SAFEOP: neither mailbox nor process data.
    pub unused: Vec<u8>,
    /// PDOs of the dictionary, compared and written after the start-up commands of PREOP.
    pub pdos: Vec<PdoPlan>,
    /// The SubDevice supports LRW.
    pub lrw_supported: bool,
    /// Watchdog registers to write before SAFEOP.
    pub watchdog: Vec<(RegisterAddress, Vec<u8>)>,
    /// Declarations that the SII does not permit, or that it completes.
    pub warnings: Vec<PlanWarning>,
}

impl SubDevicePlan {
    /// Areas that need an FMMU, with the FMMU's number, in the order of the SyncManagers.
    pub(crate) fn mapped_areas(&self) -> impl Iterator<Item = (u8, &AreaPlan)> {
        (0..).zip(self.process_data.iter().filter(|area| area.length > 0))
    }

    /// Whether some of its SyncManagers are for OP only: then no process data is exchanged before OP.
    pub fn is_op_only(&self) -> bool {
        self.mapped_areas().any(|(_, area)| area.op_only)
    }

    /// Mailboxes from PREOP on; `None` if there are none.
    pub fn mailbox_layout(&self) -> Option<MailboxLayout> {
        layout_of(&self.mailbox)
    }

    /// Mailboxes in BOOT; `None` if there are none.
    pub fn bootstrap_layout(&self) -> Option<MailboxLayout> {
        layout_of(&self.bootstrap)
    }
}

fn layout_of(pair: &[SmPlan]) -> Option<MailboxLayout> {
    let [out, inward] = pair else { return None };
    Some(MailboxLayout {
        receive_offset: out.register.start,
        receive_size: out.register.length,
        send_offset: inward.register.start,
        send_size: inward.register.length,
    })
}
