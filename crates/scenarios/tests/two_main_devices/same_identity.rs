//! A MainDevice with the address of the ACTIVE does not join its ring (protocol SM-09, REQ006).

use std::sync::mpsc::{Sender, channel};
use std::time::Duration;

use ringcat::simulated::two_hosts::{HostLinks, TwoHosts};
use ringcat::standby::{Policy, StandbyOptions};
use ringcat::{Error, Instant, Link, Links, MainDevice, Options, PerLink, automatic};
use ringcat_sim::cable::Host;
use ringcat_wire::al::{AlState, AlStatus};
use ringcat_wire::frame::MacAddress;
use scenarios::two::CYCLE;

use super::ring_of_two;

/// Links with addresses of their own.
#[derive(Debug)]
struct Addressed {
    links: HostLinks,
    addresses: PerLink<MacAddress>,
}

impl Links for Addressed {
    fn now(&self) -> Instant {
        self.links.now()
    }

    fn addresses(&self) -> PerLink<MacAddress> {
        self.addresses
    }

    fn send(&mut self, link: Link, frame: &[u8]) {
        self.links.send(link, frame);
    }

    fn receive(&mut self, take: &mut dyn FnMut(Link, &[u8])) -> bool {
        self.links.receive(take)
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
        self.links.carrier(link)
    }

    fn wait(&mut self, until: Instant) {
        self.links.wait(until);
    }

    fn sleep(&mut self, until: Instant) {
        self.links.sleep(until);
    }
}

/// A program that joins, runs cycles, and reports why it could not join.
fn start(hosts: &mut TwoHosts, host: Host, addresses: PerLink<MacAddress>, listen: Duration, ends: Sender<Error>) {
    let program = move |mut links: HostLinks| {
        links.switch(true);
        let options = Options::default().with_standby(StandbyOptions::default());
        let policy = Policy::default().with_time_out(3, Duration::ZERO).with_listen(listen);
        let main_device = MainDevice::request(Addressed { links, addresses }, &options);
        match main_device.join(&policy, |scan| automatic(&scan.subdevices, CYCLE)) {
            Ok(mut application) => loop {
                application.cycle(|_| ());
            },
            Err(refused) => _ = ends.send(refused.error),
        }
    };
    hosts.start(host, program).expect("a thread starts");
}

// covers: REQ006, SM-09, standby
#[test]
fn a_maindevice_with_the_identity_of_the_active_does_not_join_its_ring() {
    let address = |last: u8| MacAddress([0, 0, 0x5E, 0, 0x53, last]);
    for second in [[0x11, 0x22], [0x21, 0x11], [0x11, 0x12]] {
        let mut hosts = TwoHosts::new(ring_of_two(4, Host::First));
        let (ends, ended) = channel();
        // The second one is not there yet.
        hosts.with_network(|network| {
            Host::Second.links().into_iter().for_each(|link| network.disconnect(link, true));
        });
        let (first, ms) = (PerLink::new(address(0x11), Some(address(0x12))), Duration::from_millis);
        start(&mut hosts, Host::First, first, ms(10), ends.clone());
        hosts.run_for(ms(1500));
        let in_op = |hosts: &mut TwoHosts| {
            hosts.with_network(|network| network.devices().all(|it| it.al_status() == AlStatus::new(AlState::Op)))
        };
        assert!(in_op(&mut hosts), "{second:x?}: {:?}", ended.try_recv());
        let second_links = PerLink::new(address(second[0]), Some(address(second[1])));
        start(&mut hosts, Host::Second, second_links, ms(500), ends);
        hosts.run_for(ms(300));
        let refused = ended.try_recv();
        assert!(matches!(refused, Ok(Error::SameIdentity(_))), "{second:x?}: {refused:?}");
        assert!(in_op(&mut hosts), "{second:x?}: the ACTIVE goes on");
    }
}
