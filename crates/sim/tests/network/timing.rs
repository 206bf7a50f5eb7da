//! Arrival times of frames, detection of links, and frames on a cable during a cut (protocol 1.3, 2.2, 11.4).

use core::time::Duration;

use ringcat_sim::cable::HostLink::{Main, Redundant};
use ringcat_sim::cable::{DeviceIndex, HostLink};
use ringcat_sim::network::statistics::LossCause;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_sim::time::SimTime;
use ringcat_wire::al::{AlState, AlStatus};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::map;

use crate::wiring::{SETTLE, command, cut, endpoint, ring, segment, segment_with, shortest, travel};

/// Time from the first to the last bit of a shortest frame: 72 byte times.
const WIRE_NS: u64 = 5_760;

fn ns(time: u64) -> Duration {
    Duration::from_nanos(time)
}

fn options() -> NetworkOptions {
    NetworkOptions::default().with_processing_delay(ns(400)).with_forwarding_delay(ns(200))
}

/// Arrival times of the frames received on a link, relative to `since`.
fn arrivals(network: &mut Network, link: HostLink, since: SimTime) -> Vec<u64> {
    std::iter::from_fn(|| network.receive(link)).map(|received| (received.at - since).as_nanos() as u64).collect()
}

// covers: sim-faults
#[test]
fn a_frame_needs_its_wire_time_the_hops_and_the_cables() {
    let mut network = segment_with("main-1.0 1.1-2.0", options());
    let start = network.now();
    network.send(Main, &shortest());
    // To 1; processed and to 2; processed and back to 1; forwarded and back to the MainDevice.
    let expected = WIRE_NS + 100 + (400 + 100) + (400 + 100) + (200 + 100);
    network.advance(start + ns(expected - 1));
    assert_eq!(network.receive(Main), None);
    assert_eq!(network.next_event(), Some(start + ns(expected)));
    network.advance(start + ns(expected));
    assert_eq!(arrivals(&mut network, Main, start), [expected]);
}

// covers: sim-faults
#[test]
fn frames_sent_at_once_leave_one_after_the_other() {
    let mut network = segment(&ring(3));
    let start = network.now();
    let long = command(Command::Nop, Target::None, &[0; 1486]);
    assert_eq!(long.len(), 1_514);
    for frame in [&shortest(), &long, &shortest()] {
        network.send(Main, frame);
    }
    network.advance_by(SETTLE);
    let times = arrivals(&mut network, Redundant, start);
    // protocol 1.3: 60 + 24 byte times to the next frame, 1514 + 12 of the long one, 12 of gap, 72 of the last.
    assert_eq!(times[1] - times[0], (84 + 1_526 - 72) * 80);
    assert_eq!(times[2] - times[1], (12 + 72) * 80);
}

#[test]
fn the_two_interfaces_send_at_the_same_time() {
    let mut network = segment(&ring(3));
    let start = network.now();
    network.send(Main, &shortest());
    network.send(Redundant, &shortest());
    network.advance_by(SETTLE);
    assert_eq!(arrivals(&mut network, Redundant, start), arrivals(&mut network, Main, start));
}

#[test]
fn a_full_transmit_queue_loses_frames() {
    let mut network = segment_with(&ring(1), NetworkOptions::default().with_transmit_queue(3));
    for _ in 0..5 {
        network.send(Main, &shortest());
    }
    assert_eq!(network.statistics().lost(LossCause::TransmitQueueFull), 2);
    assert_eq!(network.statistics().link(Main).frames_sent, 3);
    assert_eq!(network.statistics().link(Main).bytes_sent, 180);
}

#[test]
fn frames_that_are_not_fetched_fill_a_bounded_queue() {
    let mut network = segment_with(&ring(1), NetworkOptions::default().with_receive_queue(2));
    for _ in 0..3 {
        network.send(Main, &shortest());
    }
    network.advance_by(SETTLE);
    assert_eq!(network.statistics().lost(LossCause::ReceiveQueueFull), 1);
    assert_eq!(network.statistics().link(Redundant).frames_received, 2);
}

// covers: sim-faults
#[test]
fn both_ends_detect_a_cut_and_a_repair_after_their_delays() {
    let options = NetworkOptions::default().with_link_down_delay(ns(20_000)).with_link_up_delay(ns(70_000));
    let mut network = segment_with(&ring(2), options);
    let cable = network.host_cable(Main).unwrap();
    let port = endpoint("1.0");
    assert_eq!(network.cable_at(port), Some(cable));
    let port_0_closed =
        |network: &Network| network.device(DeviceIndex(0)).controller.loop_closed(ringcat_sim::frame::Port::A);
    let start = network.now();
    network.cut(cable);
    network.advance(start + ns(19_999));
    assert!(network.carrier(Main) && !port_0_closed(&network));
    network.advance(start + ns(20_000));
    assert!(!network.carrier(Main) && port_0_closed(&network));
    assert!(network.carrier(Redundant));
    let start = network.now();
    network.heal(cable);
    network.advance(start + ns(69_999));
    assert!(!network.carrier(Main) && port_0_closed(&network));
    network.advance(start + ns(70_000));
    assert!(network.carrier(Main) && !port_0_closed(&network));
}

#[test]
fn a_link_flap_shorter_than_the_detection_is_not_detected() {
    let mut network = segment(&ring(2));
    let cable = network.cable_at(endpoint("1.1")).unwrap();
    network.cut(cable);
    network.advance_by(ns(5_000));
    network.heal(cable);
    network.advance_by(SETTLE);
    let lost_links =
        |device| network.device(DeviceIndex(device)).controller.register(map::LOST_LINK_COUNTER, 4).to_vec();
    assert_eq!((lost_links(0), lost_links(1)), (vec![0; 4], vec![0; 4]));
    assert!(travel(&mut network, Main).is_some());
}

#[test]
fn frames_are_lost_until_a_cut_is_detected_and_then_return() {
    let mut network = segment_with(&ring(3), NetworkOptions::default().with_detection_delay(ns(1_000_000)));
    let cable = network.cable_at(endpoint("1.1")).unwrap();
    let start = network.now();
    network.cut(cable);
    for step in 0..20 {
        network.advance(start + ns(step * 100_000));
        network.send(Main, &shortest());
        network.send(Redundant, &shortest());
    }
    network.advance_by(SETTLE);
    // Steps 0 to 9 are before the detection; the frame of step 10 is sent at the detection and reaches the port after
    // it.
    assert_eq!(arrivals(&mut network, Main, start).len(), 10);
    assert_eq!(arrivals(&mut network, Redundant, start).len(), 10);
    assert_eq!(network.statistics().lost(LossCause::DeadCable), 20);
}

/// Sends a shortest frame through a ring of 4 and cuts the cable from 1 to 2 after `cut_ns`.
fn cut_under_way(cut_ns: u64) -> Network {
    let mut network = segment_with(&ring(4), options());
    let cable = network.cable_at(endpoint("1.1")).unwrap();
    network.send(Main, &shortest());
    network.advance_by(ns(cut_ns));
    network.cut(cable);
    network.advance_by(ns(100_000));
    network
}

fn invalid_and_forwarded(network: &Network, device: usize) -> (u8, u8) {
    let controller = &network.device(DeviceIndex(device)).controller;
    (controller.register(map::RX_ERROR_COUNTER, 1)[0], controller.register(map::FORWARDED_RX_ERROR_COUNTER, 1)[0])
}

#[test]
fn a_cut_before_the_frame_enters_the_cable_causes_no_error_counts() {
    // The first bit enters the cable from 1 to 2 at 100 (cable) + 400 (device 1) = 500 ns.
    let network = cut_under_way(499);
    assert_eq!(invalid_and_forwarded(&network, 1), (0, 0));
    assert_eq!(network.statistics().lost(LossCause::DeadCable), 1);
}

// covers: sim-faults
#[test]
fn a_cut_while_the_frame_is_in_the_cable_leaves_a_damaged_remnant() {
    let mut network = cut_under_way(3_000);
    assert_eq!(network.receive(Redundant), None);
    assert_eq!(network.statistics().lost(LossCause::BadCheckSequence), 1);
    // protocol 2.5: the first controller counts it as invalid, the others as forwarded.
    let counters: Vec<_> = (0..4).map(|device| invalid_and_forwarded(&network, device)).collect();
    assert_eq!(counters, [(0, 0), (1, 0), (0, 1), (0, 1)]);
}

#[test]
fn a_cut_after_the_frame_does_not_affect_it() {
    // The last bit leaves the cable at 500 + 100 + 5760 ns.
    let mut network = cut_under_way(500 + 100 + WIRE_NS);
    assert_eq!(network.statistics().lost_total(), 0);
    assert_eq!(network.receive(Redundant).unwrap().bytes[6], 0x02);
}

#[test]
fn a_port_that_opens_interrupts_the_passing_frame() {
    let mut network = segment(&ring(2));
    let cable = cut(&mut network, "1.1");
    let start = network.now();
    network.heal(cable);
    network.advance(start + ns(10_000 - 3_000));
    network.send(Main, &shortest());
    network.send(Redundant, &shortest());
    network.advance_by(SETTLE);
    assert_eq!(network.statistics().lost(LossCause::LoopChanged), 2);
    assert_eq!(travel(&mut network, Main).unwrap().processed_by, [1, 2]);
}

#[test]
fn a_loop_that_closes_during_a_frame_does_not_return_its_remnant() {
    const SENT: u64 = 5_000;
    let (mut returned, mut interrupted) = (0, 0);
    for cut_at in (0..20_000).step_by(100) {
        let mut network = segment_with(&ring(4), options().with_detection_delay(ns(1_000)));
        let cable = network.cable_at(endpoint("1.1")).unwrap();
        let write = command(Command::Bwr, Target::Broadcast(map::USER_RAM), &[0xA5]);
        let first = SENT.min(cut_at);
        network.advance_by(ns(first));
        if cut_at <= SENT {
            network.cut(cable);
            network.advance_by(ns(SENT - first));
        }
        network.send(Redundant, &write);
        if cut_at > SENT {
            network.advance_by(ns(cut_at - first));
            network.cut(cable);
        }
        network.advance_by(SETTLE);
        let has_it =
            |device: &usize| network.device(DeviceIndex(*device)).controller.register(map::USER_RAM, 1) == [0xA5];
        let processed_by: Vec<usize> = (0..4).filter(has_it).collect();
        if network.statistics().lost(LossCause::LoopChanged) == 1 {
            interrupted += 1;
            assert_eq!(processed_by, [], "cut at {cut_at} ns: device 2 has processed the rest of a frame");
        } else if network.receive(Redundant).is_some() {
            returned += 1;
            assert_eq!(processed_by, [1, 2, 3], "cut at {cut_at} ns: the frame arrived after the loop had closed");
        }
    }
    // The duration of the frame, and the time until its first bit arrives.
    assert!(interrupted > 40 && returned > 0, "{interrupted} interrupted, {returned} returned");
}

#[test]
fn an_interface_without_carrier_sends_nothing() {
    let mut network = segment("main-1.0");
    network.send(Redundant, &shortest());
    assert_eq!(network.statistics().lost(LossCause::NoCarrier), 1);
    assert_eq!(network.statistics().link(Redundant).frames_sent, 0);
    assert!(!network.carrier(Redundant));
}

// covers: sim-interfaces
#[test]
fn time_advances_to_the_exit_of_the_last_frame_and_not_beyond() {
    let mut quiet = segment(&ring(3));
    let mut waiting = segment(&ring(3));
    let start = quiet.now();
    for network in [&mut quiet, &mut waiting] {
        network.send(Main, &shortest());
        network.send(Main, &shortest());
    }
    waiting.advance_by(SETTLE);
    let expected = arrivals(&mut waiting, Redundant, start);
    quiet.advance_until_quiet(start + SETTLE);
    assert_eq!(quiet.now(), start + ns(expected[1]));
    assert_eq!(arrivals(&mut quiet, Redundant, start), expected);
    // No frame is in the segment: time does not advance.
    quiet.advance_until_quiet(start + SETTLE);
    assert_eq!(quiet.now(), start + ns(expected[1]));
}

// covers: sim-interfaces
#[test]
fn an_advance_until_quiet_ends_at_its_limit_and_the_next_one_continues() {
    let mut network = segment(&ring(3));
    let start = network.now();
    network.send(Main, &shortest());
    network.advance_until_quiet(start + ns(WIRE_NS));
    assert!(network.now() <= start + ns(WIRE_NS));
    assert_eq!(network.receive(Redundant), None);
    network.advance_until_quiet(start + SETTLE);
    assert_eq!(arrivals(&mut network, Redundant, start).len(), 1);
}

// covers: sim-interfaces
#[test]
fn devices_react_on_demand_or_before_the_next_frame() {
    let request = |state: u8| command(Command::Bwr, Target::Broadcast(map::AL_CONTROL), &[state, 0]);
    let status = |network: &Network| network.device(DeviceIndex(0)).al_status();
    let mut network = segment(&ring(2));
    let limit = network.now() + SETTLE;
    assert_eq!(network.next_event(), None);

    network.send(Main, &request(2));
    network.advance_until_quiet(limit);
    assert!(network.receive(Redundant).is_some());
    assert_eq!(network.next_event(), None, "no transition has begun");
    network.settle_all();
    assert!(network.next_event().is_some());
    network.advance_by(SETTLE);
    assert_eq!(status(&network), AlStatus::new(AlState::PreOp));

    network.send(Main, &request(1));
    network.send(Main, &shortest());
    network.advance_until_quiet(network.now() + SETTLE);
    assert!(network.next_event().is_some(), "the devices begin the transition before the second frame");
}
