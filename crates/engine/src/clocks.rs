//! Distributed clocks as arithmetic: delays, drifts and phases from latched times, start times, corrections (protocol
//! 7).
//!
//! * [`wiring`]: the path of a frame through the segment;
//! * [`delay`]: propagation delays along this path, with known times of [`cables`] and of `sums` of cables;
//! * [`measurement`]: the mean of several measurements, corrected for the drift of each clock;
//! * `measured`: the result of a measurement, and whether it is that of a segment;
//! * [`start`]: start times of SYNC signals;
//! * [`follow`]: adjusts the cycle of the host to the reference clock.
//!
//! This module has no access to the bus: [`crate::procedures::clocks`] measures and writes, [`crate::exchange`] sends
//! the cyclic datagrams.

pub mod branches;
pub mod cable_ends;
pub mod cables;
pub mod delay;
mod delay_range;
pub mod delays;
pub mod follow;
mod known_cable;
mod measured;
pub mod measurement;
mod places;
pub mod start;
mod sums;
mod window;
pub mod wiring;

pub use cables::Cables;
pub use delay::{Passage, PortTimes, Segment};
pub use delay_range::DelayRange;
pub use delays::{Delays, Unknown};
pub use follow::{Follower, phase_error};
pub use known_cable::KnownCable;
pub use measured::{KnownClocks, Measured, port_times};
pub use measurement::{Disagreement, Latched, Measurements};
pub use start::first_pulse;
pub(crate) use window::SyncWindow;
pub use wiring::Wiring;

/// Fractional bits of times in nanoseconds: rounding errors of half a nanosecond would add up over hundreds of hops.
pub const FRACTION: u32 = 8;

/// The 64-bit time nearest to `near` with the low half `low`: extends a time of a 32-bit clock or datagram.
pub const fn extend(low: u32, near: u64) -> u64 {
    near.wrapping_add(low.wrapping_sub(near as u32) as i32 as u64)
}

/// Rounds a time with [`FRACTION`] to nanoseconds.
pub const fn round(time: i64) -> i64 {
    (time + (1 << (FRACTION - 1))) >> FRACTION
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: 7.1
    #[test]
    fn a_low_half_is_extended_across_a_wrap() {
        assert_eq!(extend(0x0000_0010, 0x5_FFFF_FFF0), 0x6_0000_0010);
        assert_eq!(extend(0xFFFF_FFF0, 0x6_0000_0010), 0x5_FFFF_FFF0);
        assert_eq!(extend(7, 9), 7);
        assert_eq!((round(127), round(128), round(-128), round(-129)), (0, 1, 0, -1));
    }
}
