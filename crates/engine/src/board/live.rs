//! State of the segment and of each declared SubDevice, for readers in any thread: each value is one atomic word.
//!
//! The acyclic half posts presence, AL status and carriers. The exchange posts working counters, and only when a cycle
//! differs from the one before. A reader neither waits nor disturbs a writer.

use alloc::vec::Vec;
use core::sync::atomic::{AtomicU8, AtomicU32, AtomicU64, Ordering};

use ringcat_wire::address::StationAddress;
use ringcat_wire::al::{AlStatus, AlStatusCode};

use crate::link::Link;
use crate::order::InOrder;

/// Lost supervision frames in a row after which no SubDevice counts as responding. A single frame may be lost without a
/// break.
const SILENT_FRAMES: u64 = 2;
/// Bits of [`LiveWords::silence`] that count lost frames.
const LOSSES: u64 = 0xFF;

/// Presence of a SubDevice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Presence {
    /// It does not answer, or is not identified yet.
    #[default]
    Offline,
    /// It is being configured, or waits for the next attempt.
    Configuring,
    /// It reached its target state with its configuration.
    Settled,
}

/// Presence and last AL status of a SubDevice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Life {
    /// Its presence.
    pub presence: Presence,
    /// The lower byte of AL status; 0 until it is read.
    pub al_status: u8,
    /// The AL status code; 0 without an error.
    pub code: u16,
}

impl Life {
    const fn pack(self) -> u32 {
        self.al_status as u32 | (self.presence as u32) << 8 | (self.code as u32) << 16
    }

    const fn unpack(word: u32) -> Life {
        let presence = match word >> 8 & 3 {
            0 => Presence::Offline,
            1 => Presence::Configuring,
            _ => Presence::Settled,
        };
        Life { presence, al_status: word as u8, code: (word >> 16) as u16 }
    }
}

/// Working counters of a SubDevice's process data in the last evaluated cycles of its domains.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Share {
    /// Sum of its increments if it processes everything.
    pub expected: u16,
    /// Sum of the increments that it certainly made.
    pub counted: u16,
    /// Number of datagrams whose working counter does not show which of its SubDevices processed it.
    pub unknown: u16,
}

impl Share {
    const fn pack(self) -> u64 {
        self.expected as u64 | (self.counted as u64) << 16 | (self.unknown as u64) << 32
    }

    const fn unpack(word: u64) -> Share {
        Share { expected: word as u16, counted: (word >> 16) as u16, unknown: (word >> 32) as u16 }
    }
}

/// The words of one SubDevice.
#[derive(Debug, Default)]
struct Words {
    /// Writer: the acyclic half.
    life: AtomicU32,
    /// Writer: the exchange.
    share: AtomicU64,
}

/// The words.
#[derive(Debug, Default)]
pub struct LiveWords {
    subdevices: Vec<Words>,
    /// Changes of presence and AL status of any SubDevice.
    changes: AtomicU64,
    /// The SubDevices by their station addresses, in order. The addresses do not change.
    stations: Vec<(StationAddress, usize)>,
    /// By link two bits: 0 is unknown, 1 no carrier, 2 carrier.
    carriers: AtomicU8,
    /// Number of the supervision result before the last lost supervision frame, and the frames lost since that result
    /// in the lowest bits.
    silence: AtomicU64,
    /// Copies that did not come back in time, by the link on which they were sent, and their bytes.
    lost: [[AtomicU64; 2]; 2],
}

impl LiveWords {
    pub(super) fn new(subdevices: usize) -> LiveWords {
        LiveWords { subdevices: (0..subdevices).map(|_| Words::default()).collect(), ..LiveWords::default() }
    }

    pub(super) fn set_stations(&mut self, stations: Vec<StationAddress>) {
        self.stations = stations.into_iter().zip(0..).collect();
        self.stations.put_in_order();
    }

    /// Number of SubDevices.
    pub fn count(&self) -> usize {
        self.subdevices.len()
    }

    /// Presence and AL status of a SubDevice.
    pub fn life(&self, subdevice: usize) -> Option<Life> {
        Some(Life::unpack(self.subdevices.get(subdevice)?.life.load(Ordering::Relaxed)))
    }

    /// Number of changes of presence and AL status of any SubDevice: while it is the same, so is what [`Self::life`]
    /// returned after it was read.
    #[cfg(feature = "standby")]
    pub fn changes(&self) -> u64 {
        self.changes.load(Ordering::Acquire)
    }

    /// Stores a life, then counts the change: a reader that has the new number has the new life too.
    fn store_life(&self, words: &Words, life: Life) {
        let life = life.pack();
        if words.life.load(Ordering::Relaxed) != life {
            words.life.store(life, Ordering::Relaxed);
            self.changes.fetch_add(1, Ordering::Release);
        }
    }

    /// Posts the presence of a SubDevice. What was read at its address while it was offline is forgotten: another
    /// SubDevice may have answered there.
    pub(crate) fn post_presence(&self, subdevice: usize, presence: Presence) {
        let Some(words) = self.subdevices.get(subdevice) else { return };
        let before = Life::unpack(words.life.load(Ordering::Relaxed));
        let life = match (before.presence, presence) {
            (_, Presence::Offline) | (Presence::Offline, _) => Life { presence, ..Life::default() },
            _ => Life { presence, ..before },
        };
        self.store_life(words, life);
    }

    /// Posts presence and AL status of a SubDevice as reported by another MainDevice.
    #[cfg(feature = "standby")]
    pub(crate) fn post_life(&self, subdevice: usize, life: Life) {
        if let Some(words) = self.subdevices.get(subdevice) {
            self.store_life(words, life);
        }
    }

    /// Posts an AL status that was read at a station address. Addresses of SubDevices without a declaration are
    /// ignored.
    pub(crate) fn post_al_status(&self, station: StationAddress, status: AlStatus, code: AlStatusCode) {
        let Ok(found) = self.stations.binary_search_by_key(&station, |(station, _)| *station) else { return };
        let Some(words) = self.subdevices.get(self.stations[found].1) else { return };
        let before = Life::unpack(words.life.load(Ordering::Relaxed));
        if before.presence == Presence::Offline {
            return;
        }
        // Without an error the register may contain an identification (protocol 5.3).
        let code = if status.error { code.0 } else { 0 };
        let life = Life { al_status: status.bits() as u8, code, ..before };
        self.store_life(words, life);
    }

    /// Working counters of a SubDevice.
    pub fn share(&self, subdevice: usize) -> Option<Share> {
        Some(Share::unpack(self.subdevices.get(subdevice)?.share.load(Ordering::Relaxed)))
    }

    /// Changes the working counters of a SubDevice. For the exchange, the only writer.
    pub(crate) fn change_share(&self, subdevice: usize, change: impl FnOnce(&mut Share)) {
        let Some(words) = self.subdevices.get(subdevice) else { return };
        let mut share = Share::unpack(words.share.load(Ordering::Relaxed));
        change(&mut share);
        words.share.store(share.pack(), Ordering::Relaxed);
    }

    /// Posts the carriers of the links, by [`Link::index`].
    pub(crate) fn post_carriers(&self, carriers: [Option<bool>; 2]) {
        let bits = |carrier: Option<bool>| carrier.map_or(0, |has| 1 + u8::from(has));
        self.carriers.store(bits(carriers[0]) | bits(carriers[1]) << 2, Ordering::Relaxed);
    }

    /// Whether a link has a carrier; `None` if it does not report it.
    pub fn carrier(&self, link: Link) -> Option<bool> {
        let bits = self.carriers.load(Ordering::Relaxed) >> (2 * link.index()) & 3;
        (bits != 0).then_some(bits == 2)
    }

    /// A supervision frame after the result with this number did not come back.
    #[cold]
    pub(super) fn post_silence(&self, number: u64) {
        let before = self.silence.load(Ordering::Relaxed);
        let losses = if before >> 8 == number { (before & LOSSES) + 1 } else { 1 };
        self.silence.store(number << 8 | losses.min(LOSSES), Ordering::Relaxed);
    }

    /// The ACTIVE has not reported anything since the result with this number: its last report is kept for a takeover,
    /// but readers get `unknown`.
    #[cfg(feature = "standby")]
    pub(super) fn post_no_active(&self, number: u64) {
        self.silence.store(number << 8 | LOSSES, Ordering::Relaxed);
    }

    /// This MainDevice is ACTIVE: the last report of the former ACTIVE is valid until its own frames return.
    #[cfg(feature = "standby")]
    pub(crate) fn end_silence(&self) {
        self.silence.store(0, Ordering::Relaxed);
    }

    /// No supervision frame follows the result with this number: nothing is known of SubDevices and links any more.
    pub(super) fn post_end(&self, number: u64) {
        self.silence.store(number << 8 | LOSSES, Ordering::Relaxed);
        self.post_carriers([None; 2]);
        (0..self.subdevices.len()).for_each(|subdevice| self.post_presence(subdevice, Presence::Offline));
    }

    /// Whether supervision frames have been lost since the result with this number, more than single frames.
    pub(super) fn is_silent(&self, number: u64) -> bool {
        let silence = self.silence.load(Ordering::Relaxed);
        silence >> 8 == number && silence & LOSSES >= SILENT_FRAMES
    }

    /// Counts a copy of this length that did not come back in time. For the exchange, the only writer.
    #[cold]
    pub(crate) fn count_lost(&self, sent_on: Link, bytes: usize) {
        let [copies, lengths] = &self.lost[sent_on.index()];
        copies.store(copies.load(Ordering::Relaxed) + 1, Ordering::Relaxed);
        lengths.store(lengths.load(Ordering::Relaxed) + bytes as u64, Ordering::Relaxed);
    }

    /// Copies sent on a link that did not come back in time, and their bytes.
    pub fn lost(&self, sent_on: Link) -> [u64; 2] {
        self.lost[sent_on.index()].each_ref().map(|word| word.load(Ordering::Relaxed))
    }
}

#[cfg(test)]
mod tests {
    use ringcat_wire::al::AlState;

    use super::*;

    fn words() -> LiveWords {
        let mut words = LiveWords::new(2);
        words.set_stations(alloc::vec![StationAddress(1001), StationAddress(1002)]);
        words
    }

    // covers: threads
    #[test]
    fn an_al_status_counts_only_while_the_subdevice_is_online() {
        let words = words();
        let refused = AlStatus { error: true, ..AlStatus::new(AlState::SafeOp) };
        words.post_al_status(StationAddress(1002), refused, AlStatusCode(0x1B));
        assert_eq!(words.life(1), Some(Life::default()), "another SubDevice may have answered");
        words.post_presence(1, Presence::Configuring);
        words.post_al_status(StationAddress(1002), refused, AlStatusCode(0x1B));
        let life = Life { presence: Presence::Configuring, al_status: 0x14, code: 0x1B };
        assert_eq!((words.life(0), words.life(1)), (Some(Life::default()), Some(life)));
        words.post_presence(1, Presence::Settled);
        assert_eq!(words.life(1), Some(Life { presence: Presence::Settled, ..life }));
        words.post_al_status(StationAddress(1002), AlStatus::new(AlState::Op), AlStatusCode(77));
        let op = Life { presence: Presence::Settled, al_status: 8, code: 0 };
        assert_eq!(words.life(1), Some(op), "the register holds an identification, not a code");
        words.post_presence(1, Presence::Offline);
        words.post_presence(1, Presence::Configuring);
        assert_eq!(words.life(1), Some(Life { presence: Presence::Configuring, ..Life::default() }));
        assert_eq!(words.life(2), None);
    }

    // covers: threads
    #[test]
    fn two_supervision_frames_lost_in_a_row_are_a_silence_and_one_is_not() {
        let words = words();
        assert!(!words.is_silent(0));
        words.post_silence(5);
        assert!(!words.is_silent(5));
        words.post_silence(6);
        assert!(!words.is_silent(6), "a result came between");
        words.post_silence(6);
        assert!(words.is_silent(6) && !words.is_silent(7));
    }

    #[test]
    fn carriers_are_kept_by_link() {
        let words = words();
        assert_eq!(Link::ALL.map(|link| words.carrier(link)), [None; 2]);
        for carriers in [[Some(true), Some(false)], [Some(false), None], [None, Some(true)]] {
            words.post_carriers(carriers);
            assert_eq!(Link::ALL.map(|link| words.carrier(link)), carriers);
        }
    }
}
