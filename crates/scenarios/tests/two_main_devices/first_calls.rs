//! The first mailbox calls of a new ACTIVE: right after the cycle with which its role changes, and from the next cycle
//! on.

use std::sync::mpsc::{Sender, channel};
use std::time::Duration;

use ringcat::simulated::two_hosts::{HostLinks, TwoHosts};
use ringcat::standby::{Policy, RoleControl, RoleRequest, StandbyOptions};
use ringcat::{Application, Error, MainDevice, MainDeviceRole, Options, SubDeviceId, automatic};
use ringcat_sim::cable::Host;
use scenarios::two::CYCLE;

use super::ring_of_two;

/// A servo.
const WITH_MAILBOX: SubDeviceId = SubDeviceId(3);
const IDENTITY: (u16, u8) = (0x1018, 1);
/// In the error of a call that is refused.
const NOT_IN_USE: &str = "the mailbox is not in use";
/// A call has ended after so many cycles.
const PATIENCE: usize = 100;

/// How the role changes.
#[derive(Clone, Copy, Debug)]
enum Change {
    HandedOver,
    TakenOver,
}

/// What became of a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ending {
    Answered,
    /// The mailbox was not in use.
    Refused,
    /// Without a result.
    Cancelled,
}

/// Starts to read the identity of a SubDevice after this many cycles; what became of it, and after how many.
fn call(application: &mut Application<HostLinks>, after: usize) -> (Ending, usize) {
    for _ in 0..after {
        application.cycle(|_| ());
    }
    let mut pending = application.subdevice(WITH_MAILBOX).sdo_read::<u32>(IDENTITY.0, IDENTITY.1);
    for cycles in 0..PATIENCE {
        application.cycle(|_| ());
        match pending.take() {
            Some(Ok(_)) => return (Ending::Answered, cycles),
            Some(Err(error)) if error.to_string().contains(NOT_IN_USE) => return (Ending::Refused, cycles),
            Some(Err(error)) => panic!("{error}"),
            None if !pending.is_running() => return (Ending::Cancelled, cycles),
            None => {}
        }
    }
    panic!("a call does not end within {PATIENCE} cycles");
}

/// What a controller tells: the handle of its role, and what became of its calls.
enum Told {
    Joined(Host, Option<RoleControl>),
    Called([(Ending, usize); 2]),
}

/// A controller. When it has become ACTIVE after the other one it calls, the first time so many cycles after the one
/// with which its role has changed, and then once more.
fn controller(mut links: HostLinks, after: usize, told: &Sender<Told>) -> Result<(), Error> {
    let host = links.host();
    links.switch(true);
    let listen = if host == Host::First { Duration::from_millis(10) } else { Duration::from_millis(500) };
    let options = Options::default().with_standby(StandbyOptions::default().with_needs_guard(false));
    let policy = Policy::default().with_time_out(3, Duration::ZERO).with_listen(listen);
    let main_device = MainDevice::request(links, &options);
    let mut application = main_device.join(&policy, |scan| automatic(&scan.subdevices, CYCLE))?;
    // The receiver is gone when it knows enough.
    let _ = told.send(Told::Joined(host, application.role_control()));
    let mut was_inactive = false;
    loop {
        application.cycle(|_| ());
        let is_inactive = application.role() == MainDeviceRole::Inactive;
        if std::mem::replace(&mut was_inactive, is_inactive) && !is_inactive {
            let calls = [call(&mut application, after), call(&mut application, 0)];
            let _ = told.send(Told::Called(calls));
        }
    }
}

/// What became of both calls of a new ACTIVE.
fn calls(change: Change, after: usize) -> [(Ending, usize); 2] {
    let mut hosts = TwoHosts::new(ring_of_two(8, Host::First));
    let (sender, told) = channel();
    for host in Host::ALL {
        let sender = sender.clone();
        let run = move |links: HostLinks| controller(links, after, &sender).expect("it joins");
        hosts.start(host, run).expect("a thread starts");
    }
    hosts.run_for(Duration::from_secs(2));
    let first = told.try_iter().find_map(|told| match told {
        Told::Joined(Host::First, control) => control,
        _ => None,
    });
    match change {
        Change::HandedOver => {
            first.expect("it has joined").request(RoleRequest::HandOver);
        }
        Change::TakenOver => {
            hosts.guard(Host::First, CYCLE);
            hosts.kill(Host::First);
        }
    }
    hosts.run_for(Duration::from_secs(1));
    let called = told.try_iter().find_map(|told| match told {
        Told::Called(calls) => Some(calls),
        Told::Joined(..) => None,
    });
    called.expect("the second one has become ACTIVE")
}

// covers: MR-17, REQ042, standby
#[test]
fn a_call_in_the_first_cycle_of_a_new_active_is_refused_and_later_ones_answered() {
    for change in [Change::HandedOver, Change::TakenOver] {
        for after in 0..4 {
            let [first, next] = calls(change, after);
            println!("{change:?}, {after} cycles after the first one: {first:?}; the next one: {next:?}");
            let expected = if after == 0 { Ending::Refused } else { Ending::Answered };
            assert_eq!((first.0, next.0), (expected, Ending::Answered), "{change:?}, {after} cycles after");
            assert!(after > 0 || first.1 == 0, "it ends with the next cycle: {first:?}");
        }
    }
}
