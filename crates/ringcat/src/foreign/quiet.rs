//! Links that send nothing before they have been listened to.

use std::sync::Arc;
use std::task::Waker;
use std::time::Duration;

use ringcat_engine::link::Link;
use ringcat_engine::time::Instant;
#[cfg(feature = "eoe")]
use ringcat_link::WakeUp;
use ringcat_wire::frame::MacAddress;

use super::{ForeignFrame, LAST_FRAMES, ListeningPhase, ListeningSockets, ListeningState, has_commands};
use crate::links::{Links, PerLink};
use crate::text::address_of_sender;

/// Interval of checks while listening: of two MainDevices that begin at once, one receives frames of the first one that
/// sends.
const LOOK: Duration = Duration::from_millis(1);
/// The same while no frame can arrive, or frames of another MainDevice arrive.
const LONG_LOOK: Duration = Duration::from_millis(5);
/// Frames that a check takes at most from each half.
const FRAMES: usize = 256;

/// Links of an acyclic half that send nothing, and report no carrier, before they have been listened to with a carrier
/// and no frame of another MainDevice has arrived. While such frames arrive they stay silent.
#[derive(Debug)]
pub struct QuietLinks<L> {
    links: L,
    quiet: Option<Quiet<L>>,
}

/// What there is while nothing may be sent.
#[derive(Debug)]
struct Quiet<L> {
    /// Frames of another MainDevice may also arrive there.
    other_half: L,
    silence: Silence,
}

/// The silence on the links until now.
#[derive(Debug)]
struct Silence {
    listened: Arc<ListeningState>,
    sockets: Arc<dyn ListeningSockets>,
    /// How they were bound when the silence began.
    binding: Option<u32>,
    /// The carriers, and since when they are so.
    carriers: [bool; 2],
    carriers_since: [Instant; 2],
    /// Since when no frame has arrived.
    silent_since: Instant,
}

impl<L: Links> QuietLinks<L> {
    /// Links of an acyclic half. They listen with those of the cyclic half too, unless the segment is free already.
    /// Nothing may have been sent on any of them.
    pub fn new(
        acyclic: L,
        cyclic: L,
        listened: Arc<ListeningState>,
        sockets: Arc<dyn ListeningSockets>,
    ) -> QuietLinks<L> {
        let now = acyclic.now();
        let binding = sockets.binding();
        let (carriers, carriers_since) = ([false; 2], [now; 2]);
        let silence = Silence { listened, sockets, binding, carriers, carriers_since, silent_since: now };
        let is_free = silence.listened.phase() == ListeningPhase::Free;
        let mut links =
            QuietLinks { links: acyclic, quiet: (!is_free).then_some(Quiet { other_half: cyclic, silence }) };
        links.look();
        links
    }

    /// Takes frames of others, and ends the silence when it has lasted long enough.
    fn look(&mut self) {
        let QuietLinks { links, quiet: Some(Quiet { other_half, silence }) } = self else { return };
        let now = links.now();
        silence.follow_carriers(now, Link::ALL.map(|link| has_carrier(links, link)));
        for links in [&mut *links, other_half] {
            for _ in 0..FRAMES {
                if !links.receive(&mut |link, frame| silence.take(now, link, frame)) {
                    break;
                }
            }
        }
        if silence.is_over(now) {
            silence.listened.set(ListeningPhase::Free);
            self.quiet = None;
        }
    }

    /// The end of a wait: while listening, the next check.
    fn end_of(&self, now: Instant, until: Instant) -> Instant {
        let Some(Quiet { silence, .. }) = &self.quiet else { return until };
        let is_listening = silence.listened.phase() == ListeningPhase::Listening;
        until.min(now + if is_listening { LOOK } else { LONG_LOOK })
    }
}

impl Silence {
    fn follow_carriers(&mut self, now: Instant, carriers: [bool; 2]) {
        for link in Link::ALL.map(Link::index) {
            if carriers[link] != self.carriers[link] {
                (self.carriers_since[link], self.silent_since) = (now, now);
            }
        }
        self.carriers = carriers;
        match (carriers.contains(&true), self.listened.phase()) {
            // It still drives the segment that the cable leads to, as far as is known.
            (false, ListeningPhase::Occupied(_)) => {}
            (false, _) => self.listened.set(ListeningPhase::NoCarrier),
            (true, ListeningPhase::NoCarrier) => self.listened.set(ListeningPhase::Listening),
            (true, _) => {}
        }
    }

    /// A frame has arrived.
    fn take(&mut self, now: Instant, arrived_on: Link, frame: &[u8]) {
        let is_late = now.since(self.carriers_since[arrived_on.index()]) >= LAST_FRAMES;
        let Some(source) = address_of_sender(frame).filter(|_| is_late && has_commands(frame)) else { return };
        self.silent_since = now;
        if self.listened.foreign_frame().is_none() {
            self.listened.set(ListeningPhase::Occupied(ForeignFrame { arrived_on, source }));
        }
    }

    /// Whether no frame has arrived for long enough, with the same sockets all the time.
    fn is_over(&mut self, now: Instant) -> bool {
        if !self.carriers.contains(&true) || now.since(self.silent_since) < self.listened.lasts() {
            return false;
        }
        let binding = self.sockets.binding();
        let was_listening = binding.is_some() && binding == self.binding;
        if !was_listening {
            (self.binding, self.silent_since) = (binding, now);
        }
        was_listening
    }
}

/// Links that do not report a carrier have one.
fn has_carrier<L: Links>(links: &L, link: Link) -> bool {
    let is_there = link == Link::Main || links.addresses().redundant.is_some();
    is_there && links.carrier(link) != Some(false)
}

impl<L: Links> Links for QuietLinks<L> {
    fn now(&self) -> Instant {
        self.links.now()
    }

    fn addresses(&self) -> PerLink<MacAddress> {
        self.links.addresses()
    }

    fn send(&mut self, link: Link, frame: &[u8]) {
        if self.quiet.is_none() {
            self.links.send(link, frame);
        }
    }

    fn receive(&mut self, take: &mut dyn FnMut(Link, &[u8])) -> bool {
        self.look();
        self.quiet.is_none() && self.links.receive(take)
    }

    fn has_frame(&self) -> bool {
        self.links.has_frame()
    }

    fn has_arrival_times(&self) -> bool {
        self.links.has_arrival_times()
    }

    fn received_at(&mut self, sent_at: Instant, now: Instant) -> Option<Instant> {
        self.links.received_at(sent_at, now)
    }

    fn carrier(&self, link: Link) -> Option<bool> {
        if self.quiet.is_some() { Some(false) } else { self.links.carrier(link) }
    }

    fn waker(&self) -> Option<Waker> {
        self.links.waker()
    }

    #[cfg(feature = "eoe")]
    fn wake_up(&self) -> Option<WakeUp> {
        self.links.wake_up()
    }

    fn take_call(&mut self) -> bool {
        self.links.take_call()
    }

    fn wait(&mut self, until: Instant) {
        let until = self.end_of(self.links.now(), until);
        self.links.wait(until);
    }

    fn wait_from(&mut self, now: Instant, until: Instant) {
        let until = self.end_of(now, until);
        self.links.wait_from(now, until);
    }

    fn sleep(&mut self, until: Instant) {
        let until = self.end_of(self.links.now(), until);
        self.links.sleep(until);
    }

    fn force_disconnect(&mut self, link: Link, disconnect: bool) -> bool {
        self.links.force_disconnect(link, disconnect)
    }
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;
    use std::rc::Rc;
    use std::sync::atomic::{AtomicU32, Ordering};

    use super::*;
    use crate::foreign::LISTEN;

    const MS: Duration = Duration::from_millis(1);

    /// What the links of a test do, shared by both halves.
    #[derive(Default)]
    struct World {
        now: Instant,
        carriers: [bool; 2],
        /// Frames that have arrived.
        arrived: Vec<(Link, Vec<u8>)>,
        sent: usize,
    }

    /// A half; `true`: frames arrive on it.
    struct Half(Rc<RefCell<World>>, bool);

    impl Links for Half {
        fn now(&self) -> Instant {
            self.0.borrow().now
        }

        fn addresses(&self) -> PerLink<MacAddress> {
            PerLink::new(MacAddress([2; 6]), Some(MacAddress([4; 6])))
        }

        fn send(&mut self, _: Link, _: &[u8]) {
            self.0.borrow_mut().sent += 1;
        }

        fn receive(&mut self, take: &mut dyn FnMut(Link, &[u8])) -> bool {
            let frame = self.1.then(|| self.0.borrow_mut().arrived.pop()).flatten();
            frame.is_some_and(|(link, frame)| {
                take(link, &frame);
                true
            })
        }

        fn carrier(&self, link: Link) -> Option<bool> {
            Some(self.0.borrow().carriers[link.index()])
        }

        fn wait(&mut self, _: Instant) {}
    }

    fn frame(kind: u8) -> Vec<u8> {
        let mut frame = vec![0xff; 12];
        frame.extend([0x88, 0xA4, 0x0e, kind]);
        frame.resize(60, 0);
        frame
    }

    /// What the sockets are bound to.
    #[derive(Debug, Default)]
    struct Sockets(AtomicU32);

    impl ListeningSockets for Sockets {
        fn binding(&self) -> Option<u32> {
            Some(self.0.load(Ordering::Relaxed)).filter(|binding| *binding != DEAF)
        }
    }

    const DEAF: u32 = u32::MAX;

    struct Bench {
        sockets: Arc<Sockets>,
        world: Rc<RefCell<World>>,
        links: QuietLinks<Half>,
        listened: Arc<ListeningState>,
        passed_on: usize,
    }

    impl Bench {
        /// Frames arrive on the acyclic half or on the other one.
        fn new(is_acyclic: bool, carriers: [bool; 2]) -> Bench {
            let world = Rc::new(RefCell::new(World { carriers, ..World::default() }));
            let listened = Arc::new(ListeningState::lasting(LISTEN));
            let halves = [is_acyclic, !is_acyclic].map(|it| Half(world.clone(), it));
            let [acyclic, cyclic] = halves;
            let sockets = Arc::new(Sockets::default());
            let links = QuietLinks::new(acyclic, cyclic, listened.clone(), sockets.clone());
            Bench { sockets, world, links, listened, passed_on: 0 }
        }

        /// This many milliseconds, each with a look and an attempt to send.
        fn run(&mut self, ms: u32) {
            for _ in 0..ms {
                let now = self.world.borrow().now + MS;
                self.world.borrow_mut().now = now;
                let passed_on = &mut self.passed_on;
                while self.links.receive(&mut |_, _| *passed_on += 1) {}
                self.links.send(Link::Main, &frame(0x10));
            }
        }

        fn arrives(&mut self, link: Link, kind: u8) {
            self.world.borrow_mut().arrived.push((link, frame(kind)));
            self.run(1);
        }

        fn sent(&self) -> usize {
            self.world.borrow().sent
        }
    }

    // covers: other-main-device
    #[test]
    fn nothing_is_sent_before_a_link_with_a_carrier_was_listened_to() {
        for carriers in [[true, false], [false, true], [true, true]] {
            let mut bench = Bench::new(true, [false; 2]);
            bench.run(10_000);
            assert_eq!((bench.sent(), bench.listened.phase()), (0, ListeningPhase::NoCarrier));
            bench.world.borrow_mut().carriers = carriers;
            bench.run(250);
            assert_eq!((bench.sent(), bench.listened.phase()), (0, ListeningPhase::Listening));
            assert_eq!(Link::ALL.map(|link| bench.links.carrier(link)), [Some(false); 2]);
            bench.run(1);
            assert_eq!((bench.sent(), bench.listened.phase()), (1, ListeningPhase::Free));
            assert_eq!(Link::ALL.map(|link| bench.links.carrier(link)), carriers.map(Some));
            bench.arrives(Link::Main, 0x10);
            assert_eq!(bench.passed_on, 1, "frames are for the engine from now on");
        }
    }

    // covers: other-main-device
    #[test]
    fn a_segment_with_frames_of_others_stays_silent_until_they_end() {
        for (is_acyclic, link) in [(true, Link::Main), (true, Link::Redundant), (false, Link::Main)] {
            let mut bench = Bench::new(is_acyclic, [true; 2]);
            bench.arrives(link, 0x10);
            assert_eq!(bench.listened.foreign_frame(), None, "its sender may have just ended");
            bench.run(30);
            bench.arrives(link, 0x40);
            assert_eq!(bench.listened.foreign_frame(), None, "network variables");
            bench.run(200);
            for _ in 0..100 {
                bench.arrives(link, 0x10);
                let source = MacAddress([0xff; 6]);
                assert_eq!(bench.listened.foreign_frame(), Some(ForeignFrame { arrived_on: link, source }));
                bench.run(240);
            }
            assert_eq!((bench.sent(), bench.passed_on), (0, 0));
            bench.run(10);
            assert_eq!((bench.sent(), bench.listened.phase()), (1, ListeningPhase::Free));
        }
    }

    // covers: other-main-device
    #[test]
    fn a_carrier_that_changes_begins_the_silence_anew() {
        let mut bench = Bench::new(true, [true, false]);
        bench.run(240);
        bench.world.borrow_mut().carriers = [true; 2];
        bench.run(250);
        assert_eq!(bench.sent(), 0);
        bench.world.borrow_mut().carriers = [false; 2];
        bench.run(1_000);
        assert_eq!((bench.sent(), bench.listened.phase()), (0, ListeningPhase::NoCarrier));
    }

    // covers: other-main-device
    #[test]
    fn frames_received_without_a_socket_at_the_interface_do_not_count() {
        let mut bench = Bench::new(true, [true; 2]);
        bench.sockets.0.store(DEAF, Ordering::Relaxed);
        bench.run(2_000);
        assert_eq!(bench.sent(), 0, "no socket is bound");
        bench.sockets.0.store(1, Ordering::Relaxed);
        bench.run(499);
        assert_eq!(bench.sent(), 0, "it was bound in the middle of the silence at the earliest");
        bench.run(2);
        assert_eq!(bench.listened.phase(), ListeningPhase::Free);
        let mut bench = Bench::new(true, [true; 2]);
        bench.run(200);
        bench.sockets.0.store(1, Ordering::Relaxed);
        bench.run(200);
        assert_eq!(bench.sent(), 0, "another interface");
    }

    // covers: other-main-device
    #[test]
    fn a_link_that_flaps_does_not_hide_what_arrives_on_the_other_one() {
        let mut bench = Bench::new(true, [true; 2]);
        for turn in 0..200 {
            bench.run(12);
            bench.world.borrow_mut().carriers = [true, turn % 2 == 0];
            bench.arrives(Link::Main, 0x10);
        }
        assert_eq!(bench.listened.foreign_frame().map(|frame| frame.arrived_on), Some(Link::Main));
        // A cable that is pulled out leads to the same segment when it comes back.
        bench.world.borrow_mut().carriers = [false; 2];
        bench.run(1_000);
        assert!(bench.listened.foreign_frame().is_some() && bench.sent() == 0);
        bench.world.borrow_mut().carriers = [true; 2];
        bench.run(251);
        assert_eq!((bench.sent(), bench.listened.phase()), (1, ListeningPhase::Free));
    }

    // covers: other-main-device
    #[test]
    fn a_free_segment_is_driven_at_once() {
        let world = Rc::new(RefCell::new(World { carriers: [true; 2], ..World::default() }));
        let halves = [true, false].map(|it| Half(world.clone(), it));
        let [acyclic, cyclic] = halves;
        let mut links =
            QuietLinks::new(acyclic, cyclic, Arc::new(ListeningState::not_shared()), Arc::new(Sockets::default()));
        links.send(Link::Main, &frame(0x10));
        assert_eq!(world.borrow().sent, 1);
    }
}
