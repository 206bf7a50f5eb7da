//! Event requests and their masks, registers 0x0200..0x0223 (protocol 3.5).

bit_register! {
    /// Registers ECAT_EVENT (0x0210) and ECAT_EVENT_MASK (0x0200).
    EcatEvent(u16, reset 0, reserved kept) {
        /// DC latch.
        dc_latch: bool = 0, 1;
        /// DL status changed; cleared by reading DL_STATUS.
        dl_status: bool = 2, 1;
        /// AL status changed; cleared by reading AL_STATUS.
        al_status: bool = 3, 1;
        /// SyncManager 0..7, one bit each.
        sync_managers: u8 = 4, 8;
    }
}

bit_register! {
    /// Registers AL_EVENT (0x0220) and AL_EVENT_MASK (0x0204).
    AlEvent(u32, reset 0, reserved kept) {
        /// AL control was written.
        al_control: bool = 0, 1;
        /// DC latch.
        dc_latch: bool = 1, 1;
        /// SYNC0.
        sync0: bool = 2, 1;
        /// SYNC1.
        sync1: bool = 3, 1;
        /// The activation of a SyncManager changed; the PDI clears it by reading an activate register.
        sync_manager_activation: bool = 4, 1;
        /// An EEPROM emulation command of the MainDevice is pending.
        eeprom_emulation: bool = 5, 1;
        /// The process data watchdog has expired.
        process_data_watchdog: bool = 6, 1;
        /// SyncManager 0..15, one bit each.
        sync_managers: u16 = 8, 16;
    }
}

impl AlEvent {
    /// Value of AL_EVENT_MASK after a reset.
    pub const MASK_RESET: u32 = 0x00FF_FF0F;
}
