//! The time that the frames of a cycle take on the wire with a standby, compared with the period.

use std::sync::mpsc;
use std::time::Duration;

use ringcat::simulated::two_hosts::HostLinks;
use ringcat::standby::StandbyOptions;
use ringcat::{ActivateError, Error, LayoutError, MainDevice, Options, automatic};
use ringcat_sim::cable::Host;
use scenarios::pair::Pair;

use super::ring_of_two;

/// The time that the frames of a ring of `count` need, if a cycle is too short for them.
fn needed(count: usize, cycle: Duration, options: StandbyOptions) -> Option<Duration> {
    let mut pair = Pair::without_programs(1, ring_of_two(count, Host::First));
    pair.start_standby(Host::Second);
    let (sender, results) = mpsc::channel();
    let program = move |mut links: HostLinks| {
        links.switch(true);
        let mut main_device = MainDevice::request(links, &Options::default().with_standby(options));
        main_device.become_active();
        let result = main_device.bring_up(|scan| automatic(&scan.subdevices, cycle));
        let needed = match result.map_err(|refused| refused.error) {
            Ok(_) => None,
            Err(Error::Activate(ActivateError::Layout(LayoutError::CycleTooShort { needed, period }))) => {
                assert_eq!(period, cycle);
                Some(needed)
            }
            Err(error) => panic!("{error}"),
        };
        sender.send(needed).expect("the test waits");
    };
    pair.hosts().start(Host::First, program).expect("a thread starts");
    pair.hosts().run_for(Duration::from_secs(2));
    results.try_recv().expect("it ends within two seconds")
}

// covers: standby, 9.9
#[test]
fn a_cycle_that_cannot_hold_its_frames_is_refused_with_the_time_they_take() {
    for count in [2, 10, 33] {
        for acyclic in [0, 4] {
            let options = StandbyOptions::default().with_max_acyclic(acyclic);
            let time = needed(count, Duration::from_micros(100), options).expect("it does not fit");
            println!("{count} SubDevices, {acyclic} acyclic frames: {time:?}");
            let just = Duration::from_micros(time.as_nanos().div_ceil(1_000) as u64);
            assert_eq!(needed(count, just, options), None, "{count}, {just:?}");
            let less = just - Duration::from_micros(1);
            assert_eq!(needed(count, less, options), Some(time), "{count}, {less:?}");
        }
    }
}
