//! What supervision without an application costs: share of the wire and of a core.

use std::time::{Duration, Instant as WallClock};

use ringcat::simulated::SimulatedSegment;
use ringcat::{Instant, Link, Links};
use ringcat_engine::main_device::{MainDevice, Options};
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::network::NetworkOptions;
use ringcat_wire::mailbox::coe::Emergency;
use scenarios::dice::Dice;
use scenarios::segments::{descriptions, ring};
use scenarios::tap::Tap;
use scenarios::witness::Witness;

const COUNT: usize = 100;
/// Preamble, FCS and gap of a frame, and its shortest length without them.
const OVERHEAD: usize = 24;
const SHORTEST: usize = 60;
/// Status register of SyncManager 1, whose mailbox the SubDevice writes.
const SEND_MAILBOX_STATUS: u16 = 0x080D;
/// Nanoseconds per byte at 100 Mbit/s.
const BYTE_NS: u64 = 80;

/// A MainDevice without an application on simulated links, with the time that it uses.
struct Idle {
    links: SimulatedSegment,
    engine: MainDevice,
    used: Duration,
    wire_ns: u64,
}

impl Idle {
    fn new(kind: &str) -> Idle {
        let links = SimulatedSegment::new(ring(descriptions(&[kind; COUNT]), NetworkOptions::default()));
        let ringcat::PerLink { main, redundant, .. } = links.addresses();
        let mut options = Options::new(main, redundant);
        options.idle_operation = true;
        let engine = MainDevice::new(options, links.now());
        Idle { links, engine, used: Duration::ZERO, wire_ns: 0 }
    }

    fn run(&mut self, time: Duration) {
        let end = self.links.now() + time;
        while self.links.now() < end {
            let now = self.links.now();
            let mut arrived: Vec<(Link, Vec<u8>)> = Vec::new();
            while self.links.receive(&mut |link, frame| arrived.push((link, frame.to_vec()))) {}
            let mut sent: Vec<(Link, Vec<u8>)> = Vec::new();
            let begun = WallClock::now();
            for (link, frame) in &arrived {
                self.engine.receive(*link, frame, now);
            }
            self.engine.poll(now);
            self.engine.transmit(now, usize::MAX, &mut |link, frame| sent.push((link, frame.to_vec())));
            let wake = self.engine.next_deadline().unwrap_or(Instant::NEVER);
            self.used += begun.elapsed();
            for (link, frame) in sent {
                if link == Link::Main {
                    self.wire_ns += (frame.len().max(SHORTEST) + OVERHEAD) as u64 * BYTE_NS;
                }
                self.links.send(link, &frame);
            }
            while self.engine.pop_event(now).is_some() {}
            self.links.wait(wake.min(end));
        }
    }

    /// Shares of the wire and of a core during ten seconds, in percent.
    fn shares(&mut self) -> [f64; 2] {
        self.run(Duration::from_secs(2));
        assert_eq!(self.engine.subdevices().len(), COUNT);
        let time = Duration::from_secs(10);
        // The least of three measurements: other programs use the core, too.
        let mut shares = [f64::MAX; 2];
        for _ in 0..3 {
            (self.used, self.wire_ns) = (Duration::ZERO, 0);
            self.run(time);
            shares[0] = 100.0 * self.wire_ns as f64 / time.as_nanos() as f64;
            shares[1] = shares[1].min(100.0 * self.used.as_secs_f64() / time.as_secs_f64());
        }
        shares
    }
}

// covers: states
#[test]
fn supervision_of_100_takes_one_percent_of_the_wire_and_of_a_core_at_most() {
    let [wire, core] = Idle::new("digital-output-8").shares();
    let [wire_with_mail, core_with_mail] = Idle::new("servo").shares();
    println!("100 SubDevices without an application, supervision: {wire:.3} % of the wire, {core:.3} % of a core");
    let (mail_wire, mail_core) = (wire_with_mail - wire, core_with_mail - core);
    println!("100 mailboxes polled each 100 ms: {mail_wire:.3} % of the wire, {mail_core:.3} % of a core more");
    assert!(wire <= 1.0 && core <= 1.0, "{wire} {core}");
    assert!(wire_with_mail <= 2.0 && core_with_mail <= 2.0, "{wire_with_mail} {core_with_mail}");
}

/// The mail of a mailbox is read within 100 ms without an application, and within 10 ms beside one.
// covers: states, mailbox
#[test]
fn mailboxes_are_polled_slower_without_an_application() {
    const SERVOS: usize = 20;
    const TRIALS: u16 = 40;
    let time = Duration::from_secs(4);
    let network = ring(descriptions(&["all-protocols"; SERVOS]), NetworkOptions::default());
    let (links, frames) = Witness::new(Tap::new(network));
    let options = ringcat::Options::default().with_idle_operation(true);
    let mut main_device = ringcat::MainDevice::request(links, &options);
    main_device.attend(Duration::from_secs(3));
    frames.take();
    main_device.attend(time);
    let polls = frames.sent().into_iter().filter(|(link, _, at)| *link == Link::Main && *at == SEND_MAILBOX_STATUS);
    let each = polls.count() as f64 / time.as_secs_f64() / SERVOS as f64;
    assert!((8.0..=10.1).contains(&each), "{each} reads per second and mailbox");
    let mut dice = Dice::new(17);
    let send = |tap: &mut Tap, dice: &mut Dice, number: u16| {
        let device = tap.network_mut().device_mut(DeviceIndex(dice.below(SERVOS as u64) as usize));
        let emergency = Emergency { error_code: number, error_register: 1, data: [0; 5] };
        assert!(device.application.emergency(&emergency));
    };
    let is_it = |event: &ringcat::Event| matches!(event, ringcat::Event::Emergency { .. });
    let mut idle = Vec::new();
    for number in 1..TRIALS {
        main_device.attend(Duration::from_micros(200_000 + dice.below(100_000)));
        while main_device.pop_event().is_some() {}
        send(main_device.links_mut().links_mut(), &mut dice, number);
        let begun = main_device.now();
        while !std::iter::from_fn(|| main_device.pop_event()).any(|timed| is_it(&timed.event)) {
            main_device.attend(Duration::from_millis(1));
        }
        idle.push(main_device.now().since(begun));
    }
    let declaration = ringcat::automatic(&main_device.subdevices(), Duration::from_millis(1));
    let mut application = main_device.activate(declaration).map_err(ringcat::Error::from).expect("it fits");
    (0..1_000).for_each(|_| application.cycle(|_| ()));
    assert!(application.all_settled());
    let mut active = Vec::new();
    for number in 1..TRIALS {
        (0..20 + dice.below(20)).for_each(|_| application.cycle(|_| ()));
        while application.pop_event().is_some() {}
        send(application.links_mut().links_mut(), &mut dice, number);
        let begun = application.now();
        while !std::iter::from_fn(|| application.pop_event()).any(|timed| is_it(&timed.event)) {
            application.cycle(|_| ());
        }
        active.push(application.now().since(begun));
    }
    let most = |times: &[Duration]| times.iter().max().copied().unwrap_or_default();
    let (idle, active) = (most(&idle), most(&active));
    println!("mail is read within {idle:?} without an application, within {active:?} beside one");
    assert!(idle > Duration::from_millis(70) && idle <= Duration::from_millis(110), "{idle:?}");
    assert!(active <= Duration::from_millis(10), "{active:?}");
}
