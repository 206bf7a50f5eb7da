//! Watchdogs, registers 0x0400..0x0443 (protocol 3.7).

/// Nanoseconds of one tick of the watchdog divider.
const TICK_NS: u64 = 40;

number_register! {
    /// Register WATCHDOG_DIVIDER (0x0400).
    WatchdogDivider(u16, reset 0x09C2)
}

impl WatchdogDivider {
    /// Length of a unit of the watchdog times; 100 us after a reset.
    pub const fn unit_ns(self) -> u64 {
        (self.0 as u64 + 2) * TICK_NS
    }
}

number_register! {
    /// Registers WATCHDOG_TIME_PDI (0x0410) and WATCHDOG_TIME_PROCESS_DATA (0x0420), in units of the divider.
    WatchdogTime(u16, reset 0x03E8)
}

impl WatchdogTime {
    /// The time; `None` if the watchdog is disabled.
    pub const fn duration_ns(self, divider: WatchdogDivider) -> Option<u64> {
        match self.0 {
            0 => None,
            units => Some(units as u64 * divider.unit_ns()),
        }
    }
}

bit_register! {
    /// Register WATCHDOG_STATUS (0x0440).
    WatchdogStatus(u16, reset 0, reserved kept) {
        /// The process data watchdog runs or is disabled (0: expired).
        process_data_ok: bool = 0, 1;
    }
}

/// Registers WATCHDOG_COUNTER_PROCESS_DATA (0x0442) and WATCHDOG_COUNTER_PDI (0x0443). They saturate; a write clears
/// both.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct WatchdogCounters {
    /// Expirations of the process data watchdog.
    pub process_data: u8,
    /// Expirations of the PDI watchdog.
    pub pdi: u8,
}

impl WatchdogCounters {
    /// Bytes of the registers.
    pub const LEN: usize = 2;

    /// From the registers' bytes.
    pub const fn decode(bytes: &[u8; Self::LEN]) -> WatchdogCounters {
        WatchdogCounters { process_data: bytes[0], pdi: bytes[1] }
    }

    /// To the registers' bytes.
    pub const fn encode(&self) -> [u8; Self::LEN] {
        [self.process_data, self.pdi]
    }
}
