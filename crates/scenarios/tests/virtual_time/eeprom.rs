//! The EEPROM is assigned to the PDI for the transition to PREOP, and returned to EtherCAT after every result of it
//! (protocol 3.8, 5.6).

use std::time::Duration;

use ringcat::simulated::SimulatedSegment;
use ringcat::{MainDevice, Options, SiiAssignment, SubDeviceConfig, automatic};
use ringcat_engine::main_device::SubDeviceState;
use ringcat_sim::cable::{CableId, DeviceIndex, Direction, HostLink};
use ringcat_sim::fault::Fault;
use ringcat_sim::network::NetworkOptions;
use ringcat_sim::time::SimTime;
use ringcat_wire::al::{AlState, AlStatusCode};
use ringcat_wire::register::map;
use scenarios::segments::{descriptions, ring};
use scenarios::world::{CYCLE, World};

const DEVICE: DeviceIndex = DeviceIndex(1);

fn world(target: AlState, prepare: impl FnOnce(&mut ringcat_sim::network::Network)) -> World {
    let kinds = ["coupler", "analog-input-4", "digital-input-8"];
    let mut network = ring(descriptions(&kinds), NetworkOptions::default());
    prepare(&mut network);
    let mut world = World::with(1, network, &Options::default(), |scan| {
        let mut declaration = automatic(&scan.subdevices, CYCLE);
        declaration.subdevices[DEVICE.0].target = target;
        declaration
    })
    .expect("scan and activation");
    world.evaluate_latched(false);
    world
}

fn world_with(options: &Options, change: impl Fn(SubDeviceConfig) -> SubDeviceConfig) -> World {
    let network = ring(descriptions(&["coupler", "analog-input-4"]), NetworkOptions::default());
    World::with(1, network, options, |scan| {
        let mut declaration = automatic(&scan.subdevices, CYCLE);
        let declared = &mut declaration.subdevices[DEVICE.0];
        *declared = change(declared.clone());
        declaration
    })
    .expect("scan and activation")
}

fn belongs_to_pdi(world: &World) -> bool {
    world.network().device(DEVICE).controller.register(map::SII_CONFIGURATION, 1) != [0]
}

#[test]
fn a_refused_preop_gives_the_eeprom_back() {
    let mut world = world(AlState::Op, |network| {
        let code = AlStatusCode::INVALID_MAILBOX_CONFIGURATION_PREOP;
        network.apply(Fault::RefuseTransition { device: DEVICE, to: AlState::PreOp, code, times: 1_000 });
    });
    world.run_cycles(90);
    assert_ne!(world.application().states()[DEVICE.0], SubDeviceState::Settled(AlState::Op));
    assert!(!belongs_to_pdi(&world), "between two attempts");
}

#[test]
fn a_subdevice_lost_on_the_way_to_preop_gives_the_eeprom_back_on_return() {
    let mut world = world(AlState::PreOp, |_| ());
    world.until(Duration::from_secs(1), "the PDI has the EEPROM", belongs_to_pdi);
    for cable in [1, 2] {
        world.cut(CableId(cable));
    }
    world.run_cycles(200);
    assert!(belongs_to_pdi(&world), "the attempt was cancelled");
    for cable in [1, 2] {
        world.heal(CableId(cable));
    }
    let settled = SubDeviceState::Settled(AlState::PreOp);
    world.until(Duration::from_secs(1), "back", |world| world.application().states()[DEVICE.0] == settled);
    assert!(!belongs_to_pdi(&world));
}

#[test]
fn a_late_response_to_a_read_command_does_not_end_the_scan() {
    // Delayed beyond the frame timeout, while the EEPROM is busy even longer.
    let moments = (15_000..45_000).step_by(1_000).flat_map(|at| [(at, Direction::AToB), (at, Direction::BToA)]);
    for (at_us, direction) in moments {
        let text = "[[device]]\ntype = \"digital-output-8\"\nsii_busy_us = 8000\n";
        let mut links = SimulatedSegment::from_toml(text).expect("the segment is right");
        let cable = links.network().host_cable(HostLink::Main).expect("there is one");
        let late = Fault::Delay { cable, direction: Some(direction), count: 2, by: Duration::from_millis(3) };
        links.network_mut().schedule(SimTime(at_us * 1_000), late);
        let mut main_device = MainDevice::request(links, &Options::default());
        let scan = main_device.scan().unwrap_or_else(|error| panic!("delayed at {at_us} us: {error}"));
        assert_eq!(scan.subdevices.len(), 1);
    }
}

// covers: 5.2, eeprom
#[test]
fn the_eeprom_is_not_lent_where_it_belongs_to_ethercat() {
    let mut always = world_with(&Options::default(), |config| config);
    always.until(Duration::from_secs(1), "the PDI has the EEPROM", belongs_to_pdi);
    let never = Options::default().with_sii_assignment(SiiAssignment::Never);
    let settled = |world: &World| world.application().states()[DEVICE.0] == SubDeviceState::Settled(AlState::Op);
    let mut world = world_with(&never, |config| config);
    world.until(Duration::from_secs(1), "in OP", |world| {
        assert!(!belongs_to_pdi(world), "on the way to OP");
        settled(world)
    });
    // A declaration that gives it away is followed.
    let mut kept = world_with(&never, SubDeviceConfig::sii_to_pdi);
    kept.until(Duration::from_secs(1), "in OP", settled);
    assert!(belongs_to_pdi(&kept));
}
