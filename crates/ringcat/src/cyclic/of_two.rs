//! Cycles of one of two MainDevices in a ring: as INACTIVE they begin with those of the ACTIVE, and a role changes at
//! their beginning (protocol 9.6).

use std::time::Duration;

use ringcat_engine::exchange::Exchange;
use ringcat_engine::link::Link;
use ringcat_engine::role::Requester;
use ringcat_engine::time::Instant;
use ringcat_engine::{Class, class_of};

use super::{Cyclic, States};
use crate::acyclic::AcyclicHalf;
use crate::links::Links;
use crate::of_two::OfTwo;
use crate::standby::Reads;
use crate::standby::policy::{Policy, Situation, Watch};

/// The exchange of an INACTIVE, its acyclic half, and when the last frame of the other MainDevice arrived.
struct Following<'a, H> {
    exchange: &'a mut Exchange,
    acyclic: &'a mut H,
    partner_data_at: &'a mut Option<Instant>,
}

impl<H: AcyclicHalf> Reads for Following<'_, H> {
    fn before(&mut self, link: Link, frame: &mut [u8], at: Instant) {
        if class_of(frame) == Some(Class::Cyclic) {
            *self.partner_data_at = Some(at);
            self.exchange.fill(link, frame, at);
        } else {
            self.acyclic.fill(link, frame, at);
        }
    }

    fn own(&mut self, frame: &[u8], at: Instant) {
        if class_of(frame) == Some(Class::Acyclic) {
            self.acyclic.take_returned(frame, at);
        }
    }

    fn after(&mut self, frame: &[u8]) {
        self.exchange.take_forwarded(frame);
    }

    fn is_up(&self, link: Link) -> bool {
        self.exchange.carrier(link) != Some(false)
    }
}

impl Cyclic {
    /// Forwards between these links as INACTIVE, if this is one of two MainDevices.
    pub fn set_up_of_two(&mut self, links: &impl Links) {
        if self.exchange.is_of_two() {
            self.of_two = OfTwo::new(links, Some(self.period()));
            self.of_two.forwards(self.exchange.role(), links.now());
        }
    }

    /// As INACTIVE: takes, fills and forwards the frames that have arrived.
    pub fn pass_on(&mut self, links: &mut impl Links, acyclic: &mut impl AcyclicHalf) {
        let Cyclic { exchange, of_two, .. } = self;
        if let Some(forwarder) = &mut of_two.forwarder {
            let taken = forwarder.forward_and_read(
                links,
                &mut Following { exchange, acyclic, partner_data_at: &mut of_two.partner_data_at },
            );
            if taken > 0 {
                self.cyclic_status.publish_forwarded(&forwarder.counters());
            }
        }
        self.expect_other();
    }

    /// Sets what decides about the role; `None`: the application does.
    pub fn set_policy(&mut self, policy: Option<Policy>, links: &impl Links) {
        let (period, main) = (self.period(), links.addresses().main);
        if let Some(control) = self.exchange.role_control() {
            // What was decided by a request lasts longer than a policy.
            control.begin_held(policy.is_some_and(|policy| !policy.takes_over));
        }
        self.of_two.watch = policy.map(|policy| Watch::new(policy, period, main, links.now()));
    }

    /// Begins the cycle as one of two MainDevices: a role that was requested takes effect. False if the cycle begins
    /// as that of one MainDevice: there is no other one, or this one was ACTIVE and stays so.
    #[inline(always)]
    pub fn begin_of_two(&mut self, now: Instant) -> bool {
        self.exchange.is_of_two() && self.begin_role(now)
    }

    #[inline(never)]
    fn begin_role(&mut self, now: Instant) -> bool {
        self.decide(now);
        let was_inactive = self.exchange.is_inactive();
        let changed = self.exchange.begin_role(now);
        if changed.is_none() && !was_inactive {
            return false;
        }
        let is_inactive = self.of_two.forwards(self.exchange.role(), now);
        let next = if is_inactive { None } else { self.exchange.grid_of_other(now) };
        self.begin_off_grid(now, next);
        true
    }

    /// The policy decides about the role.
    fn decide(&mut self, now: Instant) {
        let Cyclic { exchange, of_two, .. } = self;
        let Some(watch) = &mut of_two.watch else { return };
        if Link::ALL.iter().all(|link| exchange.carrier(*link) == Some(false)) {
            // No frame can arrive: listening begins when a link is up again.
            (of_two.inactive_since, of_two.partner_data_at) = (now, None);
        }
        let situation = Situation {
            role: exchange.role(),
            inactive_since: of_two.inactive_since,
            partner_data_at: of_two.partner_data_at,
            partner_frame_at: exchange.partner_frame_at(),
            collided_with: exchange.take_collision(),
            writes: exchange.memory_write().is_some(),
            other_writes: exchange.memory_write_of_collided().is_some(),
            is_held: exchange.is_held(),
        };
        if let Some(event) = watch.look_out(&situation, now) {
            exchange.report_standby(event);
        }
        if let Some(request) = watch.decide(&situation, now)
            && let Some(control) = exchange.role_control()
        {
            // It decides again with the next cycle; a request of an operator has priority.
            let _ = control.request_as(request, Requester::Policy);
        }
    }

    /// A cycle begins that is not on the own grid. The next one is expected at `next`, or a period later.
    fn begin_off_grid(&mut self, now: Instant, next: Option<Instant>) {
        self.pace.cycles += 1;
        self.held = false;
        self.next_cycle = next.unwrap_or_else(|| now + self.period());
        self.earliest = self.next_cycle;
        if self.states == States::Settled {
            self.states = States::Changing;
        }
    }

    /// As INACTIVE: the next cycle begins in step with the other MainDevice.
    fn expect_other(&mut self) {
        if let Some(at) = self.exchange.inactive_begins_at() {
            (self.next_cycle, self.earliest) = (at, at);
        }
    }

    /// The period of the cycles.
    pub fn period(&self) -> Duration {
        Duration::from_nanos(self.period_ns)
    }
}
