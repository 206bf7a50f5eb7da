//! Deactivation at each moment of an activation, in steps of a fraction of a state change: evaluated by the states
//! inside the SubDevices when it returns (protocol 3.4, 5.3).

use std::time::Duration;

use ringcat::{Declaration, Error, LastOutputs, MainDevice, Options, SubDeviceConfig};
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::al::{AlState, AlStatus};
use scenarios::calls::witness::is_idle;
use scenarios::segments::{descriptions, line, ring};
use scenarios::tap::Tap;

/// A tenth of the change from INIT to PREOP.
const STEP: Duration = Duration::from_micros(100);
const LIMIT: Duration = Duration::from_secs(1);
const KINDS: [&str; 3] = ["servo", "digital-output-8", "emulated-output-8"];
/// Time that a SubDevice needs for a state: longer than all other steps of a configuration.
const SLOW: Duration = Duration::from_millis(30);

fn networks(slow: bool) -> [Network; 2] {
    [line, ring].map(|build| {
        let mut kinds = descriptions(&KINDS);
        if slow {
            kinds.iter_mut().for_each(|kind| kind.transitions.to_preop = SLOW);
        }
        build(kinds, NetworkOptions::default())
    })
}

/// The AL states and settings at the end, of an application that has declared `declared` and ran for some cycles.
fn ended(network: Network, with_idle: bool, declared: &[usize], ran: usize) -> Vec<Result<(), String>> {
    let mut main_device = MainDevice::request(Tap::new(network), &Options::default().with_idle_operation(with_idle));
    let scan = main_device.scan().expect("it can be scanned");
    let mut declaration = Declaration::default();
    let domain = declaration.add_domain(STEP);
    for at in declared {
        declaration.add_to(domain, SubDeviceConfig::from_info(&scan.subdevices[*at]));
    }
    let mut application = main_device.activate(declaration).map_err(Error::from).expect("it fits");
    (0..ran).for_each(|_| application.cycle(|_| ()));
    let mut ended = application.deactivate(LastOutputs::Held, LIMIT).expect("all follow");
    let network = ended.links_mut().network();
    let found = (0..KINDS.len()).map(|at| is_idle(network, at)).collect();
    // Earlier requests take effect within this time.
    ended.attend(SLOW);
    let states = ended.links_mut().network().devices().map(|device| device.al_status());
    assert!(states.eq([AlStatus::new(AlState::PreOp); KINDS.len()]), "idle {with_idle}, {declared:?}, {ran} cycles");
    found
}

/// A SubDevice executes the request of a procedure that the activation, or its end, has interrupted, and reads the next
/// request only afterwards.
// covers: stop, 5.3
#[test]
fn all_are_in_preop_when_a_deactivation_returns_at_each_moment_of_a_start() {
    for with_idle in [true, false] {
        for declared in [&[][..], &[1], &[0, 2], &[0, 1, 2]] {
            for ran in (0..40).chain([50, 60, 80, 120, 200]) {
                for network in networks(false) {
                    let found = ended(network, with_idle, declared, ran);
                    assert!(found.iter().all(Result::is_ok), "{with_idle}, {declared:?}, {ran} cycles: {found:?}");
                }
            }
        }
    }
}

// covers: stop, 5.3
#[test]
fn a_deactivation_waits_for_slow_state_changes_that_were_requested_before() {
    for with_idle in [true, false] {
        for declared in [&[][..], &[0, 1, 2]] {
            for ran in (0..700).step_by(23) {
                for network in networks(true) {
                    let found = ended(network, with_idle, declared, ran);
                    assert!(found.iter().all(Result::is_ok), "{with_idle}, {declared:?}, {ran} cycles: {found:?}");
                }
            }
        }
    }
}
