//! Start time of SYNC signals (protocol 7.3).

/// System time of the first pulse: the first multiple of the cycle plus the shift that is not before `earliest`. So
/// SubDevices with the same cycle pulse simultaneously, whenever they were started. A cycle of zero is a single pulse.
pub const fn first_pulse(earliest: u64, cycle_ns: u64, shift_ns: i64) -> u64 {
    if cycle_ns == 0 {
        return earliest.wrapping_add_signed(shift_ns);
    }
    let cycle = cycle_ns as i64;
    let shift = shift_ns.rem_euclid(cycle) as u64;
    let passed = earliest.wrapping_sub(shift) % cycle_ns;
    if passed == 0 { earliest } else { earliest + (cycle_ns - passed) }
}

/// Length of the pulse pattern of SYNC0 and SYNC1, in nanoseconds: if the SYNC1 time is longer than the SYNC0 cycle,
/// SYNC1 pulses only with every n-th SYNC0 pulse.
pub const fn whole_cycle(sync0_cycle_ns: u32, sync1_register_ns: u32) -> u64 {
    match sync1_register_ns.checked_div(sync0_cycle_ns) {
        None => 0,
        Some(times) => sync0_cycle_ns as u64 * (times as u64 + 1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: 7.3, dc-sync
    #[test]
    fn pulses_are_aligned_to_the_cycle_and_shifted_to_either_side() {
        assert_eq!(first_pulse(10_000_001, 1_000_000, 0), 11_000_000);
        assert_eq!(first_pulse(11_000_000, 1_000_000, 0), 11_000_000);
        assert_eq!(first_pulse(10_000_001, 1_000_000, 250_000), 10_250_000);
        assert_eq!(first_pulse(10_000_001, 1_000_000, -250_000), 10_750_000);
        assert_eq!(first_pulse(10_800_000, 1_000_000, -250_000), 11_750_000);
        assert_eq!(first_pulse(10_000_001, 1_000_000, 5_250_000), 10_250_000);
        assert_eq!(first_pulse(77, 0, -7), 70);
    }

    // covers: 7.3
    #[test]
    fn sync1_lengthens_the_pattern() {
        assert_eq!(whole_cycle(1_000_000, 0), 1_000_000);
        assert_eq!(whole_cycle(1_000_000, 999_999), 1_000_000);
        assert_eq!(whole_cycle(1_000_000, 3_000_000), 4_000_000);
        assert_eq!(whole_cycle(0, 3_000_000), 0);
    }
}
