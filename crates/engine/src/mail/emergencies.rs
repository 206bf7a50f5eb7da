//! Emergencies of SubDevices (CoE, protocol 6.3), one ring per SubDevice.
//!
//! Input: emergencies as the router reads them. Output: [`EmergencyRing`], which any number of threads read, clear and
//! count at once. A ring consists of atomics: no reader waits for another, nor for the router. Its size is the
//! application's choice; without a choice it holds [`EmergencyRing::DEFAULT_SIZE`] emergencies. Like the ring of IgH, a
//! full ring keeps the oldest emergencies, and the later ones are counted.

use alloc::collections::BTreeMap;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::sync::atomic::{AtomicU64, Ordering};

use ringcat_wire::address::Position;
use ringcat_wire::mailbox::coe::Emergency;

use crate::declared::Address;
use crate::time::Instant;

#[derive(Debug)]
struct Slots {
    /// Time and content of an emergency.
    slots: Vec<[AtomicU64; 2]>,
    /// Number of emergencies ever written; only the router changes it.
    written: AtomicU64,
    /// Number of emergencies ever read or cleared.
    read: AtomicU64,
    overruns: AtomicU64,
}

/// An emergency as it was read from the SubDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct ReceivedEmergency {
    /// Host time at which it was read.
    pub at: Instant,
    /// The emergency.
    pub emergency: Emergency,
}

/// Emergencies of one SubDevice: the oldest that were not taken; more are counted. Copies are handles to the same ring
/// buffer, for any thread.
#[derive(Clone, Debug)]
pub struct EmergencyRing {
    shared: Arc<Slots>,
}

impl EmergencyRing {
    /// Size without a choice of the application.
    pub const DEFAULT_SIZE: usize = 32;
    /// Largest size: 1 MiB of memory per SubDevice.
    pub const MAX_SIZE: usize = 1 << 16;

    /// An empty ring for up to `size` emergencies, at most [`EmergencyRing::MAX_SIZE`]. With a size of 0 it keeps none
    /// and counts all.
    pub(crate) fn new(size: usize) -> EmergencyRing {
        let slots = (0..size.min(EmergencyRing::MAX_SIZE)).map(|_| [const { AtomicU64::new(0) }; 2]).collect();
        let count = || AtomicU64::new(0);
        EmergencyRing { shared: Arc::new(Slots { slots, written: count(), read: count(), overruns: count() }) }
    }

    /// Number of emergencies that fit.
    pub fn size(&self) -> usize {
        self.shared.slots.len()
    }

    /// Number of emergencies that it holds.
    pub fn len(&self) -> usize {
        let read = self.shared.read.load(Ordering::Acquire);
        // A reader may take some emergencies between the two loads.
        let count = self.shared.written.load(Ordering::Acquire).saturating_sub(read) as usize;
        count.min(self.size())
    }

    /// Whether it holds none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Takes the oldest emergency, with the time at which it was read from the SubDevice.
    pub fn pop(&self) -> Option<ReceivedEmergency> {
        let shared = &*self.shared;
        let mut read = shared.read.load(Ordering::Acquire);
        while read < shared.written.load(Ordering::Acquire) {
            let [at, content] = &shared.slots[(read % shared.slots.len() as u64) as usize];
            let (at, content) = (at.load(Ordering::Relaxed), content.load(Ordering::Relaxed));
            // The router writes this slot again only after `read` has changed: then the exchange fails.
            match shared.read.compare_exchange_weak(read, read + 1, Ordering::AcqRel, Ordering::Acquire) {
                Ok(_) => {
                    let emergency = Emergency::decode(&content.to_le_bytes());
                    return Some(ReceivedEmergency { at: Instant(at), emergency });
                }
                Err(now) => read = now,
            }
        }
        None
    }

    /// Drops all emergencies and sets the count of overruns to zero.
    pub fn clear(&self) {
        self.shared.read.fetch_max(self.shared.written.load(Ordering::Acquire), Ordering::AcqRel);
        self.shared.overruns.store(0, Ordering::Relaxed);
    }

    /// Number of emergencies that were not kept because the ring was full, since it was created or cleared.
    pub fn overruns(&self) -> u64 {
        self.shared.overruns.load(Ordering::Relaxed)
    }

    /// Appends an emergency. Called by one router only.
    pub(super) fn push(&self, at: Instant, emergency: &Emergency) {
        let shared = &*self.shared;
        let written = shared.written.load(Ordering::Relaxed);
        if written - shared.read.load(Ordering::Acquire) >= shared.slots.len() as u64 {
            shared.overruns.fetch_add(1, Ordering::Relaxed);
            return;
        }
        let slot = &shared.slots[(written % shared.slots.len() as u64) as usize];
        slot[0].store(at.0, Ordering::Relaxed);
        slot[1].store(u64::from_le_bytes(emergency.encode()), Ordering::Relaxed);
        shared.written.store(written + 1, Ordering::Release);
    }
}

/// The rings of all SubDevices. A ring outlives the mailbox: it exists from its first request or use on.
#[derive(Debug, Default)]
pub(crate) struct EmergencyRings {
    rings: BTreeMap<Address, EmergencyRing>,
    /// Ring buffers of positions that SubDevices have left, as long as other SubDevices have these positions.
    left: BTreeMap<Position, EmergencyRing>,
}

impl EmergencyRings {
    /// The ring of a SubDevice.
    pub(crate) fn of(&mut self, subdevice: Address) -> EmergencyRing {
        let ring = self.rings.entry(subdevice);
        ring.or_insert_with(|| EmergencyRing::new(EmergencyRing::DEFAULT_SIZE)).clone()
    }

    /// Replaces the ring of a SubDevice by an empty one of this size.
    pub(crate) fn create(&mut self, subdevice: Address, size: usize) -> EmergencyRing {
        let ring = EmergencyRing::new(size);
        self.rings.insert(subdevice, ring.clone());
        ring
    }

    /// The ring of a SubDevice that has another name now.
    pub(crate) fn keep(&mut self, subdevice: Address, ring: EmergencyRing) {
        self.rings.insert(subdevice, ring);
    }

    /// A SubDevice no longer has this address.
    pub(crate) fn forget(&mut self, subdevice: Address) {
        self.rings.remove(&subdevice);
    }

    /// A SubDevice has left this position. The next SubDevice at this position continues with its ring buffer.
    pub(crate) fn leave(&mut self, position: Position, ring: EmergencyRing) {
        self.rings.remove(&position.into());
        self.left.insert(position, ring);
    }

    /// The ring buffer of a SubDevice that is at this position now.
    pub(crate) fn arrive(&mut self, position: Position) -> EmergencyRing {
        match self.left.remove(&position) {
            Some(ring) => {
                self.keep(position.into(), ring.clone());
                ring
            }
            None => self.of(position.into()),
        }
    }

    /// All SubDevices have their positions: ring buffers of positions without a SubDevice can be requested again.
    pub(crate) fn end_changes(&mut self) {
        let EmergencyRings { rings, left } = self;
        left.retain(|position, ring| {
            let is_taken = rings.contains_key(&Address::from(*position));
            if !is_taken {
                rings.insert((*position).into(), ring.clone());
            }
            is_taken
        });
    }

    /// A new scan: positions of the scan before are no longer valid.
    pub(crate) fn forget_positions(&mut self) {
        self.left.clear();
        self.rings.retain(|subdevice, _| matches!(subdevice, Address::Declared(_)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn emergency(number: u16) -> Emergency {
        Emergency { error_code: number, error_register: 1, data: [number as u8; 5] }
    }

    // covers: 6.3, sdo-information
    #[test]
    fn a_full_ring_keeps_the_oldest_and_counts_the_rest_until_it_is_cleared() {
        for size in [0, 1, 3] {
            let ring = EmergencyRing::new(size);
            (0..5).for_each(|number| ring.push(Instant(u64::from(number)), &emergency(number)));
            assert_eq!((ring.len(), ring.overruns()), (size, 5 - size as u64));
            for number in 0..size as u16 {
                let expected = ReceivedEmergency { at: Instant(u64::from(number)), emergency: emergency(number) };
                assert_eq!(ring.pop(), Some(expected));
            }
            assert_eq!(ring.pop(), None);
            ring.push(Instant(9), &emergency(9));
            ring.clear();
            assert_eq!((ring.pop(), ring.overruns(), ring.is_empty()), (None, 0, true));
        }
        assert_eq!(EmergencyRing::new(usize::MAX).size(), EmergencyRing::MAX_SIZE);
    }

    // covers: 6.3, sdo-information
    #[test]
    fn several_threads_take_each_emergency_once() {
        const COUNT: u16 = 20_000;
        let ring = EmergencyRing::new(7);
        let readers: Vec<_> = (0..3)
            .map(|_| {
                let ring = ring.clone();
                std::thread::spawn(move || {
                    let mut taken = Vec::new();
                    loop {
                        match ring.pop() {
                            Some(last) if last.emergency.error_code == u16::MAX => return taken,
                            Some(ReceivedEmergency { at, emergency: kept }) => {
                                assert_eq!((at, kept), (Instant(kept.error_code.into()), emergency(kept.error_code)));
                                taken.push(kept.error_code);
                            }
                            None => std::thread::yield_now(),
                        }
                    }
                })
            })
            .collect();
        let push = |number: u16| {
            while ring.len() == ring.size() {
                std::thread::yield_now();
            }
            ring.push(Instant(number.into()), &emergency(number));
        };
        (0..COUNT).for_each(push);
        (0..3).for_each(|_| push(u16::MAX));
        let mut taken: Vec<u16> = readers.into_iter().flat_map(|reader| reader.join().unwrap()).collect();
        taken.sort_unstable();
        assert_eq!(taken, (0..COUNT).collect::<Vec<_>>());
        assert_eq!(ring.overruns(), 0);
    }
}
