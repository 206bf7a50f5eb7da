//! Calls of distributed clocks: times given before activation, in the cycle, late or never; SYNC signals that end with
//! the application.

use ringcat_sim::cable::DeviceIndex;
use scenarios::calls::errno::Errno;
use scenarios::calls::master::Ecrt;

use super::{assert_idle, configure, requested, run_all};

/// Longest start with clocks: 5 s without a lock, as with IgH.
const WITH_CLOCKS: std::time::Duration = std::time::Duration::from_secs(12);
const CYCLE_NS: u32 = 1_000_000;
const ASSIGN: u16 = 0x0300;

/// SYNC0 pulses of the first device so far.
fn pulses(ecrt: &mut Ecrt) -> u64 {
    let network = ecrt.network();
    network.device(DeviceIndex(0)).controller.sync0_pulses(network.now())
}

// covers: api, dc-sync, dc-reference
#[test]
fn sync_pulses_run_with_the_application_and_end_with_it() {
    for (count, mut ecrt) in requested() {
        for (given_before, loops_first) in [(true, 0), (false, 0), (false, 300)] {
            let (_, configs) = configure(&mut ecrt, 0..count);
            ecrt.dc(configs[0], ASSIGN, CYCLE_NS, 250_000);
            if given_before {
                let time = ecrt.application_clock();
                ecrt.application_time(time);
            }
            ecrt.activate().expect("it fits");
            // Without any time for a while, then in each cycle.
            for _ in 0..loops_first {
                ecrt.receive();
                ecrt.send();
                ecrt.pause(scenarios::calls::cycle::PERIOD);
            }
            let time = ecrt.cycle_until_op(WITH_CLOCKS).unwrap_or_else(|error| panic!("{count}: {error}"));
            let before = pulses(&mut ecrt);
            ecrt.cycles(100);
            let text = format!("{count}: given before {given_before}, {loops_first} cycles without, OP after {time:?}");
            assert!(pulses(&mut ecrt) >= before + 99, "{text}");
            assert!(ecrt.reference_clock_time().is_ok(), "{text}");
            ecrt.sync_monitor_queue().expect("there are clocks");
            assert_eq!(ecrt.sync_monitor_process(), u32::MAX, "no answer yet");
            ecrt.cycle();
            assert_ne!(ecrt.sync_monitor_process(), u32::MAX, "{text}");
            println!("{text}");
            ecrt.deactivate().expect("all follow");
            assert_idle(&mut ecrt, &text);
            let before = pulses(&mut ecrt);
            ecrt.pause(std::time::Duration::from_millis(50));
            assert!(pulses(&mut ecrt) <= before, "{text}");
        }
        // Without clocks in the configuration.
        run_all(&mut ecrt, count);
        assert_eq!(ecrt.sync_reference_clock(), Err(Errno::NxIo));
        assert_eq!(ecrt.sync_slave_clocks(), Err(Errno::NxIo));
        assert_eq!(ecrt.reference_clock_time(), Err(Errno::NxIo));
        ecrt.deactivate().expect("all follow");
        assert_idle(&mut ecrt, "without clocks");
    }
}
