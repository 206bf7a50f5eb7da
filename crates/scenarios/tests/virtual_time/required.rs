//! SubDevices that are mandatory for an activation, that may be missing or differ, and the reports about them.

use std::time::Duration;

use ringcat::{
    Declaration, Event, IdentityField, Options, Required, Scan, SubDeviceConfig, SubDeviceId, SubDeviceState, automatic,
};
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::description::DeviceDescription;
use ringcat_sim::network::NetworkOptions;
use ringcat_wire::al::{AlState, AlStatus};
use ringcat_wire::register::map;
use scenarios::segments::{descriptions, line};
use scenarios::world::{CYCLE, World};

const KINDS: [&str; 4] = ["coupler", "digital-output-8", "servo", "digital-input-8"];
const LIMIT: Duration = Duration::from_secs(5);

fn activate(
    change: impl FnOnce(&mut Vec<DeviceDescription>),
    declare: impl Fn(&mut Declaration),
) -> Result<World, ringcat::Error> {
    let mut devices = descriptions(&KINDS);
    change(&mut devices);
    let declaring = |scan: &Scan| {
        let mut declaration = automatic(&scan.subdevices, CYCLE);
        declare(&mut declaration);
        declaration
    };
    World::with(1, line(devices, NetworkOptions::default()), &Options::default(), declaring)
}

fn states(world: &World) -> Vec<AlStatus> {
    world.network().devices().map(|device| device.al_status()).collect()
}

// covers: mandatory
#[test]
fn a_mismatch_is_reported_with_both_values_and_not_configured() {
    let op = AlStatus::new(AlState::Op);
    type Change = fn(SubDeviceConfig) -> SubDeviceConfig;
    let cases: [(Change, IdentityField, u32); 4] = [
        (|config| config.expect_product(0x9999, 1), IdentityField::VendorId, 0x9999),
        (|config| config.expect_revision(0x77), IdentityField::Revision, 0x77),
        (|config| config.expect_revision_from(u32::MAX), IdentityField::MinimumRevision, u32::MAX),
        (|config| config.expect_identification(12), IdentityField::Identification, 12),
    ];
    for (change, wanted, value) in cases {
        let mut world = activate(
            |_| (),
            |declaration| {
                declaration.subdevices[2] = change(declaration.subdevices[2].clone());
                declaration.required = Required::Nothing;
            },
        )
        .expect("activation");
        world.run_cycles(200);
        let reports = |event: &Event| match event {
            Event::Mismatch { subdevice: SubDeviceId(2), position, field, expected, .. } => {
                (position.0, *field, *expected) == (2, wanted, value)
            }
            _ => false,
        };
        assert!(world.saw(world.beginning(), reports), "{wanted}");
        assert_eq!(states(&world), [op, op, AlStatus::new(AlState::Init), op], "{wanted}");
        assert_eq!(world.application().states()[2], SubDeviceState::Absent);
        assert!(!world.application().mandatory_settled());
    }
}

// covers: 5.3, mandatory
#[test]
fn a_right_identification_is_no_mismatch() {
    let declare = |declaration: &mut Declaration| {
        declaration.subdevices[2] = declaration.subdevices[2].clone().expect_identification(0x1234);
    };
    let mut world = activate(|devices| devices[2].identification = Some(0x1234), declare).expect("activation");
    world.settle();
    assert_eq!(world.scan.subdevices[2].identification, Some(0x1234));
    assert_eq!(world.scan.subdevices[1].identification, None);
    let error = activate(|devices| devices[2].identification = Some(0x1235), declare).expect_err("another one");
    assert!(error.to_string().contains("position 2: expected identification 0x00001234, got 0x00001235"), "{error}");
}

// covers: 4.3, mandatory
#[test]
fn an_identification_in_memory_is_read_there() {
    // The register of the alias, which some devices set by switches.
    let change = |devices: &mut Vec<DeviceDescription>| {
        devices[1].id_switch_address = Some(map::STATION_ALIAS.0);
        devices[1].alias = 77;
        // There is no such memory.
        devices[3].id_switch_address = Some(0xFFF0);
    };
    let declare = |declaration: &mut Declaration| {
        declaration.subdevices[1] = SubDeviceConfig::at_identification(77);
    };
    let mut world = activate(change, declare).expect("activation");
    world.settle();
    let identifications: Vec<_> = world.scan.subdevices.iter().map(|info| info.identification).collect();
    assert_eq!(identifications, [None, Some(77), Some(0), None]);
}

// covers: mandatory
#[test]
fn all_subdevices_may_be_required_including_optional_ones() {
    let with = |required| {
        activate(
            |devices| drop(devices.pop()),
            move |declaration| {
                declaration.subdevices.push(SubDeviceConfig::at_position(3).optional());
                declaration.required = required;
            },
        )
    };
    let error = with(Required::All).expect_err("one is missing");
    assert!(error.to_string().contains("no SubDevice at position 3; 3 are present"), "{error}");
    let mut world = with(Required::Mandatory).expect("activation");
    world.until(LIMIT, "settled", |world| world.application().mandatory_settled());
    assert!(
        world.saw(world.beginning(), |event| *event == Event::Missing { subdevice: SubDeviceId(3), optional: true })
    );
}

// covers: mandatory
#[test]
fn a_missing_mandatory_subdevice_is_reported_and_may_join_later() {
    let declare = |declaration: &mut Declaration| declaration.required = Required::Nothing;
    let mut devices = descriptions(&KINDS);
    for device in &mut devices {
        device.alias = 0;
    }
    let mut network = line(devices, NetworkOptions::default());
    let infos = {
        let tap = scenarios::tap::Tap::new(line(descriptions(&KINDS), NetworkOptions::default()));
        ringcat::MainDevice::request(tap, &Options::default()).scan().expect("a scan").subdevices
    };
    network.power_off(DeviceIndex(3));
    let declaring = |_: &Scan| {
        let mut declaration = automatic(&infos, CYCLE);
        declaration.subdevices[3] = declaration.subdevices[3].clone().pdos_of(&infos[3]);
        declare(&mut declaration);
        declaration
    };
    let mut world = World::with(2, network, &Options::default(), declaring).expect("activation");
    world.run_cycles(100);
    assert!(
        world.saw(world.beginning(), |event| *event == Event::Missing { subdevice: SubDeviceId(3), optional: false })
    );
    assert!(
        world
            .evaluated(world.beginning())
            .iter()
            .all(|evaluated| evaluated.status.state != ringcat::DomainState::Complete)
    );
    world.power_on(DeviceIndex(3));
    world.settle();
    assert!(world.all_in_op());
}
