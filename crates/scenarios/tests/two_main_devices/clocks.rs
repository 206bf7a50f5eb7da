//! Distributed clocks while the role changes: 33 SubDevices, a takeover and switchovers.

use std::time::Duration;

use ringcat::standby::RoleRequest;
use ringcat::{Declaration, Scan, SyncSignals};
use ringcat_sim::cable::{DeviceIndex, Host};
use ringcat_sim::network::builder::SegmentBuilder;
use ringcat_sim::network::{Network, NetworkOptions};
use scenarios::clocks::{clocked, config, spread, with_clocks};
use scenarios::segments::devices;
use scenarios::two::{CYCLE, Declare, Settings, Two};

use super::standby;

const COUNT: usize = 33;

fn ring(near: Host) -> Network {
    let options = NetworkOptions::default().with_detection_delay(Duration::from_micros(10));
    SegmentBuilder::ring_of_two(devices(clocked(COUNT, 50)), near).options(options).build().expect("the cables fit")
}

fn free_running(scan: &Scan) -> Declaration {
    with_clocks(scan, config())
}

fn steered(scan: &Scan) -> Declaration {
    let mut clocks = config();
    clocks.bus_shift = true;
    with_clocks(scan, clocks)
}

fn steered_3_s_ahead(scan: &Scan) -> Declaration {
    let mut declaration = steered(scan);
    let clocks = declaration.clocks.as_mut().expect("it has clocks");
    clocks.epoch += 3_000_000_000;
    declaration
}

fn with_signals(scan: &Scan) -> Declaration {
    let mut declaration = free_running(scan);
    for subdevice in &mut declaration.subdevices {
        subdevice.sync = Some(SyncSignals::sync0(1_000_000, 200_000));
    }
    declaration
}

/// Runs for a time; the largest spread of the clocks, and when it was last above 100 ns.
fn watch(two: &mut Two, time: Duration) -> (i64, Duration) {
    let all: Vec<usize> = (0..COUNT).collect();
    let begin = two.now();
    let (mut largest, mut last) = (0, Duration::ZERO);
    while two.now() < begin + time {
        two.run(CYCLE / 2);
        let now = spread(&two.network, &all);
        largest = largest.max(now);
        if now > 100 {
            last = two.now().since(begin);
        }
    }
    (largest, last)
}

fn both(declare: Declare) -> [Settings; 2] {
    [Settings { standby: standby(), declare }; 2]
}

/// Both with locked clocks; the second one is ready.
fn locked(near: Host, settings: [Settings; 2]) -> Two {
    let mut two = Two::with(ring(near), settings);
    two.controllers[0].begin_active();
    two.until(Duration::from_secs(10), "locked, and the partner is ready", |two| {
        two.controllers[0].engine.clocks_locked() && two.all_in_op() && two.controllers[0].partner().is_ready()
    });
    // The knowledge of the measured clocks travels.
    two.run(Duration::from_secs(1));
    two.mark();
    two
}

/// The system time of the first SubDevice minus the time since the beginning.
fn offset(two: &Two) -> u64 {
    let now = two.network.now();
    two.network.device(DeviceIndex(0)).controller.system_time(now).wrapping_sub(now.0)
}

// covers: 7.2, 7.5, dc-ring, standby
#[test]
fn clocks_of_33_subdevices_keep_together_through_a_takeover() {
    let declarations: [(&str, Declare); 2] = [("free", free_running), ("SYNC0", with_signals)];
    for (kind, declare) in declarations {
        let mut two = locked(Host::First, both(declare));
        let before = watch(&mut two, Duration::from_millis(200)).0;
        let first = offset(&two);
        two.kill(0);
        let outage = watch(&mut two, 15 * CYCLE).0;
        two.controllers[1].request(RoleRequest::Active);
        let (largest, last) = watch(&mut two, Duration::from_secs(3));
        let jumped = offset(&two).wrapping_sub(first) as i64;
        println!(
            "{kind}: spread {before} ns before, {outage} ns in 15 cycles without an ACTIVE, {largest} ns after the \
             takeover, above 100 ns until {last:?}; the system time has moved by {jumped} ns"
        );
        assert!(before <= 100 && outage <= 1_000 && largest <= 1_000, "{kind}: {before} {outage} {largest}");
        assert!(last <= Duration::from_secs(2), "{kind}: {last:?}");
        assert!(jumped.abs() < 200_000, "{kind}: no clock jumps: {jumped} ns");
        assert!(two.left_op.is_empty() && two.all_in_op(), "{kind}: {}", two.log());
        assert!(two.controllers[1].engine.clocks_locked(), "{kind}: {}", two.log());
        let written = two.controllers[1].written.iter().filter(|(_, at)| (0x0920..0x0928).contains(at));
        assert_eq!(written.count(), 0, "{kind}: offsets are not written");
    }
}

// covers: 7.2, 7.5, dc-ring, standby
#[test]
fn clocks_of_33_subdevices_keep_together_through_switchovers() {
    for near in [Host::First, Host::Second] {
        let mut two = locked(near, both(free_running));
        for round in 0..4 {
            let giver = two.active().expect("one is ACTIVE");
            two.controllers[giver].request(RoleRequest::HandOver);
            let (largest, last) = watch(&mut two, Duration::from_secs(1));
            println!("{near:?}, switchover {round}: spread {largest} ns, above 100 ns until {last:?}");
            assert_eq!(two.active(), Some(1 - giver), "{}", two.log());
            assert!(largest <= 1_000 && last <= Duration::from_secs(2), "{largest} {last:?}");
            assert!(two.left_op.is_empty(), "{}", two.log());
        }
    }
}

// covers: 7.4, standby
#[test]
fn clocks_steered_by_the_host_keep_together_through_takeovers_and_switchovers() {
    let hosts: [(&str, Declare); 2] = [("same host time", steered), ("3 s ahead", steered_3_s_ahead)];
    for (kind, other) in hosts {
        let settings = [steered, other].map(|declare| Settings { standby: standby(), declare });
        let mut two = locked(Host::First, settings);
        let first = offset(&two);
        for round in 0..4 {
            let giver = two.active().expect("one is ACTIVE");
            two.controllers[giver].request(RoleRequest::HandOver);
            let (largest, last) = watch(&mut two, Duration::from_secs(3));
            println!("{kind}, switchover {round}: spread {largest} ns, above 100 ns until {last:?}");
            assert_eq!(two.active(), Some(1 - giver), "{}", two.log());
            assert!(largest <= 1_000 && last <= Duration::from_secs(2), "{largest} {last:?}");
        }
        let before = offset(&two);
        two.kill(0);
        let outage = watch(&mut two, 15 * CYCLE).0;
        two.controllers[1].request(RoleRequest::Active);
        let (largest, last) = watch(&mut two, Duration::from_secs(20));
        let moved = offset(&two).wrapping_sub(before) as i64;
        println!("{kind}: spread {outage} ns, then {largest} ns, above 100 ns until {last:?}, moved by {moved} ns");
        assert!(outage <= 1_000 && largest <= 1_000 && last <= Duration::from_secs(2), "{outage} {largest} {last:?}");
        let moved = offset(&two).wrapping_sub(first) as i64;
        assert!(moved.abs() < 50_000, "no clock jumps, the reference goes on at the speed of the hosts: {moved} ns");
        assert!(two.left_op.is_empty() && two.all_in_op(), "{}", two.log());
    }
}
