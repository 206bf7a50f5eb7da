//! Distributed clocks in the cyclic frames (protocol 7.2, 7.4, 7.5).
//!
//! Three datagrams travel in one frame: an FRMW of 0x0910 that distributes the reference's time, an FPWR of 0x0910 that
//! steers a clock (the reference towards the host, on the other copy a second reference towards the first), and a BRD
//! of 0x092C. The supervisor posts on the board which reference each copy distributes. The FRMW leaves with the
//! predicted time of the reference: SubDevices that process it before the reference, or without one, take this
//! prediction. When ports have changed, or a ring has closed, no time is distributed until the supervisor has the new
//! delays.

use ringcat_wire::address::StationAddress;
use ringcat_wire::register::EcatEvent;

mod behind;
mod calls;
mod gap;
mod lead;
mod payload;
mod rate;
mod slide;

use crate::board::Board;
use crate::board::clocks::References;
use crate::clocks::{SyncWindow, extend};
use crate::event::CyclicEvent;
use crate::link::Link;
use crate::queue::Producer;
use crate::ring::{Arrivals, RingState};
use crate::time::Instant;
use behind::{Behind, Steering};
use calls::Calls;
pub use calls::ClockDatagrams;
use lead::Lead;
pub(crate) use payload::{CLOCK_DATA, Payload, Places, Seen};
use rate::Rate;
use slide::Slide;

/// Beyond this difference the reference is not steered: its control loop would take more than a tenth of a second, and
/// the clocks that follow it could not. The supervisor sets all clocks, or continues with another shift.
const FAR_NS: i64 = 100_000;
/// A reading that is older than this is not used for a reference that was steered since: the reference then has the
/// time that was written.
const OLD_NS: u64 = 100_000_000;

/// Choices of the application.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ClockSetup {
    /// System time when host time is zero.
    pub epoch: u64,
    /// The reference follows the host.
    pub bus_shift: bool,
    /// Limit for the OR of all differences beyond which the clocks are out of the sync window.
    pub sync_window_ns: u32,
}

/// A reading of the reference clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct ReferenceTime {
    /// System time when the frame passed the reference clock, in nanoseconds.
    pub time: u64,
    /// When the host sent that frame.
    pub sent_at: Instant,
}

impl ReferenceTime {
    /// Predicted time of the reference clock when a frame sent at `now` passes it, provided both clocks run at the same
    /// rate.
    pub const fn at(self, now: Instant) -> u64 {
        self.time.wrapping_add(now.0.wrapping_sub(self.sent_at.0))
    }
}

/// Whether a difference of the reference is more than its control loop takes out.
const fn is_far(difference: i64) -> bool {
    difference.unsigned_abs() > FAR_NS.unsigned_abs()
}

/// A time towards which the application has the reference steered once.
#[derive(Clone, Copy, Debug)]
enum WantedTime {
    /// This time.
    Given(u64),
    /// The application's time, which goes on until the frame leaves.
    Application(ReferenceTime),
}

/// State of the clocks in the exchange.
#[derive(Debug, Default)]
pub(crate) struct Clocks {
    setup: ClockSetup,
    references: References,
    changes: u32,
    /// The last frame reported a change of ports.
    ports_changed: bool,
    /// The reference on each copy.
    times: [Option<ReferenceTime>; 2],
    /// Last reading, used while there is no reference.
    last: Option<ReferenceTime>,
    /// Rate of the segment's reference.
    rate: Rate,
    /// Difference between the steered reference and the segment's reference.
    lead: Option<Lead>,
    /// Difference between the segment's reference and the time that it is to follow, and the last such time.
    behind: Behind,
    led: Option<ReferenceTime>,
    /// The application's time, and when it was set.
    application: Option<ReferenceTime>,
    /// Application time that the reference is to have when the next frame passes it.
    wanted: Option<WantedTime>,
    /// The last such time, at host time zero, and the last system time that was written for one.
    wanted_epoch: u64,
    written_epoch: Option<u64>,
    /// From application time to system time.
    slide: Slide,
    /// The wanted time is far from that of the reference.
    is_far: bool,
    spread_ns: Option<u32>,
    window: SyncWindow,
    calls: Calls,
}

impl Clocks {
    pub(crate) fn set_up(&mut self, setup: ClockSetup) {
        self.setup = setup;
    }

    /// The application's time now: base of the predictions and target of bus shift.
    pub(crate) fn set_application_time(&mut self, time: u64, now: Instant) {
        self.application = Some(ReferenceTime { time, sent_at: now });
    }

    pub(crate) fn application_time(&self, now: Instant) -> u64 {
        self.application.map_or(self.setup.epoch.wrapping_add(now.0), |application| application.at(now))
    }

    pub(crate) fn want_reference_at(&mut self, time: u64) {
        self.wanted = Some(WantedTime::Given(time));
    }

    pub(crate) fn want_reference_now(&mut self, now: Instant) {
        let time = ReferenceTime { time: self.application_time(now), sent_at: now };
        self.wanted = Some(WantedTime::Application(time));
    }

    /// When the datagrams take effect.
    pub(crate) fn set_datagrams(&mut self, policy: ClockDatagrams) {
        self.calls.policy = policy;
    }

    /// The next cycle distributes time.
    pub(crate) fn want_distribution(&mut self) {
        self.calls.distribute = true;
    }

    /// The next cycle reads the differences; the last result is forgotten.
    pub(crate) fn want_differences(&mut self) {
        self.calls.monitor = true;
        self.spread_ns = None;
    }

    /// The last reading of the segment's reference, as application time.
    pub(crate) fn reference_time(&self) -> Option<ReferenceTime> {
        let ReferenceTime { time, sent_at } = self.system_time()?;
        Some(ReferenceTime { time: time.wrapping_add(self.slide.shift()), sent_at })
    }

    fn system_time(&self) -> Option<ReferenceTime> {
        self.times[self.references.leader().0?.index()]
    }

    pub(crate) fn spread_ns(&self) -> Option<u32> {
        self.spread_ns
    }

    /// Predicted reading of the reference on a copy when a frame sent now passes it.
    fn predicted(&self, link: Link, now: Instant) -> u64 {
        let [main, redundant] = self.times;
        let (own, other) = if link == Link::Main { (main, redundant) } else { (redundant, main) };
        let unread = || self.application_time(now).wrapping_sub(self.slide.in_effect());
        let gained = |time: ReferenceTime| self.rate.gained(now.0.saturating_sub(time.sent_at.0));
        let read = own.or(other).or(self.last).map(|time| time.at(now).wrapping_add(gained(time)));
        read.or_else(|| self.slide.posted_time(now)).unwrap_or_else(unread)
    }

    /// Content of the copies of a frame that leaves now.
    pub(crate) fn depart(&mut self, board: &Board, now: Instant) -> [Payload; 2] {
        let (references, changes) = board.clocks.references();
        if changes != self.changes {
            self.follow(references, changes, board, now);
        }
        let (distributes, monitors) = self.calls.take();
        let wanted = self.wanted.take();
        let mut payloads = [Payload { monitors, ..Payload::default() }; 2];
        if board.clocks.is_held() {
            return payloads;
        }
        let steer = self.steering(distributes, wanted, board, now);
        for link in Link::ALL {
            let sync = self.references.on(link).map(|station| (station, self.predicted(link, now) as u32));
            payloads[link.index()].sync = sync.filter(|_| distributes);
            payloads[link.index()].steer = steer[link.index()];
        }
        payloads
    }

    /// Takes over newly posted references.
    #[cold]
    fn follow(&mut self, references: References, changes: u32, board: &Board, now: Instant) {
        let continued = self.written_epoch.map(|written| self.wanted_epoch.wrapping_sub(written));
        let timeline = board.clocks.times.timeline();
        let is_new = self.slide.is_before(timeline);
        let jump = self.slide.follow(timeline, continued, now);
        if jump != 0 {
            self.move_times(jump);
            self.behind = Behind::default();
        }
        if is_new && timeline.is_adopted {
            self.adopt();
        }
        self.last = self.system_time().or(self.last);
        for link in Link::ALL {
            if references.on(link) != self.references.on(link) {
                // The clock of another reference shows the same time, as far as is known.
                let time = ReferenceTime { time: self.predicted(link, now), sent_at: now };
                self.times[link.index()] = references.on(link).map(|_| time);
            }
        }
        self.lead = None;
        let leader = |references: References| references.leader().0.and_then(|link| references.on(link));
        if leader(references) != leader(self.references) {
            self.behind.restart();
            self.rate.restart();
        }
        (self.references, self.changes) = (references, changes);
        board.clocks.times.take(changes);
    }

    /// Another MainDevice has driven the clocks until now: what was read of them is old.
    fn adopt(&mut self) {
        (self.times, self.last, self.led, self.lead) = ([None; 2], None, None, None);
        self.rate.restart();
        self.behind = Behind::adopted();
    }

    /// The system time has jumped since the references were read.
    #[cold]
    fn move_times(&mut self, jump: u64) {
        self.rate.restart();
        let times = self.times.iter_mut().chain([&mut self.last, &mut self.led]).flatten();
        times.for_each(|time| time.time = time.time.wrapping_add(jump));
        self.written_epoch = self.written_epoch.map(|written| written.wrapping_add(jump));
    }

    /// The references that receive another time than their own, and that time, by the link of the copy. In an open ring
    /// each copy passes another reference: the first may follow the host, the second follows the first.
    fn steering(
        &mut self,
        distributes: bool,
        wanted: Option<WantedTime>,
        board: &Board,
        now: Instant,
    ) -> [Option<(StationAddress, u32)>; 2] {
        let (leader, steered) = self.references.leader();
        let steered = steered.filter(|_| distributes);
        let to_host = self.leading(leader, wanted, board, now);
        match (leader, steered) {
            (Some(Link::Main), Some(_)) => [to_host, self.following(Link::Redundant, now)],
            (Some(Link::Redundant), Some(_)) => [self.following(Link::Main, now), to_host],
            (Some(Link::Main), None) if self.references.redundant.is_some() => [to_host, None],
            (Some(Link::Redundant), None) if self.references.main.is_some() => [None, to_host],
            _ => [to_host; 2],
        }
    }

    /// Time written to the segment's reference: that of the host or of the application. Once the difference to that
    /// time is known: the reading of the reference, corrected by a part of the difference.
    fn leading(
        &mut self,
        leader: Option<Link>,
        wanted: Option<WantedTime>,
        board: &Board,
        now: Instant,
    ) -> Option<(StationAddress, u32)> {
        let leader = leader?;
        let station = self.references.on(leader)?;
        let time = match wanted {
            Some(WantedTime::Given(time)) => time,
            Some(WantedTime::Application(time)) => time.at(now),
            None if self.setup.bus_shift && self.calls.is_automatic() => self.application_time(now),
            None => return None,
        };
        let time = self.written_time(time, leader, board, now)?;
        self.led = Some(ReferenceTime { time, sent_at: now });
        let written = match (self.times[leader.index()], self.behind.steering(now)) {
            (_, Steering::Free) => return None,
            (Some(own), Steering::By(too_much)) => own.at(now).wrapping_sub(too_much as u64),
            (None, Steering::By(_)) | (_, Steering::ToTime) => time,
        };
        Some((station, written as u32))
    }

    /// The system time for an application time; `None` if it is far from that of the reference.
    fn written_time(&mut self, application: u64, leader: Link, board: &Board, now: Instant) -> Option<u64> {
        board.clocks.lead_reference();
        let epoch = application.wrapping_sub(now.0);
        let step = self.slide.take_steps(board.clocks.times.slid());
        if step != 0 {
            // The clocks were read before it.
            self.move_times(step.wrapping_neg());
        }
        self.slide.take_application_time(application, now);
        let shift = self.slide.step(now);
        self.wanted_epoch = epoch;
        board.clocks.times.post_wanted(epoch, shift);
        let time = application.wrapping_sub(shift);
        let read = self.times[leader.index()];
        let own = read.filter(|own| now.0.saturating_sub(own.sent_at.0) <= OLD_NS).or(self.led).or(read);
        let is_far = own.is_some_and(|own| is_far(own.at(now).wrapping_sub(time) as i64));
        if is_far && !self.is_far {
            board.clocks.times.wake_supervisor();
        }
        self.is_far = is_far;
        if is_far {
            return None;
        }
        self.written_epoch = Some(epoch.wrapping_sub(shift));
        Some(time)
    }

    /// Time written to a second reference, so that it follows the first one.
    fn following(&self, steered: Link, now: Instant) -> Option<(StationAddress, u32)> {
        let own = self.times[steered.index()]?;
        let too_much = self.lead?.steering_ns()?;
        Some((self.references.on(steered)?, own.at(now).wrapping_sub(too_much as u64) as u32))
    }

    /// References that frames leaving now distribute, by number of posts.
    pub(crate) fn changes(&self) -> u32 {
        self.changes
    }

    /// Evaluates the end of a flight.
    pub(crate) fn observe(&mut self, seen: &Seen, arrivals: Arrivals, board: &Board, events: &mut Producer) {
        let mut is_closed = false;
        // A flight that left before the latest post has read clocks that are no longer references.
        if seen.references == self.changes {
            let steered = self.observe_references(seen, board.clocks.is_window_watched());
            is_closed = steered && arrivals.verdict() == Some(RingState::Closed);
        }
        let ports_changed = EcatEvent::from_bits(seen.events).dl_status;
        // A ring that has closed, or a change of cables, changes the delays.
        let mut is_held = board.clocks.is_held();
        let is_known = is_held || board.clocks.references().1 != self.changes;
        if (is_closed && !is_known) || (ports_changed && !self.ports_changed && board.clocks.are_ports_guarded()) {
            board.clocks.hold();
            is_held = true;
        }
        self.ports_changed = ports_changed;
        if seen.spread_wkc > 0 && seen.monitors {
            // While no time is distributed, differences come from a frame on another path. A steered reference and the
            // clocks upstream of a reference show the jitter of the host; the supervisor checks each of the other
            // clocks then.
            let is_steered = self.references.leader().1.is_some() || board.clocks.shows_host_jitter();
            let is_conclusive = !is_held && !is_steered;
            self.evaluate_spread(seen.spread, is_conclusive, board, events);
        }
    }

    /// Evaluates the readings of the references; whether one of them is steered towards the other.
    fn observe_references(&mut self, seen: &Seen, together: bool) -> bool {
        let (leader, steered) = self.references.leader();
        let mut fresh = 0;
        for link in Link::ALL {
            let (low, wkc) = seen.sync[link.index()];
            if wkc.0 == 0 || self.references.on(link).is_none() {
                continue;
            }
            let time = extend(low, self.predicted(link, seen.sent_at));
            self.times[link.index()] = Some(ReferenceTime { time, sent_at: seen.sent_at });
            fresh += 1;
            if leader == Some(link) {
                self.rate.read(time, seen.sent_at);
                self.observe_led(time, seen.sent_at);
            }
        }
        let Some(steered) = steered else { return false };
        if fresh == 2 {
            let leader = if steered == Link::Main { Link::Redundant } else { Link::Main };
            let time = |link: Link| self.times[link.index()].map_or(0, |time| time.time);
            let difference = time(steered).wrapping_sub(time(leader)) as i64;
            // Clocks that were all locked have followed one clock until now.
            let begin = Lead::begin(difference, together, seen.sent_at);
            self.lead = Some(self.lead.map_or(begin, |lead| lead.go_on(difference, seen.sent_at)));
        }
        true
    }

    /// Takes the time of the segment's reference as a frame read it.
    fn observe_led(&mut self, time: u64, sent_at: Instant) {
        let wanted = match self.led {
            Some(led) if led.sent_at == sent_at => led.time,
            _ if self.setup.bus_shift => self.application_time(sent_at).wrapping_sub(self.slide.in_effect()),
            _ => return,
        };
        let difference = time.wrapping_sub(wanted) as i64;
        if is_far(difference) {
            return;
        }
        self.behind.observe(difference, sent_at);
    }

    fn evaluate_spread(&mut self, spread_ns: u32, is_conclusive: bool, board: &Board, events: &mut Producer) {
        self.spread_ns = Some(spread_ns);
        board.clocks.post_spread(spread_ns);
        let inside = spread_ns <= self.setup.sync_window_ns;
        if !is_conclusive || !board.clocks.is_window_watched() {
            self.window.skip();
        } else if self.window.take(inside) {
            events.push(CyclicEvent::SyncWindow { inside, spread_ns }.pack());
        }
    }
}
