//! What an INACTIVE MainDevice takes from the frames that it forwards, and puts into them (protocol FR-08).
//!
//! [`Following::fill`] works on a frame before it is forwarded, and on its first pass only: it takes the areas of the
//! ACTIVE from master frames, puts the answer and the process data of this MainDevice into them, and counts both in the
//! working counters. A cycle counts when all its fragments have arrived, of either copy; otherwise the one before stays
//! as it is (protocol 9.8). Both copies of a frame get the same bytes, because a cycle has one snapshot of them.

mod content;
mod cycle;
mod knowledge;
mod outputs;

use alloc::sync::Arc;

use ringcat_wire::master_frame::{
    Answer, Area, Fragment, Header, Lengths, MasterFrameError, NotReady, Phase, Stage, fragments_mut, is_master_frame,
};

pub(crate) use self::content::Content;
use self::cycle::Cycle;
use self::knowledge::ReceivedKnowledge;
pub(crate) use self::outputs::OutputsSeen;
use crate::board::standby::StandbyWords;
use crate::link::Link;
use crate::ring::identity::class_of;
use crate::ring::{Class, Sequence, foreign_frame, is_forwarded};
use crate::time::Instant;

/// A cycle whose number is this much lower than the newest one belongs to another count: the ACTIVE has begun anew.
const ANEW: i32 = -16;

/// The last cycle of which everything has arrived.
#[derive(Debug)]
pub(crate) struct Whole {
    pub cycle: u32,
    pub header: Header,
    pub content: Content,
    /// When its last fragment arrived.
    pub at: Instant,
}

/// Why fragments of the ACTIVE are not used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unusable {
    /// It has a version that this MainDevice does not understand.
    Version { least: u8, got: u8 },
    /// Areas have other lengths than here.
    Lengths(Lengths),
}

/// The master frames as received by the INACTIVE.
#[derive(Debug)]
pub(crate) struct Following {
    lengths: Lengths,
    words: Arc<StandbyWords>,
    knowledge: ReceivedKnowledge,
    /// By the lowest bit of the cycle.
    cycles: [Cycle; 2],
    whole: Whole,
    has_whole: bool,
    /// The sender that is followed.
    sender: Option<[u8; 3]>,
    newest: Option<u32>,
    /// By link, the last cycle whose last fragment arrived there, and when.
    ended: [Option<(u32, Instant)>; 2],
    /// When the first master frame of the newest cycle arrived.
    begun_at: Instant,
    pub unusable: Option<Unusable>,
    /// Since the last [`Following::take_anew`] this INACTIVE has begun to follow another ACTIVE, or the same one after
    /// a restart.
    is_anew: bool,
    /// The answer, without what depends on the cycle.
    pub answer: Answer,
}

impl Following {
    /// `lengths`: bytes of the areas by the own configuration; zeros without one.
    pub fn new(lengths: Lengths, words: Arc<StandbyWords>) -> Following {
        let cycle = || Cycle::new(&lengths);
        Following {
            cycles: [cycle(), cycle()],
            whole: Whole { cycle: 0, header: Header::default(), content: Content::new(&lengths), at: Instant::NEVER },
            has_whole: false,
            knowledge: ReceivedKnowledge::default(),
            sender: None,
            newest: None,
            ended: [None; 2],
            begun_at: Instant::NEVER,
            unusable: None,
            is_anew: false,
            answer: Answer { not_ready: NotReady::NO_CYCLE, ..Answer::new() },
            lengths,
            words,
        }
    }

    /// The last whole cycle.
    pub fn whole(&self) -> Option<&Whole> {
        self.has_whole.then_some(&self.whole)
    }

    /// The sender that is followed.
    pub fn sender(&self) -> Option<[u8; 3]> {
        self.sender
    }

    /// The newest cycle of which anything has arrived, and when its first master frame did.
    pub fn newest(&self) -> Option<(u32, Instant)> {
        Some((self.newest?, self.begun_at))
    }

    /// By link, the last cycle that has ended there, and when.
    pub fn ended(&self) -> [Option<(u32, Instant)>; 2] {
        self.ended
    }

    /// Whether a cycle is whole, or was.
    pub fn is_whole(&self, cycle: u32) -> bool {
        self.has_whole && self.whole.cycle.wrapping_sub(cycle) as i32 >= 0
    }

    /// Whether this INACTIVE has begun to follow another ACTIVE since the last call, or the same one after a restart:
    /// what is known of the previous session is no longer valid.
    pub fn take_anew(&mut self) -> bool {
        core::mem::take(&mut self.is_anew)
    }

    /// This INACTIVE begins to follow another ACTIVE, or the same one after a restart.
    fn begin_anew(&mut self, sender: Option<[u8; 3]>) {
        self.reset();
        (self.sender, self.is_anew) = (sender, true);
    }

    /// Forgets the ACTIVE: what is whole stays.
    pub fn forget(&mut self) {
        (self.sender, self.newest, self.ended) = (None, None, [None; 2]);
        (self.begun_at, self.unusable) = (Instant::NEVER, None);
        self.cycles.iter_mut().for_each(Cycle::forget);
        self.knowledge.forget();
    }

    /// The role was another one: nothing of the ACTIVE is known.
    pub fn reset(&mut self) {
        self.forget();
        self.has_whole = false;
    }

    /// Whether this MainDevice has accepted the role in a cycle.
    pub fn has_accepted(&self, cycle: u32) -> bool {
        self.cycles[cycle as usize & 1].has_accepted(cycle)
    }

    /// Takes and fills a received frame of another MainDevice, before it is forwarded. True if it is a master frame.
    /// `to_active`: process data of this MainDevice for the ACTIVE.
    pub fn fill(&mut self, arrived_on: Link, frame: &mut [u8], now: Instant, to_active: &[u8]) -> bool {
        if !is_master_frame(frame) {
            return false;
        }
        // Acyclic ones are taken by the acyclic half.
        let is_of_cycle = !is_forwarded(frame) && class_of(frame) == Some(Class::Cyclic);
        let Some((sender, sequence)) = foreign_frame(frame).filter(|_| is_of_cycle) else { return true };
        if *self.sender.get_or_insert(sender) != sender {
            // Another one controls the bus now.
            self.begin_anew(Some(sender));
        }
        let mut cycle = None;
        for fragment in fragments_mut(frame) {
            cycle = cycle.or(Some(fragment.head.cycle));
            self.take(fragment, (arrived_on, sequence), now, to_active);
        }
        if let Some(cycle) = cycle {
            self.complete(cycle, now);
        }
        true
    }

    fn take(
        &mut self,
        mut fragment: Fragment<'_>,
        (arrived_on, sequence): (Link, Sequence),
        now: Instant,
        to_active: &[u8],
    ) {
        let head = fragment.head;
        if !self.begin(head.cycle, now) {
            return;
        }
        let answer = (head.area == Area::Answer).then(|| self.answer_to(head.cycle));
        let cycle = &mut self.cycles[head.cycle as usize & 1];
        let is_first = cycle.note(head.number);
        let is_done = match head.area {
            Area::Header => match Header::decode(fragment.data) {
                Ok(header) => {
                    self.unusable = (header.lengths != self.lengths).then_some(Unusable::Lengths(header.lengths));
                    self.words.post_header(&header, now);
                    self.knowledge.expect(&header);
                    cycle.header = Some((header, sequence));
                    true
                }
                Err(MasterFrameError::Version { least, got }) => {
                    self.unusable = Some(Unusable::Version { least, got });
                    false
                }
                Err(_) => false,
            },
            Area::Answer => answer.is_some_and(|answer| cycle.give_answer(&answer, fragment.data)),
            Area::ToActive => cycle.give(to_active, head.offset, fragment.data),
            // Without its header it may be a piece of other knowledge.
            Area::Knowledge if cycle.header.is_none() => false,
            Area::Knowledge => {
                self.knowledge.take(&self.words.partner_knowledge, head.offset as usize, fragment.data);
                true
            }
            area => cycle.content.take(area, head.offset, fragment.data, is_first),
        };
        if is_done {
            fragment.count();
        }
        if cycle.header.is_some_and(|(header, _)| header.fragments == head.number.wrapping_add(1)) {
            self.ended[arrived_on.index()] = Some((head.cycle, now));
        }
    }

    /// A fragment of a cycle arrives. False if the cycle is too old.
    fn begin(&mut self, number: u32, now: Instant) -> bool {
        let age = self.newest.map_or(1, |newest| number.wrapping_sub(newest) as i32);
        if age < ANEW {
            self.begin_anew(self.sender);
        } else if age < -1 {
            return false;
        }
        if self.newest.is_none() || age > 0 {
            (self.newest, self.begun_at) = (Some(number), now);
        }
        let cycle = &mut self.cycles[number as usize & 1];
        if cycle.number != Some(number) {
            cycle.begin(number);
        }
        true
    }

    /// The answer in a cycle.
    fn answer_to(&self, cycle: u32) -> Answer {
        let header = self.cycles[cycle as usize & 1].header.map(|(header, _)| header);
        let is_offered = header.is_some_and(|header| matches!(header.phase, Phase::Offers | Phase::Ends));
        let not_ready = self.answer.not_ready;
        let stage = match (not_ready.is_ready(), is_offered) {
            (true, true) => Stage::Accepts,
            (true, false) => Stage::Ready,
            (false, _) if not_ready.has(NotReady::NO_APPLICATION) => Stage::Listens,
            (false, _) => Stage::Follows,
        };
        Answer { stage, whole: if self.has_whole { self.whole.cycle } else { 0 }, ..self.answer }
    }

    /// Makes a cycle the whole one, if everything of it is there.
    fn complete(&mut self, number: u32, now: Instant) {
        let is_older = self.is_whole(number);
        let cycle = &mut self.cycles[number as usize & 1];
        let Some((header, _)) = cycle.header.filter(|_| cycle.number == Some(number) && !cycle.is_done) else { return };
        if header.lengths != self.lengths || !cycle.is_whole(&header) {
            return;
        }
        cycle.is_done = true;
        if is_older {
            return;
        }
        core::mem::swap(&mut self.whole.content, &mut cycle.content);
        (self.whole.cycle, self.whole.header, self.whole.at) = (number, header, now);
        self.has_whole = true;
        self.words.diagnosis.write(&self.whole.content.diagnosis);
    }

    /// The header of a cycle of which not everything may have arrived, with the sequence number of its frame.
    pub fn header_of(&self, cycle: u32) -> Option<(Header, Sequence)> {
        let found = &self.cycles[cycle as usize & 1];
        found.header.filter(|_| found.number == Some(cycle))
    }
}
