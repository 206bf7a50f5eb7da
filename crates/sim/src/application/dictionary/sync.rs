//! Synchronisation parameters, objects 0x1C32 and 0x1C33 (ETG.1020): written by a MainDevice and updated from
//! distributed clocks.

use super::Dictionary;

/// Subindices and bits of the objects.
#[derive(Debug)]
pub struct SyncParameters;

impl SyncParameters {
    /// Subindex: synchronisation type.
    pub const TYPE: u8 = 1;
    /// Subindex: cycle time in nanoseconds.
    pub const CYCLE: u8 = 2;
    /// Subindex: cycle of SYNC0 in nanoseconds.
    pub const SYNC0_CYCLE: u8 = 10;
    /// Supported type: free run.
    pub const FREE_RUN: u16 = 1 << 0;
    /// Supported type: synchronous with the event of a SyncManager.
    pub const SYNCHRONOUS: u16 = 1 << 1;
    /// Supported type: distributed clocks with SYNC0.
    pub const SYNC0: u16 = 1 << 2;

    const OBJECTS: [u16; 2] = [0x1C32, 0x1C33];
    const TYPE_SYNCHRONOUS: u16 = 1;
    const TYPE_SYNC0: u16 = 2;
}

impl Dictionary {
    /// Updates the objects when SAFEOP is entered with SYNC0 of this cycle, or without SYNC signals.
    pub fn note_sync0(&mut self, cycle_ns: Option<u32>) {
        for index in SyncParameters::OBJECTS {
            let kept = self.read(index, SyncParameters::TYPE).ok().and_then(<[u8]>::first_chunk).copied();
            let Some(kept) = kept.map(u16::from_le_bytes) else {
                continue;
            };
            let kind = match cycle_ns {
                Some(cycle_ns) => {
                    self.set(index, SyncParameters::CYCLE, &cycle_ns.to_le_bytes());
                    SyncParameters::TYPE_SYNC0
                }
                None if kept == SyncParameters::TYPE_SYNC0 => SyncParameters::TYPE_SYNCHRONOUS,
                None => kept,
            };
            self.set(index, SyncParameters::TYPE, &kind.to_le_bytes());
            self.set(index, SyncParameters::SYNC0_CYCLE, &cycle_ns.unwrap_or(0).to_le_bytes());
        }
    }
}
