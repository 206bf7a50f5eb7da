//! Ethernet between two programs of the library, each on its host, with both halves in one thread.

use std::time::Duration;

use ringcat::standby::RoleRequest;
use ringcat_sim::cable::Host;
use scenarios::pair::{CYCLE, Pair, Phase};

use super::ring_of_two;

/// Longest time without outputs when a role is handed over.
const HANDED_OVER_GAP: Duration = CYCLE.saturating_add(Duration::from_micros(600));

fn pair_with_ethernet(seed: u64) -> Pair {
    let mut pair = Pair::without_programs(seed, ring_of_two(8, Host::First));
    pair.let_members_send_frames(2);
    pair.with_members()
}

/// Frames that each side has received, and those that it has missed; nothing was wrong.
fn counts(pair: &Pair) -> [(u64, u64); 2] {
    Host::ALL.map(|host| {
        let peer = pair.seen(host).ethernet;
        assert_eq!(peer.fault, None, "{host:?} {}", pair.log());
        (peer.received, peer.missed)
    })
}

// covers: 9.12, AC-01, AC-02, REQ034, REQ036, REQ040, MR-07, standby
#[test]
fn two_programs_of_the_library_exchange_ethernet_frames_in_both_roles() {
    let mut pair = pair_with_ethernet(21);
    let (mut active, mut other) = (Host::First, Host::Second);
    for round in 0..20 {
        pair.run_cycles(100);
        let before = counts(&pair);
        pair.take_longest_gap();
        pair.request(active, RoleRequest::HandOver);
        pair.run_cycles(50);
        let here = format!("round {round}: {before:?} {:?}\n{}", counts(&pair), pair.log());
        assert!(pair.take_longest_gap() <= HANDED_OVER_GAP && pair.seen(other).phase == Phase::Active, "{here}");
        for (before, after) in before.into_iter().zip(counts(&pair)) {
            // Two per cycle, but for those that wait at both ends.
            assert!(after.0 >= before.0 + 90, "{here}");
            assert_eq!(before.1, after.1, "none is lost: {here}");
        }
        pair.until_ready(other);
        assert!(pair.all_in_op(), "{here}");
        (active, other) = (other, active);
    }
}

// covers: AC-05, MR-07, MR-26, REQ034, standby
#[test]
fn ethernet_goes_on_with_a_controller_that_was_killed_and_comes_back() {
    let mut pair = pair_with_ethernet(22);
    let (mut active, mut other) = (Host::First, Host::Second);
    for _ in 0..3 {
        pair.hosts().guard(active, CYCLE);
        pair.kill(active);
        pair.run_cycles(60);
        assert!(pair.seen(other).phase == Phase::Active && pair.all_in_op(), "{}", pair.log());
        pair.hosts().dismiss_guard(active);
        pair.start_member(active);
        pair.until_ready(other);
        pair.run_cycles(50);
        let before = counts(&pair);
        pair.run_cycles(50);
        let after = counts(&pair);
        let is_whole = |(before, after): (&(u64, u64), &(u64, u64))| after.0 >= before.0 + 98 && before.1 == after.1;
        assert!(before.iter().zip(&after).all(is_whole), "{before:?} {after:?}");
        (active, other) = (other, active);
    }
}
