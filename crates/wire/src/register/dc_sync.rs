//! Distributed clocks: SYNC and LATCH units, registers 0x0980..0x09FF (protocol 3.12; bits of the activation and SYNC
//! status registers from the data sheet's register description).

bit_register! {
    /// Register DC_CYCLIC_UNIT_CONTROL (0x0980): units controlled by the PDI (0: by EtherCAT).
    DcCyclicUnitControl(u8, reset 0, reserved kept) {
        /// SYNC unit.
        sync_by_pdi: bool = 0, 1;
        /// Latch 0.
        latch0_by_pdi: bool = 4, 1;
        /// Latch 1.
        latch1_by_pdi: bool = 5, 1;
    }
}

bit_register! {
    /// Register DC_ACTIVATION (0x0981).
    DcActivation(u8, reset 0) {
        /// The cyclic unit runs.
        cyclic_unit: bool = 0, 1;
        /// SYNC0 is generated.
        sync0: bool = 1, 1;
        /// SYNC1 is generated.
        sync1: bool = 2, 1;
        /// Activated by writing the start time.
        auto_activation: bool = 3, 1;
        /// The start time is extended from 32 to 64 bits.
        extend_start_time: bool = 4, 1;
        /// The start time is checked for plausibility.
        start_plausibility: bool = 5, 1;
        /// Selects the near future of the plausibility check.
        near_future_select: bool = 6, 1;
        /// Debug pulse on both SYNC signals.
        debug_pulse: bool = 7, 1;
    }
}

number_register! {
    /// Register DC_PULSE_LENGTH (0x0982) in units of 10 ns; 0 is the acknowledge mode.
    DcPulseLength(u16, reset 0)
}

impl DcPulseLength {
    /// The length; `None` in acknowledge mode.
    pub const fn duration_ns(self) -> Option<u32> {
        match self.0 {
            0 => None,
            units => Some(units as u32 * 10),
        }
    }
}

bit_register! {
    /// Register DC_ACTIVATION_STATUS (0x0984).
    DcActivationStatus(u8, reset 0, reserved kept) {
        /// SYNC0 waits for its first pulse or runs.
        sync0_pending: bool = 0, 1;
        /// SYNC1 waits for its first pulse or runs.
        sync1_pending: bool = 1, 1;
        /// The start time was not in the near future.
        start_implausible: bool = 2, 1;
    }
}

bit_register! {
    /// Registers DC_SYNC0_STATUS (0x098E) and DC_SYNC1_STATUS (0x098F).
    DcSyncStatus(u8, reset 0, reserved kept) {
        /// State of the signal in acknowledge mode.
        active: bool = 0, 1;
    }
}

number_register! {
    /// Registers DC_SYNC0_CYCLE (0x09A0; 0 is a single shot) and DC_SYNC1_CYCLE (0x09A4), in nanoseconds.
    DcSyncCycle(u32, reset 0)
}

bit_register! {
    /// Registers DC_LATCH0_CONTROL (0x09A8) and DC_LATCH1_CONTROL (0x09A9).
    DcLatchControl(u8, reset 0, reserved kept) {
        /// Only the first positive edge is latched (0: each).
        positive_single: bool = 0, 1;
        /// Only the first negative edge is latched (0: each).
        negative_single: bool = 1, 1;
    }
}

bit_register! {
    /// Registers DC_LATCH0_STATUS (0x09AE) and DC_LATCH1_STATUS (0x09AF).
    DcLatchStatus(u8, reset 0, reserved kept) {
        /// A positive edge was latched.
        positive_event: bool = 0, 1;
        /// A negative edge was latched.
        negative_event: bool = 1, 1;
        /// State of the pin.
        pin: bool = 2, 1;
    }
}
