//! Difference between the segment's reference and the time of the host that it follows (protocol 7.4).
//!
//! After a takeover the reference has followed another host, or this one under another shift. The shift of this host is
//! then as exact as one reading: the reference is not steered until the rest is known, and goes on without a step. If
//! it were steered to the shift as it was read, it would differ from the clocks that follow it by microseconds for
//! seconds.

use super::lead::Lead;
use crate::time::Instant;

/// Differences so far.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Behind {
    /// `None` before the first difference.
    lead: Option<Lead>,
    rest: Rest,
}

/// The difference that remains: the error of the shift.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Rest {
    Known(i64),
    Sought,
}

impl Default for Rest {
    fn default() -> Rest {
        Rest::Known(0)
    }
}

/// What is written to the reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Steering {
    /// Nothing: it goes on as it is.
    Free,
    /// Its own time, less these nanoseconds.
    By(i64),
    /// The time that it is to follow.
    ToTime,
}

impl Behind {
    /// The reference has followed another time until now.
    pub const fn adopted() -> Behind {
        Behind { lead: None, rest: Rest::Sought }
    }

    /// Another clock is the reference now.
    pub fn restart(&mut self) {
        self.lead = None;
    }

    /// What to write in a frame that leaves now.
    pub fn steering(&self, now: Instant) -> Steering {
        let lead = self.lead.filter(|lead| lead.is_fresh(now));
        match (self.rest, lead.and_then(|lead| lead.steering_ns())) {
            (Rest::Sought, _) => Steering::Free,
            (Rest::Known(_), Some(too_much)) => Steering::By(too_much),
            (Rest::Known(_), None) => Steering::ToTime,
        }
    }

    /// Takes a difference that a frame sent at this time has read.
    pub fn observe(&mut self, difference: i64, sent_at: Instant) {
        let lead = match (self.lead.filter(|lead| lead.is_fresh(sent_at)), self.rest) {
            (Some(lead), _) => lead.go_on(difference, sent_at),
            (None, Rest::Known(gap)) => Lead::behind_host(sent_at).with_gap(gap),
            (None, Rest::Sought) => Lead::adopted(sent_at),
        };
        if let (Rest::Sought, Some(gap)) = (self.rest, lead.found_gap()) {
            self.rest = Rest::Known(gap);
        }
        self.lead = Some(lead);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CYCLE_NS: u64 = 1_000_000;

    /// Takes these differences, one per cycle; what is written after each.
    fn steer(behind: &mut Behind, from: u64, differences: &[i64]) -> alloc::vec::Vec<Steering> {
        let times = (from..).map(|cycle| Instant(cycle * CYCLE_NS));
        let each = times.zip(differences).map(|(at, difference)| {
            behind.observe(*difference, at);
            behind.steering(at)
        });
        each.collect()
    }

    // covers: 7.4, standby
    #[test]
    fn a_reference_of_another_host_is_left_alone_until_the_rest_is_known() {
        let mut behind = Behind::adopted();
        let written = steer(&mut behind, 0, &[7_000; 40]);
        assert_eq!(written[..16], [Steering::Free; 16]);
        assert_eq!(written[17..], [Steering::By(0); 23]);
        // It drifts away, and is steered by a small part of a long mean.
        let drifted = steer(&mut behind, 40, &[9_000; 2_000]);
        assert!(matches!(drifted.last(), Some(Steering::By(100..=130))), "{:?}", drifted.last());
        // After an outage, and with another reference, the rest is the same.
        let later = steer(&mut behind, 4_000, &[7_000; 400]);
        assert_eq!(later.last(), Some(&Steering::By(0)), "the first is as after a start: {:?}", later[0]);
        behind.restart();
        assert_eq!(steer(&mut behind, 4_400, &[7_000; 400]).last(), Some(&Steering::By(0)));
    }

    #[test]
    fn a_reference_that_begins_gets_the_time_that_it_is_to_follow() {
        let mut behind = Behind::default();
        assert_eq!(behind.steering(Instant(0)), Steering::ToTime);
        let written = steer(&mut behind, 0, &[7_000; 40]);
        assert!(matches!(written.last(), Some(Steering::By(7_000..))), "{:?}", written.last());
    }
}
