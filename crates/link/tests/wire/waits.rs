//! Waiting asleep, spinning and both.

use std::thread;
use std::time::Duration;

use ringcat_link::monotonic::{now_ns, sleep_until_ns};
use ringcat_link::{PacketOptions, ReceiveMode, wait};

use crate::bench::{Bench, drain, ethercat};

const MODES: [ReceiveMode; 4] = [
    ReceiveMode::Blocking,
    ReceiveMode::BusyPoll,
    ReceiveMode::Hybrid { spin: Duration::from_micros(50) },
    ReceiveMode::Hybrid { spin: Duration::from_secs(10) },
];

/// Longer than any wait here.
const LONG_NS: u64 = 5_000_000_000;

#[test]
fn every_mode_ends_when_a_frame_arrives() {
    let Some(bench) = Bench::make() else { return };
    let mut far = bench.far_socket();
    let mut near = bench.near_socket(PacketOptions::default());
    for mode in MODES {
        let begin = now_ns();
        thread::scope(|scope| {
            scope.spawn(|| {
                sleep_until_ns(begin + 3_000_000);
                assert!(far.send(&ethercat(0, 1)));
            });
            assert!(wait(&[&near], begin + LONG_NS, mode), "{mode:?}");
        });
        let waited = now_ns() - begin;
        assert!((3_000_000..LONG_NS / 2).contains(&waited), "{mode:?}: {waited} ns");
        assert_eq!(drain(&mut near).len(), 1);
    }
}

#[test]
fn every_mode_ends_at_its_time_without_a_frame() {
    let Some(bench) = Bench::make() else { return };
    let near = bench.near_socket(PacketOptions::default());
    for mode in MODES {
        let until = now_ns() + 2_000_000;
        assert!(!wait(&[&near], until, mode), "{mode:?}");
        assert!(now_ns() >= until, "{mode:?}");
    }
}

#[test]
fn a_waiting_frame_ends_a_wait_after_its_time() {
    let Some(bench) = Bench::make() else { return };
    let mut far = bench.far_socket();
    let near = bench.near_socket(PacketOptions::default());
    assert!(far.send(&ethercat(0, 1)));
    assert!(wait(&[&near], now_ns() + LONG_NS, ReceiveMode::Blocking));
    for mode in MODES {
        assert!(wait(&[&near], 0, mode), "{mode:?}");
    }
}

#[test]
fn a_frame_on_any_of_several_sockets_ends_the_wait() {
    let Some(bench) = Bench::make() else { return };
    let mut near = bench.near_socket(PacketOptions::default());
    let mut far = bench.far_socket();
    for mode in MODES {
        assert!(far.send(&ethercat(0, 1)));
        assert!(wait(&[&far, &near], now_ns() + LONG_NS, mode), "{mode:?}");
        assert_eq!(drain(&mut near).len(), 1);
        assert!(near.send(&ethercat(0, 2)));
        assert!(wait(&[&far, &near], now_ns() + LONG_NS, mode), "{mode:?}");
        assert_eq!(drain(&mut far).len(), 1);
    }
}

#[test]
fn without_sockets_a_wait_is_a_sleep() {
    for mode in MODES {
        let until = now_ns() + 1_000_000;
        assert!(!wait(&[], until, mode));
        assert!(now_ns() >= until);
    }
}
