//! Watchdogs that are shorter than a takeover are reported when the policy is set.

use std::sync::mpsc;
use std::time::Duration;

use ringcat::simulated::two_hosts::HostLinks;
use ringcat::standby::{Policy, StandbyEvent, StandbyOptions};
use ringcat::{Event, MainDevice, Options, SubDeviceId, automatic};
use ringcat_sim::cable::Host;
use scenarios::pair::{CYCLE, Pair};

use super::ring_of_two;

/// Reported SubDevices with their watchdogs and what is needed, and those of `short_watchdogs`.
type Short = [Vec<(usize, Duration, Duration)>; 2];

/// An ACTIVE whose SubDevices have these watchdogs in units of 100 us, with a policy.
fn reported(watchdogs: &[(usize, u16)], policy: Policy) -> Short {
    let mut pair = Pair::without_programs(1, ring_of_two(4, Host::First));
    pair.start_standby(Host::Second);
    let (sender, results) = mpsc::channel();
    let watchdogs = watchdogs.to_vec();
    let program = move |mut links: HostLinks| {
        links.switch(true);
        let mut main_device = MainDevice::request(links, &Options::default().with_standby(StandbyOptions::default()));
        main_device.become_active();
        let application = main_device.bring_up(|scan| {
            let mut declaration = automatic(&scan.subdevices, CYCLE);
            for (subdevice, intervals) in watchdogs {
                let config = declaration.subdevices[subdevice].clone();
                declaration.subdevices[subdevice] = config.watchdog(None, Some(intervals));
            }
            declaration
        });
        let mut application = application.unwrap_or_else(|refused| panic!("{}", refused.error));
        application.set_policy(Some(policy));
        let mut events = Vec::new();
        while let Some(event) = application.pop_event() {
            if let Event::Standby(StandbyEvent::WatchdogTooShort { subdevice, watchdog, needed }) = event.event {
                events.push((subdevice.0, watchdog, needed));
            }
        }
        let short = application.short_watchdogs(&policy).expect("it runs here");
        let short = short.into_iter().map(|(SubDeviceId(number), watchdog, needed)| (number, watchdog, needed));
        sender.send([events, short.collect()]).expect("the test waits");
    };
    pair.hosts().start(Host::First, program).expect("a thread starts");
    pair.hosts().run_for(Duration::from_secs(2));
    results.try_recv().expect("it ends within two seconds")
}

// covers: standby, 9.9
#[test]
fn a_watchdog_that_is_shorter_than_a_takeover_is_named_when_the_policy_is_set() {
    let ms = Duration::from_millis;
    let policy = Policy::default().with_time_out(3, Duration::ZERO);
    // 1 has outputs, 2 inputs, 3 both; a takeover lasts 3 and 2 cycles of 1 ms.
    let none: Short = [vec![], vec![]];
    assert_eq!(reported(&[(1, 51), (2, 10), (3, 0)], policy), none, "long enough, inputs, off");
    let [events, short] = reported(&[(1, 50), (2, 10), (3, 40)], policy);
    assert_eq!(events, [(1, ms(5), ms(5)), (3, ms(4), ms(5))]);
    assert_eq!(short, events);
    // The default is 100 ms.
    let [events, short] = reported(&[], policy.with_time_out(98, Duration::ZERO));
    assert_eq!(events, [(1, ms(100), ms(100)), (3, ms(100), ms(100))]);
    assert_eq!(short, events);
    let held = Policy::permanent_standby().with_time_out(99, Duration::ZERO);
    assert_eq!(reported(&[(1, 10)], held), none, "it does not take over");
}
