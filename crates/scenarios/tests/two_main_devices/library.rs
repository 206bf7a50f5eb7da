//! Two MainDevices of the library at one ring, each a program on its host: they join, follow, take over and hand the
//! role over. Evaluated from inside the SubDevices.

use std::sync::mpsc;
use std::time::Duration;

use ringcat::simulated::SimulatedSegment;
use ringcat::simulated::two_hosts::HostLinks;
use ringcat::standby::{Policy, RoleRequest, StandbyOptions};
use ringcat::{ActivateError, Error, LrwPolicy, MainDevice, Options, RingState, automatic};
use ringcat_sim::cable::Host;
use ringcat_sim::fault::Fault;
use scenarios::pair::{CYCLE, Pair, Phase, TIME_OUT_CYCLES};

use super::ring_of_two;

/// Moments of a cycle, in microseconds.
const PHASES: [u32; 5] = [0, 12, 60, 300, 900];

/// Longest time without outputs when the ACTIVE fails: the time-out counts from its last process data, and the other
/// one takes over with one of its cycles after that. In cycles, one less are missing.
const LONGEST_GAP: Duration = CYCLE.saturating_mul(TIME_OUT_CYCLES + 1);
/// The same where process data takes several frames: a cycle of which only the first has arrived restarts the time-out.
const LONGEST_GAP_OF_SEVERAL: Duration = LONGEST_GAP.saturating_add(CYCLE);
/// And when a role is handed over: a cycle, and what the grid moves by, because it is taken from master frames that
/// have come through the ring after the process data.
const HANDED_OVER_GAP: Duration = CYCLE.saturating_add(Duration::from_micros(400));
/// The same with 33 SubDevices, through which they take longer.
const HANDED_OVER_GAP_OF_33: Duration = CYCLE.saturating_add(Duration::from_micros(600));

// covers: standby, MR-01, MR-08, FR-05, FR-08
#[test]
fn the_second_maindevice_joins_follows_and_sends_nothing() {
    for near in Host::ALL {
        let mut pair = Pair::of_members(1, ring_of_two(8, near));
        pair.run_cycles(200);
        let (first, second) = (pair.seen(Host::First), pair.seen(Host::Second));
        assert_eq!((first.phase, second.phase), (Phase::Active, Phase::Inactive), "{}", pair.log());
        assert_eq!(first.ring, RingState::Closed, "{}", pair.log());
        assert!(second.followed >= 200 && second.is_last_complete, "{}", pair.log());
        assert!(second.oldest_followed <= 1, "its image has the outputs of the ACTIVE: {}", pair.log());
    }
}

/// How the ACTIVE fails.
#[derive(Clone, Copy, Debug)]
enum Death {
    /// Its computer loses its power: both links go down at once.
    Power,
    /// Its program is killed between two frames; a guard takes its links down after a cycle.
    Killed,
    /// Its program hangs, with such a guard.
    Hangs,
}

/// The ACTIVE fails at a moment of a cycle. Longest time between outputs in a SubDevice.
fn gap_after(pair: &mut Pair, death: Death, phase: u32) -> Duration {
    let (active, moment) = (Host::First, Duration::from_micros(phase.into()));
    pair.take_longest_gap();
    pair.hosts().guard(active, CYCLE);
    match death {
        Death::Power => pair.fault_in(moment, Fault::PowerHostOff(active)),
        Death::Hangs => pair.fault_in(moment, Fault::StopHost(active, true)),
        Death::Killed => {
            pair.hosts().run_for(moment);
            pair.kill(active);
        }
    }
    pair.run_cycles(100);
    pair.take_longest_gap()
}

// covers: standby, MR-07, MR-16, MR-18, MR-21, REQ005, 9.9
#[test]
fn an_active_that_fails_is_followed_by_the_other_one_within_the_time_out() {
    let mut table = String::new();
    let rings = [
        (2, Host::First, LONGEST_GAP),
        (3, Host::Second, LONGEST_GAP),
        (8, Host::First, LONGEST_GAP),
        (8, Host::Second, LONGEST_GAP),
        (33, Host::Second, LONGEST_GAP_OF_SEVERAL),
    ];
    for (count, near, most) in rings {
        for death in [Death::Power, Death::Killed, Death::Hangs] {
            let mut longest = Duration::ZERO;
            for phase in PHASES {
                let mut pair = Pair::of_members(2, ring_of_two(count, near));
                let gap = gap_after(&mut pair, death, phase);
                let here = format!("{count} SubDevices, {near:?}, {death:?} at {phase} us: {gap:?}\n{}", pair.log());
                assert!(gap <= most && gap >= CYCLE * (TIME_OUT_CYCLES - 1), "{here}");
                assert_eq!(pair.seen(Host::Second).phase, Phase::Active, "{here}");
                assert!(pair.all_in_op() && pair.seen(Host::Second).is_last_complete, "{here}");
                longest = longest.max(gap);
            }
            table += &format!("{count} SubDevices, line at {near:?}, {death:?}: {longest:?} without outputs at most\n");
        }
    }
    println!(
        "cycle {CYCLE:?}, time-out {TIME_OUT_CYCLES} cycles; at most {LONGEST_GAP:?} without outputs, with several \
         frames {LONGEST_GAP_OF_SEVERAL:?}\n{table}"
    );
}

// covers: standby, MR-07, MR-17, MR-26, REQ015
#[test]
fn a_controller_that_comes_back_follows_and_takes_over_in_its_turn() {
    let mut pair = Pair::of_members(3, ring_of_two(8, Host::First));
    let (mut active, mut other) = (Host::First, Host::Second);
    for round in 0..4 {
        pair.take_longest_gap();
        pair.hosts().guard(active, CYCLE);
        pair.kill(active);
        pair.run_cycles(60);
        let gap = pair.take_longest_gap();
        let here = format!("round {round}: {gap:?}\n{}", pair.log());
        assert!(gap <= LONGEST_GAP && pair.seen(other).phase == Phase::Active && pair.all_in_op(), "{here}");
        assert_eq!(pair.ring(other), RingState::Open, "{here}");
        pair.hosts().dismiss_guard(active);
        pair.start_member(active);
        pair.until_ready(other);
        assert!(pair.take_longest_gap() <= 3 * CYCLE, "{}", pair.log());
        assert_eq!(pair.ring(other), RingState::Closed, "{}", pair.log());
        (active, other) = (other, active);
    }
}

// covers: standby, MR-07, REQ015
#[test]
fn a_role_that_is_handed_over_costs_no_cycle() {
    for (count, near) in [2, 8, 33].into_iter().flat_map(|count| Host::ALL.map(|near| (count, near))) {
        let mut pair = Pair::of_members(4, ring_of_two(count, near));
        let (mut active, mut other) = (Host::First, Host::Second);
        for round in 0..4 {
            pair.take_longest_gap();
            pair.request(active, RoleRequest::HandOver);
            pair.run_cycles(50);
            let gap = pair.take_longest_gap();
            let phases = [active, other].map(|host| pair.seen(host).phase);
            println!("{count} SubDevices, line at {near:?}, {active:?} hands over: {gap:?} without outputs");
            let here = format!("{count}, {near:?}, round {round}: {gap:?}\n{}", pair.log());
            let most = if count > 8 { HANDED_OVER_GAP_OF_33 } else { HANDED_OVER_GAP };
            assert!(gap <= most && phases == [Phase::Inactive, Phase::Active], "{here}");
            pair.until_ready(other);
            assert!(pair.all_in_op() && pair.ring(other) == RingState::Closed, "{here}");
            (active, other) = (other, active);
        }
    }
}

// covers: standby, MR-10, MR-24, 9.9
#[test]
fn of_two_that_are_active_one_yields_within_two_cycles_and_no_cycle_is_lost() {
    let cases = [(2, Host::Second), (8, Host::Second), (8, Host::First), (33, Host::Second)];
    for (count, asked) in cases {
        let stays = Host::First;
        let mut pair = Pair::of_members(5, ring_of_two(count, Host::First));
        if asked == Host::First {
            pair.request(Host::First, RoleRequest::HandOver);
            pair.run_cycles(50);
            pair.until_ready(Host::Second);
        }
        pair.take_longest_gap();
        pair.request(asked, RoleRequest::Active);
        // The check of each cycle finds two that send for more than two cycles.
        pair.run_cycles(100);
        let gap = pair.take_longest_gap();
        let here = format!("{count} SubDevices, {asked:?} was asked: {gap:?}\n{}", pair.log());
        assert_eq!(
            (pair.seen(stays).phase, pair.seen(stays.other()).phase),
            (Phase::Active, Phase::Inactive),
            "{here}"
        );
        assert!(gap <= 3 * CYCLE && pair.all_in_op(), "{here}");
        pair.until_ready(stays);
    }
}

// covers: standby, MR-27
#[test]
fn an_active_that_becomes_inactive_leaves_the_bus_to_the_time_out_of_the_other_one() {
    let mut pair = Pair::of_members(6, ring_of_two(8, Host::First));
    pair.take_longest_gap();
    pair.request(Host::First, RoleRequest::Inactive);
    pair.run_cycles(30);
    let (gap, phases) = (pair.take_longest_gap(), Host::ALL.map(|host| pair.seen(host).phase));
    let here = format!("{gap:?}\n{}", pair.log());
    // No frame has arrived since the change: a random pause of a time-out at most for the one that was ACTIVE.
    assert!(phases == [Phase::Inactive, Phase::Active] && gap <= LONGEST_GAP, "{here}");
    assert!(pair.all_in_op(), "{here}");
    pair.until_ready(Host::Second);
}

// covers: standby, MR-06, 9.9
#[test]
fn of_two_that_start_at_the_same_time_one_becomes_active_and_the_other_one_follows() {
    for seed in 7..12 {
        let mut pair = Pair::without_programs(seed, ring_of_two(3, Host::First));
        // Their pauses depend on the time of the start.
        pair.run_cycles(seed as u32);
        Host::ALL.into_iter().for_each(|host| pair.start_member(host));
        let active = |pair: &Pair| Host::ALL.into_iter().find(|host| pair.seen(*host).phase == Phase::Active);
        while active(&pair).is_none() {
            pair.run_cycles(1);
            assert!(pair.hosts().now().0 < 2_000_000_000, "seed {seed}: no ACTIVE within 2 s\n{}", pair.log());
        }
        pair.until_ready(active(&pair).expect("it was found"));
    }
}

// covers: standby, MR-10, 9.9
#[test]
fn of_two_that_begin_to_scan_at_the_same_time_one_yields_and_follows() {
    for (count, apart) in [(1, 0), (3, 0), (8, 0), (3, 1), (8, 7), (8, 12), (33, 3), (33, 20)] {
        let mut pair = Pair::without_programs(14, ring_of_two(count, Host::First));
        // Also the one with the lower address later: it stays nevertheless.
        pair.start_eager_member(Host::Second);
        pair.run_cycles(apart);
        pair.start_eager_member(Host::First);
        pair.until_ready(Host::First);
        assert_eq!(pair.seen(Host::Second).phase, Phase::Inactive, "{}", pair.log());
    }
}

/// Takes the links of the first one down, or brings them up.
fn disconnect(pair: &mut Pair, down: bool) {
    pair.say(format!("links of the first one are down: {down}"));
    let links = Host::First.links();
    pair.hosts().with_network(|network| links.into_iter().for_each(|link| network.disconnect(link, down)));
}

// covers: standby, MR-25, MR-26
#[test]
fn an_active_that_loses_its_links_and_gets_them_back_follows_the_other_one() {
    let mut pair = Pair::of_members(12, ring_of_two(8, Host::First));
    pair.take_longest_gap();
    disconnect(&mut pair, true);
    pair.run_cycles(50);
    let gap = pair.take_longest_gap();
    assert!(gap <= LONGEST_GAP && pair.seen(Host::Second).phase == Phase::Active, "{gap:?}\n{}", pair.log());
    assert_eq!(pair.seen(Host::First).phase, Phase::Inactive, "{}", pair.log());
    disconnect(&mut pair, false);
    pair.run_cycles(2);
    pair.until_ready(Host::Second);
    assert!(pair.take_longest_gap() <= 3 * CYCLE && pair.all_in_op(), "{}", pair.log());
    assert_eq!(pair.ring(Host::Second), RingState::Closed, "{}", pair.log());
}

// covers: standby, MR-16, MR-25, MR-27
#[test]
fn an_active_without_a_successor_continues_with_its_subdevices() {
    // How many cycles its links are down. Watchdogs expire after 100.
    for (count, down) in [(3, 0), (8, 0), (8, 30), (33, 30), (8, 150)] {
        let mut pair = Pair::of_members(13, ring_of_two(count, Host::First));
        pair.hosts().guard(Host::Second, CYCLE);
        pair.kill(Host::Second);
        pair.run_cycles(50);
        pair.take_longest_gap();
        if down > 0 {
            disconnect(&mut pair, true);
            pair.run_cycles(down);
            disconnect(&mut pair, false);
        } else {
            pair.request(Host::First, RoleRequest::Inactive);
        }
        pair.run_cycles(150);
        let (gap, seen) = (pair.take_longest_gap(), pair.seen(Host::First));
        let here = format!("{count} SubDevices, links down for {down} cycles: {gap:?}\n{}", pair.log());
        assert!(seen.phase == Phase::Active && seen.is_last_complete && seen.cold_takeovers == 0, "{here}");
        assert!(pair.all_in_op(), "{here}");
        // A time-out and a random pause of a time-out at most.
        assert!(gap <= CYCLE * (down + 2 * TIME_OUT_CYCLES + 2), "{here}");
    }
}

// covers: standby, REQ047
#[test]
fn one_of_two_refuses_a_declaration_with_lrw_and_says_why() {
    let mut pair = Pair::without_programs(15, ring_of_two(4, Host::First));
    pair.start_standby(Host::Second);
    let (sender, results) = mpsc::channel();
    let program = move |mut links: HostLinks| {
        links.switch(true);
        let options = Options::default().with_standby(StandbyOptions::default());
        let mut main_device = MainDevice::request(links, &options);
        main_device.become_active();
        let refused = main_device.bring_up(|scan| {
            let mut declaration = automatic(&scan.subdevices, CYCLE);
            declaration.lrw = LrwPolicy::PerSubDevice;
            declaration
        });
        sender.send(refused.err().map(|refused| refused.error)).expect("the test waits");
    };
    pair.hosts().start(Host::First, program).expect("a thread starts");
    pair.hosts().run_for(Duration::from_secs(1));
    let refused = results.try_recv().expect("it ends within a second");
    let is_lrw = matches!(refused, Some(Error::Activate(ActivateError::LrwWithStandby)));
    assert!(is_lrw, "{refused:?}");
}

// covers: standby, MR-22
#[test]
fn a_maindevice_with_one_link_cannot_be_one_of_two_and_says_so() {
    let links = SimulatedSegment::from_toml("[segment]\n[[device]]\ntype = \"coupler\"\n").expect("it can be built");
    let options = Options::default().with_standby(StandbyOptions::default());
    let main_device = MainDevice::request(links, &options);
    let refused = main_device.join(&Policy::default(), |scan| automatic(&scan.subdevices, CYCLE));
    let error = refused.expect_err("it has one link").error;
    assert!(matches!(error, Error::NeedsTwoLinks(_)), "{error}");
    assert!(error.to_string().contains("expected a redundant link, got none"), "{error}");
}
