//! Deactivation at each moment of an activation, in steps of a fraction of a state change: evaluated by the states
//! inside the SubDevices when it returns (protocol 3.4, 5.3).

use std::time::Duration;

use ringcat::{Declaration, Error, LastOutputs, MainDevice, Options, SubDeviceConfig};
use ringcat_sim::cable::CableId;
use ringcat_sim::fault::Fault;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::al::{AlState, AlStatus};
use scenarios::calls::witness::is_idle;
use scenarios::segments::{descriptions, line, ring};
use scenarios::tap::Tap;

/// A tenth of the change from INIT to PREOP.
const STEP: Duration = Duration::from_micros(100);
const LIMIT: Duration = Duration::from_secs(1);
/// Well below the watchdog of process data.
const LONGEST: Duration = Duration::from_millis(80);
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

/// Frames are lost at each moment of a deactivation. The attempt that ends by it is repeated soon, before the watchdogs
/// of the SubDevices with held outputs expire (100 ms).
// covers: stop, 5.3
#[test]
fn lost_frames_make_no_deactivation_last_until_a_watchdog_expires() {
    let mut slowest = Duration::ZERO;
    for (at_us, lost) in (0..6_000).step_by(50).flat_map(|at_us| [1, 2, 3].map(|lost| (at_us, lost))) {
        for network in networks(false) {
            let mut main_device = MainDevice::request(Tap::new(network), &Options::default());
            let scan = main_device.scan().expect("it can be scanned");
            let declaration = ringcat::automatic(&scan.subdevices, STEP);
            let mut application = main_device.activate(declaration).map_err(Error::from).expect("it fits");
            (0..1_000).for_each(|_| application.cycle(|_| ()));
            assert!(application.all_settled());
            let network = application.links_mut().network_mut();
            let at = network.now() + Duration::from_micros(at_us);
            network.schedule(at, Fault::Drop { cable: CableId(1), direction: None, count: lost });
            let begun = application.now();
            let ended = application.deactivate(LastOutputs::Held, LIMIT);
            let ended = ended.unwrap_or_else(|refused| panic!("{lost} lost after {at_us} us: {}", refused.error));
            let took = ended.now().since(begun);
            assert!(took < LONGEST, "{lost} lost after {at_us} us: {took:?}");
            slowest = slowest.max(took);
        }
    }
    println!("deactivation with lost frames: at most {slowest:?}");
}
