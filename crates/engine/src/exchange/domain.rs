//! A domain: image, judgement of its working counters, freshness of its SubDevices, and which of its cycles are under
//! way.
//!
//! Inputs of a SubDevice are fresh where it put them into frames of the cycle that was judged last, all of them; those
//! of one that did not keep their last value.

use alloc::boxed::Box;
use alloc::vec::Vec;
use core::ops::Range;
use core::time::Duration;

use super::flight::CyclicFrame;
use super::image::{Image, InputNumber};
use crate::domain::{DomainState, DomainStatus, Freshness};
use crate::layout::PlannedDomain;

/// What is kept per SubDevice.
#[derive(Debug)]
struct Member {
    subdevice: usize,
    /// Numbers of all its inputs.
    inputs: Box<[InputNumber]>,
}

/// Cycles that may stay silent behind the moment in which SubDevices begin to take part: those that are under way, and
/// the first ones with process data of theirs.
const SILENT_CYCLES: u8 = 16;

/// A domain of the exchange.
///
/// Its frames lie in sets, one per cycle that may be under way, each with all frames of a cycle. They take turns.
#[derive(Debug)]
pub struct Domain {
    image: Image,
    /// All sets.
    frames: Range<usize>,
    /// Frames of a set.
    set: usize,
    /// First frame of the oldest set that was queued and not judged.
    oldest: usize,
    /// First frame of the set that was queued last.
    newest: usize,
    /// Sets that were queued and not judged.
    out: usize,
    /// The newest set has not left since it was queued.
    unsent: bool,
    timeout_ns: u64,
    members: Vec<Member>,
    status: DomainStatus,
    told: Told,
    /// When, as a cycle plus one, the flight that was judged last had left.
    judged: u64,
}

/// What was told of a domain's state.
#[derive(Clone, Copy, Debug)]
enum Told {
    /// Nothing: no SubDevice has answered so far. So many cycles were judged since SubDevices take part.
    Nothing { silent: u8 },
    /// At least one state.
    Something,
}

impl Domain {
    /// `first` is the place of the domain's frames among `frames`, which ends with them.
    pub(crate) fn new(planned: &PlannedDomain, first: usize, frames: &[CyclicFrame]) -> Domain {
        let contributions =
            planned.frames.iter().flat_map(|frame| &frame.datagrams).flat_map(|datagram| &datagram.contributions);
        let expected = contributions.map(|(_, wkc)| u32::from(wkc.0)).sum();
        let mut subdevices: Vec<usize> = planned.areas.iter().map(|placed| placed.area.subdevice).collect();
        subdevices.sort_unstable();
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
            // Until shortly before its turn comes again.
            timeout_ns: whole_ns(planned.period.saturating_mul(planned.under_way.into()) - planned.period / 4),
            members: subdevices.into_iter().map(member).collect(),
            status: DomainStatus { expected, ..DomainStatus::default() },
            told: Told::Nothing { silent: 0 },
            judged: 0,
        }
    }

    pub(crate) fn image(&self) -> &[u8] {
        &self.image.bytes
    }

    pub(crate) fn image_mut(&mut self) -> &mut [u8] {
        &mut self.image.bytes
    }

    /// Where inputs are delivered.
    pub(crate) fn inputs_mut(&mut self) -> &mut Image {
        &mut self.image
    }

    /// Places of the frames of all sets.
    pub(crate) fn frames(&self) -> Range<usize> {
        self.frames.clone()
    }

    /// Places of the frames that are to be judged next; `None` where all were judged.
    pub(crate) fn oldest(&self) -> Option<Range<usize>> {
        (self.out > 0).then(|| self.oldest..self.oldest + self.set)
    }

    /// Places of the frames that are to be queued next.
    pub(crate) fn next(&self) -> Range<usize> {
        let at = if self.unsent { self.newest } else { self.after(self.newest) };
        at..at + self.set
    }

    /// The set after one, by their first frames.
    fn after(&self, at: usize) -> usize {
        let next = at + self.set;
        if next == self.frames.end { self.frames.start } else { next }
    }

    /// Whether the frames of a cycle that left after the oldest one have all come back: on each link frames come in the
    /// order in which they left.
    pub(crate) fn is_overtaken(&self, frames: &[CyclicFrame]) -> bool {
        let mut at = self.oldest;
        (1..self.out).any(|_| {
            at = self.after(at);
            let left = !(self.unsent && at == self.newest);
            left && !frames[at..at + self.set].iter().any(CyclicFrame::is_waiting)
        })
    }

    /// Whether every set is out, and none has come back.
    pub(crate) fn is_full(&self, frames: &[CyclicFrame]) -> bool {
        let mut sets = frames[self.frames()].chunks(self.set.max(1));
        self.set > 0 && sets.all(|set| set.iter().any(CyclicFrame::is_waiting))
    }

    pub(crate) fn timeout_ns(&self) -> u64 {
        self.timeout_ns
    }

    pub(crate) fn set_timeout(&mut self, timeout: Duration) {
        self.timeout_ns = whole_ns(timeout);
    }

    /// Puts the outputs into the frames of the next set, which begins there and is ready, to leave in this cycle.
    // Inlined on purpose: a cycle has few instructions to spare (bin `cycle`).
    #[inline(always)]
    pub(crate) fn load(&mut self, next: usize, frames: &mut [CyclicFrame], cycle: u64) {
        for frame in frames {
            frame.load(&self.image.bytes, cycle);
        }
        if self.unsent {
            if self.out == 0 {
                (self.oldest, self.out) = (self.newest, 1);
            }
            return;
        }
        self.newest = next;
        if self.out > 0 && next == self.oldest {
            // Nobody judged it.
            self.oldest = self.after(self.oldest);
        } else {
            self.out += 1;
        }
        self.unsent = true;
    }

    /// Places of the frames that leave now; `None` where nothing was queued.
    pub(crate) fn leave(&mut self) -> Option<Range<usize>> {
        core::mem::take(&mut self.unsent).then(|| self.newest..self.newest + self.set)
    }

    pub(crate) fn count_skip(&mut self) {
        self.status.skipped += 1;
    }

    /// The last judgement.
    pub(crate) fn state(&self) -> DomainState {
        self.status.state
    }

    pub(crate) fn status(&self, pending: bool) -> DomainStatus {
        DomainStatus { pending, ..self.status }
    }

    /// Judges the oldest cycle under way, which left in cycle `left` minus one: the sum of its working counters, and
    /// whether each datagram had just what it should. True where it was complete like the one before; else
    /// [`Domain::change_state`] is to follow.
    pub(crate) fn judge(&mut self, wkc: u32, complete: bool, left: u64) -> bool {
        self.status.wkc = wkc;
        self.oldest = self.after(self.oldest);
        self.out -= 1;
        self.judged = left;
        complete && wkc > 0 && self.status.state == DomainState::Complete
    }

    /// The state of what was judged, of which any copy returned or none. True where it is to be told: it is another one
    /// than before, or process data stays silent from the beginning though SubDevices take part.
    pub(crate) fn change_state(&mut self, wkc: u32, complete: bool, returned: bool, is_awaited: bool) -> bool {
        self.status.returned = returned;
        let state = match (wkc, complete) {
            (0, _) if self.status.expected > 0 => DomainState::Zero,
            (_, true) => DomainState::Complete,
            (_, false) => DomainState::Incomplete,
        };
        let is_another = core::mem::replace(&mut self.status.state, state) != state;
        match &mut self.told {
            Told::Something => is_another,
            Told::Nothing { silent } => {
                *silent = silent.saturating_add(u8::from(is_awaited));
                let is_due = is_another || *silent >= SILENT_CYCLES;
                if is_due {
                    self.told = Told::Something;
                }
                is_due
            }
        }
    }

    /// Whether SubDevices with process data in it take part.
    pub(crate) fn is_awaited(&self, takes_part: impl Fn(usize) -> bool) -> bool {
        self.members.iter().any(|member| takes_part(member.subdevice))
    }

    /// When these inputs came last: a cycle, plus one.
    pub(crate) fn came(&self, input: InputNumber) -> u64 {
        self.image.moment(input).came
    }

    /// When, as a cycle plus one, the flight had left that was judged last.
    pub(crate) fn judged(&self) -> u64 {
        self.judged
    }

    pub(crate) fn freshness(&self, subdevice: usize) -> Freshness {
        let found = self.members.binary_search_by_key(&subdevice, |member| member.subdevice);
        let Some(member) = found.ok().and_then(|number| self.members.get(number)) else { return Freshness::Never };
        // When, as a cycle plus one, the oldest of its inputs had left.
        match member.inputs.iter().map(|input| self.image.moment(*input).left).min().unwrap_or(0) {
            0 => Freshness::Never,
            left if left >= self.judged => Freshness::Fresh,
            left => Freshness::Stale { cycles: self.judged - left },
        }
    }
}

/// A duration in the unit of the hot path, as long as it gets.
fn whole_ns(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}
