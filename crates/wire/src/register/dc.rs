//! Distributed clocks: receive times, system time, control loop, registers 0x0900..0x0936 (protocol 3.12).
//!
//! Times are [`DcTime`] and [`DcTime32`].

use crate::time::{DcTime, DcTime32};

// DC_SYSTEM_TIME, DC_RECEIVE_TIME_EPU, DC_START_TIME, DC_NEXT_SYNC1 and the latch times.
number_bytes!(DcTime(u64));
// A single receive time, and the SyncManager event times.
number_bytes!(DcTime32(u32));

/// Register DC_RECEIVE_TIME (0x0900): time at which the latching frame arrived at each port.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct DcReceiveTimes {
    /// Port 0..3, local time.
    pub ports: [DcTime32; 4],
}

impl DcReceiveTimes {
    /// Bytes of the registers.
    pub const LEN: usize = 16;

    /// From the registers' bytes.
    pub fn decode(bytes: &[u8; Self::LEN]) -> DcReceiveTimes {
        let b = bytes;
        DcReceiveTimes { ports: [0, 4, 8, 12].map(|at| DcTime32::decode(&[b[at], b[at + 1], b[at + 2], b[at + 3]])) }
    }

    /// To the registers' bytes.
    pub fn encode(&self) -> [u8; Self::LEN] {
        let mut bytes = [0; Self::LEN];
        for (port, time) in self.ports.iter().enumerate() {
            bytes[4 * port..4 * port + 4].copy_from_slice(&time.encode());
        }
        bytes
    }
}

number_register! {
    /// Register DC_SYSTEM_TIME_OFFSET (0x0920): nanoseconds from local to system time.
    DcSystemTimeOffset(i64, reset 0)
}

number_register! {
    /// Register DC_SYSTEM_TIME_DELAY (0x0928): nanoseconds from the reference clock to this SubDevice.
    DcSystemTimeDelay(u32, reset 0)
}

bit_register! {
    /// Register DC_SYSTEM_TIME_DIFFERENCE (0x092C).
    DcSystemTimeDifference(u32, reset 0) {
        /// Mean magnitude in nanoseconds, 31 bits.
        magnitude_ns: u32 = 0, 31;
        /// The local copy is equal to or ahead of the received system time.
        local_ahead: bool = 31, 1;
    }
}

impl DcSystemTimeDifference {
    /// Local copy minus received system time.
    pub const fn signed_ns(self) -> i32 {
        let magnitude = (self.magnitude_ns & 0x7FFF_FFFF) as i32;
        if self.local_ahead { magnitude } else { -magnitude }
    }
}

number_register! {
    /// Register DC_SPEED_COUNTER_START (0x0930); any write resets the filters and the mean difference.
    DcSpeedCounterStart(u16, reset 0x1000)
}

impl DcSpeedCounterStart {
    /// Smallest value allowed.
    pub const MIN: DcSpeedCounterStart = DcSpeedCounterStart(0x0080);
    /// Largest value allowed.
    pub const MAX: DcSpeedCounterStart = DcSpeedCounterStart(0x3FFF);
}

number_register! {
    /// Register DC_SPEED_COUNTER_DIFFERENCE (0x0932).
    DcSpeedCounterDifference(i16, reset 0)
}

impl DcSpeedCounterDifference {
    /// The speed deviation of the clock caused by this value, in parts per billion: Diff / (5 (Start + Diff + 2) (Start
    /// - Diff + 2)), see protocol 7.2.1. 0 if Diff exceeds the range allowed by Start.
    pub const fn deviation_ppb(self, start: DcSpeedCounterStart) -> i64 {
        let (diff, start) = (self.0 as i64, start.0 as i64);
        let product = 5 * (start + diff + 2) * (start - diff + 2);
        if product > 0 { diff * 1_000_000_000 / product } else { 0 }
    }
}

number_register! {
    /// Register DC_FILTER_DIFFERENCE (0x0934).
    DcFilterDifference(u8, reset 4)
}

number_register! {
    /// Register DC_FILTER_SPEED (0x0935).
    DcFilterSpeed(u8, reset 12)
}

bit_register! {
    /// Register DC_LATCH_MODE (0x0936).
    DcLatchMode(u8, reset 0, reserved kept) {
        /// Receive times are latched by frames in forwarding direction (0: in processing direction).
        forwarding_direction: bool = 0, 1;
    }
}
