//! What the two halves of the engine exchange without a queue: the latest value of a few words.
//!
//! The exchange posts the result of its supervision datagram and the state of the ring; the supervisor posts which
//! SubDevices take part in process data. Readers use the latest value, so a slow reader blocks and loses nothing.

pub mod clock_times;
pub mod clocks;
pub mod commands;
pub mod live;
mod rest;
#[cfg(feature = "standby")]
pub mod sheet;
#[cfg(feature = "standby")]
pub mod standby;
pub mod traffic;

use alloc::vec::Vec;
use core::sync::atomic::{AtomicU32, AtomicU64, Ordering};

use ringcat_wire::address::{StationAddress, Wkc};

use crate::link::Link;
use crate::ring::RingState;

/// Result of one supervision datagram, a BRD of AL status.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Supervision {
    /// SubDevices that processed the main copy.
    pub main: Wkc,
    /// SubDevices that processed the redundant copy.
    pub redundant: Wkc,
    /// OR of the lower bytes of all AL status words, by the copy that read them.
    pub al_status: [u8; 2],
    /// OR of all ECAT event requests (register 0x0210 under its mask).
    pub irq: u16,
    /// A copy came back on the link it was sent on: the counts are those of an open ring, or of one link.
    pub returned: bool,
}

/// Bits of both AL status bytes that are kept: the upper two carry no information (protocol 5.3).
const AL_MASK: u16 = 0x3F3F;
/// Bit of [`Supervision::returned`] in the packed word: one of those that [`AL_MASK`] leaves free.
const RETURNED_BIT: u32 = 32 + 15;

impl Supervision {
    /// SubDevices that answered on either copy.
    pub const fn total(&self) -> Wkc {
        self.main.plus(self.redundant)
    }

    /// The packed word: results of copies are put together by OR.
    pub(crate) const fn pack(self) -> u64 {
        self.main.0 as u64
            | (self.redundant.0 as u64) << 16
            | ((u16::from_le_bytes(self.al_status) & AL_MASK) as u64) << 32
            | (self.returned as u64) << RETURNED_BIT
            | (self.irq as u64) << 48
    }

    /// Bit of a packed word that says [`Supervision::returned`].
    pub(crate) const RETURNED: u64 = 1 << RETURNED_BIT;

    pub(crate) const fn unpack(word: u64) -> Supervision {
        Supervision {
            main: Wkc(word as u16),
            redundant: Wkc((word >> 16) as u16),
            al_status: ((word >> 32) as u16 & AL_MASK).to_le_bytes(),
            irq: (word >> 48) as u16,
            returned: word >> RETURNED_BIT & 1 != 0,
        }
    }
}

/// State of the ring as the exchange last posted it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RingWord {
    /// The state.
    pub state: RingState,
    /// Number of changes, so that a quick double change is seen too.
    pub changes: u32,
    /// In an open ring the first copy that showed it: the link it was sent on and came back on, and the SubDevices that
    /// processed it, where it carried a supervision datagram.
    pub returned: Option<(Link, u16)>,
    /// The link whose copies are lost though those of the other link pass the ring.
    pub dead_way: Option<Link>,
}

impl RingWord {
    /// State in bits 0 and 1, link that returned plus one in 2 and 3, dead way plus one in 4 and 5, SubDevices in 16 to
    /// 31, changes above.
    const fn pack(self) -> u64 {
        let state = match self.state {
            RingState::Unknown => 0,
            RingState::Closed => 1,
            RingState::Open => 2,
        };
        let (returned, count) = match self.returned {
            None => (0, 0),
            Some((link, count)) => (link.index() as u64 + 1, count as u64),
        };
        let dead_way = match self.dead_way {
            None => 0,
            Some(link) => link.index() as u64 + 1,
        };
        state | returned << 2 | dead_way << 4 | count << 16 | (self.changes as u64) << 32
    }

    fn unpack(word: u64) -> RingWord {
        let link = |bits: u64| (bits & 3).checked_sub(1).and_then(|index| Link::ALL.get(index as usize).copied());
        RingWord {
            state: match word & 3 {
                1 => RingState::Closed,
                2 => RingState::Open,
                _ => RingState::Unknown,
            },
            changes: (word >> 32) as u32,
            returned: link(word >> 2).map(|link| (link, (word >> 16) as u16)),
            dead_way: link(word >> 4),
        }
    }
}

/// Frames of the cyclic half since activation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CyclicFrames {
    /// Sent.
    pub sent: u64,
    /// Of these, frames of which no copy came back in time.
    pub lost: u64,
}

/// The shared words.
#[derive(Debug)]
pub struct Board {
    supervision: AtomicU64,
    /// Counts supervision results; 0 = none yet.
    supervision_count: AtomicU64,
    ring: AtomicU64,
    cycles: AtomicU64,
    frames: [AtomicU64; 2],
    /// Wrong working counters, by SubDevice.
    wkc_errors: Vec<AtomicU32>,
    /// One bit per SubDevice: takes part in process data.
    taking_part: Vec<AtomicU64>,
    taking_part_changes: AtomicU32,
    /// By SubDevice, the cycles after which its process data has left for the first time since it last took part.
    left_after: Vec<AtomicU64>,
    /// SubDevices that may be missing without a domain being incomplete.
    optional: Vec<bool>,
    /// One bit per SubDevice: its absence is intended.
    excused: Vec<AtomicU64>,
    /// One bit per SubDevice: its FMMUs are set, but it has not been seen to deliver its inputs yet.
    unproven: Vec<AtomicU64>,
    /// Distributed clocks.
    pub clocks: clocks::ClockWords,
    /// Frames of the cyclic half on the wire.
    pub traffic: traffic::Traffic,
    /// State of SubDevices and links, for any thread.
    pub live: live::LiveWords,
    /// Wrong working counters, by datagram.
    pub commands: commands::CommandWords,
}

impl Board {
    /// A board for this many SubDevices; none takes part.
    pub fn new(subdevices: usize) -> Board {
        Board {
            supervision: AtomicU64::new(0),
            supervision_count: AtomicU64::new(0),
            ring: AtomicU64::new(0),
            cycles: AtomicU64::new(0),
            frames: [AtomicU64::new(0), AtomicU64::new(0)],
            wkc_errors: (0..subdevices).map(|_| AtomicU32::new(0)).collect(),
            taking_part: (0..subdevices.div_ceil(64)).map(|_| AtomicU64::new(0)).collect(),
            excused: (0..subdevices.div_ceil(64)).map(|_| AtomicU64::new(0)).collect(),
            unproven: (0..subdevices.div_ceil(64)).map(|_| AtomicU64::new(0)).collect(),
            taking_part_changes: AtomicU32::new(0),
            left_after: (0..subdevices).map(|_| AtomicU64::new(0)).collect(),
            optional: Vec::new(),
            clocks: clocks::ClockWords::default(),
            traffic: traffic::Traffic::default(),
            live: live::LiveWords::new(subdevices),
            commands: commands::CommandWords::default(),
        }
    }

    /// Sets the numbers of process data datagrams, by domain.
    #[must_use]
    pub fn with_commands(mut self, datagrams: impl Iterator<Item = usize>) -> Board {
        self.commands = commands::CommandWords::new(datagrams);
        self
    }

    /// Sets the station addresses of the SubDevices.
    #[must_use]
    pub fn with_stations(mut self, stations: Vec<StationAddress>) -> Board {
        self.live.set_stations(stations);
        self
    }

    /// Sets which SubDevices may be missing without a domain being incomplete.
    #[must_use]
    pub fn with_optional(mut self, optional: Vec<bool>) -> Board {
        self.optional = optional;
        self
    }

    /// Whether a SubDevice may be missing without a domain being incomplete.
    pub fn is_optional(&self, subdevice: usize) -> bool {
        self.optional.get(subdevice).copied().unwrap_or(false) || bit(&self.excused, subdevice)
    }

    /// Sets whether the absence of a SubDevice is intended, so that no domain is incomplete without it.
    pub fn set_excused(&self, subdevice: usize, excused: bool) {
        self.set(&self.excused, subdevice, excused);
    }

    /// Sets whether a SubDevice with its FMMUs set has still to show that it delivers its inputs. Until then the
    /// increment of the working counter that its AL state allows is not expected.
    pub fn set_unproven(&self, subdevice: usize, unproven: bool) {
        self.set(&self.unproven, subdevice, unproven);
    }

    /// Whether a SubDevice has still to show that it delivers its inputs.
    pub fn is_unproven(&self, subdevice: usize) -> bool {
        bit(&self.unproven, subdevice)
    }

    /// Posts a packed result.
    #[inline]
    pub(crate) fn post_supervision(&self, supervision: u64) {
        self.supervision.store(supervision, Ordering::Relaxed);
        // Single writer: a plain store of the next number is enough, and cheaper than a read-modify-write.
        let count = self.supervision_count.load(Ordering::Relaxed);
        self.supervision_count.store(count + 1, Ordering::Release);
    }

    /// The latest supervision result and its number; `None` before the first.
    pub fn supervision(&self) -> Option<(u32, Supervision)> {
        let count = self.supervision_count.load(Ordering::Acquire);
        (count != 0).then(|| (count as u32, Supervision::unpack(self.supervision.load(Ordering::Relaxed))))
    }

    /// The number of the latest supervision result; 0 before the first.
    #[inline]
    pub(crate) fn supervision_number(&self) -> u32 {
        self.supervision_count.load(Ordering::Acquire) as u32
    }

    /// That result, packed, and whether there was any.
    #[inline]
    pub(crate) fn supervision_word(&self) -> (u64, bool) {
        let is_any = self.supervision_count.load(Ordering::Acquire) != 0;
        (self.supervision.load(Ordering::Relaxed), is_any)
    }

    /// The latest supervision result; none while supervision frames do not come back, after the application has ended,
    /// and of an INACTIVE without an ACTIVE.
    pub fn responding(&self) -> Supervision {
        let seen = self.supervision().filter(|_| !self.is_silent());
        seen.map(|(_, supervision)| supervision).unwrap_or_default()
    }

    /// Whether supervision frames do not come back, the application has ended, or no ACTIVE reports to this INACTIVE:
    /// then no SubDevice is known to be present.
    pub fn is_silent(&self) -> bool {
        self.live.is_silent(self.supervision_count.load(Ordering::Acquire))
    }

    /// Posts that the ACTIVE does not report any more: no SubDevice is known to be present.
    #[cfg(feature = "standby")]
    pub(crate) fn post_no_active(&self) {
        self.live.post_no_active(self.supervision_count.load(Ordering::Acquire));
    }

    /// Posts the carriers of the links.
    pub(crate) fn post_carriers(&self, carriers: [Option<bool>; 2]) {
        self.live.post_carriers(carriers);
    }

    /// Takes over what another board shows of the segment as a whole.
    pub(crate) fn go_on_from(&self, before: &Board) {
        if !before.is_silent()
            && let Some((_, seen)) = before.supervision()
        {
            self.post_supervision(seen.pack());
        }
        self.post_carriers(Link::ALL.map(|link| before.live.carrier(link)));
    }

    /// A supervision frame did not come back.
    #[cold]
    pub(crate) fn post_silence(&self) {
        self.live.post_silence(self.supervision_count.load(Ordering::Relaxed));
    }

    /// The application has ended: no SubDevice is known to be present.
    pub(crate) fn post_end(&self) {
        self.live.post_end(self.supervision_count.load(Ordering::Relaxed));
    }

    /// Posts the state of the ring and counts its changes.
    pub(crate) fn post_ring(&self, word: RingWord) {
        let before = RingWord::unpack(self.ring.load(Ordering::Relaxed));
        let changes = before.changes.wrapping_add(u32::from(before.state != word.state));
        self.ring.store(RingWord { changes, ..word }.pack(), Ordering::Release);
    }

    /// State of the ring in the exchange.
    pub fn ring(&self) -> RingWord {
        RingWord::unpack(self.ring.load(Ordering::Acquire))
    }

    /// State of the ring in the exchange, as a packed word.
    #[inline]
    pub(crate) fn ring_word(&self) -> u64 {
        self.ring.load(Ordering::Acquire)
    }

    /// Posts the number of cycles and frames sent.
    pub(crate) fn post_cycle(&self, cycles: u64, frames: u64) {
        self.frames[0].store(frames, Ordering::Relaxed);
        self.cycles.store(cycles, Ordering::Release);
    }

    /// Posts the number of frames lost.
    pub(crate) fn post_lost(&self, frames: u64) {
        self.frames[1].store(frames, Ordering::Relaxed);
    }

    /// Cycles that the exchange has sent: 0 until the application runs it.
    pub fn cycles(&self) -> u64 {
        self.cycles.load(Ordering::Acquire)
    }

    /// Frames of the cyclic half, up to the latest cycle.
    pub fn frames(&self) -> CyclicFrames {
        CyclicFrames { sent: self.frames[0].load(Ordering::Relaxed), lost: self.frames[1].load(Ordering::Relaxed) }
    }

    /// Counts a datagram with process data of a SubDevice that takes part, which came back with a wrong working counter
    /// or not at all.
    pub(crate) fn count_wkc_error(&self, subdevice: usize) {
        if let Some(counter) = self.wkc_errors.get(subdevice) {
            // Single writer.
            counter.store(counter.load(Ordering::Relaxed).wrapping_add(1), Ordering::Relaxed);
        }
    }

    /// Number of datagrams with process data of a SubDevice that, while it took part, came back with a working counter
    /// other than that of all SubDevices that take part, or did not come back. Wraps to 0.
    pub fn wkc_errors(&self, subdevice: usize) -> u32 {
        self.wkc_errors.get(subdevice).map_or(0, |counter| counter.load(Ordering::Relaxed))
    }

    /// Sets whether a SubDevice takes part in process data. Indices beyond the board are ignored.
    pub fn set_taking_part(&self, subdevice: usize, takes_part: bool) {
        if let Some(after) = self.left_after.get(subdevice).filter(|_| takes_part != self.takes_part(subdevice)) {
            after.store(0, Ordering::Relaxed);
        }
        self.set(&self.taking_part, subdevice, takes_part);
    }

    /// Sets or clears a bit and counts the change, if it is one.
    fn set(&self, words: &[AtomicU64], subdevice: usize, set: bool) {
        let Some(word) = words.get(subdevice / 64) else { return };
        let bit = 1 << (subdevice % 64);
        let before = if set { word.fetch_or(bit, Ordering::Relaxed) } else { word.fetch_and(!bit, Ordering::Relaxed) };
        if (before & bit != 0) != set {
            self.taking_part_changes.fetch_add(1, Ordering::Release);
        }
    }

    /// Whether a SubDevice takes part in process data.
    pub fn takes_part(&self, subdevice: usize) -> bool {
        bit(&self.taking_part, subdevice)
    }

    /// Posts that frames with process data of a SubDevice leave with the cycle that has this number. With process data
    /// in several domains the first of them counts.
    pub(crate) fn post_leaving(&self, subdevice: usize, cycle: u64) {
        if let Some(after) = self.left_after.get(subdevice).filter(|_| self.takes_part(subdevice)) {
            let _ = after.compare_exchange(0, cycle + 1, Ordering::Release, Ordering::Relaxed);
        }
    }

    /// Whether a cycle with process data of a SubDevice has been sent since it began to take part.
    pub fn has_left(&self, subdevice: usize) -> bool {
        let after = self.left_after.get(subdevice).map_or(0, |after| after.load(Ordering::Acquire));
        after > 0 && self.cycles() >= after
    }

    /// Number of changes to the bits `taking_part`, `excused` and `unproven` since activation.
    pub(crate) fn taking_part_changes(&self) -> u32 {
        self.taking_part_changes.load(Ordering::Acquire)
    }
}

fn bit(words: &[AtomicU64], subdevice: usize) -> bool {
    words.get(subdevice / 64).is_some_and(|word| word.load(Ordering::Relaxed) & (1 << (subdevice % 64)) != 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_latest_supervision_result_is_read_with_its_number() {
        let board = Board::new(1);
        assert_eq!(board.supervision(), None);
        let first = Supervision { main: Wkc(3), redundant: Wkc(1), al_status: [0x18, 8], irq: 4, returned: false };
        board.post_supervision(first.pack());
        board.post_supervision(Supervision { irq: 0x8004, ..first }.pack() | Supervision::RETURNED);
        assert_eq!(board.supervision(), Some((2, Supervision { irq: 0x8004, returned: true, ..first })));
    }

    // covers: ring-status
    #[test]
    fn the_state_of_the_ring_survives_the_word() {
        let board = Board::new(1);
        assert_eq!(board.ring(), RingWord::default());
        let open =
            RingWord { state: RingState::Open, changes: 1, returned: Some((Link::Redundant, 700)), dead_way: None };
        board.post_ring(open);
        assert_eq!(board.ring(), open);
        let closed = RingWord { state: RingState::Closed, changes: 2, returned: None, dead_way: Some(Link::Main) };
        board.post_ring(RingWord { changes: 0, ..closed });
        board.post_ring(RingWord { changes: 0, ..closed });
        assert_eq!(board.ring(), closed, "a change is counted once");
    }

    #[test]
    fn process_data_has_left_with_the_cycle_that_first_carries_it() {
        let board = Board::new(2);
        board.post_leaving(1, 0);
        board.post_cycle(1, 1);
        assert!(!board.has_left(1), "it takes no part");
        board.set_taking_part(1, true);
        board.post_leaving(1, 1);
        assert!(!board.has_left(1), "queued, not sent");
        board.post_cycle(2, 2);
        board.post_leaving(1, 7);
        assert!(board.has_left(1) && !board.has_left(0) && !board.has_left(2));
        board.set_taking_part(1, true);
        assert!(board.has_left(1), "no change");
        board.set_taking_part(1, false);
        board.set_taking_part(1, true);
        assert!(!board.has_left(1), "it takes part anew");
    }

    #[test]
    fn only_real_changes_of_taking_part_are_counted() {
        let board = Board::new(70);
        board.set_taking_part(69, true);
        board.set_taking_part(69, true);
        board.set_taking_part(1000, true);
        assert_eq!(board.taking_part_changes(), 1);
        assert!(board.takes_part(69) && !board.takes_part(68) && !board.takes_part(1000));
    }

    // covers: states
    #[test]
    fn one_that_is_away_on_purpose_is_optional_for_as_long() {
        let board = Board::new(2).with_optional(alloc::vec![true, false]);
        assert!(board.is_optional(0) && !board.is_optional(1));
        board.set_excused(1, true);
        assert!(board.is_optional(1));
        board.set_excused(1, false);
        assert!(!board.is_optional(1) && !board.is_optional(7));
        assert_eq!(board.taking_part_changes(), 2);
    }
}
