//! The start of the application of a handle: its declaration, links, times and memory.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use ringcat::{ClockDatagrams, Declaration, DomainId, Error, Instant, LastOutputs, Links};

use super::{CLAIM_LIMIT, Master, end_limit};
use crate::active::{Active, App, Slot};
use crate::bus::Bus;
use crate::code::{Code, Outcome, report};
use crate::draft::Draft;
use crate::given_time::{GivenTimes, passed_since};
use crate::locks::locked;

/// Memory of an image is allocated in pieces of this size, so that later applications can use it again.
const MEMORY_GRAIN: usize = 4096;

impl Master {
    /// Takes the links, loads the declaration and starts the application. After an error all of them are as before, so
    /// that another activation can follow; once the acyclic half has ended, none can.
    ///
    /// # Errors
    /// [`Code::BUSY`]: an application has the links, or a cyclic call does not end. [`Code::INVALID`]: the declaration
    /// does not fit. [`Code::GONE`]: the acyclic half has ended.
    pub(super) fn begin(&self, bus: &Arc<Bus>, draft: &Draft) -> Outcome {
        let links = bus.take_links().ok_or(Code::BUSY)?;
        self.is_ring.store(links.addresses().redundant.is_some(), Ordering::Relaxed);
        let supervisor = bus.supervisor().clone();
        let begun = match supervisor.load(self.with_memory(draft)) {
            Ok(()) => supervisor.apply(links).map_err(|refused| (refused.error, refused.main_device.links)),
            Err(error) => Err((error, links)),
        };
        let mut application = match begun {
            Ok(application) => application,
            Err((error, links)) => {
                report(format_args!("master {}: {error}", bus.master()));
                self.keep_memory(draft, |domain| bus.supervisor().unused_memory(domain));
                bus.give_links_back(links);
                return Err(if matches!(error, Error::Gone) { Code::GONE } else { Code::INVALID });
            }
        };
        self.prepare(&mut application, draft);
        let is_followed = self.live.follow(bus, draft.found().len(), self.is_ring());
        let begun = Active::new(application, self.has_clock.load(Ordering::Relaxed), bus.clone());
        let mut begun = Some(begun);
        let placed = is_followed.and_then(|()| {
            self.application.use_within(CLAIM_LIMIT, |slot| {
                if let Some(begun) = begun.take() {
                    *slot = Slot::Active(begun);
                }
            })
        });
        if let (Err(_), Some(Active { mut application, .. })) = (&placed, begun) {
            self.keep_memory(draft, |domain| application.give_memory_back(domain));
            let ended = match application.deactivate(LastOutputs::Zero, end_limit(bus)) {
                Ok(ended) => ended,
                Err(refused) => refused.main_device,
            };
            bus.give_links_back(ended.links);
        } else {
            *locked(&self.given) = GivenTimes::default();
        }
        placed
    }

    /// Settings and times that were given before.
    fn prepare(&self, application: &mut App, draft: &Draft) {
        application.set_clock_datagrams(ClockDatagrams::Called);
        if let Some(interval) = draft.send_interval() {
            application.expect_sends_every(interval);
        }
        let now = application.now();
        let GivenTimes { first, last } = *locked(&self.given);
        if let Some((time, at)) = first {
            application.set_first_application_time(time, Instant(now.0.saturating_sub(passed_since(at))));
        }
        if let Some((time, at)) = last {
            application.set_application_time(time.wrapping_add(passed_since(at)), now);
        }
    }

    /// The declaration with memory for the images of its domains, where the program finds it from now on.
    fn with_memory(&self, draft: &Draft) -> Declaration {
        let mut declaration = draft.declaration();
        for (number, words) in draft.domains().iter().enumerate() {
            let bytes = words.bytes();
            if bytes > 0 {
                let memory = self.take_memory(bytes);
                words.set_memory(memory.as_mut_ptr());
                declaration.place_image(DomainId(number), memory);
            }
        }
        declaration
    }

    /// Keeps the memory of the images of an application that has ended or did not begin, for the next one. The program
    /// does not find it any more.
    pub(super) fn keep_memory(&self, draft: &Draft, mut of: impl FnMut(DomainId) -> Option<&'static mut [u8]>) {
        for (number, words) in draft.domains().iter().enumerate() {
            words.set_memory(std::ptr::null_mut());
            locked(&self.memory).extend(of(DomainId(number)));
        }
    }

    /// Zeroed memory for an image, as long or longer.
    fn take_memory(&self, bytes: usize) -> &'static mut [u8] {
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

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use super::*;
    use crate::settings::Name;

    /// A handle on a simulated segment, with process data of the drive at position 2 in one domain.
    fn declared(index: u32) -> Master {
        let segment = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/c/services.toml");
        // SAFETY: the tests of this crate read variables by the standard library alone, which has a lock for them.
        unsafe { std::env::set_var(format!("RINGCAT_SIM_{index}"), segment) };
        let master = Master::open(index).expect("a simulated segment");
        master.reserve().expect("nothing else has it");
        let declared = master.change(|draft| {
            let info = &draft.found()[2];
            let (vendor, product) = (info.identity.vendor_id, info.identity.product_code);
            let drive = draft.add(Name { alias: 0, position: 2, vendor, product });
            let (domain, _) = draft.add_domain();
            draft.register(drive, domain, (0x6041, 0))
        });
        declared.expect("its status word is mapped");
        master
    }

    fn kept(master: &Master) -> usize {
        locked(&master.memory).len()
    }

    // covers: c-interface
    #[test]
    fn a_cyclic_call_that_does_not_end_stops_the_activation_and_all_is_given_back() {
        let master = declared(61);
        let (begin, begins) = channel();
        let (end, ends) = channel::<()>();
        std::thread::scope(|scope| {
            let held = &master;
            let holder = scope.spawn(move || {
                held.application.use_now(|_| {
                    begin.send(()).expect("it waits");
                    ends.recv().expect("it ends");
                })
            });
            begins.recv().expect("it began");
            for _ in 0..2 {
                assert_eq!(master.activate(), Err(Code::BUSY));
                assert_eq!(kept(&master), 1);
                assert!(!master.is_active() && master.look(|draft| draft.domains()[0].memory().is_null()) == Ok(true));
            }
            end.send(()).expect("it waits");
            assert_eq!(holder.join().expect("no panic"), Ok(()));
        });
        assert_eq!(master.activate(), Ok(()));
        assert_eq!(kept(&master), 0);
        assert_eq!(master.release(), Ok(()));
    }

    fn descriptors() -> usize {
        std::fs::read_dir("/proc/self/fd").expect("proc").count()
    }

    /// What comes back is used again: the same memory with each try. Other tests open descriptors meanwhile.
    // covers: c-interface
    #[test]
    fn two_hundred_refused_declarations_leave_no_memory_and_no_descriptor() {
        let master = declared(63);
        let address = |master: &Master| locked(&master.memory)[0].as_ptr();
        let spoil = |is_spoiled| {
            master.change(|draft| {
                draft.spoil(is_spoiled);
                Ok(())
            })
        };
        spoil(true).expect("nothing is active");
        assert_eq!(master.activate(), Err(Code::INVALID));
        let (first, before) = (address(&master), descriptors());
        for _ in 0..200 {
            assert_eq!(master.activate(), Err(Code::INVALID));
            assert_eq!((kept(&master), address(&master)), (1, first));
        }
        assert!(descriptors() < before + 100, "{before}, then {}", descriptors());
        spoil(false).expect("nothing is active");
        assert_eq!((master.activate(), kept(&master)), (Ok(()), 0));
        assert_eq!(master.release(), Ok(()));
    }

    // covers: c-interface
    #[test]
    fn without_links_an_activation_takes_no_memory() {
        let master = declared(62);
        let bus = master.bus().expect("it is open");
        let links = bus.take_links().expect("nothing uses them");
        for _ in 0..3 {
            assert_eq!(master.activate(), Err(Code::BUSY));
        }
        assert_eq!(kept(&master), 0);
        assert_eq!(master.look(|draft| draft.domains()[0].memory().is_null()), Ok(true));
        bus.give_links_back(links);
        assert_eq!(master.activate(), Ok(()));
        assert_eq!(master.release(), Ok(()));
    }
}
