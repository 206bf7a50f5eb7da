//! Effects of each injected fault.

use core::time::Duration;

use ringcat_sim::cable::HostLink::{Main, Redundant};
use ringcat_sim::cable::{CableId, DeviceIndex, Direction};
use ringcat_sim::fault::Fault;
use ringcat_sim::network::Network;
use ringcat_sim::network::statistics::LossCause;
use ringcat_wire::address::{Position, RegisterAddress};
use ringcat_wire::al::{AlState, AlStatusCode};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::map;

use crate::wiring::{SETTLE, command, endpoint, journey, probe, ring, segment, shortest, travel};

const MILLISECOND: Duration = Duration::from_millis(1);

/// The cable at port 1 of device 1; its end `a` is device 1.
fn first_cable(network: &Network) -> CableId {
    network.cable_at(endpoint("1.1")).unwrap()
}

fn processed_by(network: &mut Network, link: ringcat_sim::cable::HostLink) -> Option<Vec<u16>> {
    travel(network, link).map(|journey| journey.processed_by)
}

#[test]
fn dropped_frames_are_counted_per_direction() {
    let mut network = segment(&ring(2));
    let cable = first_cable(&network);
    network.apply(Fault::Drop { cable, direction: Some(Direction::AToB), count: 2 });
    assert_eq!(processed_by(&mut network, Redundant), Some(vec![]));
    assert_eq!(processed_by(&mut network, Main), None);
    assert_eq!(processed_by(&mut network, Main), None);
    assert_eq!(processed_by(&mut network, Main), Some(vec![1, 2]));
    network.apply(Fault::Drop { cable, direction: None, count: 1 });
    assert_eq!(processed_by(&mut network, Redundant), None);
    assert_eq!(processed_by(&mut network, Main), None);
    assert_eq!(processed_by(&mut network, Redundant), Some(vec![]));
    assert_eq!(network.statistics().lost(LossCause::Dropped), 4);
}

// covers: sim-faults
#[test]
fn a_duplicated_frame_returns_twice_one_wire_time_apart() {
    let mut network = segment(&ring(2));
    let cable = first_cable(&network);
    network.apply(Fault::Duplicate { cable, direction: Some(Direction::AToB), count: 1 });
    network.send(Main, &shortest());
    network.advance_by(SETTLE);
    let [one, two] = [network.receive(Redundant).unwrap(), network.receive(Redundant).unwrap()];
    assert_eq!(one.bytes, two.bytes);
    assert_eq!((two.at - one.at).as_nanos(), 84 * 80);
    assert_eq!(network.receive(Redundant), None);
    assert_eq!(processed_by(&mut network, Main), Some(vec![1, 2]));
}

#[test]
fn a_corrupted_frame_is_counted_by_the_controllers_and_refused_by_the_interface() {
    let mut network = segment(&ring(3));
    let cable = first_cable(&network);
    network.apply(Fault::Corrupt { cable, direction: Some(Direction::AToB), count: 1 });
    assert_eq!(processed_by(&mut network, Main), None);
    assert_eq!(network.statistics().lost(LossCause::BadCheckSequence), 1);
    let register = |device: usize, address| network.device(DeviceIndex(device)).controller.register(address, 1)[0];
    assert_eq!([0, 1, 2].map(|device| register(device, map::RX_ERROR_COUNTER)), [0, 1, 0]);
    assert_eq!([0, 1, 2].map(|device| register(device, map::FORWARDED_RX_ERROR_COUNTER)), [0, 0, 1]);
    assert_eq!(processed_by(&mut network, Main), Some(vec![1, 2, 3]));
}

// covers: 2.5, sim-counters
#[test]
fn symbol_errors_are_counted_at_the_receiver_and_damage_only_their_frames() {
    let mut network = segment(&ring(3));
    let cable = first_cable(&network);
    let counted = |network: &Network, device: usize| {
        network.device(DeviceIndex(device)).controller.register(map::RX_ERROR_COUNTER, 8).to_vec()
    };
    network.apply(Fault::IdleSymbolErrors { cable, direction: None, count: 300 });
    assert_eq!(counted(&network, 0), [0, 0, 0, 0xFF, 0, 0, 0, 0]);
    assert_eq!(counted(&network, 1), [0, 0xFF, 0, 0, 0, 0, 0, 0]);
    assert_eq!(processed_by(&mut network, Main), Some(vec![1, 2, 3]));
    network.apply(Fault::SymbolErrors { cable, direction: Some(Direction::AToB), count: 1 });
    assert_eq!(processed_by(&mut network, Main), None);
    assert_eq!(network.statistics().lost(LossCause::BadCheckSequence), 1);
    assert_eq!(counted(&network, 1), [1, 0xFF, 0, 0, 0, 0, 0, 0]);
    assert_eq!(counted(&network, 2), [0; 8]);
    // A cut cable carries no signal.
    network.apply(Fault::Cut(cable));
    network.advance_by(SETTLE);
    let clear = command(Command::Bwr, Target::Broadcast(map::RX_ERROR_COUNTER), &[0]);
    network.send(Main, &clear);
    network.send(Redundant, &clear);
    network.advance_by(SETTLE);
    network.apply(Fault::IdleSymbolErrors { cable, direction: None, count: 1 });
    assert_eq!((counted(&network, 0), counted(&network, 1)), (vec![0; 8], vec![0; 8]));
}

// covers: sim-faults
#[test]
fn a_corrupted_write_changes_no_register() {
    let mut network = segment("main-1.0");
    let cable = network.host_cable(Main).unwrap();
    let write = command(Command::Bwr, Target::Broadcast(map::STATION_ADDRESS), &[0x34, 0x12]);
    network.apply(Fault::Corrupt { cable, direction: Some(Direction::AToB), count: 1 });
    network.send(Main, &write);
    network.advance_by(SETTLE);
    let address =
        |network: &Network| network.device(DeviceIndex(0)).controller.register(map::STATION_ADDRESS, 2).to_vec();
    assert_eq!(address(&network), [0, 0]);
    network.send(Main, &write);
    network.advance_by(SETTLE);
    assert_eq!(address(&network), [0x34, 0x12]);
}

// covers: sim-faults
#[test]
fn a_delayed_frame_is_overtaken() {
    let mut network = segment(&ring(2));
    let cable = first_cable(&network);
    network.apply(Fault::Delay { cable, direction: Some(Direction::AToB), count: 1, by: MILLISECOND });
    let start = network.now();
    network.send(Main, &probe(Main, 1));
    network.send(Main, &shortest());
    network.advance_by(SETTLE);
    let [one, two] = [network.receive(Redundant).unwrap(), network.receive(Redundant).unwrap()];
    assert_eq!(one.bytes.len(), 60);
    assert!(one.at - start < MILLISECOND);
    assert!(two.at - start > MILLISECOND && two.at - start < MILLISECOND + Duration::from_micros(20));
}

// covers: sim-faults
#[test]
fn a_cable_that_works_one_way_keeps_its_links() {
    let mut network = segment(&ring(2));
    let cable = first_cable(&network);
    network.apply(Fault::OneWay { cable, direction: Direction::AToB, blocked: true });
    network.advance_by(SETTLE);
    assert_eq!(travel(&mut network, Main), None);
    assert_eq!(travel(&mut network, Redundant), journey(Main, &[], 0x08, false));
    network.apply(Fault::OneWay { cable, direction: Direction::AToB, blocked: false });
    assert_eq!(travel(&mut network, Main), journey(Redundant, &[1, 2], 0x02, false));
}

// covers: sim-faults
#[test]
fn a_device_without_power_breaks_the_ring_and_returns_after_a_reset() {
    let mut network = segment(&ring(3));
    let address = command(Command::Bwr, Target::Broadcast(map::STATION_ADDRESS), &[0x34, 0x12]);
    network.send(Main, &address);
    network.advance_by(SETTLE);
    assert!(network.receive(Redundant).is_some());
    network.apply(Fault::PowerOff(DeviceIndex(1)));
    network.advance_by(SETTLE);
    assert_eq!(travel(&mut network, Main), journey(Main, &[1], 0x02, false));
    assert_eq!(travel(&mut network, Redundant), journey(Redundant, &[3], 0x0A, true));
    network.apply(Fault::PowerOn(DeviceIndex(1)));
    network.advance_by(SETTLE);
    assert_eq!(travel(&mut network, Main), journey(Redundant, &[1, 2, 3], 0x02, false));
    let address = |device| network.device(DeviceIndex(device)).controller.register(map::STATION_ADDRESS, 2).to_vec();
    assert_eq!([0, 1, 2].map(address), [vec![0x34, 0x12], vec![0, 0], vec![0x34, 0x12]]);
}

#[test]
fn a_scheduled_fault_occurs_at_its_time() {
    let mut network = segment(&ring(2));
    let cable = network.host_cable(Main).unwrap();
    let at = network.now() + MILLISECOND;
    network.schedule(at, Fault::Cut(cable));
    network.schedule(at + MILLISECOND, Fault::Heal(cable));
    let delay = network.options().link_down_delay;
    let mut carriers = Vec::new();
    for time in [at, at + delay, at + MILLISECOND, at + MILLISECOND + delay] {
        network.advance(time);
        carriers.push(network.carrier(Main));
    }
    assert_eq!(carriers, [true, false, false, true]);
}

/// Requests a state of the first device and returns its later AL status and AL status code.
fn request(network: &mut Network, control: u16) -> (u16, u16) {
    let write = command(Command::Apwr, Target::Position(Position(0), map::AL_CONTROL), &control.to_le_bytes());
    network.send(Main, &write);
    network.advance_by(SETTLE);
    while network.receive(Main).is_some() {}
    al_status(network)
}

fn al_status(network: &Network) -> (u16, u16) {
    let word = |address: RegisterAddress| {
        let bytes = network.device(DeviceIndex(0)).controller.register(address, 2);
        u16::from_le_bytes([bytes[0], bytes[1]])
    };
    (word(map::AL_STATUS), word(map::AL_STATUS_CODE))
}

#[test]
fn a_refused_transition_has_the_chosen_code_for_the_chosen_number_of_times() {
    let mut network = segment("main-1.0");
    let code = AlStatusCode(0x8123);
    network.apply(Fault::RefuseTransition { device: DeviceIndex(0), to: AlState::PreOp, code, times: 1 });
    assert_eq!(request(&mut network, 0x02), (0x11, 0x8123));
    assert_eq!(request(&mut network, 0x11), (0x01, 0));
    assert_eq!(request(&mut network, 0x02), (0x02, 0));
}

#[test]
fn a_hung_application_answers_after_it_continues() {
    let mut network = segment("main-1.0");
    network.apply(Fault::Hang(DeviceIndex(0), true));
    assert_eq!(request(&mut network, 0x02), (0x01, 0));
    network.apply(Fault::Hang(DeviceIndex(0), false));
    network.advance_by(SETTLE);
    assert_eq!(al_status(&network), (0x02, 0));
}

// covers: sim-faults
#[test]
fn a_corrupted_eeprom_is_not_loaded_after_the_next_power_cycle() {
    let mut network = segment("main-1.0");
    let device = DeviceIndex(0);
    network.apply(Fault::CorruptSii { device, offset: 0, mask: 0x01 });
    assert!(network.device(device).controller.pdi_operational());
    network.power_off(device);
    network.advance_by(SETTLE);
    network.power_on(device);
    network.advance_by(SETTLE);
    assert!(!network.device(device).controller.pdi_operational());
    network.apply(Fault::CorruptSii { device, offset: 0, mask: 0x01 });
    network.power_off(device);
    network.power_on(device);
    network.advance_by(SETTLE);
    assert!(network.device(device).controller.pdi_operational());
}

#[test]
#[should_panic(expected = "no cable 7 among 3")]
fn a_fault_on_a_missing_cable_is_an_error() {
    segment(&ring(2)).apply(Fault::Cut(CableId(7)));
}
