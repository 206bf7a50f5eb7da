//! The master frames of the ACTIVE: sent after the frames with process data, and what comes back in them.
//!
//! The bytes of the frames are built once; each cycle writes the areas of the ACTIVE into them. A copy that comes back
//! shows by its working counters whether the INACTIVE has taken and filled it. Each copy is evaluated by itself: either
//! copy is enough, and counters of both are never added (protocol 9.8).

mod frame;

use alloc::boxed::Box;
use alloc::vec;

use ringcat_wire::master_frame::{Answer, Area, Diagnosis, DomainRecord, Header, MasterFrameError, SubDeviceRecord};

use self::frame::MasterFrame;
use super::domain::Domain;
use super::flight::Step;
use crate::board::Board;
use crate::board::live::Presence;
use crate::board::standby::StandbyWords;
use crate::domain::{DomainId, DomainState, Freshness};
use crate::exchange::CyclicCounters;
use crate::layout::{PlannedFragment, PlannedMasterFrames};
use crate::link::{Link, LinkSet};
use crate::ring::{FrameCopy, Identity, RingState, Sequence};

/// Bytes of inputs, from the image of a domain into a frame.
#[derive(Clone, Copy, Debug)]
struct Move {
    domain: DomainId,
    image_at: usize,
    frame: usize,
    frame_at: usize,
    length: usize,
}

/// What a cycle has brought back from the INACTIVE.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Returned {
    /// A copy was forwarded by an INACTIVE MainDevice.
    pub is_forwarded: bool,
    /// The INACTIVE has taken all areas for it that were sent.
    pub is_taken: bool,
    /// Its answer.
    pub answer: Option<Answer>,
    /// Its answer is of a version that cannot be read: that version, and the oldest one that could.
    pub unreadable: Option<(u8, u8)>,
}

/// Where the areas of the ACTIVE come from.
pub(super) struct Sources<'a> {
    pub board: &'a Board,
    pub words: &'a StandbyWords,
    pub domains: &'a [Domain],
    pub counters: &'a CyclicCounters,
    pub ring: RingState,
    /// Process data for the INACTIVE.
    pub to_inactive: &'a [u8],
}

/// The master frames.
#[derive(Debug)]
pub(super) struct MasterFrames {
    frames: Box<[MasterFrame]>,
    moves: Box<[Move]>,
    /// The domain of each SubDevice whose inputs are shown as fresh or not.
    domains: Box<[Option<DomainId>]>,
    /// [`Board`]'s number of changes for which the states in the frames are valid, if all inputs were fresh then.
    states_at: Option<u64>,
    /// The cycle that was sent last.
    pub cycle: u32,
    /// Its header.
    pub header: Header,
    /// Process data of the INACTIVE in the cycle under way.
    coming: Box<[u8]>,
    /// The last cycle in which all of it came, while this MainDevice is ACTIVE.
    pub to_active_cycle: Option<u32>,
    /// Frames with areas of the INACTIVE, and those of them that came back filled in this cycle.
    filled: (usize, usize),
    answer: [u8; Answer::LEN],
    diagnosis: Box<[u8]>,
    knowledge_at: usize,
}

impl MasterFrames {
    pub fn new(
        identity: &Identity,
        planned: &PlannedMasterFrames,
        header: Header,
        domains: Box<[Option<DomainId>]>,
    ) -> MasterFrames {
        let mut number = 0;
        let mut frames = alloc::vec::Vec::with_capacity(planned.frames.len());
        for fragments in &planned.frames {
            frames.push(MasterFrame::new(identity, fragments, number));
            number += fragments.len() as u16;
        }
        let zeros = |length: u32| vec![0; length as usize].into_boxed_slice();
        let lengths = planned.lengths;
        let filled = frames.iter().filter(|frame| frame.is_filled_by_inactive()).count();
        MasterFrames {
            moves: moves(planned, &frames),
            frames: frames.into_boxed_slice(),
            domains,
            states_at: None,
            cycle: 0,
            header: Header { lengths, fragments: number, ..header },
            coming: zeros(lengths.to_active),
            to_active_cycle: None,
            filled: (filled, 0),
            answer: [0; Answer::LEN],
            diagnosis: zeros(lengths.diagnosis),
            knowledge_at: 0,
        }
    }

    /// Number of frames.
    pub fn count(&self) -> usize {
        self.frames.len()
    }

    /// Whether copies of the last cycle may still come back.
    pub fn is_expected(&self) -> bool {
        self.frames.iter().any(|frame| !frame.is_home())
    }

    /// What the last cycle has brought back so far.
    pub fn returned(&self) -> Returned {
        let answer = (self.filled.0 == self.filled.1).then(|| Answer::decode(&self.answer));
        Returned {
            is_forwarded: self.frames.iter().any(MasterFrame::is_forwarded),
            is_taken: self.frames.iter().all(MasterFrame::is_taken),
            unreadable: match answer {
                Some(Err(MasterFrameError::Version { least, got })) => Some((got, least)),
                _ => None,
            },
            answer: answer.and_then(Result::ok),
        }
    }

    /// Number of frames of the last cycle of which no copy came back.
    pub fn lost(&self) -> u64 {
        self.frames.iter().filter(|frame| frame.is_lost()).count() as u64
    }

    /// Writes the areas of the next cycle into the frames.
    pub fn load(&mut self, sources: &Sources<'_>) {
        self.cycle = self.cycle.wrapping_add(1);
        self.filled.1 = 0;
        self.write_diagnosis(sources);
        self.write_states(sources);
        let cycle = self.cycle;
        self.frames.iter_mut().for_each(|frame| frame.begin(cycle));
        for at in &self.moves {
            let image = sources.domains.get(at.domain.0).map_or(&[][..], Domain::image);
            if let Some(bytes) = image.get(at.image_at..at.image_at + at.length) {
                self.frames[at.frame].write(at.frame_at, bytes);
            }
        }
        self.write_knowledge(sources.words);
        let (to_inactive, diagnosis) = (sources.to_inactive, &self.diagnosis);
        for frame in &mut self.frames {
            frame.write_area(Area::ToInactive, to_inactive);
            frame.write_area(Area::Diagnosis, diagnosis);
        }
        let mut header = [0; Header::LEN];
        self.header.encode(&mut header);
        self.frames.iter_mut().for_each(|frame| frame.write_area(Area::Header, &header));
    }

    /// A byte per SubDevice, and the lowest state of those that answer. Those of the last cycle stay while no state has
    /// changed and all inputs are fresh, as in nearly every cycle.
    fn write_states(&mut self, sources: &Sources<'_>) {
        let are_fresh = sources.domains.iter().all(|domain| domain.state() == DomainState::Complete);
        // Before the states: one that changes meanwhile is written in the next cycle.
        let states_at = are_fresh.then(|| sources.board.live.changes());
        if states_at.is_some() && states_at == self.states_at {
            return;
        }
        let mut lowest = u8::MAX;
        for frame in &mut self.frames {
            let domains = &self.domains;
            frame.write_each(Area::SubDevices, |subdevice| {
                let life = sources.board.live.life(subdevice).unwrap_or_default();
                let domain = domains.get(subdevice).copied().flatten();
                let answers = life.presence != Presence::Offline;
                let is_fresh = || match domain.and_then(|id| sources.domains.get(id.0)) {
                    Some(domain) => domain.freshness(subdevice) == Freshness::Fresh,
                    None => answers,
                };
                if answers {
                    lowest = lowest.min(life.al_status & 0x0F);
                }
                let record = SubDeviceRecord::new(life.al_status).with_answers(answers);
                let record = record.with_settled(life.presence == Presence::Settled);
                record.with_fresh(answers && (are_fresh || is_fresh())).0
            });
        }
        self.states_at = states_at;
        self.header.state = if lowest == u8::MAX { 0 } else { lowest };
    }

    fn write_diagnosis(&mut self, sources: &Sources<'_>) {
        let Sources { board, domains, counters, ring, .. } = sources;
        let seen = board.responding();
        let bits = |link: Link| board.live.carrier(link).map_or(0, |has| 1 + u8::from(has));
        let CyclicCounters { sent, lost, incomplete, skipped, foreign, .. } = **counters;
        let ring = match ring {
            RingState::Unknown => 0,
            RingState::Closed => 1,
            RingState::Open => 2,
        };
        let diagnosis = Diagnosis {
            ring,
            carriers: bits(Link::Main) | bits(Link::Redundant) << 2,
            al_states: seen.al_status,
            answering: [seen.main.0, seen.redundant.0],
            sent,
            lost,
            incomplete,
            skipped,
            foreign,
        };
        diagnosis.encode(&mut self.diagnosis);
        let records = self.diagnosis[Diagnosis::LEN..].chunks_exact_mut(DomainRecord::LEN);
        for (domain, record) in domains.iter().zip(records) {
            let status = domain.status(false);
            let state = match status.state {
                DomainState::Zero => 0,
                DomainState::Incomplete => 1,
                DomainState::Complete => 2,
            };
            DomainRecord { state, wkc: status.wkc, expected: status.expected }.encode(record);
        }
    }

    /// The next piece of the knowledge.
    fn write_knowledge(&mut self, words: &StandbyWords) {
        let at = self.knowledge_at;
        let mut read = None;
        for frame in &mut self.frames {
            frame.write_piece(Area::Knowledge, at, |place| {
                read = words.knowledge.read_at(at, place).map(|it| (it, place.len()));
                read.is_some()
            });
        }
        let Some(((version, length), piece)) = read else {
            (self.header.knowledge_len, self.knowledge_at) = (0, 0);
            return;
        };
        let is_new = self.header.knowledge != version as u16 || self.header.knowledge_len != length as u32;
        (self.header.knowledge, self.header.knowledge_len) = (version as u16, length as u32);
        self.knowledge_at = if is_new || at + piece >= length { 0 } else { at + piece };
    }

    /// Sends the loaded frames on both links. `next` gives each frame its sequence number.
    pub fn send(
        &mut self,
        identity: &Identity,
        links: LinkSet,
        mut next: impl FnMut(usize) -> Sequence,
        transmit: &mut impl FnMut(Link, &[u8]),
    ) -> u64 {
        let mut bytes = 0;
        for (number, frame) in self.frames.iter_mut().enumerate() {
            bytes += frame.send(identity, links, next(number), transmit) as u64;
        }
        bytes
    }

    /// Takes a copy that came back. `to_active`: place of the process data of the INACTIVE, as soon as all of it came.
    pub fn receive(&mut self, number: usize, copy: FrameCopy, bytes: &[u8], to_active: &mut [u8]) -> Step {
        let Some(frame) = self.frames.get_mut(number) else { return Step::Late };
        let was_filled = frame.is_filled();
        let step = frame.receive(copy, bytes);
        let brings = frame.is_filled() && (!was_filled || copy.sent_on == Link::Main);
        if matches!(step, Step::Waiting | Step::Finished) && brings {
            frame.read_area(bytes, Area::Answer, &mut self.answer);
            frame.read_area(bytes, Area::ToActive, &mut self.coming);
            self.filled.1 += usize::from(!was_filled);
            if self.filled.0 == self.filled.1 {
                to_active.copy_from_slice(&self.coming);
                self.to_active_cycle = Some(self.cycle);
            }
        }
        step
    }

    /// No copy is expected any more: the role is INACTIVE.
    pub fn end(&mut self) {
        self.frames.iter_mut().for_each(MasterFrame::close);
        (self.filled.1, self.to_active_cycle) = (0, None);
    }
}

/// Where the inputs go.
fn moves(planned: &PlannedMasterFrames, frames: &[MasterFrame]) -> Box<[Move]> {
    let mut moves = alloc::vec::Vec::new();
    for (frame, fragments) in planned.frames.iter().enumerate() {
        for (number, fragment) in fragments.iter().enumerate().filter(|(_, it)| it.area == Area::Inputs) {
            let PlannedFragment { offset, length, .. } = *fragment;
            for run in &planned.inputs {
                let begin = run.offset.max(offset);
                let end = (run.offset + run.length).min(offset + length);
                if begin < end {
                    moves.push(Move {
                        domain: run.domain,
                        image_at: run.image_offset + begin - run.offset,
                        frame,
                        frame_at: frames[frame].data_at(number) + begin - offset,
                        length: end - begin,
                    });
                }
            }
        }
    }
    moves.into_boxed_slice()
}
