//! The ACTIVE: sends acyclic master frames.

use core::time::Duration;

use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::frame::{FrameBuilder, MIN_FRAME, MacAddress};
use ringcat_wire::master_frame::{ADO, Area, ETHERNET_AREA, EthernetHead, FragmentHead, VERSION};

use super::pace::{EthernetDue, PERIOD};
use super::state::PartnerEthernet;
use crate::link::{Link, LinkSet};
use crate::ring::identity::DATAGRAMS_AT;
use crate::ring::{Class, Identity, Sequence};
use crate::standby::endpoint::add;
use crate::time::Instant;

/// Traffic is expected to go on for this time.
const BUSY_FOR: Duration = Duration::from_millis(100);
/// A master frame that does not fit the send window has waited for this time: it leaves before other acyclic frames, if
/// need be beyond the window, as a datagram of a procedure does.
const STARVED: Duration = Duration::from_millis(10);

impl PartnerEthernet {
    /// Sets the period of the cycles.
    pub fn set_period(&mut self, period: Duration) {
        self.pace.period = if period.is_zero() { PERIOD } else { period };
    }

    /// Whether frames wait since it was determined last what is due. Cheap.
    #[inline]
    pub fn has_frames(&self) -> bool {
        self.pace.is_active && !self.pace.had_frames && !self.outgoing.is_empty()
    }

    /// Follows the role, and determines what is due.
    pub fn poll(&mut self, is_active: bool, now: Instant) -> EthernetDue {
        if is_active && !self.pace.is_active {
            // Answers of the time as INACTIVE arrive before the first frame of this role.
            (self.pace.from, self.pace.owed) = (now + self.pace.period, 0);
        }
        self.pace.is_active = is_active;
        let absent_at = self.check_sign(now);
        let at = self.next_at(now);
        if at <= now {
            EthernetDue { at: absent_at, is_now: true }
        } else {
            EthernetDue { at: at.min(absent_at), is_now: false }
        }
    }

    fn next_at(&mut self, now: Instant) -> Instant {
        if !self.pace.is_active {
            return Instant::NEVER;
        }
        let is_busy = self.traffic_at.is_some_and(|at| now.since(at) < BUSY_FOR);
        self.pace.had_frames = !self.outgoing.is_empty();
        self.pace.next_at(now, self.pace.had_frames, is_busy)
    }

    /// Whether its master frames leave before other acyclic frames.
    pub fn is_starved(&self, now: Instant) -> bool {
        self.pace.blocked_since.is_some_and(|since| now.since(since) >= STARVED)
    }

    /// Sends the master frames that are due, on all links, within a byte budget. `next` gives each its sequence number.
    /// The bytes sent per link.
    pub fn transmit(
        &mut self,
        (now, budget): (Instant, usize),
        links: LinkSet,
        mut next: impl FnMut() -> Sequence,
        transmit: &mut impl FnMut(Link, &[u8]),
    ) -> usize {
        let mut used = 0;
        while self.next_at(now) <= now {
            let (own, room) = self.pace.plan(self.outgoing.next_len());
            let length = (DATAGRAMS_AT + 2 * ETHERNET_AREA + own + room).max(MIN_FRAME);
            let left = budget - used;
            if length > left && (left == 0 || !self.is_starved(now)) {
                self.pace.blocked_since.get_or_insert(now);
                break;
            }
            self.pace.note_sent(now, (own, room));
            self.pace.poll = self.pace.poll.wrapping_add(1);
            add(&self.figures.master_frames, 1);
            let sequence = next();
            let mut buffer = core::mem::take(&mut self.buffer);
            if let Some(length) = self.build(&mut buffer, sequence, (own, room), now) {
                let bytes = &mut buffer[..length];
                self.identity.stamp(bytes, sequence, 0);
                transmit(Link::Main, bytes);
                if links == LinkSet::Ring {
                    Identity::mark_redundant(bytes, true);
                    transmit(Link::Redundant, bytes);
                }
            }
            self.buffer = buffer;
            used = (used + length).min(budget);
        }
        used
    }

    /// Builds a master frame; its length.
    fn build(
        &mut self,
        buffer: &mut [u8],
        sequence: Sequence,
        (own, room): (usize, usize),
        now: Instant,
    ) -> Option<usize> {
        let (index, cycle) = (sequence.index(Class::Acyclic), self.pace.poll);
        let mut builder = FrameBuilder::ethernet(buffer, MacAddress::ETHERCAT_GROUP, self.identity.source())?;
        for (number, area, length) in [(0, Area::EthernetToInactive, own), (1, Area::EthernetToActive, room)] {
            let whole = FragmentHead::LEN + EthernetHead::LEN + length;
            let at = builder.datagram(Command::Nop, index, Target::Broadcast(ADO), whole)?;
            let (head, content) = builder.data_mut(at, whole)?.split_at_mut(FragmentHead::LEN);
            head.copy_from_slice(&FragmentHead { area, version: VERSION, number, cycle, offset: 0 }.encode());
            if area == Area::EthernetToInactive {
                self.put_next(own, content, now);
            }
        }
        Some(builder.finish())
    }
}
