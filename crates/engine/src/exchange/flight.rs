//! A frame of a domain and its flights (round trips): load, depart, receive the copies, evaluate, deliver or give up.
//!
//! A frame here is on the wire at most once at a time, so its bytes are built once: a flight changes the frame id, the
//! Idx bytes and the outputs. Reads leave as zeros and working counters as zero, because returned bytes are never
//! written here. A domain with several cycles on the wire has each of its frames that many times; they share the image.
//! Each copy is evaluated by itself, and its inputs are delivered when it arrives ([`super::place`]). While no
//! SubDevice can answer its process data, a frame leaves without it: see [`CyclicFrame::vacant`].

mod increments;
mod only_copy;
mod places;
mod tries;
mod variants;

use alloc::boxed::Box;
use ringcat_wire::address::Wkc;

use super::clocks::{Places, Seen};
use super::counters::Tally;
use super::image::{Image, InputNumber, Moment};
use super::place::Place;
use super::presence::Presence;
use super::template::Template;
use super::usual::Usual;
use super::words::{Header, header_at, supervision_at, u16_at};
use crate::board::{Board, Supervision};
use crate::layout::PlannedFrame;
use crate::link::Link;
use crate::ring::{Arrivals, Class, FrameCopy, Identity, Sequence};
use crate::time::Instant;

/// Effect of a received copy on its flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Step {
    /// Another copy is still expected.
    Waiting,
    /// All copies are received.
    Finished,
    /// It does not belong to the current flight, or is a duplicate.
    Late,
    /// Its content is not what was sent.
    Corrupt,
}

/// Stage of a flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// No flight is on the wire.
    Idle,
    /// On the wire, not delivered.
    Waiting,
    /// Complete and delivered; the second copy has not arrived.
    Delivered,
    /// Incomplete at its deadline; copies that arrive now are late.
    GivenUp,
}

#[derive(Debug)]
pub(crate) struct CyclicFrame {
    /// Bits of the links on which copies leave.
    all_links: u8,
    domain: usize,
    stage: Stage,
    sequence: Sequence,
    /// Idx of all datagrams.
    index: u8,
    deadline: Instant,
    /// Cycle, plus one, in which it left.
    left: u64,
    /// Number of changes on the board that are applied.
    followed: u32,
    /// Results of the copies received so far.
    shown: Shown,
    /// Offset of the supervision datagram's header.
    supervision_at: Option<usize>,
    /// Datagrams of distributed clocks.
    clocks: Option<Places>,
    clocks_seen: Seen,
    headers: Box<[Header]>,
    places: Box<[Place]>,
    /// Outputs of a datagram lie in several places of the image.
    has_outputs_apart: bool,
    /// What copies mostly show, by the link on which they were sent.
    usual: [Usual; 2],
    presence: Option<Presence>,
    /// Number of the first inputs in the image.
    first: InputNumber,
    /// Results for the copies, as of the last evaluation.
    views: Views,
    tx: Box<[u8]>,
}

/// Results of the copies of a flight that were received so far: two words, so that they are cleared at once.
#[derive(Clone, Copy, Debug, Default)]
struct Shown {
    /// Result of the supervision datagram, packed.
    supervision: u64,
    /// Sum of the working counters of process data.
    wkc: u32,
    arrivals: Arrivals,
    /// Every process data datagram has exactly the expected working counter.
    complete: bool,
    /// Newer inputs were in the image when this flight came back.
    is_overtaken: bool,
}

/// Results for the copies, by the link on which they were sent. They stay valid for the next flight while copies come
/// back unchanged.
#[derive(Clone, Copy, Debug, Default)]
struct Views {
    /// The copies were evaluated since the last change on the board.
    evaluated: [bool; 2],
    /// The copy alone is complete.
    is_enough: [bool; 2],
    /// Both copies together are complete.
    are_enough: bool,
    /// At least one SubDevice processed both.
    are_doubled: bool,
}

impl CyclicFrame {
    /// `first`: numbers of the first datagram and of the first inputs in the domain's image.
    pub(crate) fn new(
        identity: &Identity,
        all_links: u8,
        domain: usize,
        planned: &PlannedFrame,
        first: InputNumber,
    ) -> CyclicFrame {
        let Template { bytes, headers, places, presence, clocks, supervision_at } =
            Template::new(identity, planned, first);
        let usual = || Usual::new(bytes.len(), &headers, places.iter().map(|place| place.wkc_at), supervision_at);
        CyclicFrame {
            usual: [usual(), usual()],
            all_links,
            domain,
            stage: Stage::Idle,
            sequence: Sequence::default(),
            index: 0,
            shown: Shown::default(),
            deadline: Instant::NEVER,
            left: 0,
            followed: 0,
            supervision_at,
            clocks,
            clocks_seen: Seen::default(),
            headers: headers.into_iter().map(|at| Header { at, sent: header_at(&bytes, at) }).collect(),
            has_outputs_apart: places.iter().any(|place| !place.outputs_apart.is_empty()),
            places: places.into_boxed_slice(),
            presence,
            first,
            views: Views::default(),
            tx: bytes.into_boxed_slice(),
        }
    }

    /// Whether the frame needs process data, because a SubDevice with process data in it takes part.
    pub(crate) fn concerns(&self, takes_part: impl Fn(usize) -> bool) -> bool {
        self.places.iter().any(|place| place.concerns(&takes_part))
    }

    pub(crate) fn domain(&self) -> usize {
        self.domain
    }

    pub(crate) fn is_waiting(&self) -> bool {
        self.stage == Stage::Waiting
    }

    /// Complete without its second copy.
    pub(crate) fn is_delivered(&self) -> bool {
        self.stage == Stage::Delivered
    }

    /// Complete, and no copy is expected any more.
    pub(crate) fn is_home(&self) -> bool {
        self.shown.complete && self.stage == Stage::Idle
    }

    pub(crate) fn is_open(&self) -> bool {
        self.stage != Stage::Idle
    }

    pub(crate) fn overdue(&self, now: Instant) -> bool {
        now >= self.deadline
    }

    /// Id of the current or last flight.
    pub(crate) fn sequence(&self) -> Sequence {
        self.sequence
    }

    /// Its deadline.
    pub(crate) fn deadline(&self) -> Instant {
        self.deadline
    }

    /// Whether it may be loaded: not on the wire, and with this number of changes on the board applied.
    pub(crate) fn is_ready(&self, changes: u32) -> bool {
        self.stage == Stage::Idle && self.followed == changes
    }

    /// Cycle of departure, plus one.
    pub(crate) fn left(&self) -> u64 {
        self.left
    }

    pub(crate) fn arrivals(&self) -> Arrivals {
        self.shown.arrivals
    }

    pub(crate) fn close(&mut self) {
        if self.shown.arrivals.arrived & self.all_links != self.all_links {
            self.forget_missing();
        }
        self.stage = Stage::Idle;
    }

    /// Results of copies that did not come back this time are dropped.
    #[cold]
    fn forget_missing(&mut self) {
        for link in Link::ALL.into_iter().filter(|link| self.shown.arrivals.arrived & link.bit() == 0) {
            if core::mem::take(&mut self.views.evaluated[link.index()])
                && let Some(presence) = &mut self.presence
            {
                presence.forget(link.index());
            }
            self.usual[link.index()].forget();
        }
    }

    /// Sum of the working counters of process data.
    pub(crate) fn wkc(&self) -> u32 {
        self.shown.wkc
    }

    /// The same by the link on which the copies were sent.
    pub(crate) fn wkc_by_link(&self) -> [u32; 2] {
        // A copy that has arrived was noted with the sum of its working counters, or showed the noted one again.
        Link::ALL.map(|link| match self.shown.arrivals.arrived & link.bit() {
            0 => 0,
            _ => self.usual[link.index()].wkc,
        })
    }

    /// Whether every process data datagram of the flight has exactly the expected working counter. A sum over datagrams
    /// could hide a shortfall of one behind an excess of another.
    pub(crate) fn is_complete(&self) -> bool {
        self.shown.complete
    }

    /// Posts a cycle in which the tries of a datagram, by its number in the frame, did not make it complete.
    pub(crate) fn post_error(&self, datagram: usize, board: &Board) {
        let links = Link::ALL.map(|link| self.shown.arrivals.arrived & link.bit() != 0);
        self.places.get(datagram).into_iter().for_each(|place| place.post_error(board, self.domain, links));
    }

    /// Counts the wrong working counters of this flight.
    pub(crate) fn count_errors(&self, board: &Board) {
        let links = Link::ALL.map(|link| self.shown.arrivals.arrived & link.bit() != 0);
        self.places.iter().for_each(|place| place.count_errors(board, self.domain, links));
    }

    /// Result of this flight's supervision datagram, if it has one and any copy came back.
    #[inline(always)]
    pub(crate) fn supervision(&self) -> Option<u64> {
        let returned = if self.shown.arrivals.returned != 0 { Supervision::RETURNED } else { 0 };
        (self.supervision_at.is_some() && self.shown.arrivals.arrived != 0).then_some(self.shown.supervision | returned)
    }

    /// Copies the outputs in, to leave in this cycle, and clears the previous flight.
    #[inline(always)]
    pub(crate) fn load(&mut self, image: &[u8], cycle: u64) {
        for place in &mut self.places {
            place.outputs.load(image, &mut self.tx);
        }
        if self.has_outputs_apart {
            self.load_apart(image);
        }
        self.clear(cycle + 1);
    }

    /// Clears the previous flight; the next one leaves in the cycle `left` minus one.
    #[inline(always)]
    fn clear(&mut self, left: u64) {
        self.left = left;
        self.shown = Shown { complete: self.places.is_empty(), ..Shown::default() };
        if self.clocks.is_some() {
            self.clocks_seen = Seen::default();
        }
    }

    /// Offsets of the datagrams of distributed clocks, if there are any.
    pub(crate) fn clocks(&self) -> Option<Places> {
        self.clocks
    }

    /// The frame leaves now with these references; it reads the differences of the clocks or not.
    pub(crate) fn clocks_leave(&mut self, now: Instant, references: u32, monitors: bool) {
        self.clocks_seen.monitors = monitors;
        self.clocks_seen.sent_at = now;
        self.clocks_seen.references = references;
    }

    /// Result of the datagrams of distributed clocks, if there are any.
    pub(crate) fn clocks_seen(&self) -> Option<&Seen> {
        self.clocks.map(|_| &self.clocks_seen)
    }

    /// Starts a flight of the loaded frame; returns the bytes of the main copy.
    #[inline(always)]
    pub(crate) fn depart(&mut self, identity: &Identity, sequence: Sequence, deadline: Instant) -> &mut [u8] {
        let index = sequence.index(Class::Cyclic);
        if self.index != index {
            self.write_index(index);
        }
        identity.restamp(&mut self.tx, sequence);
        self.sequence = sequence;
        self.stage = Stage::Waiting;
        self.deadline = deadline;
        &mut self.tx
    }

    /// Changes the Idx of all datagrams, needed once in 256 frames.
    #[cold]
    fn write_index(&mut self, index: u8) {
        for header in &mut self.headers {
            self.tx[header.at + 1] = index;
            header.sent = header_at(&self.tx, header.at);
        }
        self.index = index;
        self.usual.iter_mut().for_each(Usual::forget);
    }

    /// Takes a copy. Delivers into the image as soon as the flight is complete.
    #[inline(always)]
    pub(crate) fn receive(
        &mut self,
        copy: FrameCopy,
        arrived_on: Link,
        bytes: &[u8],
        image: &mut Image,
        cycle: u64,
        tally: &mut Tally,
    ) -> Step {
        if matches!(self.stage, Stage::Idle | Stage::GivenUp) || self.sequence != copy.sequence {
            return Step::Late;
        }
        let link = copy.sent_on.index();
        let is_usual = self.is_usual(link, bytes);
        if !is_usual && !self.is_what_was_sent(bytes) {
            return Step::Corrupt;
        }
        if !self.shown.arrivals.note(copy.sent_on, arrived_on) {
            return Step::Late;
        }
        let first = self.shown.arrivals.arrived == copy.sent_on.bit();
        let finished = self.shown.arrivals.arrived & self.all_links == self.all_links;
        if is_usual {
            self.shown.wkc += self.usual[link].wkc;
            self.shown.supervision |= self.usual[link].supervision;
        } else {
            self.count(copy.sent_on, bytes, image);
        }
        if let Some(clocks) = self.clocks {
            clocks.read(&mut self.clocks_seen, copy.sent_on, bytes);
        }
        let complete = if first { self.views.is_enough[link] } else { self.views.are_enough };
        self.shown.complete = complete;
        if self.stage == Stage::Waiting {
            let moment = Moment { left: self.left, came: cycle + 1 };
            if moment.left >= image.newest && (first || !self.views.are_doubled) {
                image.newest = moment.left;
                for place in &mut self.places {
                    place.deliver(link, bytes, image, moment);
                }
            } else {
                self.deliver_singly(link, bytes, image, moment, tally);
            }
            if complete || finished {
                self.stage = Stage::Delivered;
            }
        }
        if finished { Step::Finished } else { Step::Waiting }
    }

    /// Delivers inputs one by one: a newer flight, or the other copy, may have brought only some of them.
    #[cold]
    fn deliver_singly(&mut self, link: usize, bytes: &[u8], image: &mut Image, moment: Moment, tally: &mut Tally) {
        let mut newest = true;
        for place in &self.places {
            newest &= place.deliver_singly(link, bytes, image, moment);
        }
        if !newest && !core::mem::replace(&mut self.shown.is_overtaken, true) {
            tally.disturbed().overtaken += 1;
        }
    }

    fn is_what_was_sent(&self, bytes: &[u8]) -> bool {
        bytes.len() >= self.tx.len() && self.headers.iter().all(|header| header_at(bytes, header.at) == header.sent)
    }

    /// Whether a copy shows the same as the last one on its link, inputs excepted: intact, with the same results.
    #[inline(always)]
    fn is_usual(&self, link: usize, bytes: &[u8]) -> bool {
        bytes.len() >= self.tx.len() && self.usual[link].is_shown_by(bytes) && self.has_usual_presence(link, bytes)
    }

    /// Whether the same SubDevices as in the last copy on the link processed this one.
    #[inline(always)]
    fn has_usual_presence(&self, link: usize, bytes: &[u8]) -> bool {
        match &self.presence {
            Some(presence) => presence.is_as_seen(link, bytes),
            None => true,
        }
    }

    /// Adds the working counters of a copy, and evaluates it where they are others than those of the copy before.
    #[cold]
    fn count(&mut self, sent_on: Link, bytes: &[u8], image: &mut Image) {
        let link = sent_on.index();
        let mut as_seen = self.views.evaluated[link] && self.has_usual_presence(link, bytes);
        let mut sum = 0;
        for place in &self.places {
            let wkc = u16_at(bytes, place.wkc_at);
            sum += u32::from(wkc);
            as_seen &= place.is_as_seen(link, wkc);
        }
        if !as_seen {
            self.evaluate_copy(link, bytes);
            image.note_change(self.left);
        }
        let supervision = self.supervision_at.map_or(0, |at| supervision_at(bytes, at, sent_on));
        self.shown.wkc += sum;
        self.shown.supervision |= supervision;
        self.usual[link].note(bytes, sum, supervision);
    }

    /// Evaluates the datagrams of a copy that differ from the copy before.
    #[cold]
    fn evaluate_copy(&mut self, link: usize, bytes: &[u8]) {
        let once = self.presence.as_mut().is_some_and(|presence| presence.evaluate(link, bytes));
        for place in &mut self.places {
            let wkc = Wkc(u16_at(bytes, place.wkc_at));
            place.evaluate(link, wkc, self.presence.as_ref(), once);
        }
        let only = [link == 0, link == 1];
        self.views.evaluated[link] = true;
        self.views.is_enough[link] = self.places.iter().all(|place| place.is_complete(only));
        self.views.are_enough = self.places.iter().all(|place| place.is_complete([true; 2]));
        self.views.are_doubled = self.places.iter().any(Place::is_doubled);
    }

    /// The deadline has passed. True where no copy came back.
    pub(crate) fn give_up(&mut self) -> bool {
        self.stage = Stage::GivenUp;
        self.shown.arrivals.arrived == 0
    }

    /// Applies changes of participation, and of the SubDevices that may be missing. What was on the wire has come back
    /// or is given up.
    pub(crate) fn follow(&mut self, changes: u32, board: &Board) {
        self.followed = changes;
        self.views = Views::default();
        self.usual.iter_mut().for_each(Usual::forget);
        self.places.iter_mut().for_each(|place| place.follow(board));
    }

    /// Posts that process data of its SubDevices leaves with this cycle.
    pub(crate) fn post_leaving(&self, board: &Board, cycle: u64) {
        self.places.iter().for_each(|place| place.post_leaving(board, cycle));
    }

    /// Inputs of a SubDevice, by their numbers in the image.
    pub(crate) fn inputs_of(&self, subdevice: usize) -> impl Iterator<Item = InputNumber> {
        self.places.iter().flat_map(move |place| place.inputs_of(subdevice))
    }

    /// The AL status that a SubDevice showed in the last flight.
    pub(crate) fn al_status(&self, subdevice: usize) -> Option<u8> {
        self.presence.as_ref()?.al_status(subdevice)
    }

    /// Number of parts of each process data datagram: inputs of one SyncManager each.
    pub(crate) fn parts(&self) -> impl Iterator<Item = usize> {
        self.places.iter().map(Place::parts)
    }

    /// Number of process data datagrams.
    pub(crate) fn datagrams(&self) -> usize {
        self.places.len()
    }
}
