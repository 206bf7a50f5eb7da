//! A network interface that leads to the other MainDevice of a ring, in memory: both halves of each MainDevice have a
//! thread of their own.

use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant as WallClock};

use ringcat::eoe::HostInterface;
use ringcat::shared_segment::SharedSegment;
use ringcat::standby::{MAX_ETHERNET, PartnerInterface, PartnerInterfaceError, Policy, RoleRequest, StandbyOptions};
use ringcat::wire::frame::MacAddress;
use ringcat::{MainDeviceRole, Options, Scan, SupervisorThread, automatic};
use ringcat_sim::cable::Host;
use ringcat_sim::device::Device;
use ringcat_sim::network::Network;
use ringcat_sim::network::builder::SegmentBuilder;

/// A machine that is busy reaches a state within this time.
const LIMIT: Duration = Duration::from_secs(20);
const CYCLE: Duration = Duration::from_millis(5);

fn ring_of_two() -> Network {
    let device = |name| Device::new(ringcat_sim::catalogue::by_name(name).expect("the catalogue has it"));
    let devices = vec![device("coupler"), device("digital-output-8"), device("digital-input-8")];
    SegmentBuilder::ring_of_two(devices, Host::First).build().expect("the cables fit")
}

/// A network interface in memory: what the host has sent, and what it gets.
#[derive(Clone, Default)]
struct Wire(Arc<Mutex<Ends>>);

#[derive(Default)]
struct Ends {
    to_send: Vec<Vec<u8>>,
    received: Vec<Vec<u8>>,
    carrier: bool,
    is_removed: bool,
}

impl Wire {
    fn with<T>(&self, work: impl FnOnce(&mut Ends) -> T) -> T {
        work(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl HostInterface for Wire {
    fn receive(&mut self, room: &mut [u8]) -> Option<usize> {
        let frame = self.with(|ends| (!ends.to_send.is_empty()).then(|| ends.to_send.remove(0)))?;
        let length = frame.len().min(room.len());
        room[..length].copy_from_slice(&frame[..length]);
        Some(length)
    }

    fn send(&mut self, frame: &[u8]) -> bool {
        self.with(|ends| ends.received.push(frame.to_vec()));
        true
    }

    fn set_carrier(&mut self, carrier: bool) {
        self.with(|ends| ends.carrier = carrier);
    }

    fn exists(&self) -> bool {
        !self.with(|ends| ends.is_removed)
    }
}

fn until(what: &str, mut holds: impl FnMut() -> bool) {
    let begin = WallClock::now();
    while !holds() {
        assert!(begin.elapsed() < LIMIT, "not within {LIMIT:?}: {what}");
        std::thread::sleep(Duration::from_millis(1));
    }
}

// covers: REQ034, REQ036, REQ039, REQ040, AC-04, threads, standby
#[test]
fn interfaces_of_two_hosts_exchange_frames_through_acyclic_halves_in_threads() {
    let halves = SharedSegment::halves_of_two(ring_of_two());
    let plant = halves[0].0.plant();
    let switch = |host: Host, up: bool| {
        plant.with_network(|network| host.links().into_iter().for_each(|link| network.disconnect(link, !up)));
    };
    switch(Host::Second, false);
    let wires = [Wire::default(), Wire::default()];
    let mut members = Vec::new();
    for ((cyclic, acyclic), wire) in halves.into_iter().zip(&wires) {
        let options = Options::default().with_standby(StandbyOptions::default().with_max_acyclic(4));
        let supervisor = SupervisorThread::start(acyclic, &options, || ()).expect("a thread starts");
        let interface = supervisor.start_partner_interface_on(Box::new(wire.clone())).expect("it has Ethernet");
        let again = supervisor.start_partner_interface_on(Box::new(wire.clone()));
        assert!(matches!(again, Err(PartnerInterfaceError::NoEthernet)));
        let policy = Policy::default().with_time_out(20, Duration::ZERO).with_listen(Duration::from_millis(300));
        let declare = |scan: &Scan| automatic(&scan.subdevices, CYCLE);
        if !members.is_empty() {
            switch(Host::Second, true);
        }
        let application =
            supervisor.join(&policy, declare, cyclic).unwrap_or_else(|refused| panic!("{}", refused.error));
        let cycles = application.start_cycles(|| (), |_| ControlFlow::Continue(())).expect("a thread starts");
        members.push((cycles, interface));
    }
    until("both have a carrier", || wires.iter().all(|wire| wire.with(|ends| ends.carrier)));
    let frame = |number: usize, round: usize| vec![(number * 100 + round) as u8; 60 + round * 200];
    for round in 0..6 {
        for (number, wire) in wires.iter().enumerate() {
            // Longer than fits: it is left out, and counted.
            let too_long = vec![0xEE; MAX_ETHERNET + 1];
            wire.with(|ends| ends.to_send.extend([frame(number, round), too_long]));
        }
        until("the frames have arrived", || wires.iter().all(|wire| wire.with(|ends| ends.received.len() > round)));
        if round % 2 == 1 {
            let controls = members.iter().map(|(member, _)| member.supervisor().role_control().expect("it runs"));
            let mut active = controls.filter(|control| control.role() == MainDeviceRole::Active);
            let control = active.next().expect("one is ACTIVE");
            until("the role is handed over", || {
                // It is refused before the other one is ready.
                control.request(RoleRequest::HandOver);
                control.role() == MainDeviceRole::Inactive
            });
        }
    }
    for (number, wire) in wires.iter().enumerate() {
        let expected: Vec<Vec<u8>> = (0..6).map(|round| frame(1 - number, round)).collect();
        assert_eq!(wire.with(|ends| ends.received.clone()), expected);
    }
    until("the counters are published", || {
        let traffic = members.iter().map(|(_, interface)| interface.status().traffic);
        traffic.into_iter().all(|traffic| (traffic.sent, traffic.received, traffic.refused_length) == (6, 6, 6))
    });
}

// covers: REQ034, REQ036, standby
#[test]
fn an_interface_that_was_removed_leaves_its_place_to_another_one() {
    let [(_cyclic, acyclic), _] = SharedSegment::halves_of_two(ring_of_two());
    let options = Options::default().with_standby(StandbyOptions::default().with_max_acyclic(4));
    let supervisor = SupervisorThread::start(acyclic, &options, || ()).expect("a thread starts");
    let [first, second] = [Wire::default(), Wire::default()];
    let interface = supervisor.start_partner_interface_on(Box::new(first.clone())).expect("it has Ethernet");
    first.with(|ends| ends.is_removed = true);
    until("the removal is seen", || interface.status().is_removed);
    let mut again = None;
    until("another one takes its place", || {
        again = supervisor.start_partner_interface_on(Box::new(second.clone())).ok();
        again.is_some()
    });
    // So does one that has ended in order.
    drop(again);
    until("a third one takes its place", || supervisor.start_partner_interface_on(Box::new(second.clone())).is_ok());
}

// covers: AC-07, REQ008, REQ006, standby
#[test]
fn each_side_has_an_address_of_its_own_that_is_the_same_at_each_start() {
    let [first, second] = [0x21, 0x31].map(|last| MacAddress([0x00, 0x1B, 0x21, 0xAA, 0xBB, last]));
    assert_eq!(PartnerInterface::address(first), [0x0A, 0xAA, 0xBB, 0x21, b'R', b'C']);
    assert_ne!(PartnerInterface::address(first), PartnerInterface::address(second));
}
