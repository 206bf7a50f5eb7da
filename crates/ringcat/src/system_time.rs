//! System time of distributed clocks from the time of day of this host (protocol 3.12).

use std::time::{SystemTime, UNIX_EPOCH};

use ringcat_engine::time::Instant;
use ringcat_wire::time::DcTime;

/// Value of [`crate::ClockConfig::epoch`] with which the clocks show the time of day: the system time when the host's
/// monotonic time was zero. Zero if the host's time is before the year 2000. `now` is the monotonic time now.
pub fn epoch(now: Instant) -> u64 {
    let unix = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let time = u64::try_from(unix.as_nanos()).ok().and_then(DcTime::from_unix_ns);
    time.map_or(0, |time| time.0.wrapping_sub(now.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn now_is_between_2020_and_2100() {
        let year = 31_556_952_000_000_000;
        let now = epoch(Instant(12_345)).wrapping_add(12_345);
        assert!((20 * year..100 * year).contains(&now), "{now}");
    }
}
