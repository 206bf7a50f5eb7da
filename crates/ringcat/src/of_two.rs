//! One of two MainDevices in a ring: processing of the frames of the other one (protocol 9.7, 9.8).
//!
//! As INACTIVE each received frame is taken and filled, sent on at the other link, and then read for its outputs.
//! Nothing here waits, allocates or locks.

use std::time::Duration;

use ringcat_engine::link::Link;
use ringcat_engine::main_device::{Listener, MainDevice as Engine, MainDeviceRole};
use ringcat_engine::time::Instant;

use crate::links::Links;
use crate::standby::policy::{Watch, is_lower};
use crate::standby::{ForwardingCounters, MAX_AGE, Reads, StoreAndForward};

/// Frames that are older than this number of cycles are not forwarded: the ACTIVE has given them up.
const MAX_AGE_CYCLES: u32 = 2;
/// Frames up to this age are forwarded however short the cycle is: threads are late now and then.
const LEAST_AGE: Duration = Duration::from_millis(1);

/// One of two MainDevices, or a single one.
#[derive(Debug, Default)]
pub(crate) struct OfTwo {
    pub forwarder: Option<StoreAndForward>,
    /// This MainDevice was ACTIVE at the last check.
    was_active: bool,
    /// When it became INACTIVE last.
    pub inactive_since: Instant,
    /// When a frame with process data of the other one came last.
    pub partner_data_at: Option<Instant>,
    /// What decides about the role; `None`: the application does.
    pub watch: Option<Watch>,
}

impl OfTwo {
    /// One that forwards between these links; alone without a redundant link. `period`: of its cycles.
    pub fn new(links: &impl Links, period: Option<Duration>) -> OfTwo {
        let max_age = period.map_or(MAX_AGE, |period| (period * MAX_AGE_CYCLES).clamp(LEAST_AGE, MAX_AGE));
        let forwarder = StoreAndForward::new(links.addresses()).ok().map(|it| it.with_max_age(max_age));
        OfTwo { forwarder, inactive_since: links.now(), ..OfTwo::default() }
    }

    /// Whether received frames are forwarded: this MainDevice is INACTIVE. Own frames that come back after it was
    /// ACTIVE are known as such.
    pub fn forwards(&mut self, role: MainDeviceRole, now: Instant) -> bool {
        let Some(forwarder) = &mut self.forwarder else { return false };
        let is_active = role == MainDeviceRole::Active;
        if self.was_active && !is_active {
            forwarder.note_sent(now);
            (self.inactive_since, self.partner_data_at) = (now, None);
        }
        self.was_active = is_active;
        !is_active
    }

    /// Takes the frames that have arrived, for an acyclic half, and forwards them as INACTIVE; true if there were any.
    pub fn take_in(&mut self, links: &mut impl Links, engine: &mut Engine, now: Instant) -> bool {
        if self.forwards(engine.role(), now)
            && let Some(forwarder) = &mut self.forwarder
        {
            return forwarder.forward_and_read(links, engine) > 0;
        }
        let any = take_own(links, engine, now);
        if let Some(other) = engine.take_collision()
            && is_lower(other, links.addresses().main)
            && engine.memory_write_under_way().is_none()
        {
            // There is no application that could decide. A scan under way ends with an error. After a write the next
            // frame is another collision.
            engine.set_role(MainDeviceRole::Inactive);
        }
        any
    }

    /// Forwards the frames that have arrived while another thread has the acyclic half, and there is no application.
    pub fn listen(&mut self, links: &mut impl Links, listener: &mut Listener) {
        if let Some(forwarder) = &mut self.forwarder {
            forwarder.forward_and_read(links, listener);
        }
    }

    /// What was forwarded.
    pub fn counters(&self) -> ForwardingCounters {
        self.forwarder.as_ref().map(StoreAndForward::counters).unwrap_or_default()
    }
}

/// Takes the frames that have arrived, of one that is ACTIVE; true if there were any.
fn take_own(links: &mut impl Links, engine: &mut Engine, now: Instant) -> bool {
    let mut any = false;
    while links.receive(&mut |link, frame| {
        engine.receive(link, frame, now);
    }) {
        any = true;
    }
    any
}

impl Reads for Listener {
    fn before(&mut self, link: Link, frame: &mut [u8], at: Instant) {
        self.fill(link, frame, at);
    }
}

impl Reads for Engine {
    fn before(&mut self, link: Link, frame: &mut [u8], at: Instant) {
        self.fill(link, frame, at);
    }

    fn own(&mut self, frame: &[u8], at: Instant) {
        self.take_returned(frame, at);
    }
}
