//! Frames, bytes and losses of each link, and their rates over 1, 10 and 60 s.
//!
//! The acyclic half takes a sample each second; the cyclic half does nothing for it. Frames of both halves count.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use ringcat_engine::AcyclicCounters;
use ringcat_engine::link::Link;
use ringcat_engine::main_device::LiveStatus;
use ringcat_engine::time::Instant;

use crate::cyclic_status::CyclicStatus;
use crate::words::Words;

/// Times over which rates are computed, in samples.
const SPANS: [usize; 3] = [1, 10, 60];
/// Interval of samples.
const INTERVAL: Duration = Duration::from_secs(1);
/// Samples that are kept: those of the longest time, and the one at its beginning.
const KEPT: usize = 61;
/// Words of a sample: time; frames and bytes on each link; copies lost and their bytes, by link.
const SAMPLE: usize = 7;

/// Frames of a link since activation. Each frame leaves on each link.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct LinkFigures {
    /// Frames sent.
    pub frames: u64,
    /// Their bytes, without FCS.
    pub bytes: u64,
    /// Of these frames, copies that did not come back in time, also where the copy on the other link did.
    pub lost: u64,
    /// Their bytes.
    pub lost_bytes: u64,
    /// Rates over the last second, 10 s and 60 s.
    pub rates: [LinkRate; 3],
}

/// Rates of a link. All are zero before the second sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct LinkRate {
    /// The time that they cover: shorter soon after the activation.
    pub over: Duration,
    /// Frames sent per second.
    pub frames_per_s: f64,
    /// Bytes sent per second.
    pub bytes_per_s: f64,
    /// Copies lost per second.
    pub lost_per_s: f64,
    /// Their bytes per second.
    pub lost_bytes_per_s: f64,
    /// Copies lost, as a share of the frames sent: 0 to 1.
    pub lost_share: f64,
}

/// The samples.
#[derive(Debug)]
pub(crate) struct LinkSamples {
    cyclic_status: Arc<CyclicStatus>,
    live: LiveStatus,
    /// Number of samples, then the newest ones in turn.
    words: Words,
}

/// A sample of one link.
#[derive(Clone, Copy, Debug, Default)]
struct Sample {
    at: u64,
    frames: u64,
    bytes: u64,
    lost: u64,
    lost_bytes: u64,
}

impl LinkSamples {
    pub fn new(cyclic_status: Arc<CyclicStatus>, live: LiveStatus) -> LinkSamples {
        LinkSamples { cyclic_status, live, words: Words::new(1 + KEPT * SAMPLE) }
    }

    /// Takes a sample. For the thread of the acyclic half.
    pub fn take(&self, now: Instant, acyclic: AcyclicCounters) {
        let cyclic = self.cyclic_status.counters();
        let [main, redundant] = Link::ALL.map(|link| {
            let (lost, at) = (self.live.lost(link), link.index());
            [lost.copies + acyclic.copies_lost[at], lost.bytes + acyclic.bytes_lost[at]]
        });
        let (frames, bytes) = (cyclic.sent + acyclic.sent, cyclic.bytes + acyclic.bytes);
        let sample: [u64; SAMPLE] = [now.0, frames, bytes, main[0], main[1], redundant[0], redundant[1]];
        self.words.write(|words| {
            let Some((count, samples)) = words.split_first() else { return };
            let number = count.load(Ordering::Relaxed);
            let place = samples.chunks_exact(SAMPLE).nth(number as usize % KEPT).unwrap_or_default();
            let store = |(word, value): (&AtomicU64, u64)| word.store(value, Ordering::Relaxed);
            place.iter().zip(sample).for_each(store);
            count.store(number + 1, Ordering::Relaxed);
        });
    }

    /// The figures of a link as of the last sample.
    pub fn of(&self, link: Link) -> LinkFigures {
        // A sample is taken once a second, so the second copy is whole.
        let words = std::iter::repeat_with(|| self.words.read(2)).take(3).flatten().next();
        let Some((count, samples)) = words.as_ref().and_then(|words| words.split_first()) else {
            return LinkFigures::default();
        };
        let count = *count as usize;
        let sample = |number: usize| {
            let words = samples.chunks_exact(SAMPLE).nth(number % KEPT).unwrap_or_default();
            let [at, frames, bytes, ref lost @ ..] = *words else { return Sample::default() };
            let [lost, lost_bytes] = [2 * link.index(), 2 * link.index() + 1].map(|at| lost[at]);
            Sample { at, frames, bytes, lost, lost_bytes }
        };
        let newest = sample(count - 1);
        let rates = SPANS.map(|span| rate(sample(count - 1 - span.min(count - 1)), newest));
        let Sample { frames, bytes, lost, lost_bytes, .. } = newest;
        LinkFigures { frames, bytes, lost, lost_bytes, rates }
    }
}

/// Samples of the acyclic half alone, while no application is active.
#[derive(Debug, Default)]
pub(crate) struct AcyclicSamples(VecDeque<(Instant, AcyclicCounters)>);

impl AcyclicSamples {
    /// Takes a sample if the last one is a second old.
    pub fn take(&mut self, now: Instant, counters: AcyclicCounters) {
        if self.0.back().is_some_and(|(last, _)| now.since(*last) < INTERVAL) {
            return;
        }
        if self.0.len() == KEPT {
            self.0.pop_front();
        }
        self.0.push_back((now, counters));
    }

    /// The figures of a link now.
    pub fn of(&self, link: Link, counters: AcyclicCounters) -> LinkFigures {
        let sample = |(at, counters): (Instant, AcyclicCounters)| Sample {
            at: at.0,
            frames: counters.sent,
            bytes: counters.bytes,
            lost: counters.copies_lost[link.index()],
            lost_bytes: counters.bytes_lost[link.index()],
        };
        let newest = self.0.len().saturating_sub(1);
        let at = |place: usize| self.0.get(place).copied().map(sample).unwrap_or_default();
        let rates = SPANS.map(|span| rate(at(newest.saturating_sub(span)), at(newest)));
        let Sample { frames, bytes, lost, lost_bytes, .. } = sample((Instant(0), counters));
        LinkFigures { frames, bytes, lost, lost_bytes, rates }
    }
}

fn rate(from: Sample, to: Sample) -> LinkRate {
    let over = Duration::from_nanos(to.at.saturating_sub(from.at));
    if over.is_zero() {
        return LinkRate::default();
    }
    let difference = |of: fn(&Sample) -> u64| of(&to).saturating_sub(of(&from)) as f64;
    let (frames, lost) = (difference(|it| it.frames), difference(|it| it.lost));
    let seconds = over.as_secs_f64();
    LinkRate {
        over,
        frames_per_s: frames / seconds,
        bytes_per_s: difference(|it| it.bytes) / seconds,
        lost_per_s: lost / seconds,
        lost_bytes_per_s: difference(|it| it.lost_bytes) / seconds,
        lost_share: if frames > 0.0 { (lost / frames).min(1.0) } else { 0.0 },
    }
}
