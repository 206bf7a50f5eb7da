//! Bits of the ECAT and AL event registers (protocol 3.5).

/// ECAT event: DL status changed; cleared by a read.
pub(super) const EVENT_DL_STATUS: u16 = 1 << 2;
/// ECAT event: AL status written; cleared by a read.
pub(super) const EVENT_AL_STATUS: u16 = 1 << 3;
/// First of the eight ECAT events that mirror SyncManagers.
pub(super) const EVENT_SYNC_MANAGER_ECAT: u32 = 4;
/// SyncManagers with an ECAT event.
pub(super) const MIRRORED: usize = 8;
/// AL event: AL control written; cleared by a read of the PDI.
pub(super) const EVENT_AL_CONTROL: u32 = 1 << 0;
/// AL event: the activation of a SyncManager changed; cleared when the PDI reads an activate register.
pub(super) const EVENT_SYNC_MANAGER_ACTIVATION: u32 = 1 << 4;
/// AL event: the process data watchdog expired; cleared when the PDI reads the watchdog status.
pub(super) const EVENT_PROCESS_DATA_WATCHDOG: u32 = 1 << 6;
/// First of the sixteen AL events of SyncManagers.
pub(super) const EVENT_SYNC_MANAGER_PDI: u32 = 8;
