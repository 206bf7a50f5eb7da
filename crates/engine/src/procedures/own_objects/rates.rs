//! Frames per second and lost frames of both halves (0xF120).

use core::time::Duration;

use super::seen::Seen;
use crate::time::Instant;

/// Minimum time over which a rate is computed.
const SPAN: Duration = Duration::from_secs(1);

/// Frames per second, cyclic and acyclic, between two requests that are at least a second apart.
#[derive(Debug, Default)]
pub(super) struct Rates {
    /// Time and number of frames of the last count.
    before: Option<(Instant, [u64; 2])>,
    rates: [u32; 2],
}

impl Rates {
    /// The present rates. The first request returns 0 and starts the count.
    pub(super) fn take(&mut self, now: Instant, sent: [u64; 2]) -> [u32; 2] {
        let Some((at, before)) = self.before else {
            self.before = Some((now, sent));
            return self.rates;
        };
        let span = now.since(at);
        if span >= SPAN {
            let rate = |half: usize| {
                let frames = u128::from(sent[half].saturating_sub(before[half])) * 1_000_000_000;
                u32::try_from(frames / span.as_nanos()).unwrap_or(u32::MAX)
            };
            self.rates = [rate(0), rate(1)];
            self.before = Some((now, sent));
        }
        self.rates
    }
}

/// Frames sent, cyclic and acyclic.
pub(super) fn sent(seen: &Seen) -> [u64; 2] {
    [seen.segment.as_ref().map_or(0, |segment| segment.board.frames().sent), seen.acyclic.sent]
}

/// Frames lost, cyclic and acyclic.
pub(super) fn lost(seen: &Seen) -> [u64; 2] {
    [seen.segment.as_ref().map_or(0, |segment| segment.board.frames().lost), seen.acyclic.lost]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_are_those_between_requests_a_second_apart() {
        let mut rates = Rates::default();
        let at = |ms: u64| Instant(ms * 1_000_000);
        assert_eq!(rates.take(at(100), [50, 5]), [0, 0]);
        assert_eq!(rates.take(at(600), [550, 10]), [0, 0]);
        assert_eq!(rates.take(at(2100), [2050, 25]), [1000, 10]);
        assert_eq!(rates.take(at(2200), [9000, 99]), [1000, 10], "too soon");
        assert_eq!(rates.take(at(4100), [2050, 25]), [0, 0]);
    }
}
