//! Time on the bus.

/// Distributed-clocks system time: nanoseconds since 2000-01-01T00:00:00 (protocol 3.12).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct DcTime(pub u64);

/// Seconds from the Unix epoch to the DC epoch (protocol 3.12).
pub const DC_EPOCH_UNIX_SECONDS: u64 = 946_684_800;

impl DcTime {
    /// From nanoseconds since the Unix epoch; `None` before the DC epoch.
    pub const fn from_unix_ns(ns: u64) -> Option<DcTime> {
        match ns.checked_sub(DC_EPOCH_UNIX_SECONDS * 1_000_000_000) {
            Some(ns) => Some(DcTime(ns)),
            None => None,
        }
    }

    /// Nanoseconds since the Unix epoch; `None` if they exceed 64 bits.
    pub const fn to_unix_ns(self) -> Option<u64> {
        self.0.checked_add(DC_EPOCH_UNIX_SECONDS * 1_000_000_000)
    }

    /// The lower 32 bits, as in 32-bit clocks and receive time registers.
    pub const fn low(self) -> DcTime32 {
        DcTime32(self.0 as u32)
    }
}

/// A 32-bit time of a SubDevice's clock in nanoseconds, wrapping every 4.29 s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct DcTime32(pub u32);

impl DcTime32 {
    /// `self - earlier` as a signed difference, correct across a wrap if it is below 2^31 ns (protocol 7.1).
    pub const fn since(self, earlier: DcTime32) -> i32 {
        self.0.wrapping_sub(earlier.0) as i32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: codec-frames
    #[test]
    fn differences_are_correct_across_the_wrap_of_a_32_bit_clock() {
        // protocol 7.1, wrap test: S2 port 0 at 0xFFFFF800, port 1 at 0x00000408: 3080 ns apart.
        assert_eq!(DcTime32(0x0000_0408).since(DcTime32(0xFFFF_F800)), 3080);
        assert_eq!(DcTime32(0x0000_020C).since(DcTime32(0xFFFF_FF00)), 780);
    }

    // covers: codec-frames
    #[test]
    fn unix_time_converts_both_ways() {
        assert_eq!(DcTime::from_unix_ns(946_684_800_000_000_001), Some(DcTime(1)));
        assert_eq!(DcTime(1).to_unix_ns(), Some(946_684_800_000_000_001));
        assert_eq!(DcTime::from_unix_ns(0), None);
    }
}
