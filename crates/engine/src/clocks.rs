//! Distributed clocks as arithmetic: what follows from latched times, and what to do about it (protocol 7).
//!
//! * [`wiring`]: the way of a frame through the segment;
//! * [`delay`]: propagation delays along it, with what is known about [`cables`] and what follows from `sums` of them;
//! * [`measurement`]: the mean of several measurements, corrected for the drift of each clock;
//! * [`start`]: when SYNC signals begin;
//! * [`follow`]: making a cycle of the host follow the reference clock.
//!
//! Nothing here talks to the bus: [`crate::procedures::clocks`] does, and the cyclic datagrams are in
//! [`crate::exchange`].

pub mod branches;
pub mod cable_ends;
pub mod cables;
pub mod delay;
pub mod delays;
pub mod follow;
pub mod measurement;
mod places;
pub mod start;
mod sums;
mod window;
pub mod wiring;

pub use cables::Cables;
pub use delay::{Passage, PortTimes, Segment};
pub use delays::{Delays, Unknown};
pub use follow::{Follower, phase_error};
pub use measurement::{Disagreement, Latched, Measurements};
pub use start::first_pulse;
pub(crate) use window::SyncWindow;
pub use wiring::Wiring;

/// Fractional bits of times in nanoseconds here: halves add up over hundreds of hops.
pub const FRACTION: u32 = 8;

/// The 64-bit time nearest to `near` whose low half is `low`: what a clock or a datagram of 32 bits means.
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
