//! What other threads see of the process data: images, working counters, FMMUs, figures of the links.
//!
//! A request sets a bit in a word that each cycle reads anyway. The cycle after the request copies images and states
//! into words that were allocated at the activation; without a request it does nothing. Any number of threads may read.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread;
use std::time::{Duration, Instant as WallClock};

use ringcat_engine::domain::{DomainId, DomainStatus};
use ringcat_engine::exchange::{CyclicCounters, Entry, Exchange};
use ringcat_engine::info::Direction;
use ringcat_engine::link::Link;
use ringcat_engine::main_device::{Directory, LiveStatus, SubDeviceId};
use ringcat_engine::time::Instant;
use ringcat_wire::address::LogicalAddress;

use crate::cyclic_status::{CyclicStatus, pack_status, unpack_status};
use crate::link_figures::{LinkFigures, LinkSamples};
use crate::process_data::Rate;
use crate::words::Words;

/// Pause of a thread that waits for a snapshot.
const PAUSE: Duration = Duration::from_micros(100);
/// Words before those of the domains: number and time of the cycle, the application's time, the reference clock's.
const CYCLE_WORDS: usize = 4;
/// Words of a domain before its image: its state in two, pending and known working counters, working counters by link.
const DOMAIN_WORDS: usize = 4;
const PENDING: u64 = 1;
const BY_LINK: u64 = 2;

/// A handle for any thread: images of the domains, their working counters and FMMUs, figures of the links.
///
/// ```
/// use std::time::Duration;
/// use ringcat::{Link, Observer};
///
/// /// In a thread that draws the machine.
/// fn show(observer: &Observer) -> Result<(), ringcat::NoSnapshot> {
///     let snapshot = observer.snapshot(Duration::from_millis(100))?;
///     for domain in &snapshot.domains {
///         println!("{:?}, by link {:?}: {:02x?}", domain.status, domain.wkc_by_link, domain.image);
///     }
///     let [second, ..] = observer.link(Link::Main).rates;
///     println!("{:.0} frames/s, {:.1} lost/s", second.frames_per_s, second.lost_per_s);
///     Ok(())
/// }
/// ```
#[derive(Clone, Debug)]
pub struct Observer(Arc<Observed>);

/// What the cyclic half fills, and what does not change.
#[derive(Debug)]
pub(crate) struct Observed {
    cyclic_status: Arc<CyclicStatus>,
    samples: Arc<LinkSamples>,
    words: Words,
    /// Bytes of the images.
    images: Box<[usize]>,
    fmmus: Vec<DomainFmmu>,
}

/// Process data and states of one cycle.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct ProcessDataSnapshot {
    /// Number of the cycle, from 0.
    pub cycle: u64,
    /// When it began; for an application that runs the parts of a cycle, when it processed the domain.
    pub taken_at: Instant,
    /// Time of the application, in nanoseconds.
    pub application_time: u64,
    /// Time of the reference clock as it was read last, in nanoseconds; `None` if it was not.
    pub reference_time: Option<u64>,
    /// Counters up to this cycle.
    pub counters: CyclicCounters,
    /// By [`DomainId`].
    pub domains: Vec<DomainSnapshot>,
}

/// A domain in a snapshot: after its evaluation, before the work of the application. Inputs are those of the evaluated
/// cycle, outputs those that left last.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct DomainSnapshot {
    /// Its state.
    pub status: DomainStatus,
    /// Working counters by the link on which copies were sent ([`Exchange::wkc_by_link`]); `None` while no cycle is
    /// evaluated that was not followed by another one.
    pub wkc_by_link: Option<[u32; 2]>,
    /// Its image.
    pub image: Vec<u8>,
}

/// Process data of one SyncManager as an FMMU maps it into the logical address space.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct DomainFmmu {
    /// The domain.
    pub domain: DomainId,
    /// The declared SubDevice.
    pub subdevice: SubDeviceId,
    /// Its SyncManager.
    pub sync_manager: u8,
    /// Outputs or inputs.
    pub direction: Direction,
    /// Logical address of the first byte.
    pub logical: LogicalAddress,
    /// Bytes.
    pub length: u16,
    /// First byte in the image of the domain.
    pub image_offset: u32,
}

/// A request for a snapshot ([`Observer::request`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SnapshotRequest(u64);

/// No cycle has answered a request for a snapshot within the limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct NoSnapshot {
    /// The limit.
    pub limit: Duration,
}

impl fmt::Display for NoSnapshot {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "no snapshot of the process data within {} ms: no cycle runs", self.limit.as_millis())
    }
}

impl std::error::Error for NoSnapshot {}

impl Observer {
    /// Reads what a cyclic half fills.
    pub(crate) fn new(observed: Arc<Observed>) -> Observer {
        Observer(observed)
    }

    /// Requests a snapshot; the next cycle takes it, and [`Observer::take`] returns it. Neither waits nor allocates.
    pub fn request(&self) -> SnapshotRequest {
        let request = SnapshotRequest(self.0.words.next());
        self.0.cyclic_status.want_snapshot();
        request
    }

    /// The snapshot of a request, or a newer one; `None` until a cycle has taken it, and while a cycle takes another
    /// one.
    pub fn take(&self, request: SnapshotRequest) -> Option<ProcessDataSnapshot> {
        self.0.words.read(request.0).map(|words| self.0.unpack(&words))
    }

    /// Requests a snapshot and waits for it. Not for real-time threads: it pauses and allocates.
    ///
    /// # Errors
    /// No cycle has begun within the limit.
    pub fn snapshot(&self, limit: Duration) -> Result<ProcessDataSnapshot, NoSnapshot> {
        let end = WallClock::now() + limit;
        let request = self.request();
        loop {
            if let Some(snapshot) = self.take(request) {
                return Ok(snapshot);
            }
            if WallClock::now() >= end {
                return Err(NoSnapshot { limit });
            }
            thread::sleep(PAUSE);
        }
    }

    /// Counts and delays of the cycles; zeros for an application that runs the parts of a cycle itself.
    #[cfg(feature = "daemon")]
    pub(crate) fn pace(&self) -> crate::pace::Pace {
        self.0.cyclic_status.pace()
    }

    /// Figures of the cyclic thread.
    #[cfg(all(feature = "standby", feature = "daemon"))]
    pub(crate) fn cyclic_status(&self) -> &CyclicStatus {
        &self.0.cyclic_status
    }

    /// Process data of all SubDevices as their FMMUs map it.
    pub fn fmmus(&self) -> &[DomainFmmu] {
        &self.0.fmmus
    }

    /// Frames, bytes, losses and rates of a link, at most one second old. The counters of both halves together.
    pub fn link(&self, link: Link) -> LinkFigures {
        self.0.samples.of(link)
    }
}

impl Observed {
    pub fn new(
        cyclic_status: Arc<CyclicStatus>,
        live: LiveStatus,
        exchange: &Exchange,
        directory: &Directory,
    ) -> Observed {
        let images: Box<[usize]> =
            (0..exchange.domain_count()).map(|domain| exchange.image(DomainId(domain)).len()).collect();
        let of_images: usize = images.iter().map(|bytes| DOMAIN_WORDS + bytes.div_ceil(size_of::<u64>())).sum();
        Observed {
            samples: Arc::new(LinkSamples::new(cyclic_status.clone(), live)),
            cyclic_status,
            words: Words::new(CYCLE_WORDS + CyclicCounters::COUNT + of_images),
            images,
            fmmus: fmmus(directory),
        }
    }

    /// The samples of the links' counters.
    pub fn samples(&self) -> Arc<LinkSamples> {
        self.samples.clone()
    }

    /// Takes a snapshot. For the thread of the cycles.
    #[cold]
    pub fn fill(&self, cycle: u64, now: Instant, exchange: &Exchange, rates: &[Rate]) {
        self.words.write(|words| {
            let mut words = words.iter();
            let mut put = |value: u64| {
                if let Some(word) = words.next() {
                    word.store(value, Ordering::Relaxed);
                }
            };
            put(cycle);
            put(now.0);
            put(exchange.application_time(now));
            put(exchange.reference_time().map_or(0, |read| read.time));
            exchange.counters().to_words().into_iter().for_each(&mut put);
            for (domain, rate) in (0..).map(DomainId).zip(rates) {
                pack_status(&rate.status).into_iter().for_each(&mut put);
                let by_link = exchange.wkc_by_link(domain);
                let pending = if rate.status.pending { PENDING } else { 0 };
                put(pending | if by_link.is_some() { BY_LINK } else { 0 });
                let [main, redundant] = by_link.unwrap_or_default().map(u64::from);
                put(main | redundant << 32);
                let (whole, rest) = exchange.image(domain).as_chunks::<{ size_of::<u64>() }>();
                whole.iter().for_each(|bytes| put(u64::from_le_bytes(*bytes)));
                if !rest.is_empty() {
                    let mut last = [0; size_of::<u64>()];
                    last[..rest.len()].copy_from_slice(rest);
                    put(u64::from_le_bytes(last));
                }
            }
        });
    }

    fn unpack(&self, words: &[u64]) -> ProcessDataSnapshot {
        let mut words = words.iter().copied();
        let mut next = || words.next().unwrap_or_default();
        let (cycle, taken_at) = (next(), Instant(next()));
        let (application_time, reference_time) = (next(), Some(next()).filter(|time| *time != 0));
        let counters = CyclicCounters::from_words(std::array::from_fn(|_| next()));
        let domain = |bytes: &usize| {
            let mut status = unpack_status([next(), next()]);
            let (flags, by_link) = (next(), next());
            status.pending = flags & PENDING != 0;
            let wkc_by_link = (flags & BY_LINK != 0).then_some([by_link as u32, (by_link >> 32) as u32]);
            let words = (0..bytes.div_ceil(size_of::<u64>())).flat_map(|_| next().to_le_bytes());
            DomainSnapshot { status, wkc_by_link, image: words.take(*bytes).collect() }
        };
        let domains = self.images.iter().map(domain).collect();
        ProcessDataSnapshot { cycle, taken_at, application_time, reference_time, counters, domains }
    }
}

impl ProcessDataSnapshot {
    /// Value of an entry, zero-extended; `None` if it is not in an image.
    pub fn read(&self, entry: &Entry) -> Option<u64> {
        let image = &self.domains.get(entry.domain.0)?.image;
        let end = u64::from(entry.bit_offset) + u64::from(entry.bit_length);
        (end <= image.len() as u64 * 8).then(|| entry.read(image))
    }
}

fn fmmus(directory: &Directory) -> Vec<DomainFmmu> {
    let all = (0..directory.subdevice_count()).map(SubDeviceId);
    let of = |subdevice: SubDeviceId| {
        directory.areas(subdevice).iter().map(move |area| DomainFmmu {
            domain: area.domain,
            subdevice,
            sync_manager: area.placed.area.sync_manager,
            direction: area.direction,
            logical: area.placed.logical,
            length: area.placed.area.length,
            image_offset: area.placed.image_offset,
        })
    };
    all.flat_map(of).filter(|fmmu| fmmu.length > 0).collect()
}
