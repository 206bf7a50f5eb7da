//! Power-on to OP with lost frames: the distribution over seeds, losses in a row, and a segment that stops for a while
//! (protocol SM-04, decision 0064).

use std::time::Duration;

use ringcat::{Links, MainDevice, Options, automatic};
use ringcat_sim::cable::{DeviceIndex, Direction, HostLink};
use ringcat_sim::fault::Fault;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_sim::time::SimTime;
use ringcat_wire::al::AlState;
use scenarios::segments::{descriptions, drives, ring};
use scenarios::tap::Tap;

const CYCLE: Duration = Duration::from_millis(1);
const SEEDS: u64 = 40;

/// Time from power-on to OP of all devices, by their own registers, and the number of lost frames.
fn start(network: Network, per_mille: u64, seed: u64) -> (Duration, u64) {
    let mut tap = Tap::new(network);
    tap.set_limit(tap.now() + Duration::from_secs(5));
    tap.lose_per_mille(per_mille, seed);
    let mut main_device = MainDevice::request(tap, &Options::default());
    let found = main_device.scan().unwrap_or_else(|error| panic!("seed {seed}: {error}"));
    let mut application = main_device.activate(automatic(&found.subdevices, CYCLE)).expect("it fits");
    let is_op = |network: &Network| network.devices().all(|it| it.al_status().al_state() == Some(AlState::Op));
    while !is_op(application.links().network()) {
        application.cycle(|_| ());
    }
    (Duration::from_nanos(application.now().0), application.acyclic_counters().lost)
}

/// Sorted times of all seeds.
fn distribution(name: &str, network: impl Fn() -> Network, per_mille: u64) -> Vec<Duration> {
    let mut lost = 0;
    let mut times: Vec<Duration> = Vec::new();
    for seed in 0..SEEDS {
        let (took, frames) = start(network(), per_mille, seed);
        times.push(took);
        lost += frames;
    }
    times.sort();
    let [median, most] = [times[times.len() / 2], times[times.len() - 1]].map(|it| it.as_secs_f64() * 1e3);
    println!("{name}, {per_mille} of 1,000 frames lost: median {median:.1} ms, longest {most:.1} ms, {lost} lost");
    assert!(lost > 0, "{name}: nothing was lost");
    times
}

// covers: scan, lost-frames
#[test]
fn a_start_with_lost_frames_has_no_outliers() {
    let mut outliers = Vec::new();
    for (count, longest_ms) in [(1, [64, 120]), (10, [40, 65]), (50, [50, 75])] {
        for (per_mille, longest_ms) in [10, 50].into_iter().zip(longest_ms) {
            let times = distribution(&format!("{count} drives"), || drives(count), per_mille);
            let most = times[times.len() - 1];
            outliers.extend((most > Duration::from_millis(longest_ms)).then_some((count, per_mille, most)));
        }
    }
    assert_eq!(outliers, []);
}

// covers: scan, lost-frames
#[test]
fn a_start_of_a_ring_with_lost_frames_has_no_outliers() {
    let network = || ring(descriptions(&["servo"; 10]), NetworkOptions::default());
    for (per_mille, longest_ms) in [(10, 45), (50, 75)] {
        let times = distribution("ring of 10 drives", network, per_mille);
        let most = times[times.len() - 1];
        assert!(most <= Duration::from_millis(longest_ms), "{per_mille}: {most:?}");
    }
}

// covers: SM-04, scan, lost-frames
#[test]
fn six_losses_in_a_row_cost_a_start_less_than_17_ms() {
    for (count, limit_ms) in [(1, 17), (10, 17)] {
        let (usual, _) = start(drives(count), 0, 0);
        let mut most = Duration::ZERO;
        for at_us in (2_000..20_000).step_by(1_300) {
            let mut network = drives(count);
            let cable = network.host_cable(HostLink::Main).expect("there is one");
            let lost = Fault::Drop { cable, direction: Some(Direction::AToB), count: 6 };
            network.schedule(SimTime(at_us * 1_000), lost);
            let (took, lost) = start(network, 0, 0);
            assert!(lost >= 6, "{lost}");
            most = most.max(took - usual);
        }
        println!("{count} drives: six losses in a row cost at most {most:?}, usual start {usual:?}");
        assert!(most < Duration::from_millis(limit_ms), "{count} drives: {most:?}");
    }
}

// covers: SM-04, scan, lost-frames
#[test]
fn a_start_continues_soon_after_all_frames_were_lost_for_up_to_90_ms() {
    let (usual, _) = start(drives(1), 0, 0);
    for lost_ms in [5, 10, 20, 30, 45, 60, 90] {
        let mut most = Duration::ZERO;
        for at_us in (3_000..9_000).step_by(1_900) {
            let mut network = drives(1);
            let cable = network.host_cable(HostLink::Main).expect("there is one");
            let direction = Some(Direction::AToB);
            let all = Fault::Drop { cable, direction, count: u32::MAX };
            network.schedule(SimTime(at_us * 1_000), all);
            let none = Fault::Drop { cable, direction, count: 0 };
            network.schedule(SimTime((at_us + lost_ms * 1_000) * 1_000), none);
            let (took, _) = start(network, 0, 0);
            most = most.max(took - usual);
        }
        println!("all frames lost for {lost_ms} ms: the start is at most {most:?} longer");
        // The longest limit is 20 ms; all tries of a datagram together wait for 100 ms.
        let limit = lost_ms + 21;
        assert!(most < Duration::from_millis(limit), "{lost_ms} ms: {most:?}");
    }
}

/// A segment that is simulated by a process, or is behind a bridge, may stand still: its frames come together then.
// covers: scan, lost-frames
#[test]
fn a_segment_that_stands_still_for_100_ms_makes_no_eeprom_unreadable() {
    for stopped_us in (93_000..101_000).step_by(1_000) {
        for at_us in (10_000..60_000_u64).step_by(4_700) {
            let mut network = drives(1);
            let slow = Fault::SlowSii { device: DeviceIndex(0), busy: Duration::from_millis(5), times: u32::MAX };
            network.apply(slow);
            let cable = network.host_cable(HostLink::Main).expect("there is one");
            let (direction, end_us) = (Some(Direction::AToB), at_us + stopped_us);
            for now_us in (at_us..end_us).step_by(100) {
                let by = Duration::from_micros(end_us - now_us);
                network.schedule(SimTime(now_us * 1_000), Fault::Delay { cable, direction, count: u32::MAX, by });
            }
            let none = Fault::Delay { cable, direction, count: 0, by: Duration::ZERO };
            network.schedule(SimTime(end_us * 1_000), none);
            let mut main_device = MainDevice::request(Tap::new(network), &Options::default());
            // All tries of a datagram together wait for 100 ms.
            let Ok(found) = main_device.scan() else { continue };
            let text = format!("{stopped_us} us from {at_us} us on: {:?}", found.subdevices[0].warnings);
            assert!(!found.subdevices[0].is_blank(), "{text}");
        }
    }
}
