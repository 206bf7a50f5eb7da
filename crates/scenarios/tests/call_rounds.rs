//! 1,000 rounds of activation, OP and deactivation, with other configurations in turn and faults meanwhile: memory and
//! procedures do not grow. A program of its own, because it counts allocations.

use std::time::Duration;

use ringcat::{DomainId, SubDeviceId};
use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_sim::fault::Fault;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::al::{AlControl, AlState};
use ringcat_wire::register::map;
use scenarios::calls::faults::write_as_another;
use scenarios::calls::master::Ecrt;
use scenarios::calls::witness::is_idle;
use scenarios::counting_allocator::{CountingAllocator, counts};
use scenarios::segments::{descriptions, line, ring};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

const KINDS: [&str; 6] =
    ["servo", "digital-output-8", "all-protocols", "digital-input-8", "emulated-output-8", "analog-output-4"];
const LIMIT: Duration = Duration::from_secs(3);
/// Rounds after which memory is measured. The log of 4,096 events is full before the last but one; the last two numbers
/// differ by a multiple of all that rounds differ in, so that both end alike.
const ROUNDS: [usize; 4] = [100, 300, 580, 1_000];
/// Difference between two texts of events of the log: names, positions, codes.
const NOISE: i64 = 16 * 1024;

/// Configures a part of the segment: other SubDevices, domains, clocks and requests in each round.
fn configure(ecrt: &mut Ecrt, round: usize) {
    let domains: Vec<DomainId> = (0..1 + round % 3).map(|_| ecrt.create_domain().expect("reserved")).collect();
    for (at, info) in ecrt.side.engine().subdevices().into_iter().enumerate() {
        if (at + round).is_multiple_of(4) {
            continue;
        }
        let config: SubDeviceId =
            ecrt.slave_config(0, at as u16, (info.identity.vendor_id, info.identity.product_code)).expect("it is new");
        for (number, entry) in ecrt.default_entries(config).into_iter().enumerate() {
            let domain = domains[(number + at) % domains.len()];
            let _ = ecrt.reg_pdo_entry(config, entry, domain, Some(&mut 0));
        }
        if round.is_multiple_of(5) && info.controller.features.dc {
            ecrt.dc(config, 0x0300, 1_000_000, 0);
        }
        ecrt.create_sdo_request(config, 0x1018, 1).expect("before activation");
        ecrt.create_voe_handler(config).expect("before activation");
        ecrt.emerg_size(config, 3).expect("before activation");
    }
}

/// A fault of each kind in turn, in the middle of a round, and its end.
fn disturb(ecrt: &mut Ecrt, round: usize, begins: bool) {
    let network = ecrt.network();
    let (cable, device) = (CableId(round % network.cables().len()), DeviceIndex(round % KINDS.len()));
    match (round % 7, begins) {
        (1, true) => network.apply(Fault::Cut(cable)),
        (1, false) => network.apply(Fault::Heal(cable)),
        (3, true) => network.apply(Fault::PowerOff(device)),
        (3, false) => network.apply(Fault::PowerOn(device)),
        (5, true) => {
            let control = AlControl::new(AlState::Init).encode();
            write_as_another(network, device.0 as u16, map::AL_CONTROL, &control);
        }
        _ => {}
    }
}

fn one_round(ecrt: &mut Ecrt, round: usize) {
    configure(ecrt, round);
    ecrt.activate().expect("it fits");
    ecrt.cycles(20);
    disturb(ecrt, round, true);
    ecrt.requests.sdo.iter_mut().for_each(|request| request.read().expect("it is not busy"));
    ecrt.cycles(10 + round % 17);
    disturb(ecrt, round, false);
    if (round % 7).is_multiple_of(2) && !round.is_multiple_of(5) {
        ecrt.cycle_until_op(LIMIT).unwrap_or_else(|error| panic!("round {round}: {error}"));
    }
    // One that lost its power or its cable follows later.
    let _ = ecrt.deactivate();
}

/// What the MainDevice holds after some rounds.
#[derive(Clone, Copy, Debug)]
struct Held {
    bytes: i64,
    procedures: usize,
    datagrams: usize,
}

/// Runs some rounds, then measures the MainDevice without an application. Simulated devices do not count.
fn after(rounds: usize, network: Network) -> Held {
    let mut ecrt = Ecrt::new(network);
    ecrt.request().expect("it is free");
    (1..=rounds).for_each(|round| one_round(&mut ecrt, round));
    ecrt.pause(Duration::from_secs(2));
    ecrt.release();
    ecrt.request().expect("it is free");
    for device in 0..KINDS.len() {
        is_idle(ecrt.network(), device).unwrap_or_else(|error| panic!("after {rounds} rounds: {error}"));
    }
    ecrt.forget_log();
    let under_way = ecrt.side.engine().under_way();
    drop(ecrt.side.links_mut().take_network());
    let with = counts().bytes;
    drop(ecrt);
    Held { bytes: with - counts().bytes, procedures: under_way.procedures, datagrams: under_way.datagrams }
}

fn compare(name: &str, network: impl Fn() -> Network) {
    let before = counts().bytes;
    let held = ROUNDS.map(|rounds| after(rounds, network()));
    let left = counts().bytes - before;
    for (rounds, held) in ROUNDS.iter().zip(held) {
        println!("{name}, {rounds} rounds: {held:?}");
        assert_eq!(held.datagrams, 0, "{name}, {rounds} rounds");
    }
    let [.., full, last] = held;
    assert_eq!(last.procedures, held[0].procedures, "{name}");
    let grown = last.bytes - full.bytes;
    assert!(grown <= NOISE, "{name}: {grown} bytes more");
    println!("{name}: {left} bytes are left");
    assert_eq!(left, 0, "{name}: bytes are left");
}

// covers: stop, api
#[test]
fn memory_and_procedures_do_not_grow_in_1000_rounds_of_activation() {
    let options = NetworkOptions::default;
    compare("line", || line(descriptions(&KINDS), options()));
    compare("ring", || ring(descriptions(&KINDS), options()));
}
