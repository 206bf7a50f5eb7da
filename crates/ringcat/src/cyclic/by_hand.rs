//! The steps of a cycle for an application with its own loop.

use std::time::Duration;

use ringcat_engine::domain::{DomainId, DomainStatus};
use ringcat_engine::time::Instant;

use super::{Cyclic, SHORTEST_PERIOD, States};
use crate::links::Links;

/// The acyclic half has the wire between two sends. A longer time is that of a program that seldom sends.
const LONGEST_EXPECTED: Duration = Duration::from_secs(1);

impl Cyclic {
    /// Evaluates a domain, for an application with its own loop.
    pub fn process(&mut self, domain: DomainId, now: Instant) -> DomainStatus {
        let status = self.exchange.process(domain, now);
        if let Some(rate) = self.rates.get_mut(domain.0) {
            rate.status = status;
        }
        let is_wanted = self.states == States::Wanted;
        self.note_states();
        if is_wanted {
            self.observed.fill(self.cycle, now, &self.exchange, &self.rates);
        }
        status
    }

    /// The time from one send to the next, for an application with its own loop.
    pub fn expect_sends_every(&mut self, period: Duration) {
        self.period_ns = period.clamp(SHORTEST_PERIOD, LONGEST_EXPECTED).as_nanos() as u64;
    }

    /// Sends the queued frames, for an application with its own loop: the next cycle is expected one period later.
    pub fn send_by_hand(&mut self, now: Instant, links: &mut impl Links) {
        if self.states == States::Wanted {
            // No domain was processed since the request.
            self.states = States::Changing;
            self.observed.fill(self.cycle, now, &self.exchange, &self.rates);
        }
        self.pace.cycles += 1;
        self.next_cycle = Instant(now.0.saturating_add(self.period_ns));
        self.earliest = self.next_cycle;
        self.send(now, self.next_cycle, links);
        self.publish();
    }
}
