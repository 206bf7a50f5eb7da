//! Tests of the router and its protocols with a SubDevice that consists of a mailbox only, undisturbed and with frames
//! lost, late and duplicated. Time is virtual, random numbers are seeded.

mod device;
mod interrupted;
mod late;
mod protocols;
mod raw_mail;
mod server;
mod storm;

use alloc::rc::Rc;
use alloc::vec::Vec;
use core::cell::RefCell;
use core::future::Future;
use core::time::Duration;

use ringcat_wire::address::StationAddress;
use ringcat_wire::frame::MacAddress;
use ringcat_wire::source_address::MacCodec;

use self::device::{Device, STATION};
use self::server::AllProtocols;
use super::{Limits, Mailbox};
use crate::declared::SubDeviceId;
use crate::link::{Link, LinkSet};
use crate::ring::Identity;
use crate::supervisor::Supervisor;
use crate::time::Instant;

const LIMITS: Limits = Limits::new(Duration::from_millis(100), Duration::from_secs(1));
const MAIN: MacAddress = MacAddress([0, 0, 0x5E, 0, 0x53, 1]);
const REDUNDANT: MacAddress = MacAddress([0, 0, 0x5E, 0, 0x53, 2]);
/// Round-trip time of a frame.
const ROUND_TRIP: Duration = Duration::from_micros(50);

/// Fate of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fate {
    Passes,
    LostOut,
    LostBack,
    /// The frame comes back later.
    Late(Duration),
    /// The ring closes while the frame is on the wire: the SubDevice processes both copies.
    ProcessedTwice,
}

/// A MainDevice with one SubDevice.
struct Bench {
    supervisor: Supervisor,
    mailbox: Mailbox,
    device: Device<AllProtocols>,
    now: Instant,
    under_way: Vec<(Instant, Link, Vec<u8>)>,
}

impl Bench {
    fn new(links: LinkSet, size: u16) -> Bench {
        let identity = Identity::new(MacCodec::FlagsFirst, MAIN, Some(REDUNDANT));
        let supervisor = Supervisor::new(identity, links, Instant(0));
        let server = AllProtocols::new(usize::from(size) - 6);
        let device = Device::new(size, server);
        let mailbox = Mailbox::new(&supervisor.bus(), SubDeviceId(0));
        mailbox.open(StationAddress(STATION), device.layout, 1);
        Bench { supervisor, mailbox, device, now: Instant(1_000), under_way: Vec::new() }
    }

    fn start<T: 'static>(&mut self, work: impl Future<Output = T> + 'static) -> Rc<RefCell<Option<T>>> {
        let result = Rc::new(RefCell::new(None));
        let slot = result.clone();
        self.supervisor.spawn(async move {
            let value = work.await;
            *slot.borrow_mut() = Some(value);
        });
        result
    }

    /// Sends queued frames and advances time to the next event, by at most a millisecond.
    fn step(&mut self, mut fate: impl FnMut() -> Fate) {
        self.supervisor.poll(self.now);
        let mut sent = Vec::new();
        self.supervisor.transmit(self.now, usize::MAX, &mut |link, frame| sent.push((link, frame.to_vec())));
        let mut last = Fate::Passes;
        for (link, mut frame) in sent {
            if link == Link::Main {
                last = fate();
            }
            if last == Fate::LostOut {
                continue;
            }
            if link == Link::Main || last == Fate::ProcessedTwice {
                self.device.pass(&mut frame, self.now);
            } else {
                frame[6] |= 0x02;
            }
            let late = if let Fate::Late(by) = last { by } else { Duration::ZERO };
            if last != Fate::LostBack {
                self.under_way.push((self.now + ROUND_TRIP + late, link, frame));
            }
        }
        let frame = self.under_way.iter().map(|(at, _, _)| *at).min();
        let deadline = self.supervisor.next_deadline().filter(|at| *at > self.now);
        let soon = self.now + Duration::from_millis(1);
        self.now = frame.into_iter().chain(deadline).fold(soon, Instant::min).max(self.now);
        self.device.run(self.now);
        let now = self.now;
        let (arrived, left) = self.under_way.drain(..).partition(|(at, _, _)| *at <= now);
        self.under_way = left;
        let arrived: Vec<(Instant, Link, Vec<u8>)> = arrived;
        for (_, link, frame) in arrived {
            self.supervisor.receive(link, &frame, now);
        }
    }

    /// Runs a future to its end.
    fn run<T: 'static>(&mut self, work: impl Future<Output = T> + 'static) -> T {
        let result = self.start(work);
        let end = self.now + Duration::from_secs(60);
        loop {
            if let Some(result) = result.borrow_mut().take() {
                return result;
            }
            assert!(self.now < end, "no end in 60 s");
            self.step(|| Fate::Passes);
        }
    }

    /// Advances time.
    fn pass(&mut self, time: Duration) {
        let end = self.now + time;
        while self.now < end {
            self.step(|| Fate::Passes);
        }
    }
}
