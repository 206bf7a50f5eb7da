//! Bits of the ECAT and AL event registers (protocol 3.5).

/// ECAT event: DL status changed; cleared by reading it.
pub(super) const EVENT_DL_STATUS: u16 = 1 << 2;
/// ECAT event: AL status written; cleared by reading it.
pub(super) const EVENT_AL_STATUS: u16 = 1 << 3;
/// First of the eight ECAT events that mirror SyncManagers.
pub(super) const EVENT_SYNC_MANAGER_ECAT: u32 = 4;
/// SyncManagers with an ECAT event.
pub(super) const MIRRORED: usize = 8;
/// AL event: AL control written; cleared by the PDI reading it.
pub(super) const EVENT_AL_CONTROL: u32 = 1 << 0;
/// AL event: a SyncManager's activation changed; cleared by the PDI reading an activate register.
pub(super) const EVENT_SYNC_MANAGER_ACTIVATION: u32 = 1 << 4;
/// AL event: the process data watchdog expired; cleared by the PDI reading the watchdog status.
pub(super) const EVENT_PROCESS_DATA_WATCHDOG: u32 = 1 << 6;
/// First of the sixteen AL events of SyncManagers.
pub(super) const EVENT_SYNC_MANAGER_PDI: u32 = 8;
