//! Two MainDevices on one segment, in virtual time: whatever happens to the INACTIVE or to a cable, outputs never go
//! back, no frame is older than it may be, and SubDevices stay in OP as long as their watchdogs allow.
//!
//! `SEED=17 cargo test -p scenarios --test virtual_time pair::seeds -- --nocapture` runs one seed of random faults.

use std::time::Duration;

use ringcat::RingState;
use ringcat_sim::cable::{DeviceIndex, Host};
use ringcat_sim::fault::Fault;
use ringcat_sim::host::program::TurnAround;
use ringcat_sim::network::builder::SegmentBuilder;
use ringcat_sim::network::{Network, NetworkOptions};
use scenarios::pair::{CYCLE, Pair, Phase};
use scenarios::segments::{descriptions, devices};

mod seeds;

const KINDS: [&str; 8] = [
    "coupler",
    "digital-output-16",
    "digital-input-8",
    "servo",
    "digital-output-8",
    "analog-output-4",
    "digital-output-16",
    "block",
];
/// Moments of a cycle.
const PHASES: [u32; 6] = [0, 7, 20, 60, 300, 900];
/// Time limit of the guard of a host.
const GUARD: Duration = Duration::from_millis(2);

/// A ring through two MainDevices; the line begins at the main link of `near`.
fn ring_of_two(seed: u64, count: usize, near: Host) -> Network {
    let options = NetworkOptions::default().with_detection_delay(Duration::from_micros(10)).with_seed(seed);
    let devices = devices(descriptions(&KINDS[..count]));
    SegmentBuilder::ring_of_two(devices, near).options(options).build().expect("the cables fit")
}

/// Runs some cycles; how many of the ACTIVE on the first host were not complete.
fn incomplete_in(pair: &mut Pair, cycles: u32) -> u64 {
    let before = pair.incomplete(Host::First);
    pair.run_cycles(cycles);
    pair.incomplete(Host::First) - before
}

// covers: standby, CF-04, CF-08, MR-05
#[test]
fn a_ring_of_two_programs_runs_and_each_check_has_seen_it() {
    for near in Host::ALL {
        let mut pair = Pair::new(1, ring_of_two(1, 8, near));
        assert_eq!(incomplete_in(&mut pair, 200), 0, "{}", pair.log());
        assert_eq!(pair.ring(Host::First), RingState::Closed);
        let (outputs, passes) = (pair.checked_outputs(), pair.checked_passes());
        // Six SubDevices have outputs; of both copies of a frame each passes the INACTIVE once.
        assert!(outputs >= 200 * 6 && passes >= 200 * 2, "{outputs} outputs, {passes} passes");
        assert!(pair.take_oldest_outputs() <= CYCLE, "outputs arrive in their cycle");
        let counters = pair.forwarded(Host::Second);
        assert_eq!((counters.again, counters.too_old, counters.no_link), (0, 0, 0), "{counters:?}");
    }
}

/// The same run from the same seed, as numbers of what was seen.
fn fingerprint(seed: u64) -> String {
    let mut pair = Pair::without_programs(seed, ring_of_two(seed, 8, Host::First));
    pair.set_turn_around(TurnAround { least: Duration::from_micros(3), most: Duration::from_micros(40) });
    pair.start_standby(Host::Second);
    pair.start_active(Host::First);
    pair.settle();
    pair.fault_in(CYCLE * 3 / 2, Fault::StopHost(Host::Second, true));
    pair.fault_in(CYCLE * 9 / 2, Fault::StopHost(Host::Second, false));
    pair.run_cycles(100);
    let statistics = pair.hosts().with_network(|network| format!("{:?} {:?}", network.now(), network.statistics()));
    format!("{}{statistics}", pair.log())
}

#[test]
fn two_programs_with_the_same_seed_run_alike_and_with_another_one_not() {
    assert_eq!(fingerprint(5), fingerprint(5));
    assert_ne!(fingerprint(5), fingerprint(6));
}

// covers: standby, MR-26
#[test]
fn a_standby_that_ends_in_order_and_comes_back_costs_two_cycles_at_most_each_time() {
    for near in Host::ALL {
        let mut pair = Pair::new(2, ring_of_two(2, 8, near));
        for round in 0..3 {
            pair.stop(Host::Second);
            let lost = incomplete_in(&mut pair, 30);
            assert!(lost <= 2 && pair.ring(Host::First) == RingState::Open, "round {round}: {lost}\n{}", pair.log());
            pair.start_standby(Host::Second);
            let lost = incomplete_in(&mut pair, 100);
            assert!(lost <= 2 && pair.ring(Host::First) == RingState::Closed, "round {round}: {lost}\n{}", pair.log());
            assert!(pair.all_in_op(), "{}", pair.log());
        }
    }
}

// covers: standby
#[test]
fn a_killed_standby_without_a_guard_takes_the_bus_until_its_links_go_down() {
    let mut pair = Pair::new(3, ring_of_two(3, 8, Host::First));
    pair.kill(Host::Second);
    assert!(incomplete_in(&mut pair, 50) >= 45, "its interfaces are up, and forward nothing\n{}", pair.log());
    // Watchdogs of 100 ms are not over.
    assert!(pair.all_in_op(), "{}", pair.log());
    let down = |network: &mut Network| Host::Second.links().into_iter().for_each(|link| network.disconnect(link, true));
    pair.hosts().with_network(down);
    assert!(incomplete_in(&mut pair, 50) <= 2, "{}", pair.log());
}

// covers: standby, MR-21
#[test]
fn the_guard_of_a_standby_that_fails_or_hangs_costs_its_limit_and_two_cycles() {
    for (seed, near) in [(4, Host::First), (5, Host::Second)] {
        for phase in PHASES {
            for dies in [true, false] {
                let mut pair = Pair::new(seed, ring_of_two(seed, 8, near));
                pair.hosts().guard(Host::Second, GUARD);
                let before = pair.incomplete(Host::First);
                let moment = CYCLE * phase / 1000;
                if dies {
                    pair.hosts().run_for(moment);
                    pair.kill(Host::Second);
                } else {
                    pair.fault_in(moment, Fault::StopHost(Host::Second, true));
                }
                pair.run_cycles(60);
                let lost = pair.incomplete(Host::First) - before;
                let here = format!("line at {near:?}, moment {phase}, dies {dies}: {lost} lost\n{}", pair.log());
                // The limit of two cycles, the cycle in which it happens, and that of the detection of the link.
                assert!(lost <= 4 && pair.hosts().guard_has_acted(Host::Second), "{here}");
                assert!(pair.ring(Host::First) == RingState::Open && pair.all_in_op(), "{here}");
                // It goes on, and its frames do not leave; then it is started anew.
                pair.fault(Fault::StopHost(Host::Second, false));
                assert_eq!(incomplete_in(&mut pair, 20), 0, "{here}");
                pair.hosts().dismiss_guard(Host::Second);
                pair.start_standby(Host::Second);
                assert!(incomplete_in(&mut pair, 100) <= 2, "{here}");
                assert!(pair.ring(Host::First) == RingState::Closed && pair.all_in_op(), "{here}");
            }
        }
    }
}

// covers: standby, CF-03
#[test]
fn a_standby_that_hangs_and_goes_on_sends_no_old_outputs_also_behind_a_cut() {
    for (seed, near) in [(6, Host::First), (7, Host::Second)] {
        for hangs_for in [3, 10, 30] {
            for phase in PHASES {
                let mut pair = Pair::new(seed, ring_of_two(seed, 8, near));
                pair.cut(4);
                pair.run_cycles(50);
                pair.take_oldest_outputs();
                let moment = CYCLE * phase / 1000;
                pair.fault_in(moment, Fault::StopHost(Host::Second, true));
                pair.fault_in(moment + CYCLE * hangs_for, Fault::StopHost(Host::Second, false));
                pair.run_cycles(hangs_for + 1);
                let lost = incomplete_in(&mut pair, 20);
                let (oldest, forwarded) = (pair.take_oldest_outputs(), pair.forwarded(Host::Second));
                let here = format!("{near:?}, {hangs_for} ms, moment {phase}: {lost} lost, {oldest:?}, {forwarded:?}");
                assert!(oldest <= 3 * CYCLE && lost <= 2, "{here}\n{}", pair.log());
                assert!(forwarded.too_old >= u64::from(hangs_for - 3), "{here}\n{}", pair.log());
                assert!(pair.all_in_op(), "{here}\n{}", pair.log());
            }
        }
    }
}

#[test]
#[should_panic(expected = "a frame is on its way for")]
fn the_checks_find_frames_that_have_waited_in_a_standby_without_a_limit() {
    let mut pair = Pair::new(6, ring_of_two(6, 8, Host::First));
    pair.start_standby_without_limit(Host::Second);
    pair.run_cycles(100);
    pair.fault(Fault::StopHost(Host::Second, true));
    pair.run_cycles(10);
    pair.fault(Fault::StopHost(Host::Second, false));
    pair.run_cycles(10);
}

#[test]
#[should_panic(expected = "device 3 leaves OP for INIT")]
fn the_checks_find_a_subdevice_that_leaves_op_before_its_watchdog() {
    let mut pair = Pair::new(6, ring_of_two(6, 8, Host::First));
    pair.run_cycles(5);
    pair.fault(Fault::PowerOff(DeviceIndex(3)));
    pair.fault(Fault::PowerOn(DeviceIndex(3)));
    pair.run_cycles(1);
}

// covers: standby, MR-06, MR-08
#[test]
fn two_inactive_maindevices_send_nothing_and_neither_becomes_active() {
    let mut pair = Pair::without_programs(12, ring_of_two(12, 8, Host::First));
    Host::ALL.into_iter().for_each(|host| pair.start_standby(host));
    // The checks of each cycle hold: neither sends a frame of its own.
    pair.run_cycles(1_000);
    assert_eq!(pair.checked_passes(), 0, "{}", pair.log());
    let phases = Host::ALL.map(|host| pair.seen(host).phase);
    assert_eq!(phases, [Phase::Inactive; 2]);
}

// covers: standby, MR-21
#[test]
fn a_failed_standby_and_a_cut_leave_the_active_the_subdevices_on_its_side() {
    // Those with outputs behind the cut leave OP; the others have no watchdog.
    for (near, behind) in [(Host::First, vec![4, 5, 6, 7]), (Host::Second, vec![1, 3])] {
        let mut pair = Pair::new(13, ring_of_two(13, 8, near));
        pair.hosts().guard(Host::Second, GUARD);
        pair.kill(Host::Second);
        pair.run_cycles(60);
        assert!(pair.all_in_op(), "{near:?}\n{}", pair.log());
        pair.cut(4);
        pair.run_cycles(300);
        assert_eq!(pair.not_in_op(), behind, "{near:?}\n{}", pair.log());
        pair.heal(4);
        pair.settle();
        assert_eq!(pair.ring(Host::First), RingState::Open, "{near:?}\n{}", pair.log());
        pair.hosts().dismiss_guard(Host::Second);
        pair.start_standby(Host::Second);
        assert!(incomplete_in(&mut pair, 100) <= 2, "{near:?}\n{}", pair.log());
        assert!(pair.ring(Host::First) == RingState::Closed && pair.all_in_op(), "{near:?}\n{}", pair.log());
    }
}

// covers: standby, MR-08
#[test]
fn an_active_that_is_killed_leaves_all_subdevices_to_their_watchdogs() {
    for near in Host::ALL {
        let mut pair = Pair::new(8, ring_of_two(8, 8, near));
        pair.kill(Host::First);
        // The checks of each cycle hold: nothing leaves OP before its watchdog has expired.
        pair.run_cycles(90);
        assert!(pair.all_in_op(), "{}", pair.log());
        pair.run_cycles(60);
        assert!(!pair.all_in_op(), "{}", pair.log());
        // The other controller, started by hand: warm, through INIT.
        pair.kill(Host::Second);
        pair.start_standby(Host::First);
        pair.start_active(Host::Second);
        pair.settle();
        let before = pair.incomplete(Host::Second);
        pair.run_cycles(100);
        assert_eq!(pair.incomplete(Host::Second), before, "{}", pair.log());
        assert_eq!(pair.ring(Host::Second), RingState::Closed, "{}", pair.log());
    }
}

// covers: standby
#[test]
fn an_active_that_stops_in_order_leaves_its_place_to_the_other_one() {
    for near in Host::ALL {
        let mut pair = Pair::new(9, ring_of_two(9, 8, near));
        pair.stop(Host::First);
        for _ in 0..3_000 {
            pair.cycle();
            if pair.seen(Host::First).phase == Phase::Ended {
                break;
            }
        }
        let seen = pair.seen(Host::First);
        assert!(seen.phase == Phase::Ended && seen.failure.is_none(), "{}", pair.log());
        pair.kill(Host::Second);
        pair.start_active(Host::Second);
        pair.settle();
        assert_eq!(pair.ring(Host::Second), RingState::Open, "a line: the links of the first one are down");
        pair.start_standby(Host::First);
        pair.run_cycles(100);
        assert_eq!(pair.ring(Host::Second), RingState::Closed, "{}", pair.log());
    }
}

// covers: standby
#[test]
fn a_standby_that_loses_its_power_and_gets_it_back_is_a_line_until_it_forwards() {
    for (seed, near) in [(10, Host::First), (11, Host::Second)] {
        for phase in PHASES {
            let mut pair = Pair::new(seed, ring_of_two(seed, 8, near));
            let before = pair.incomplete(Host::First);
            pair.fault_in(CYCLE * phase / 1000, Fault::PowerHostOff(Host::Second));
            pair.run_cycles(30);
            let lost = pair.incomplete(Host::First) - before;
            assert!(lost <= 2 && pair.ring(Host::First) == RingState::Open, "{phase}: {lost}\n{}", pair.log());
            assert!(pair.hosts().has_ended(Host::Second));
            // Interfaces that its firmware leaves off until the program switches them on.
            let down = |network: &mut Network| {
                Host::Second.links().into_iter().for_each(|link| network.disconnect(link, true))
            };
            pair.hosts().with_network(down);
            pair.fault(Fault::PowerHostOn(Host::Second));
            assert_eq!(incomplete_in(&mut pair, 30), 0, "{phase}\n{}", pair.log());
            pair.start_standby(Host::Second);
            let lost = incomplete_in(&mut pair, 100);
            assert!(lost <= 2 && pair.ring(Host::First) == RingState::Closed, "{phase}: {lost}\n{}", pair.log());
        }
    }
}
