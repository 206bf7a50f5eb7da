//! Ethernet frames between both MainDevices in acyclic master frames, while roles change, controllers fail, cables are
//! cut and frames are lost (protocol 9.12).

use std::time::Duration;

use ringcat::MainDeviceRole;
use ringcat::standby::{RoleRequest, StandbyOptions};
use ringcat_sim::cable::{CableId, Host};
use ringcat_sim::fault::Fault;
use scenarios::two::{CYCLE, EthernetTraffic, Two};

use super::{declare, ring_of_two, standby};

const COUNT: usize = 4;
const READY: Duration = Duration::from_millis(500);

fn with_ethernet() -> StandbyOptions {
    standby().with_max_acyclic(4)
}

/// In OP with a standby that is ready, and each has received frames of the other one.
fn in_op() -> Two {
    let mut two = Two::in_op(ring_of_two(COUNT, Host::First), declare, with_ethernet());
    two.run(Duration::from_millis(100));
    assert!(are_up(&two), "{}", two.log());
    two.mark();
    two
}

fn are_up(two: &Two) -> bool {
    two.controllers.iter().all(|it| it.endpoint.as_ref().is_some_and(|endpoint| endpoint.is_up()))
}

/// Both exchange frames for some cycles.
fn exchange_frames(two: &mut Two, traffic: &mut EthernetTraffic, cycles: u32) {
    for _ in 0..cycles {
        traffic.step(two);
        two.run(CYCLE);
    }
    traffic.receive(two);
}

/// All frames that wait arrive.
fn finish(two: &mut Two, traffic: &mut EthernetTraffic) {
    for _ in 0..30 {
        two.run(CYCLE);
        traffic.receive(two);
    }
}

fn hand_over(two: &mut Two, traffic: &mut EthernetTraffic) {
    let active = two.active().expect("one is ACTIVE");
    two.controllers[active].request(RoleRequest::HandOver);
    exchange_frames(two, traffic, 30);
    assert_eq!(two.active(), Some(1 - active), "{}", two.log());
}

fn until_ready(two: &mut Two, traffic: &mut EthernetTraffic) {
    let active = two.active().expect("one is ACTIVE");
    let end = two.now() + READY;
    while !two.controllers[active].partner().is_ready() {
        assert!(two.now() < end, "{}", two.log());
        exchange_frames(two, traffic, 1);
    }
}

// covers: 9.12, AC-01, AC-02, AC-06, REQ034, REQ040, FR-07, standby
#[test]
fn ethernet_passes_both_ways_from_the_scan_on_and_in_op_and_no_frame_is_lost() {
    for near in Host::ALL {
        let mut two = Two::new(ring_of_two(COUNT, near), declare, with_ethernet());
        let mut traffic = EthernetTraffic::new(1);
        two.controllers[0].begin_active();
        let mut before_applications = [0; 2];
        while !(two.all_in_op() && two.controllers[0].partner().is_ready()) {
            assert!(two.now().0 < 5_000_000_000, "{}", two.log());
            if two.controllers.iter().any(|it| !it.has_application()) {
                before_applications = traffic.sides.each_ref().map(|side| side.received);
            }
            exchange_frames(&mut two, &mut traffic, 1);
        }
        assert!(before_applications.iter().all(|count| *count > 0), "{before_applications:?} {near:?}");
        two.mark();
        exchange_frames(&mut two, &mut traffic, 200);
        finish(&mut two, &mut traffic);
        assert_eq!(traffic.missing(), [0, 0], "{traffic:?}");
        assert!(traffic.sides.iter().all(|side| side.received > 200), "{traffic:?}");
        assert!(two.left_op.is_empty() && two.went_back.is_empty(), "{}", two.log());
        assert_eq!(two.controllers.each_ref().map(|it| it.sent_inactive), [0, 0], "an INACTIVE sends nothing");
        assert_eq!(two.controllers.each_ref().map(|it| it.allocations), [0, 0], "taking, filling, cycles");
    }
}

// covers: AC-02, MR-07, MR-17, REQ034, standby
#[test]
fn twenty_switchovers_lose_no_ethernet_frame() {
    let mut two = in_op();
    let mut traffic = EthernetTraffic::new(2);
    for _ in 0..20 {
        hand_over(&mut two, &mut traffic);
        until_ready(&mut two, &mut traffic);
    }
    finish(&mut two, &mut traffic);
    println!("20 switchovers: {traffic:?}");
    assert_eq!(traffic.missing(), [0, 0], "{traffic:?}");
    assert!(traffic.sides.iter().all(|side| side.received > 1000 && side.refused == 0), "{traffic:?}");
    assert!(two.left_op.is_empty() && two.all_in_op() && two.went_back.is_empty(), "{}", two.log());
    assert!(two.longest_gap <= CYCLE + CYCLE / 2, "{:?}", two.longest_gap);
}

// covers: AC-02, AC-05, MR-07, MR-26, standby
#[test]
fn after_a_takeover_and_the_return_of_the_other_one_frames_pass_again() {
    for killed in [0, 1] {
        let mut two = in_op();
        let mut traffic = EthernetTraffic::new(2);
        exchange_frames(&mut two, &mut traffic, 50);
        let before = traffic.sides[1 - killed].received;
        two.kill(killed);
        if killed == 0 {
            two.run(5 * CYCLE);
            two.controllers[1].request(RoleRequest::Active);
        }
        exchange_frames(&mut two, &mut traffic, 1500);
        assert_eq!(two.active(), Some(1 - killed), "{}", two.log());
        assert!(!two.controllers[1 - killed].endpoint.as_ref().is_some_and(|it| it.is_up()), "it is dead");
        assert!(traffic.sides[1 - killed].received <= before + 2);
        two.revive(killed);
        traffic.begin_anew(killed);
        until_ready(&mut two, &mut traffic);
        let begun = traffic.sides.each_ref().map(|side| (side.sent, side.received));
        exchange_frames(&mut two, &mut traffic, 100);
        finish(&mut two, &mut traffic);
        for (side, (sent, received)) in traffic.sides.iter().zip(begun) {
            assert!(side.sent >= sent + 200 && side.received >= received + 200, "{begun:?} {traffic:?}");
        }
        assert!(two.all_in_op() && two.went_back.is_empty(), "{}", two.log());
    }
}

// covers: 9.7.5, AC-02, REQ034, standby
#[test]
fn with_any_cable_cut_ethernet_passes_and_only_the_edges_lose_frames() {
    for active in [0, 1] {
        for cable in 0..COUNT + 2 {
            let mut two = in_op();
            let mut traffic = EthernetTraffic::new(1);
            if active == 1 {
                hand_over(&mut two, &mut traffic);
                until_ready(&mut two, &mut traffic);
            }
            for is_cut in [true, false] {
                let fault = if is_cut { Fault::Cut(CableId(cable)) } else { Fault::Heal(CableId(cable)) };
                two.fault(fault);
                exchange_frames(&mut two, &mut traffic, 20);
                finish(&mut two, &mut traffic);
                let here = format!("ACTIVE {active}, cable {cable}, cut: {is_cut}: {traffic:?}");
                let edge = traffic.missing();
                assert!(edge.iter().all(|count| *count <= 8), "{here}");
                exchange_frames(&mut two, &mut traffic, 100);
                finish(&mut two, &mut traffic);
                assert_eq!(traffic.missing(), edge, "{here}");
            }
            assert_eq!(two.active(), Some(active), "{}", two.log());
        }
    }
}

// covers: AC-02, REQ034, standby
#[test]
fn lost_frames_cost_ethernet_frames_and_never_bring_one_twice_or_in_another_order() {
    let mut two = in_op();
    let mut traffic = EthernetTraffic::new(3);
    for round in 0..60_usize {
        let (cable, count) = (CableId(round % (COUNT + 2)), 1 + round as u32 % 5);
        two.fault(match round % 3 {
            0 => Fault::Drop { cable, direction: None, count },
            1 => Fault::Duplicate { cable, direction: None, count },
            _ => Fault::Corrupt { cable, direction: None, count },
        });
        exchange_frames(&mut two, &mut traffic, 10);
        if round % 10 == 9 {
            hand_over(&mut two, &mut traffic);
            until_ready(&mut two, &mut traffic);
        }
    }
    finish(&mut two, &mut traffic);
    println!("60 rounds of lost, doubled and damaged frames: {traffic:?}");
    let missing = traffic.missing();
    let sent = traffic.sides.each_ref().map(|side| side.sent);
    assert!(missing.iter().zip(sent).all(|(missing, sent)| missing * 20 < sent), "{traffic:?}");
    let counted = two.controllers.each_ref().map(|it| it.endpoint.as_ref().map(|it| it.traffic().missed));
    assert_eq!(counted, [Some(missing[1]), Some(missing[0])], "each has counted what it has missed");
}

// covers: AC-03, AC-06, standby
#[test]
fn bursts_in_both_directions_arrive_and_process_data_does_not_suffer() {
    let mut two = in_op();
    let mut traffic = EthernetTraffic::new(20);
    for _ in 0..20 {
        traffic.step(&mut two);
        for _ in 0..15 {
            two.run(CYCLE);
            traffic.receive(&mut two);
        }
    }
    finish(&mut two, &mut traffic);
    assert_eq!(traffic.missing(), [0, 0], "{traffic:?}");
    assert!(traffic.sides.iter().all(|side| (side.sent, side.refused) == (400, 0)), "{traffic:?}");
    assert!(two.left_op.is_empty() && two.longest_gap <= CYCLE + CYCLE / 4, "{:?}", two.longest_gap);
}

// covers: AC-03, AC-05, standby
#[test]
fn without_the_option_of_the_other_one_nothing_is_answered_and_no_frame_is_kept() {
    let mut settings = [with_ethernet(), standby()].map(|standby| scenarios::two::Settings { standby, declare });
    for _ in 0..2 {
        let mut two = Two::with(ring_of_two(COUNT, Host::First), settings);
        two.controllers[0].begin_active();
        two.until(Duration::from_secs(5), "ready", |two| two.controllers[0].partner().is_ready());
        two.run(Duration::from_millis(200));
        assert!(!are_up(&two) && two.controllers.iter().filter(|it| it.endpoint.is_some()).count() == 1);
        let mut traffic = EthernetTraffic::new(1);
        exchange_frames(&mut two, &mut traffic, 10);
        assert_eq!(traffic.sides.each_ref().map(|side| (side.sent, side.received)), [(0, 0); 2]);
        assert_eq!(two.controllers[0].engine.role(), MainDeviceRole::Active);
        settings.reverse();
    }
}
