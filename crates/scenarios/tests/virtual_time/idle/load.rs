//! What supervision without an application costs: share of the wire and of a core.

use std::time::{Duration, Instant as WallClock};

use ringcat::simulated::SimulatedSegment;
use ringcat::{Instant, Link, Links};
use ringcat_engine::main_device::{MainDevice, Options};
use ringcat_sim::network::NetworkOptions;
use scenarios::segments::{descriptions, ring};

const COUNT: usize = 100;
/// Preamble, FCS and gap of a frame, and its shortest length without them.
const OVERHEAD: usize = 24;
const SHORTEST: usize = 60;
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
