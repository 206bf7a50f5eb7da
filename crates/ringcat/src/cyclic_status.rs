//! Figures of the cyclic thread for other threads: atomics that only this thread writes, once per cycle, without
//! waiting.
//!
//! Each number is consistent by itself; two numbers may be from adjacent cycles.

use std::sync::atomic::{AtomicU8, AtomicU64, Ordering};
use std::time::Duration;

use ringcat_engine::RingState;
use ringcat_engine::domain::{DomainId, DomainState, DomainStatus};
use ringcat_engine::exchange::CyclicCounters;
use ringcat_engine::link::Link;
use ringcat_wire::frame::MacAddress;

use crate::histogram::Histogram;
use crate::no_domain::NoDomain;
use crate::pace::{Pace, PaceNs};
use crate::process_data::Rate;
#[cfg(feature = "standby")]
use crate::standby::ForwardingCounters;

/// How far cycles are from their phase in the system time of the segment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Phase {
    /// Last error in nanoseconds; positive: the host is late.
    pub error_ns: i64,
    /// The errors have been small for a while.
    pub is_locked: bool,
}

/// Status of the cyclic half.
#[derive(Debug)]
pub struct CyclicStatus {
    pace: [AtomicU64; 6],
    counters: [AtomicU64; COUNTERS],
    /// Working counter and expected working counter; state, and number of times that the domain was skipped.
    domains: Box<[[AtomicU64; 2]]>,
    round_trips: Histogram,
    wake_ups: Histogram,
    phase_errors: Histogram,
    /// Last phase error, and whether errors have been small, in the lowest bit.
    phase: AtomicU64,
    /// Spread of the clocks plus one; zero before it was read.
    spread: AtomicU64,
    /// Requests of readers, a bit each.
    wanted: AtomicU8,
    /// Source address of the last frame of another MainDevice, and the link it arrived on, plus one.
    foreign: AtomicU64,
    ring: AtomicU64,
    #[cfg(feature = "standby")]
    forwarded: [AtomicU64; ForwardingCounters::COUNT],
}

/// Bit of [`CyclicStatus::restart_histograms`].
const RESTART: u8 = 1;
/// Bit of [`CyclicStatus::want_snapshot`].
const SNAPSHOT: u8 = 2;
/// Fields of [`CyclicCounters`].
const COUNTERS: usize = CyclicCounters::COUNT;

fn zeros<const N: usize>() -> [AtomicU64; N] {
    [const { AtomicU64::new(0) }; N]
}

#[inline]
fn set(word: &AtomicU64, value: u64) {
    word.store(value, Ordering::Relaxed);
}

fn store(to: &[AtomicU64], values: &[u64]) {
    for (word, value) in to.iter().zip(values) {
        set(word, *value);
    }
}

fn load<const N: usize>(from: &[AtomicU64; N]) -> [u64; N] {
    std::array::from_fn(|at| from[at].load(Ordering::Relaxed))
}

impl CyclicStatus {
    pub(crate) fn new(domains: usize) -> CyclicStatus {
        CyclicStatus {
            pace: zeros(),
            counters: zeros(),
            domains: (0..domains).map(|_| zeros()).collect(),
            round_trips: Histogram::default(),
            wake_ups: Histogram::default(),
            phase_errors: Histogram::default(),
            phase: AtomicU64::new(0),
            spread: AtomicU64::new(0),
            wanted: AtomicU8::new(0),
            foreign: AtomicU64::new(0),
            ring: AtomicU64::new(0),
            #[cfg(feature = "standby")]
            forwarded: zeros(),
        }
    }

    /// Frames that the cyclic half has forwarded as INACTIVE.
    #[cfg(feature = "standby")]
    pub fn forwarded(&self) -> ForwardingCounters {
        ForwardingCounters::from_words(load(&self.forwarded))
    }

    #[cfg(feature = "standby")]
    pub(crate) fn publish_forwarded(&self, counters: &ForwardingCounters) {
        store(&self.forwarded, &counters.to_words());
    }

    /// Counts and delays of the cycles.
    pub fn pace(&self) -> Pace {
        let [cycles, late, skipped, paused, last_delay, longest_delay] = load(&self.pace);
        let [last_delay, longest_delay] = [last_delay, longest_delay].map(Duration::from_nanos);
        Pace { cycles, late, skipped, paused, last_delay, longest_delay }
    }

    /// Counters of process data.
    pub fn counters(&self) -> CyclicCounters {
        CyclicCounters::from_words(load(&self.counters))
    }

    /// State of a domain when its frames were last evaluated.
    ///
    /// # Errors
    /// The declaration has no such domain.
    pub fn status(&self, domain: DomainId) -> Result<DomainStatus, NoDomain> {
        let declared = self.domains.len();
        let words = self.domains.get(domain.0).ok_or(NoDomain { domain, declared })?;
        Ok(unpack_status(load(words)))
    }

    /// Times from the sending of a cycle's frames to the arrival of each of their copies at the interface.
    pub fn round_trips(&self) -> &Histogram {
        &self.round_trips
    }

    /// Delays of the beginning of cycles.
    pub fn wake_ups(&self) -> &Histogram {
        &self.wake_ups
    }

    /// How far cycles were from their phase in the system time of the segment, with
    /// [`Trigger::ReferenceClock`](crate::Trigger::ReferenceClock), to either side: once per reading of the reference
    /// clock.
    pub fn phase_errors(&self) -> &Histogram {
        &self.phase_errors
    }

    /// The last of these errors.
    pub fn phase(&self) -> Phase {
        let word = self.phase.load(Ordering::Relaxed);
        Phase { error_ns: word as i64 >> 1, is_locked: word & 1 != 0 }
    }

    /// OR of all |0x092C| in nanoseconds, as the last cyclic frame saw it: at most twice the largest.
    pub fn clock_spread_ns(&self) -> Option<u32> {
        self.spread.load(Ordering::Relaxed).checked_sub(1).map(|ns| ns as u32)
    }

    /// Clears the histograms with the next cycle.
    pub fn restart_histograms(&self) {
        self.wanted.fetch_or(RESTART, Ordering::Release);
    }

    /// State of the ring as process data shows it.
    pub fn ring(&self) -> RingState {
        match self.ring.load(Ordering::Relaxed) {
            1 => RingState::Closed,
            2 => RingState::Open,
            _ => RingState::Unknown,
        }
    }

    /// Source address of the last frame of another MainDevice, and where it arrived.
    pub fn foreign(&self) -> Option<(Link, MacAddress)> {
        let bytes = self.foreign.load(Ordering::Relaxed).to_be_bytes();
        let link = match bytes[0] {
            1 => Link::Main,
            2 => Link::Redundant,
            _ => return None,
        };
        Some((link, MacAddress([bytes[2], bytes[3], bytes[4], bytes[5], bytes[6], bytes[7]])))
    }

    pub(crate) fn publish_foreign(&self, link: Link, source: [u8; 6]) {
        let [a, b, c, d, e, f] = source;
        let link = match link {
            Link::Main => 1,
            Link::Redundant => 2,
        };
        self.foreign.store(u64::from_be_bytes([link, 0, a, b, c, d, e, f]), Ordering::Relaxed);
    }

    pub(crate) fn publish_phase(&self, error_ns: i64, is_locked: bool) {
        self.phase_errors.record(Duration::from_nanos(error_ns.unsigned_abs()));
        self.phase.store((error_ns << 1) as u64 | u64::from(is_locked), Ordering::Relaxed);
    }

    #[inline(always)]
    pub(crate) fn publish_spread(&self, spread_ns: Option<u32>) {
        self.spread.store(spread_ns.map_or(0, |ns| u64::from(ns) + 1), Ordering::Relaxed);
    }

    pub(crate) fn publish_ring(&self, ring: RingState) {
        let ring = match ring {
            RingState::Unknown => 0,
            RingState::Closed => 1,
            RingState::Open => 2,
        };
        set(&self.ring, ring);
    }

    /// Publishes the figures that change in each cycle.
    #[inline(always)]
    pub(crate) fn publish_cycle(&self, pace: &PaceNs, counters: &CyclicCounters) {
        let [cycles, .., last_delay, _] = &self.pace;
        set(cycles, pace.cycles);
        set(last_delay, pace.last_delay);
        let [sent, bytes, received, ..] = &self.counters;
        set(sent, counters.sent);
        set(bytes, counters.bytes);
        set(received, counters.received);
    }

    /// Requests a snapshot ([`crate::observer`]).
    pub(crate) fn want_snapshot(&self) {
        self.wanted.fetch_or(SNAPSHOT, Ordering::Release);
    }

    /// Whether a reader has requested anything.
    #[inline(always)]
    pub(crate) fn is_any_wanted(&self) -> bool {
        self.wanted.load(Ordering::Relaxed) != 0
    }

    /// Publishes the figures that change only when a cycle was disturbed. Returns whether a snapshot is wanted.
    #[cold]
    pub(crate) fn publish_rest(&self, pace: &PaceNs, counters: &CyclicCounters) -> bool {
        let PaceNs { cycles, late, skipped, paused, last_delay, longest_delay, disturbances: _ } = *pace;
        store(&self.pace, &[cycles, late, skipped, paused, last_delay, longest_delay]);
        store(&self.counters, &counters.to_words());
        let wanted = if self.is_any_wanted() { self.wanted.swap(0, Ordering::Acquire) } else { 0 };
        if wanted & RESTART != 0 {
            self.round_trips.clear();
            self.wake_ups.clear();
            self.phase_errors.clear();
        }
        wanted & SNAPSHOT != 0
    }

    #[inline(always)]
    pub(crate) fn publish_rates(&self, rates: &[Rate]) {
        for ([sum, state], rate) in self.domains.iter().zip(rates) {
            let [counted, kind] = pack_status(&rate.status);
            set(sum, counted);
            set(state, kind);
        }
    }
}

/// A status in two words, [`DomainStatus::pending`] excepted.
#[inline(always)]
pub(crate) fn pack_status(status: &DomainStatus) -> [u64; 2] {
    let kind = match status.state {
        DomainState::Zero => 0,
        DomainState::Incomplete => 1,
        DomainState::Complete => 2,
    };
    let counted = u64::from(status.wkc) | u64::from(status.expected) << 32;
    [counted, kind | u64::from(status.returned) << 7 | status.skipped << 8]
}

/// The status of [`pack_status`].
pub(crate) fn unpack_status([counted, state]: [u64; 2]) -> DomainStatus {
    let states = [DomainState::Zero, DomainState::Incomplete, DomainState::Complete];
    let mut status = DomainStatus::default();
    status.wkc = counted as u32;
    status.expected = (counted >> 32) as u32;
    status.state = states[(state as usize & 0x7F).min(2)];
    status.returned = state >> 7 & 1 != 0;
    status.skipped = state >> 8;
    status
}
