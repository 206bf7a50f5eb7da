//! A process data datagram within a frame: where its bytes lie, which SubDevice adds how much to its working counter,
//! which inputs a copy brought.
//!
//! A working counter to which only one SubDevice adds is exact. Where several add, the presence datagram of the same
//! copy shows which of them processed it; the working counter must equal the sum of their increments. Each copy is
//! evaluated by itself: in a ring that closes or breaks the same SubDevice may have processed both.

mod increments;
mod tries;

use alloc::boxed::Box;
use alloc::vec::Vec;
use core::ops::Range;

use ringcat_wire::address::Wkc;
use ringcat_wire::command::Command;
use ringcat_wire::frame::MAX_FRAME;

use super::image::{Image, InputNumber, Moment};
use super::presence::{Passed, Presence};
use crate::board::Board;
use crate::layout::{PlacedArea, PlannedDatagram};

/// Offsets of data that is in no frame lie beyond this.
const OUTSIDE: usize = 2 * MAX_FRAME;
/// Increment of an LRW for inputs alone, where a SubDevice has both directions.
const INPUTS_OF_LRW: Wkc = Wkc(1);

/// Bytes copied between frame and image. In these types no sum overflows, which is not checked then.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Span {
    pub frame_at: u16,
    pub image_at: u32,
    pub length: u16,
}

/// Inputs of one SubDevice within a datagram.
#[derive(Clone, Copy, Debug)]
struct Segment {
    subdevice: usize,
    /// Index of the SubDevice among the contributions.
    contribution: usize,
    span: Span,
}

/// Contribution of a SubDevice, and its state.
#[derive(Clone, Debug)]
struct Contribution {
    subdevice: usize,
    wkc: Wkc,
    /// The datagram contains inputs of it.
    has_inputs: bool,
    /// Index in the presence datagram.
    witness: Option<usize>,
    /// It takes part in process data, and has been seen to deliver its inputs.
    is_proven: bool,
    /// It is required: without it the datagram is incomplete.
    required: bool,
    /// It is being brought up with its FMMUs set: it takes outputs, whose increment must not be taken for that of
    /// another SubDevice.
    is_mapped: bool,
    /// By link: the copy brought its inputs.
    delivered: [bool; 2],
    /// By link: it processed the copy completely, in any state.
    processed: [bool; 2],
}

/// Result of a copy, by the link on which it was sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Brought {
    /// No inputs.
    #[default]
    Nothing,
    /// Those of some SubDevices, or all, which lie apart from each other in the image.
    InRuns,
    /// All inputs, as one piece of the image.
    All,
}

/// Results for the copies sent on a link.
#[derive(Debug, Default)]
struct View {
    wkc: Wkc,
    brought: Brought,
    /// It brought all inputs.
    is_all: bool,
    /// Working counter and presence are consistent.
    is_sure: bool,
    /// The received inputs, neighbours joined. Memory for all of them is reserved at activation.
    runs: Vec<Span>,
    /// Number of this share of the inputs in the image, 0 until it is known.
    share: u32,
}

/// A process data datagram.
#[derive(Debug)]
pub(crate) struct Place {
    pub wkc_at: usize,
    command: Command,
    /// Number of the datagram in the image.
    datagram: usize,
    /// Number of its first part in the image.
    first_part: usize,
    /// Working counter with all SubDevices.
    expected: Wkc,
    pub outputs: Span,
    /// Outputs that lie apart from these in the image.
    pub outputs_apart: Box<[Span]>,
    inputs: Span,
    contributions: Box<[Contribution]>,
    segments: Box<[Segment]>,
    views: [View; 2],
}

impl Place {
    pub fn new(datagram: &PlannedDatagram, data_at: usize, number: InputNumber) -> Place {
        let (outputs, inputs) = (usize::from(datagram.outputs), usize::from(datagram.inputs));
        let span = |placed: &PlacedArea| Span {
            frame_at: data_at as u16 + placed.logical.0.saturating_sub(datagram.logical.0) as u16,
            image_at: placed.image_offset,
            length: placed.area.length,
        };
        let mut out = joined(datagram.output_areas.iter().map(span)).into_iter();
        let contribution = |subdevice: usize| datagram.contributions.iter().position(|(other, _)| *other == subdevice);
        let segment = |placed: &PlacedArea| Segment {
            subdevice: placed.area.subdevice,
            contribution: contribution(placed.area.subdevice).unwrap_or_default(),
            span: span(placed),
        };
        let contributor = |(subdevice, wkc): &(usize, Wkc)| {
            let has_inputs = datagram.input_areas.iter().any(|placed| placed.area.subdevice == *subdevice);
            Contribution::new(*subdevice, *wkc, has_inputs)
        };
        let view = || View { runs: Vec::with_capacity(datagram.input_areas.len()), ..View::default() };
        Place {
            wkc_at: data_at + outputs + inputs,
            command: datagram.command,
            datagram: number.datagram,
            first_part: number.part,
            expected: datagram.contributions.iter().fold(Wkc(0), |sum, (_, wkc)| sum.plus(*wkc)),
            outputs: out.next().unwrap_or_default(),
            outputs_apart: out.collect(),
            inputs: joined(datagram.input_areas.iter().map(span)).into_iter().next().unwrap_or_default(),
            contributions: datagram.contributions.iter().map(contributor).collect(),
            segments: datagram.input_areas.iter().map(segment).collect(),
            views: [view(), view()],
        }
    }

    /// The same place in a frame without this datagram: no bytes are copied from or to it, its working counter is zero.
    pub fn outside(&self) -> Place {
        let span = |span: Span| Span { frame_at: span.frame_at + OUTSIDE as u16, ..span };
        let segment = |segment: &Segment| Segment { span: span(segment.span), ..*segment };
        let view = || View { runs: Vec::with_capacity(self.segments.len()), ..View::default() };
        Place {
            wkc_at: self.wkc_at + OUTSIDE,
            outputs: span(self.outputs),
            outputs_apart: self.outputs_apart.iter().copied().map(span).collect(),
            inputs: span(self.inputs),
            contributions: self.contributions.clone(),
            segments: self.segments.iter().map(segment).collect(),
            views: [view(), view()],
            ..*self
        }
    }

    /// Whether the frame does not contain it.
    pub fn is_outside(&self) -> bool {
        self.wkc_at >= OUTSIDE
    }

    /// Its SubDevices show their AL status in this datagram.
    pub fn witness(&mut self, presence: &Presence) {
        for contribution in &mut self.contributions {
            contribution.witness = presence.place(contribution.subdevice);
        }
    }

    /// Number of parts: inputs of one SyncManager each.
    pub fn parts(&self) -> usize {
        self.segments.len()
    }

    /// Whether a SubDevice with process data in it takes part.
    pub fn concerns(&self, takes_part: impl Fn(usize) -> bool) -> bool {
        self.contributions.iter().any(|it| takes_part(it.subdevice))
    }

    /// Posts that process data of its SubDevices leaves with this cycle.
    pub fn post_leaving(&self, board: &Board, cycle: u64) {
        self.contributions.iter().for_each(|it| board.post_leaving(it.subdevice, cycle));
    }

    /// Whether a copy has the same working counter as the last one evaluated.
    #[inline]
    pub fn is_as_seen(&self, link: usize, wkc: u16) -> bool {
        self.views[link].wkc.0 == wkc
    }

    /// Evaluates a copy: which inputs are in it, and which SubDevices processed it. `once`: no SubDevice processed it
    /// more than once.
    pub fn evaluate(&mut self, link: usize, wkc: Wkc, presence: Option<&Presence>, once: bool) {
        self.views[link].wkc = wkc;
        self.views[link].is_sure = match &mut self.contributions[..] {
            // The datagram was not in the frame: no SubDevice can have processed it.
            all if self.wkc_at >= OUTSIDE => {
                all.iter_mut().for_each(|it| it.forget(link));
                true
            }
            [alone] => alone.match_alone(link, wkc, self.command),
            all if all.iter().all(|it| it.witness.is_some()) => {
                once && presence.is_some_and(|presence| match_all(all, link, wkc, presence))
            }
            // Outputs of SubDevices without a presence byte: the sum over both copies counts.
            all => {
                all.iter_mut().for_each(|it| it.forget(link));
                true
            }
        };
        if !self.views[link].is_sure {
            self.contributions.iter_mut().for_each(|it| it.forget(link));
        }
        self.gather(link);
    }

    /// Collects the inputs that a copy brought.
    fn gather(&mut self, link: usize) {
        let Place { views, segments, contributions, .. } = self;
        let view = &mut views[link];
        view.runs.clear();
        view.share = 0;
        let mut count = 0;
        for segment in segments.iter().filter(|segment| contributions[segment.contribution].delivered[link]) {
            count += 1;
            match view.runs.last_mut() {
                Some(run) if run.reaches(&segment.span) => run.length += segment.span.length,
                _ => view.runs.push(segment.span),
            }
        }
        view.is_all = count == segments.len();
        view.brought = match count {
            0 => Brought::Nothing,
            _ if view.is_all && view.runs.len() == 1 => Brought::All,
            _ => Brought::InRuns,
        };
    }

    /// Whether copies on these links, as last evaluated, bring exactly what is expected: each required SubDevice
    /// processed one of them and its inputs are valid, and none processed both.
    pub fn is_complete(&self, links: [bool; 2]) -> bool {
        let arrived = || self.views.iter().zip(links).filter(|(_, arrived)| *arrived).map(|(view, _)| view);
        let sum = self.sum(links);
        if self.is_summed() {
            let needed = self.contributions.iter().filter(|it| it.required || it.is_mapped);
            let needed = needed.map(|it| u32::from(it.wkc.0)).sum();
            return (needed..=u32::from(self.expected.0)).contains(&sum);
        }
        // Inputs of a SubDevice below SAFEOP, or not yet seen to deliver them, are not fresh.
        let brings = |it: &Contribution| {
            !it.required || !it.has_inputs || it.delivered.iter().zip(links).any(|(came, arrived)| *came && arrived)
        };
        if let [alone] = &self.contributions[..] {
            let wkc = u32::from(alone.wkc.0);
            return (sum == wkc && brings(alone)) || (!alone.required && sum < wkc);
        }
        let is_exact = |it: &Contribution| {
            let copies = it.processed.iter().zip(links).filter(|(processed, arrived)| **processed && *arrived).count();
            (copies == 1 && brings(it)) || (copies == 0 && !it.required)
        };
        arrived().all(|view| view.is_sure) && self.contributions.iter().all(is_exact)
    }

    /// Sum of the working counters of copies on these links, as last evaluated.
    fn sum(&self, links: [bool; 2]) -> u32 {
        let arrived = self.views.iter().zip(links).filter(|(_, arrived)| *arrived);
        arrived.map(|(view, _)| u32::from(view.wkc.0)).sum()
    }

    /// Whether any SubDevice processed the copies on both links, as last evaluated.
    pub fn is_doubled(&self) -> bool {
        self.contributions.iter().any(|it| it.processed == [true; 2])
    }

    /// Whether only the sum over both copies shows which SubDevices processed it.
    fn is_summed(&self) -> bool {
        self.contributions.len() > 1 && self.contributions.iter().any(|it| it.witness.is_none())
    }

    /// Counts an error for each expected SubDevice that processed none of the received copies, or both.
    pub fn count_errors(&self, board: &Board, domain: usize, links: [bool; 2]) {
        if self.is_complete(links) {
            return;
        }
        self.post_error(board, domain, links);
        let is_summed = self.is_summed();
        let processed = |it: &Contribution| {
            it.processed.iter().zip(links).filter(|(processed, arrived)| **processed && *arrived).count()
        };
        let expected = self.contributions.iter().filter(|it| it.is_proven);
        expected.filter(|it| is_summed || processed(it) != 1).for_each(|it| board.count_wkc_error(it.subdevice));
    }

    /// Puts the inputs of a copy into the image, except where it has newer ones.
    #[inline(always)]
    pub fn deliver(&mut self, link: usize, bytes: &[u8], image: &mut Image, moment: Moment) {
        match self.views[link].brought {
            Brought::Nothing => {}
            Brought::All => {
                self.inputs.deliver(bytes, &mut image.bytes);
                if let Some(whole) = image.datagrams.get_mut(self.datagram) {
                    *whole = moment;
                }
            }
            Brought::InRuns => self.deliver_runs(link, bytes, image, moment),
        }
    }

    /// Puts inputs into several places of the image.
    #[inline(never)]
    fn deliver_runs(&mut self, link: usize, bytes: &[u8], image: &mut Image, moment: Moment) {
        let view = &self.views[link];
        view.runs.iter().for_each(|run| run.deliver(bytes, &mut image.bytes));
        if view.is_all {
            if let Some(whole) = image.datagrams.get_mut(self.datagram) {
                *whole = moment;
            }
        } else if !image.note_share(self.datagram, link, view.share, moment) {
            let has_arrived = |part: usize| self.contributions[self.segments[part].contribution].delivered[link];
            self.views[link].share = image.take_share(self.datagram, link, has_arrived, moment);
        }
    }

    /// As [`Place::deliver`], for inputs one by one: inputs with a newer value, or a value from the other copy of the
    /// flight, are left out. False where something newer was there.
    #[cold]
    pub fn deliver_singly(&self, link: usize, bytes: &[u8], image: &mut Image, moment: Moment) -> bool {
        let mut newest = true;
        for (number, segment) in self.segments.iter().enumerate() {
            if !self.contributions[segment.contribution].delivered[link] {
                continue;
            }
            let input = self.number_of(number);
            let before = image.moment(input);
            newest &= before.left <= moment.left;
            if before.left < moment.left {
                segment.span.deliver(bytes, &mut image.bytes);
                if let Some(part) = image.parts.get_mut(input.part) {
                    *part = moment;
                }
            }
        }
        newest
    }

    fn number_of(&self, segment: usize) -> InputNumber {
        InputNumber { datagram: self.datagram, part: self.first_part + segment }
    }

    /// Applies which SubDevices take part, and which may be missing.
    pub fn follow(&mut self, board: &Board) {
        for contribution in &mut self.contributions {
            let takes_part = board.takes_part(contribution.subdevice);
            contribution.is_proven = takes_part && !board.is_unproven(contribution.subdevice);
            contribution.required = takes_part || !board.is_optional(contribution.subdevice);
            contribution.is_mapped = board.is_unproven(contribution.subdevice);
        }
    }

    /// Inputs of a SubDevice in it.
    pub fn inputs_of(&self, subdevice: usize) -> impl Iterator<Item = InputNumber> {
        let numbered = self.segments.iter().enumerate();
        numbered.filter(move |(_, segment)| segment.subdevice == subdevice).map(|(number, _)| self.number_of(number))
    }

    /// Where the outputs lie in the frame.
    pub fn outputs_in_frame(&self) -> impl Iterator<Item = &Span> {
        core::iter::once(&self.outputs).chain(&self.outputs_apart)
    }

    /// Whether outputs contain all the given bytes of the image.
    pub fn has_outputs(&self, bytes: &Range<usize>) -> bool {
        self.outputs.holds(bytes) || self.outputs_apart.iter().any(|span| span.holds(bytes))
    }

    /// The SubDevice whose inputs contain all the given bytes of the image.
    pub fn whose_inputs(&self, bytes: &Range<usize>) -> Option<usize> {
        self.segments.iter().find(|segment| segment.span.holds(bytes)).map(|segment| segment.subdevice)
    }
}

/// Spans with neighbours joined.
fn joined(spans: impl Iterator<Item = Span>) -> Vec<Span> {
    let mut runs: Vec<Span> = Vec::new();
    for span in spans {
        match runs.last_mut() {
            Some(run) if run.reaches(&span) => run.length += span.length,
            _ => runs.push(span),
        }
    }
    runs
}

impl Contribution {
    fn new(subdevice: usize, wkc: Wkc, has_inputs: bool) -> Contribution {
        Contribution {
            subdevice,
            wkc,
            has_inputs,
            witness: None,
            is_proven: false,
            required: true,
            is_mapped: false,
            delivered: [false; 2],
            processed: [false; 2],
        }
    }

    fn forget(&mut self, link: usize) {
        (self.delivered[link], self.processed[link]) = (false, false);
    }

    /// The only SubDevice of a datagram. False where it processed a copy twice.
    fn match_alone(&mut self, link: usize, wkc: Wkc, command: Command) -> bool {
        let has_both = command == Command::Lrw && self.wkc == Wkc(3);
        self.processed[link] = wkc == self.wkc;
        // Below SAFEOP its inputs are undefined memory content.
        self.delivered[link] = self.is_proven && (wkc == self.wkc || (has_both && wkc == INPUTS_OF_LRW));
        wkc.0 <= self.wkc.0
    }
}

/// Determines which of several SubDevices processed a copy: those that take part and are in a state in which they
/// deliver inputs. The working counter must contain their increments, and at most the increments that the others
/// present can have added. False where it does not.
fn match_all(all: &mut [Contribution], link: usize, wkc: Wkc, presence: &Presence) -> bool {
    let (mut sure, mut others) = (0, 0);
    for contribution in all.iter_mut() {
        let passed = contribution.witness.map_or(Passed::Not, |place| presence.passed(link, place));
        contribution.delivered[link] = passed == Passed::Delivering && contribution.is_proven;
        contribution.processed[link] = contribution.delivered[link];
        match passed {
            Passed::Not => {}
            Passed::Delivering if contribution.is_proven => sure += u32::from(contribution.wkc.0),
            Passed::Delivering | Passed::Somehow => others += u32::from(contribution.wkc.0),
        }
    }
    let wkc = u32::from(wkc.0);
    if wkc == sure + others {
        // Every SubDevice present added its full increment. Below SAFEOP inputs are undefined memory content.
        for contribution in all.iter_mut() {
            let passed = contribution.witness.map_or(Passed::Not, |place| presence.passed(link, place));
            contribution.delivered[link] = passed == Passed::Delivering;
            contribution.processed[link] = passed != Passed::Not;
        }
    }
    (sure..=sure + others).contains(&wkc)
}

impl Span {
    /// Whether it contains all the given bytes of the image.
    pub fn holds(&self, image: &Range<usize>) -> bool {
        let start = self.image_at as usize;
        start <= image.start && image.end <= start + usize::from(self.length)
    }

    /// Whether `next` follows directly.
    fn reaches(&self, next: &Span) -> bool {
        self.frame_at + self.length == next.frame_at && self.image_at + u32::from(self.length) == next.image_at
    }

    /// Copies from the image into the frame.
    pub fn load(&self, image: &[u8], frame: &mut [u8]) {
        copy(image, self.image_at as usize, frame, self.frame_at.into(), self.length);
    }

    /// Copies from a frame into another one with the same process data.
    pub fn take_over(&self, from: &[u8], to: &mut [u8]) {
        copy(from, self.frame_at.into(), to, self.frame_at.into(), self.length);
    }

    fn deliver(&self, frame: &[u8], image: &mut [u8]) {
        copy(frame, self.frame_at.into(), image, self.image_at as usize, self.length);
    }
}

#[inline(always)]
fn copy(from: &[u8], from_at: usize, to: &mut [u8], to_at: usize, length: u16) {
    let length = usize::from(length);
    if length > 0
        && let Some(to) = to.get_mut(to_at..to_at + length)
        && let Some(from) = from.get(from_at..from_at + length)
    {
        to.copy_from_slice(from);
    }
}
