//! The start of the application of a handle: its declaration, links, times and memory.

use std::sync::atomic::Ordering;

use ringcat::{ClockDatagrams, Declaration, DomainId, Instant, LastOutputs, Links};

use super::{CLAIM_LIMIT, END_LIMIT, Master};
use crate::active::{Active, Slot};
use crate::bus::Bus;
use crate::code::{Code, Outcome, report};
use crate::draft::Draft;
use crate::given_time::{GivenTimes, passed_since};
use crate::locks::locked;

/// Memory of an image is allocated in pieces of this size, so that later applications can use it again.
const MEMORY_GRAIN: usize = 4096;

impl Master {
    /// Loads the declaration, takes the links and starts the application.
    pub(super) fn begin(&self, bus: &Bus, declaration: Declaration, draft: &Draft) -> Outcome {
        let links = bus.take_links().ok_or(Code::BUSY)?;
        self.is_ring.store(links.addresses().redundant.is_some(), Ordering::Relaxed);
        let supervisor = bus.supervisor().clone();
        if let Err(error) = supervisor.load(declaration) {
            bus.give_links_back(links);
            report(format_args!("master {}: {error}", bus.master()));
            return Err(Code::INVALID);
        }
        let mut application = match supervisor.apply(links) {
            Ok(application) => application,
            Err(refused) => {
                report(format_args!("master {}: {}", bus.master(), refused.error));
                let ringcat::Ended { supervisor, links, .. } = refused.main_device;
                let unused = (0..draft.domains().len()).filter_map(|domain| supervisor.unused_memory(DomainId(domain)));
                locked(&self.memory).extend(unused);
                bus.give_links_back(links);
                return Err(Code::INVALID);
            }
        };
        application.set_clock_datagrams(ClockDatagrams::Called);
        if let Some(interval) = draft.send_interval() {
            application.expect_sends_every(interval);
        }
        let now = application.now();
        let GivenTimes { first, last } = std::mem::take(&mut *locked(&self.given));
        if let Some((time, at)) = first {
            application.set_first_application_time(time, Instant(now.0.saturating_sub(passed_since(at))));
        }
        if let Some((time, at)) = last {
            application.set_application_time(time.wrapping_add(passed_since(at)), now);
        }
        self.live.follow(bus, draft.found_count(), self.is_ring());
        let begun = Active::new(application, self.has_clock.load(Ordering::Relaxed), bus.ownership());
        let mut begun = Some(begun);
        let placed = self.application.use_within(CLAIM_LIMIT, |slot| {
            if let Some(begun) = begun.take() {
                *slot = Slot::Active(begun);
            }
        });
        // A cyclic call has kept the claim: the bus is as before, so that another activation can follow.
        if let (Err(_), Some(Active { application, .. })) = (&placed, begun) {
            let ended = match application.deactivate(LastOutputs::Zero, END_LIMIT) {
                Ok(ended) => ended,
                Err(refused) => refused.main_device,
            };
            bus.give_links_back(ended.links);
        }
        placed
    }

    /// Zeroed memory for an image, as long or longer.
    pub(super) fn take_memory(&self, bytes: usize) -> &'static mut [u8] {
        let mut unused = locked(&self.memory);
        let fitting = unused.iter().position(|memory| memory.len() >= bytes);
        match fitting.map(|place| unused.swap_remove(place)) {
            Some(memory) => {
                memory.fill(0);
                memory
            }
            None => Vec::leak(vec![0; bytes.next_multiple_of(MEMORY_GRAIN)]),
        }
    }
}
