//! A domain: image, state of its working counters, age of its SubDevices' inputs, and its cycles on the wire.
//!
//! Inputs of a SubDevice are fresh where it put all of them into frames of the last evaluated cycle; otherwise they
//! keep their last value.

use alloc::boxed::Box;
use alloc::vec::Vec;
use core::ops::Range;
use core::time::Duration;

use super::flight::CyclicFrame;
#[cfg(feature = "standby")]
use super::image::Moment;
use super::image::{Image, InputNumber};
use crate::domain::{DomainState, DomainStatus, Freshness};
use crate::layout::PlannedDomain;
use crate::order::InOrder;

/// Record of one SubDevice.
#[derive(Debug)]
struct Member {
    subdevice: usize,
    /// Numbers of all its inputs.
    inputs: Box<[InputNumber]>,
}

/// Cycles without an answer that are tolerated after SubDevices begin to take part: those on the wire at that time, and
/// the first ones with their process data.
const SILENT_CYCLES: u8 = 16;

/// Deadline of the frames of a domain without a period: that of IgH's interface.
const WITHOUT_PERIOD: Duration = Duration::from_micros(500);
/// Cycles in which frames are sent again without success before this ends: more than a slow detection of a break takes.
const FRUITLESS: u8 = 128;

/// A domain of the exchange.
///
/// Its frames lie in sets, one per cycle that may be on the wire, each with all frames of a cycle. The sets are used in
/// turn.
#[derive(Debug)]
pub struct Domain {
    image: Image,
    /// All sets.
    frames: Range<usize>,
    /// Frames of a set.
    set: usize,
    /// First frame of the oldest set that was queued and not evaluated yet.
    oldest: usize,
    /// First frame of the set that was queued last.
    newest: usize,
    /// Number of sets that were queued and not evaluated yet.
    out: usize,
    /// The newest set was queued and has not left yet.
    unsent: bool,
    timeout_ns: u64,
    period_ns: u64,
    members: Vec<Member>,
    status: DomainStatus,
    reported: Reported,
    /// Departure of the last evaluated flight, as a cycle plus one.
    evaluated: u64,
    /// Incomplete cycles in a row in which frames were sent again.
    fruitless: u8,
    /// Evaluated cycles since the last complete one.
    interruption: u64,
}

/// Last reported state of a domain.
#[derive(Clone, Copy, Debug)]
enum Reported {
    /// None: no SubDevice has answered so far. Cycles evaluated since SubDevices take part.
    Nothing { silent: u8 },
    /// At least one state was reported.
    State,
}

impl Domain {
    /// `first` is the index of the domain's first frame in `frames`; its frames are the last ones there.
    pub(crate) fn new(planned: &PlannedDomain, first: usize, frames: &[CyclicFrame]) -> Domain {
        let contributions =
            planned.frames.iter().flat_map(|frame| &frame.datagrams).flat_map(|datagram| &datagram.contributions);
        let expected = contributions.map(|(_, wkc)| u32::from(wkc.0)).sum();
        let mut subdevices: Vec<usize> = planned.areas.iter().map(|placed| placed.area.subdevice).collect();
        subdevices.put_in_order();
        subdevices.dedup();
        let set = planned.frames.len();
        let one = &frames[first..first + set];
        let member =
            |subdevice| Member { subdevice, inputs: one.iter().flat_map(|frame| frame.inputs_of(subdevice)).collect() };
        Domain {
            image: Image::new(planned.image_len as usize, one.iter().flat_map(CyclicFrame::parts)),
            frames: first..frames.len(),
            set,
            oldest: first,
            newest: frames.len() - set,
            out: 0,
            unsent: false,
            timeout_ns: whole_ns(timeout(planned)),
            period_ns: whole_ns(planned.period),
            members: subdevices.into_iter().map(member).collect(),
            status: DomainStatus { expected, ..DomainStatus::default() },
            reported: Reported::Nothing { silent: 0 },
            evaluated: 0,
            fruitless: 0,
            interruption: 0,
        }
    }

    pub(crate) fn image(&self) -> &[u8] {
        &self.image.bytes
    }

    pub(crate) fn image_mut(&mut self) -> &mut [u8] {
        &mut self.image.bytes
    }

    /// Targets for the delivery of inputs.
    pub(crate) fn inputs_mut(&mut self) -> &mut Image {
        &mut self.image
    }

    /// Indices of the frames of all sets.
    pub(crate) fn frames(&self) -> Range<usize> {
        self.frames.clone()
    }

    /// Indices of the frames to evaluate next; `None` where all are evaluated.
    pub(crate) fn oldest(&self) -> Option<Range<usize>> {
        (self.out > 0).then(|| self.oldest..self.oldest + self.set)
    }

    /// Index of the only frame of the only cycle on the wire, where that is so.
    #[inline]
    pub(crate) fn only(&self) -> Option<usize> {
        (self.out == 1 && self.set == 1).then_some(self.oldest)
    }

    /// Evaluates the only cycle on the wire if it is complete like the previous one. False, and nothing is evaluated,
    /// if the previous one was incomplete or no SubDevice answered.
    #[inline]
    pub(crate) fn evaluate_repeated(&mut self, wkc: u32, left: u64) -> bool {
        let is_again = left >= self.image.usual_from;
        if is_again {
            self.evaluate(wkc, true, left);
        }
        is_again
    }

    /// Evaluates the only cycle on the wire, of a domain with one set, if it is complete with the working counter of
    /// the one before, so that its status stays the same. False, and nothing is evaluated, otherwise.
    #[inline(always)]
    pub(crate) fn evaluate_unchanged(&mut self, wkc: u32, left: u64) -> bool {
        let is_same = self.out == 1 && left >= self.image.usual_from && self.status.wkc == wkc;
        if is_same {
            self.out = 0;
            self.evaluated = left;
        }
        is_same
    }

    /// Indices of the frames to queue next.
    pub(crate) fn next(&self) -> Range<usize> {
        let at = if self.unsent { self.newest } else { self.after(self.newest) };
        at..at + self.set
    }

    /// As [`Domain::next`], where a set is one frame and none is queued.
    #[inline(always)]
    pub(crate) fn next_alone(&self) -> Option<usize> {
        (self.set == 1 && !self.unsent).then(|| self.after(self.newest))
    }

    /// The set after one, by their first frames.
    #[inline(always)]
    fn after(&self, at: usize) -> usize {
        let next = at + self.set;
        if next == self.frames.end { self.frames.start } else { next }
    }

    /// Whether all frames of a cycle that left after the oldest one have come back: on each link frames come in the
    /// order of departure.
    pub(crate) fn is_overtaken(&self, frames: &[CyclicFrame]) -> bool {
        let mut at = self.oldest;
        (1..self.out).any(|_| {
            at = self.after(at);
            let left = !(self.unsent && at == self.newest);
            left && !frames[at..at + self.set].iter().any(CyclicFrame::is_waiting)
        })
    }

    /// Whether every set is on the wire, and none has come back.
    pub(crate) fn is_full(&self, frames: &[CyclicFrame]) -> bool {
        let mut sets = frames[self.frames()].chunks(self.set.max(1));
        self.set > 0 && sets.all(|set| set.iter().any(CyclicFrame::is_waiting))
    }

    /// Indices of the frames of the only cycle on the wire, if it has left.
    pub(crate) fn on_the_wire(&self) -> Option<Range<usize>> {
        (self.out == 1 && !self.unsent).then(|| self.oldest..self.oldest + self.set)
    }

    /// A cycle was evaluated. `was_sent`: frames of it were sent again.
    #[inline]
    pub(crate) fn count_tries(&mut self, was_sent: bool, complete: bool) {
        if was_sent {
            self.fruitless = if complete { 0 } else { self.fruitless.saturating_add(1) };
        }
    }

    /// Whether it is worth it to send frames again: not if that did not help for many cycles, until a cycle is
    /// complete.
    pub(crate) fn may_send_again(&mut self) -> bool {
        if self.status.state == DomainState::Complete {
            self.fruitless = 0;
        }
        self.fruitless < FRUITLESS
    }

    pub(crate) fn period_ns(&self) -> u64 {
        self.period_ns
    }

    pub(crate) fn timeout_ns(&self) -> u64 {
        self.timeout_ns
    }

    pub(crate) fn set_timeout(&mut self, timeout: Duration) {
        self.timeout_ns = whole_ns(timeout);
    }

    /// Puts the outputs into the frames of the next set, which is then ready to leave in this cycle.
    pub(crate) fn load(&mut self, next: usize, frames: &mut [CyclicFrame], cycle: u64) {
        for frame in frames {
            frame.load(&self.image.bytes, cycle);
        }
        if self.unsent {
            return;
        }
        self.note_loaded(next);
    }

    /// Notes that the next set was queued. No other set is queued.
    #[inline(always)]
    pub(crate) fn note_loaded(&mut self, next: usize) {
        self.newest = next;
        if self.out > 0 && next == self.oldest {
            // It was never evaluated.
            self.oldest = self.after(self.oldest);
        } else {
            self.out += 1;
        }
        self.unsent = true;
    }

    /// Notes that the only set was loaded and leaves at once.
    #[inline(always)]
    pub(crate) fn note_loaded_alone(&mut self) {
        self.out = 1;
    }

    /// Whether frames are queued and have not left.
    #[inline(always)]
    pub(crate) fn is_queued(&self) -> bool {
        self.unsent
    }

    /// Whether a set is queued and has not left.
    pub(crate) fn has_not_left(&self, set: &Range<usize>) -> bool {
        self.unsent && set.start == self.newest
    }

    /// The newest set was evaluated though it has not left: it is evaluated again when it has.
    pub(crate) fn await_departure(&mut self) {
        (self.oldest, self.out) = (self.newest, 1);
    }

    /// Number of the set that was queued last, and its first frame.
    pub(crate) fn queued_set(&self) -> (usize, usize) {
        ((self.newest - self.frames.start).checked_div(self.set).unwrap_or_default(), self.newest)
    }

    /// Indices of the frames that leave now; `None` where none is queued.
    #[inline(always)]
    pub(crate) fn leave(&mut self) -> Option<Range<usize>> {
        core::mem::take(&mut self.unsent).then(|| self.newest..self.newest + self.set)
    }

    pub(crate) fn count_skip(&mut self) {
        self.status.skipped += 1;
    }

    /// The last state.
    pub(crate) fn state(&self) -> DomainState {
        self.status.state
    }

    pub(crate) fn status(&self, pending: bool) -> DomainStatus {
        DomainStatus { pending, ..self.status }
    }

    /// Evaluates the oldest cycle on the wire, which left in cycle `left` minus one: the sum of its working counters,
    /// and whether each datagram has exactly the expected one. True where it was complete with the results of the one
    /// before; otherwise [`Domain::change_state`] follows.
    pub(crate) fn evaluate(&mut self, wkc: u32, complete: bool, left: u64) -> bool {
        self.status.wkc = wkc;
        self.oldest = self.after(self.oldest);
        self.out -= 1;
        self.evaluated = left;
        complete && left >= self.image.usual_from
    }

    /// Updates the state after an evaluated cycle of which any copy returned or none. True where the state is to be
    /// reported: it has changed, or process data has been silent since activation though SubDevices take part.
    pub(crate) fn change_state(&mut self, wkc: u32, complete: bool, returned: bool, is_awaited: bool) -> bool {
        self.status.returned = returned;
        let state = match (wkc, complete) {
            (0, _) if self.status.expected > 0 => DomainState::Zero,
            (_, true) => DomainState::Complete,
            (_, false) => DomainState::Incomplete,
        };
        let is_another = core::mem::replace(&mut self.status.state, state) != state;
        // A domain without process data has no working counter that shows a return.
        self.image.set_complete(state == DomainState::Complete && wkc > 0);
        match &mut self.reported {
            Reported::State => is_another,
            Reported::Nothing { silent } => {
                *silent = silent.saturating_add(u8::from(is_awaited));
                let is_due = is_another || *silent >= SILENT_CYCLES;
                if is_due {
                    self.reported = Reported::State;
                }
                is_due
            }
        }
    }

    /// Counts an evaluated cycle after [`Domain::change_state`]: incomplete cycles of this interruption, or of the one
    /// that has just ended if the cycle was complete.
    pub(crate) fn count_interruption(&mut self) -> u64 {
        if self.status.state == DomainState::Complete {
            return core::mem::take(&mut self.interruption);
        }
        self.interruption += 1;
        self.interruption
    }

    /// Whether SubDevices with process data in the domain take part.
    pub(crate) fn is_awaited(&self, takes_part: impl Fn(usize) -> bool) -> bool {
        self.members.iter().any(|member| takes_part(member.subdevice))
    }

    /// When these inputs last arrived: a cycle, plus one.
    pub(crate) fn came(&self, input: InputNumber) -> u64 {
        self.image.moment(input).came
    }

    /// Departure of the last evaluated flight, as a cycle plus one.
    pub(crate) fn evaluated(&self) -> u64 {
        self.evaluated
    }

    pub(crate) fn freshness(&self, subdevice: usize) -> Freshness {
        let found = self.members.binary_search_by_key(&subdevice, |member| member.subdevice);
        let Some(member) = found.ok().and_then(|number| self.members.get(number)) else { return Freshness::Never };
        // Departure of the oldest of its inputs, as a cycle plus one.
        match member.inputs.iter().map(|input| self.image.moment(*input).left).min().unwrap_or(0) {
            0 => Freshness::Never,
            left if left >= self.evaluated => Freshness::Fresh,
            left => Freshness::Stale { cycles: self.evaluated - left },
        }
    }
}

#[cfg(feature = "standby")]
impl Domain {
    /// Another MainDevice exchanges the domain: its state there in the cycle that is sent as number `left` minus one
    /// here, and the SubDevices whose inputs in the image are those of this cycle.
    pub(crate) fn follow(&mut self, status: DomainStatus, left: u64, is_fresh: impl Fn(usize) -> bool) {
        self.status = DomainStatus { skipped: self.status.skipped, ..status };
        self.image.set_complete(false);
        self.evaluated = left;
        (self.out, self.unsent, self.interruption) = (0, false, 0);
        let fresh = self.members.iter().filter(|member| is_fresh(member.subdevice));
        for input in fresh.flat_map(|member| &member.inputs) {
            self.image.note_moment(*input, Moment { left, came: left });
        }
    }
}

/// Until shortly before a set of frames is used again.
fn timeout(planned: &PlannedDomain) -> Duration {
    match planned.period {
        Duration::ZERO => WITHOUT_PERIOD,
        period => period.saturating_mul(planned.under_way.into()) - period / 4,
    }
}

/// A duration in the unit of the hot path, limited to its range.
fn whole_ns(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}
