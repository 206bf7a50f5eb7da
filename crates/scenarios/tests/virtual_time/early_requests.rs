//! Requests of states by another program while SubDevices are configured: at random times, of all states.
//!
//! `SEED=0..300 cargo test -p scenarios --test virtual_time early_requests::seeds -- --nocapture` runs many.

use std::time::Duration;

use ringcat::{Application, Error, MainDevice, Options, Retries, automatic};
use ringcat_sim::network::NetworkOptions;
use ringcat_wire::al::{AlControl, AlState, AlStatus};
use ringcat_wire::register::map;
use scenarios::calls::faults::write_as_another;
use scenarios::dice::Dice;
use scenarios::seeds;
use scenarios::segments::{descriptions, line, ring};
use scenarios::tap::Tap;

const KINDS: [&str; 6] =
    ["servo", "digital-output-8", "emulated-output-8", "all-protocols", "emulated-input-8", "digital-input-8"];
/// Longest time until all are in OP: a start-up command waits for its answer for one second.
const LIMIT: Duration = Duration::from_secs(3);
const FAST: Duration = Duration::from_micros(100);
const STATES: [AlState; 5] = [AlState::Init, AlState::PreOp, AlState::SafeOp, AlState::Op, AlState::Boot];

fn one(seed: u64) {
    let mut dice = Dice::new(seed);
    let size = 1 + dice.below(5) as usize;
    let kinds: Vec<&str> = (0..size).map(|_| *dice.pick(&KINDS)).collect();
    let is_ring = dice.one_in(2);
    let build = if is_ring { ring } else { line };
    let network = build(descriptions(&kinds), NetworkOptions::default());
    let with_idle = dice.one_in(2);
    let options = Options::default().with_retries(Retries::OnRequest).with_idle_operation(with_idle);
    let mut main_device = MainDevice::request(Tap::new(network), &options);
    if with_idle {
        main_device.attend(Duration::from_millis(300));
    }
    let scan = main_device.scan().expect("it can be scanned");
    let mut application =
        main_device.activate(automatic(&scan.subdevices, FAST)).map_err(Error::from).expect("it fits");
    let late = dice.below(200);
    let state = *dice.pick(&STATES);
    let targets: Vec<u16> = (0..size as u16).filter(|_| dice.one_in(2)).collect();
    (0..late).for_each(|_| application.cycle(|_| ()));
    let before: Vec<String> = application.links().network().devices().map(|it| it.al_status().to_string()).collect();
    let request = AlControl::new(state).encode();
    let network = application.links_mut().network_mut();
    targets.iter().for_each(|at| write_as_another(network, *at, map::AL_CONTROL, &request));
    let begun = application.now();
    // A SAFEOP in OP is seen by the read of all states, once a second.
    (0..12_500).for_each(|_| application.cycle(|_| ()));
    let statuses = |application: &Application<Tap>| -> Vec<AlStatus> {
        application.links().network().devices().map(|device| device.al_status()).collect()
    };
    let expected = vec![AlStatus::new(AlState::Op); size];
    while statuses(&application) != expected && application.now().since(begun) < LIMIT {
        application.cycle(|_| ());
    }
    let states = application.states();
    assert_eq!(
        statuses(&application),
        expected,
        "seed {seed}, {kinds:?}, ring {is_ring}, idle {with_idle}: {state} of {targets:?} after {late} cycles in \
         {before:?}, then {states:?}"
    );
}

// covers: stop, refused-states
#[test]
fn seeds_from_the_environment() {
    seeds::from_environment().unwrap_or(0..40).for_each(one);
}
