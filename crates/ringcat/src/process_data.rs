//! What an application works on within a cycle.

use ringcat_engine::domain::{DomainId, DomainStatus, Freshness};
use ringcat_engine::exchange::{Entry, Exchange};
use ringcat_engine::info::Direction;
use ringcat_engine::main_device::Directory;
use ringcat_engine::time::Instant;

/// When a domain is due, and how it was judged last.
#[derive(Debug)]
pub(crate) struct Rate {
    /// The domain is due every so many cycles.
    pub divider: u64,
    pub status: DomainStatus,
}

/// The images of all domains and what is known of them.
#[derive(Debug)]
pub struct ProcessData<'a> {
    pub(crate) exchange: &'a mut Exchange,
    pub(crate) directory: &'a Directory,
    pub(crate) rates: &'a [Rate],
    pub(crate) cycle: u64,
    pub(crate) now: Instant,
}

impl ProcessData<'_> {
    /// Number of the cycle, from 0.
    pub fn cycle(&self) -> u64 {
        self.cycle
    }

    /// Time at which the cycle began.
    pub fn now(&self) -> Instant {
        self.now
    }

    /// Last judgement of a domain.
    pub fn status(&self, domain: DomainId) -> DomainStatus {
        self.rates.get(domain.0).map_or_else(DomainStatus::default, |rate| rate.status)
    }

    /// Whether a domain is due in this cycle.
    pub fn is_due(&self, domain: DomainId) -> bool {
        self.rates.get(domain.0).is_some_and(|rate| self.cycle.is_multiple_of(rate.divider))
    }

    /// Value of an entry, zero-extended.
    pub fn read(&self, entry: &Entry) -> u64 {
        self.exchange.read(entry)
    }

    /// Value of an entry, sign-extended.
    pub fn read_signed(&self, entry: &Entry) -> i64 {
        entry.read_signed(self.exchange.image(entry.domain))
    }

    /// Sets an entry.
    pub fn write(&mut self, entry: &Entry, value: u64) {
        self.exchange.write(entry, value);
    }

    /// A domain's whole image.
    pub fn image(&self, domain: DomainId) -> &[u8] {
        self.exchange.image(domain)
    }

    /// A domain's whole image, to write outputs.
    pub fn image_mut(&mut self, domain: DomainId) -> &mut [u8] {
        self.exchange.image_mut(domain)
    }

    /// Sets all outputs of all domains to zero.
    pub fn zero_outputs(&mut self) {
        for subdevice in 0..self.directory.subdevice_count() {
            for area in self.directory.areas(subdevice).iter().filter(|area| area.direction == Direction::Outputs) {
                let start = area.placed.image_offset as usize;
                let end = start + usize::from(area.placed.area.length);
                self.exchange.image_mut(area.domain)[start..end].fill(0);
            }
        }
    }

    /// How old a SubDevice's inputs are.
    pub fn freshness(&self, domain: DomainId, subdevice: usize) -> Freshness {
        self.exchange.freshness(domain, subdevice)
    }

    /// Where process data lies.
    pub fn directory(&self) -> &Directory {
        self.directory
    }
}
