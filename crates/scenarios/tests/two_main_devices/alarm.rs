//! Without an ACTIVE, an INACTIVE that does not take over raises an alarm, once until an ACTIVE sends again.

use std::time::Duration;

use ringcat::standby::RoleRequest;
use ringcat_sim::cable::Host;
use scenarios::pair::{CYCLE, Pair, Phase, TIME_OUT_CYCLES};

use super::ring_of_two;

/// Events of a host about the presence of an ACTIVE.
fn notices(pair: &Pair, host: Host) -> Vec<String> {
    let is_notice = |event: &String| event.starts_with("NoActive") || event == "ActiveIsBack";
    pair.seen(host).events.into_iter().filter(is_notice).collect()
}

// covers: standby, REQ032, MR-17, 9.11
#[test]
fn a_permanent_standby_raises_an_alarm_before_and_after_an_active() {
    let mut pair = Pair::without_programs(1, ring_of_two(3, Host::First));
    pair.start_permanent_standby(Host::Second);
    pair.run_cycles(25);
    assert_eq!(notices(&pair, Host::Second), [""; 0], "it listens: {}", pair.log());
    pair.run_cycles(60);
    let [alarm] = &notices(&pair, Host::Second)[..] else { panic!("one alarm: {}", pair.log()) };
    assert!(alarm.starts_with("NoActive { silence: "), "{alarm}");
    pair.start_member(Host::First);
    pair.settle();
    pair.run_cycles(50);
    assert_eq!(notices(&pair, Host::Second)[1..], ["ActiveIsBack"], "{}", pair.log());
    assert_eq!(pair.seen(Host::Second).phase, Phase::Inactive, "{}", pair.log());
    pair.hosts().guard(Host::First, CYCLE);
    pair.kill(Host::First);
    pair.run_cycles(TIME_OUT_CYCLES - 1);
    let early = notices(&pair, Host::Second).len();
    pair.run_cycles(TIME_OUT_CYCLES + 10);
    let seen = notices(&pair, Host::Second);
    assert_eq!((early, seen.len()), (2, 3), "after the time-out, and once: {}", pair.log());
    let silence = seen[2].trim_start_matches("NoActive { silence: ").trim_end_matches("ms }");
    let silence = Duration::from_secs_f64(silence.parse::<f64>().expect("milliseconds") / 1e3);
    let limit = CYCLE * TIME_OUT_CYCLES;
    assert!((limit..=limit + CYCLE).contains(&silence), "{silence:?}");
    // It still takes over on request.
    pair.request(Host::Second, RoleRequest::Active);
    pair.run_cycles(5);
    assert_eq!((pair.seen(Host::Second).phase, notices(&pair, Host::Second).len()), (Phase::Active, 3));
}

// covers: standby, 9.11
#[test]
fn an_inactive_that_takes_over_raises_no_alarm() {
    let mut pair = Pair::of_members(2, ring_of_two(3, Host::Second));
    pair.hosts().guard(Host::First, CYCLE);
    pair.kill(Host::First);
    pair.run_cycles(50);
    assert_eq!(pair.seen(Host::Second).phase, Phase::Active, "{}", pair.log());
    for host in Host::ALL {
        assert_eq!(notices(&pair, host), [""; 0], "{}", pair.log());
    }
}

// covers: standby, MR-10, 9.11
#[test]
fn after_a_collision_in_which_both_yield_one_is_active_again_after_its_pause() {
    for seed in 0..8 {
        let mut pair = Pair::without_programs(seed, ring_of_two(3, Host::First));
        pair.start_yielding_member(Host::First);
        pair.run_cycles(5);
        pair.start_yielding_member(Host::Second);
        pair.until_ready(Host::First);
        pair.take_longest_gap();
        pair.run_cycles(seed as u32);
        pair.request(Host::Second, RoleRequest::Active);
        pair.run_cycles(200);
        let active = Host::ALL.into_iter().filter(|host| pair.seen(*host).phase == Phase::Active);
        assert_eq!(active.count(), 1, "{}", pair.log());
        assert!(pair.all_in_op(), "{}", pair.log());
        // The collision, and the time-out with a pause of up to as long again.
        let limit = CYCLE * (2 * TIME_OUT_CYCLES + 4);
        let gap = pair.take_longest_gap();
        assert!(gap <= limit, "{gap:?}: {}", pair.log());
        for host in Host::ALL {
            assert_eq!(notices(&pair, host), [""; 0], "{}", pair.log());
        }
    }
}
