//! Start-up commands: objects and IDNs at each transition, in the declared order, the same at each re-entry; pauses,
//! and EEPROMs for the PDI.

use std::time::Duration;

use ringcat::{Event, Options, Scan, SubDeviceConfig, SubDeviceId, Transition, automatic};
use ringcat_sim::application::ServedMail;
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::description::DeviceDescription;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::al::{AlState, AlStatusCode};
use ringcat_wire::mailbox::Protocol;
use ringcat_wire::mailbox::sdo::SdoRequest;
use ringcat_wire::mailbox::soe::{Idn, SoeMessage};
use ringcat_wire::register::map;
use scenarios::check::troubles;
use scenarios::segments::{descriptions, line};
use scenarios::world::{CYCLE, World};

const KINDS: [&str; 4] = ["coupler", "digital-output-8", "all-protocols", "digital-input-8"];
/// The SubDevice with a mailbox.
const DRIVE: usize = 2;

fn segment(change: impl FnOnce(&mut DeviceDescription)) -> Network {
    let mut devices = descriptions(&KINDS);
    change(&mut devices[DRIVE]);
    line(devices, NetworkOptions::default())
}

fn world(network: Network, change: impl Fn(SubDeviceConfig) -> SubDeviceConfig) -> World {
    let declare = |scan: &Scan| {
        let mut declaration = automatic(&scan.subdevices, CYCLE);
        declaration.subdevices[DRIVE] = change(declaration.subdevices[DRIVE].clone());
        declaration
    };
    let mut world = World::with(1, network, &Options::default(), declare).expect("scan and activation");
    world.network_mut().device_mut(DeviceIndex(DRIVE)).application.record_mail();
    world
}

/// Writes that the device received, without reads: object or IDN, value, state.
fn written(world: &World) -> Vec<(AlState, String, Vec<u8>)> {
    let reports = |mail: &ServedMail| match mail.protocol {
        Protocol::Coe => match SdoRequest::decode(&mail.payload).ok()? {
            SdoRequest::DownloadExpedited { index, sub_index, complete_access, data }
            | SdoRequest::DownloadNormal { index, sub_index, complete_access, data, .. } => {
                let whole = if complete_access { " whole" } else { "" };
                Some((mail.state, format!("{index:#06x}:{sub_index}{whole}"), data.to_vec()))
            }
            _ => None,
        },
        Protocol::Soe => {
            let message = SoeMessage::decode(&mail.payload).ok()?;
            Some((mail.state, format!("{} of {}", Idn(message.number), message.drive), message.data.to_vec()))
        }
        _ => None,
    };
    let device = world.network().device(DeviceIndex(DRIVE));
    device.application.served_mail().iter().filter_map(reports).collect()
}

/// Commands of every kind at every transition, not declared in the order of the transitions.
fn many(config: SubDeviceConfig) -> SubDeviceConfig {
    let mut config = config
        .sdo_at(Transition::So, 0x2001, 9, [9, 0])
        .idn_at(Transition::So, 1, Idn::standard(0, 36), 100i32.to_le_bytes())
        .sdo(0x2001, 1, [1, 1])
        .idn_at(Transition::Ps, 0, Idn::standard(0, 1), 500u16.to_le_bytes())
        .sdo(0x2001, 2, [2, 2])
        .sdo_complete(0x2003, 1, [7, 0, 0x10, 0x27, 0, 0, 1, 2, 3, 4])
        .sdo_at(Transition::Ip, 0x2001, 3, [3, 3]);
    for sub_index in 10..100 {
        config = config.sdo(0x2001, sub_index, [sub_index, 0x55]);
    }
    config.sdo(0x2004, 0, vec![b'x'; 64])
}

fn expected() -> Vec<(AlState, String, Vec<u8>)> {
    let object = |state, name: &str, data: &[u8]| (state, name.to_owned(), data.to_vec());
    let mut all = vec![
        object(AlState::PreOp, "0x2001:3", &[3, 3]),
        object(AlState::PreOp, "0x2001:1", &[1, 1]),
        object(AlState::PreOp, "S-0-0001 of 0", &[0xF4, 0x01]),
        object(AlState::PreOp, "0x2001:2", &[2, 2]),
        object(AlState::PreOp, "0x2003:1 whole", &[7, 0, 0x10, 0x27, 0, 0, 1, 2, 3, 4]),
    ];
    all.extend((10..100).map(|sub_index| object(AlState::PreOp, &format!("0x2001:{sub_index}"), &[sub_index, 0x55])));
    all.push(object(AlState::PreOp, "0x2004:0", &[b'x'; 64]));
    all.push(object(AlState::SafeOp, "0x2001:9", &[9, 0]));
    all.push(object(AlState::SafeOp, "S-0-0036 of 1", &[100, 0, 0, 0]));
    all
}

// covers: 5.2, startup-commands
#[test]
fn objects_and_idns_are_written_at_their_transitions_in_the_declared_order() {
    let mut world = world(segment(|_| ()), many);
    world.settle();
    assert_eq!(written(&world), expected());
    let device = world.network().device(DeviceIndex(DRIVE));
    let idn = |drive, number| {
        let server = device.application.servers().soe().expect("it supports SoE");
        server.idn(drive, Idn::standard(0, number)).expect("it is there").value.clone()
    };
    assert_eq!((idn(0, 1), idn(1, 36)), (vec![0xF4, 0x01], vec![100, 0, 0, 0]));
    assert_eq!(troubles(world.events(world.beginning())), Vec::<&Event>::new());
}

// covers: startup-commands
#[test]
fn a_hundred_power_cycles_write_the_same_list_in_the_same_order_each_time() {
    let mut world = world(segment(|_| ()), many);
    world.settle();
    let mark = world.mark();
    for round in 0..100 {
        let device = DeviceIndex(DRIVE);
        world.network_mut().device_mut(device).application.record_mail();
        world.power_off(device);
        world.run_cycles(5 + round % 7);
        world.power_on(device);
        world.settle();
        assert_eq!(written(&world), expected(), "power cycle {round}");
    }
    let others = world.left_op(mark).into_iter().filter(|device| device.0 < DRIVE);
    assert_eq!(others.count(), 0, "those before it stay in OP");
}

// covers: startup-commands
#[test]
fn a_subdevice_that_loses_op_gets_the_commands_of_the_way_back() {
    let mut world = world(segment(|_| ()), many);
    world.settle();
    world.network_mut().device_mut(DeviceIndex(DRIVE)).application.record_mail();
    // Its watchdog expires.
    world.stall(Duration::from_millis(150));
    world.run_cycles(5);
    world.settle();
    assert_eq!(written(&world), expected()[expected().len() - 2..]);
}

// covers: 6.6, startup-commands
#[test]
fn a_refused_idn_is_reported_with_its_number_and_code() {
    let mut world = world(segment(|_| ()), |config| {
        config.sdo(0x2001, 1, [1, 1]).idn_at(Transition::So, 0, Idn::standard(0, 1), [0xF4, 1])
    });
    world.run_cycles(300);
    let reports = |event: &Event| {
        matches!(event, Event::ConfigurationFailed { subdevice: SubDeviceId(DRIVE), reason }
            if reason.starts_with("start-up command 1 (SAFEOP to OP): SoE drive 0 S-0-0001 elements 0x40: refused by \
                the drive"))
    };
    assert!(world.saw(world.beginning(), reports), "{:?}", troubles(world.events(world.beginning())));
    let others = world.network().devices().enumerate().filter(|(number, _)| *number != DRIVE);
    assert!(others.into_iter().all(|(_, device)| device.al_status().al_state() == Some(AlState::Op)));
}

// covers: watchdogs
#[test]
fn a_declared_pause_before_safeop_is_kept() {
    let network = || segment(|device| device.preop_settling = Duration::from_millis(60));
    let mut hasty = world(network(), |config| config);
    hasty.run_cycles(1000);
    let refused = |event: &Event| {
        matches!(event, Event::StateError { subdevice: SubDeviceId(DRIVE), requested: Some(AlState::SafeOp), code, .. }
            if *code == AlStatusCode::EXTERNAL_HARDWARE_NOT_READY)
    };
    assert!(hasty.saw(hasty.beginning(), refused) && !hasty.application().all_settled());
    let mut patient = world(network(), |config| config.wait_before_safeop(Duration::from_millis(60)));
    patient.settle();
    assert_eq!(troubles(patient.events(patient.beginning())), Vec::<&Event>::new());
}

// covers: 5.2, watchdogs
#[test]
fn the_eeprom_is_left_to_the_pdi_if_declared() {
    let owner = |world: &World| {
        let controller = &world.network().device(DeviceIndex(DRIVE)).controller;
        controller.register(map::SII_CONFIGURATION, 1)[0] & 1
    };
    let mut kept = world(segment(|_| ()), |config| config);
    kept.settle();
    assert_eq!(owner(&kept), 0);
    let mut left = world(segment(|_| ()), SubDeviceConfig::sii_to_pdi);
    left.settle();
    assert_eq!(owner(&left), 1);
    left.power_off(DeviceIndex(DRIVE));
    left.run_cycles(10);
    left.power_on(DeviceIndex(DRIVE));
    left.settle();
    assert_eq!(owner(&left), 1, "again on every re-entry");
}

// covers: 3.7, watchdogs
#[test]
fn watchdogs_are_written_before_safeop() {
    let mut world = world(segment(|_| ()), |config| config.watchdog(Some(0x1000), Some(700)).pdi_watchdog(900));
    world.settle();
    let controller = &world.network().device(DeviceIndex(DRIVE)).controller;
    let word = |register| *controller.register(register, 2).first_chunk().expect("two bytes");
    assert_eq!(u16::from_le_bytes(word(map::WATCHDOG_DIVIDER)), 0x1000);
    assert_eq!(u16::from_le_bytes(word(map::WATCHDOG_TIME_PDI)), 900);
    assert_eq!(u16::from_le_bytes(word(map::WATCHDOG_TIME_PROCESS_DATA)), 700);
}

// covers: 5.4, watchdogs
#[test]
fn a_state_change_may_have_its_own_time_limit() {
    let slow = |device: &mut DeviceDescription| device.transitions.to_safeop = Duration::from_millis(80);
    let limit = Duration::from_millis(30);
    let mut world = world(segment(slow), |config| config.state_timeout(AlState::PreOp, AlState::SafeOp, limit));
    world.run_cycles(300);
    let named = |event: &Event| {
        matches!(event, Event::ConfigurationFailed { subdevice: SubDeviceId(DRIVE), reason }
            if reason.contains("expected SAFEOP within 30 ms"))
    };
    assert!(world.saw(world.beginning(), named), "{:?}", troubles(world.events(world.beginning())));
}
