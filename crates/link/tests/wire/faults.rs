//! Cables that are cut, interfaces that go down, come back or disappear.

use std::thread;
use std::time::{Duration, Instant};

use ringcat_link::monotonic::now_ns;
use ringcat_link::{CarrierWatch, ClassFilter, PacketOptions, ReceiveMode, interface, wait};

use crate::bench::{Bench, class, ethercat, take};

#[test]
fn an_interface_that_goes_down_loses_only_the_frames_sent_meanwhile() {
    let Some(bench) = Bench::make() else { return };
    let mut far = bench.far_socket();
    let mut near = bench.near_socket(class(ClassFilter::All));
    for _ in 0..3 {
        bench.near.ip(&["link", "set", "near", "down"]);
        assert!(!near.send(&ethercat(0, 1)) && !near.send(&ethercat(0, 2)));
        bench.near.ip(&["link", "set", "near", "up"]);
        assert!(near.send(&ethercat(0, 3)));
        assert_eq!(take(&mut far, 1), [ethercat(0, 3)]);
        assert!(far.send(&ethercat(0, 4)));
        assert_eq!(take(&mut near, 1), [ethercat(0, 4)]);
    }
    assert_eq!((near.counters().down, near.counters().sent), (6, 3));
}

#[test]
fn an_interface_that_was_down_between_two_frames_loses_neither() {
    let Some(bench) = Bench::make() else { return };
    let mut far = bench.far_socket();
    let mut near = bench.near_socket(class(ClassFilter::All));
    assert!(near.send(&ethercat(0, 1)));
    bench.near.ip(&["link", "set", "near", "down"]);
    bench.near.ip(&["link", "set", "near", "up"]);
    assert!(near.send(&ethercat(0, 2)));
    assert_eq!(take(&mut far, 2), [ethercat(0, 1), ethercat(0, 2)]);
}

#[test]
fn a_socket_opened_on_an_interface_that_is_down_works_once_it_is_up() {
    let Some(bench) = Bench::make() else { return };
    bench.near.ip(&["link", "set", "near", "down"]);
    let mut near = bench.near_socket(PacketOptions::default());
    assert!(!near.send(&ethercat(0, 1)));
    bench.near.ip(&["link", "set", "near", "up"]);
    let mut far = bench.far_socket();
    assert!(near.send(&ethercat(0, 2)) && far.send(&ethercat(0, 3)));
    assert_eq!((take(&mut far, 1).len(), take(&mut near, 1).len()), (1, 1));
}

#[test]
fn an_interface_that_disappears_has_no_carrier_and_sends_nothing() {
    let Some(bench) = Bench::make() else { return };
    let mut near = bench.near_socket(PacketOptions::default());
    let watch = bench.near.run(|| CarrierWatch::start(&["near"], CarrierWatch::PERIOD)).expect("a watch");
    bench.far.ip(&["link", "delete", "far"]);
    assert!(!near.send(&ethercat(0, 1)) && !near.has_frame());
    assert_eq!(near.counters().down, 1);
    let begin = Instant::now();
    assert!(!wait(&[&near], now_ns() + 20_000_000, ReceiveMode::Blocking));
    assert!(begin.elapsed() >= Duration::from_millis(19));
    assert!(!watch.carrier(0).is_up());
    assert_eq!(bench.near.run(|| interface::carrier("near")), None);
}

/// Processor time of the calling thread.
fn thread_time() -> Duration {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: the pointer is to a live timespec.
    unsafe { libc::clock_gettime(libc::CLOCK_THREAD_CPUTIME_ID, &mut time) };
    Duration::new(time.tv_sec as u64, time.tv_nsec as u32)
}

#[test]
fn a_wait_on_an_interface_that_is_down_sleeps_until_its_end() {
    let Some(bench) = Bench::make() else { return };
    let near = bench.near_socket(PacketOptions::default());
    bench.near.ip(&["link", "set", "near", "down"]);
    let (begin, busy) = (Instant::now(), thread_time());
    assert!(!wait(&[&near], now_ns() + 100_000_000, ReceiveMode::Blocking));
    assert!(begin.elapsed() >= Duration::from_millis(100));
    assert!(thread_time() - busy < Duration::from_millis(20), "{:?}", thread_time() - busy);
}

#[test]
fn a_cut_and_a_repaired_cable_are_detected_within_some_periods() {
    let Some(bench) = Bench::make() else { return };
    let watch = bench.near.run(|| CarrierWatch::start(&["lo", "near"], CarrierWatch::PERIOD)).expect("a watch");
    let carrier = watch.carrier(1).clone();
    assert!(carrier.is_up());
    let mut latest = Duration::ZERO;
    for (state, up) in [("down", false), ("up", true), ("down", false), ("up", true)] {
        bench.far.ip(&["link", "set", "far", state]);
        let begin = Instant::now();
        while carrier.is_up() != up {
            assert!(begin.elapsed() < Duration::from_millis(500), "the carrier change to {state} was not detected");
            thread::sleep(Duration::from_micros(200));
        }
        latest = latest.max(begin.elapsed());
        assert_eq!(bench.near.run(|| interface::carrier("near")), Some(up));
    }
    assert_eq!(carrier.changes(), 4);
    println!("a carrier's change was seen after {latest:?} at the latest");
}
