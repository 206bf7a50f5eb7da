//! The ACTIVE: when acyclic master frames leave, and what is in them.
//!
//! Frames and answers that are known to wait leave at once, at most a number of master frames per period. Otherwise a
//! poll leaves in each period while there is traffic, and now and then without any.

use core::time::Duration;

use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::frame::{FrameBuilder, MIN_FRAME, MacAddress};
use ringcat_wire::master_frame::{ADO, Area, ETHERNET_AREA, EthernetHead, FragmentHead, MAX_ETHERNET, VERSION};

use super::{PartnerEthernet, add};
use crate::link::{Link, LinkSet};
use crate::ring::identity::DATAGRAMS_AT;
use crate::ring::{Class, Identity, Sequence};
use crate::time::Instant;

/// Most master frames per period.
pub(crate) const MOST_PER_PERIOD: u8 = 16;
/// Period of an ACTIVE that has no application.
const PERIOD: Duration = Duration::from_millis(1);
/// Between two polls without traffic, or a period if that is longer.
const IDLE: Duration = Duration::from_millis(5);
/// Traffic is expected to go on for this time.
const BUSY_FOR: Duration = Duration::from_millis(100);
/// Room in each poll: a frame that fits needs no poll of its own.
const ROOM: usize = 128;
/// A master frame that does not fit the send window has waited for this time: it leaves before other acyclic frames, if
/// need be beyond the window, as a datagram of a procedure does.
const STARVED: Duration = Duration::from_millis(10);

/// When the Ethernet of this MainDevice has work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct EthernetDue {
    /// The next time, if nothing is to be sent now.
    pub at: Instant,
    /// A master frame is to be sent now.
    pub is_now: bool,
}

/// Departures of the ACTIVE.
#[derive(Debug)]
pub(super) struct Pace {
    most: u8,
    period: Duration,
    is_active: bool,
    /// The first departure in this role.
    from: Instant,
    /// When the period began in which a master frame left last, and their number in it.
    begun_at: Instant,
    count: u8,
    sent_at: Option<Instant>,
    /// Number of the last master frame.
    poll: u32,
    /// The newest one with an answer.
    answered: Option<u32>,
    /// Bytes of the next frame of the other MainDevice; 0 without one.
    owed: usize,
    /// The last master frame had no frame of this MainDevice.
    has_yielded: bool,
    /// Frames waited when it was determined last what is due.
    had_frames: bool,
    /// Since when the next master frame does not fit the window.
    blocked_since: Option<Instant>,
}

impl Pace {
    pub fn new(most: u8) -> Pace {
        Pace {
            most: most.clamp(1, MOST_PER_PERIOD),
            period: PERIOD,
            is_active: false,
            from: Instant::default(),
            begun_at: Instant::default(),
            count: 0,
            sent_at: None,
            poll: 0,
            answered: None,
            owed: 0,
            has_yielded: false,
            had_frames: false,
            blocked_since: None,
        }
    }

    /// Notes the answer in a copy of a master frame; false if it is not newer than the ones before.
    pub fn note_answer(&mut self, poll: u32, next: u16) -> bool {
        let is_new = self.answered.is_none_or(|answered| poll.wrapping_sub(answered) as i32 > 0);
        if is_new {
            self.answered = Some(poll);
            self.owed = usize::from(next).min(MAX_ETHERNET);
        }
        is_new
    }

    /// When the next master frame leaves.
    fn next_at(&self, now: Instant, has_frames: bool, is_busy: bool) -> Instant {
        let has_room = self.count < self.most || now >= self.begun_at + self.period;
        let allowed = if has_room { self.from } else { self.begun_at + self.period };
        if has_frames || self.owed > 0 {
            return allowed;
        }
        let pause = if is_busy { self.period } else { IDLE.max(self.period) };
        self.sent_at.map_or(allowed, |at| (at + pause).max(allowed))
    }

    /// Bytes of the own frame and of the room for the other one in the next master frame.
    fn plan(&self, next: Option<usize>) -> (usize, usize) {
        let own = next.unwrap_or(0);
        let beside = MAX_ETHERNET - own;
        let least = ROOM.min(beside);
        match self.owed {
            // Both in turn.
            owed if owed > beside && !self.has_yielded => (0, owed.max(ROOM)),
            owed if owed > beside => (own, least),
            owed => (own, owed.max(least)),
        }
    }

    fn note_sent(&mut self, now: Instant, (own, room): (usize, usize)) {
        self.has_yielded = own == 0;
        if now >= self.begun_at + self.period {
            (self.begun_at, self.count) = (now, 0);
        }
        self.count += 1;
        self.sent_at = Some(now);
        self.blocked_since = None;
        if room >= self.owed {
            // The answer says whether there is another one.
            self.owed = 0;
        }
    }
}

impl PartnerEthernet {
    /// Sets the period of the cycles.
    pub fn set_period(&mut self, period: Duration) {
        self.pace.period = if period.is_zero() { PERIOD } else { period };
    }

    /// Whether frames wait since it was determined last what is due. Cheap.
    #[inline]
    pub fn has_news(&self) -> bool {
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
