//! Declarations of an application about its SubDevices: identity, PDOs, objects.

use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;

use ringcat::{
    Declaration, Direction, Event, MainDevice, Options, PdoEntry, PdoMapping, Scan, SubDeviceConfig, SubDeviceId,
    Watchdog, automatic,
};
use ringcat_engine::mail::coe::{SdoAddress, SdoError, read, write};
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::al::AlState;
use scenarios::check::troubles;
use scenarios::segments::{SIXTEEN, descriptions, line, ring, ring_of_16};
use scenarios::tap::Tap;
use scenarios::world::{CYCLE, World};

const FAST: Duration = Duration::from_micros(10);
const LIMITS: ringcat::Limits = ringcat::Limits::new(Duration::from_millis(100), Duration::from_secs(1));

fn declared(network: Network, change: impl Fn(usize, SubDeviceConfig) -> SubDeviceConfig) -> World {
    let declare = |scan: &Scan| -> Declaration {
        let mut declaration = automatic(&scan.subdevices, CYCLE);
        for (number, config) in declaration.subdevices.iter_mut().enumerate() {
            *config = change(number, config.clone());
        }
        declaration
    };
    World::with(0, network, &Options::default(), declare).unwrap_or_else(|error| panic!("{error}"))
}

fn refused(network: Network, change: impl Fn(usize, SubDeviceConfig) -> SubDeviceConfig) -> String {
    let declare = |scan: &Scan| -> Declaration {
        let mut declaration = automatic(&scan.subdevices, CYCLE);
        for (number, config) in declaration.subdevices.iter_mut().enumerate() {
            *config = change(number, config.clone());
        }
        declaration
    };
    match World::with(0, network, &Options::default(), declare) {
        Ok(_) => panic!("the declaration was taken"),
        Err(error) => error.to_string(),
    }
}

// covers: declaration
#[test]
fn the_expected_product_is_compared_and_a_mismatch_names_both() {
    let text = refused(ring_of_16(FAST), |number, config| match number {
        3 => config.expect_product(0x0C47, 0x1234_5678),
        _ => config,
    });
    assert!(text.contains("position 3: expected product code 0x12345678, got 0x0bf00004"), "{text}");
}

#[test]
fn two_swapped_subdevices_are_reported_by_the_first_wrong_place() {
    let mut kinds = SIXTEEN;
    kinds.swap(2, 6);
    let swapped = ring(descriptions(&kinds), NetworkOptions::default());
    let mut main_device = MainDevice::request(Tap::new(ring_of_16(FAST)), &Options::default());
    let intended = main_device.scan().expect("a scan").subdevices;
    let text = match World::with(1, swapped, &Options::default(), |_| automatic(&intended, CYCLE)) {
        Ok(_) => panic!("swapped SubDevices were taken"),
        Err(error) => error.to_string(),
    };
    assert!(text.contains("position 2: expected product code 0x07d80008, got 0x07d80010"), "{text}");
}

#[test]
fn a_wildcard_accepts_any_identity() {
    let mut world = declared(ring_of_16(FAST), |number, _| SubDeviceConfig::at_position(number as u16));
    world.settle();
}

// covers: declaration
#[test]
fn subdevices_are_found_by_alias_at_any_position() {
    let mut devices = descriptions(&SIXTEEN);
    devices[6].alias = 77;
    let declare = |scan: &Scan| {
        let mut declaration = automatic(&scan.subdevices, CYCLE);
        declaration.subdevices[2] = SubDeviceConfig::at_alias(77, 0).expect_product(0x0C47, 0x07D8_0010);
        declaration.subdevices[6] = SubDeviceConfig::at_position(2);
        // The SubDevice behind it.
        declaration.subdevices[7] = SubDeviceConfig::at_alias(77, 1).expect_product(0x0C47, 0x0FA0_0004);
        declaration
    };
    let network = ring(devices, NetworkOptions::default());
    let mut world = World::with(2, network, &Options::default(), declare).expect("activation");
    assert_eq!((world.device_of(2), world.device_of(6)), (Some(DeviceIndex(6)), Some(DeviceIndex(2))));
    world.settle();
    world.run_cycles(50);
    // It comes back as the same SubDevice.
    world.power_off(DeviceIndex(6));
    world.run_cycles(30);
    world.power_on(DeviceIndex(6));
    world.settle();
    world.run_cycles(20);
    assert_eq!(
        troubles(world.events(world.beginning())),
        [&Event::Lost { subdevice: SubDeviceId(2) }, &Event::Returned { subdevice: SubDeviceId(2) }]
    );
}

// covers: topology
#[test]
fn a_duplicate_alias_is_an_event_and_an_error_if_it_is_declared() {
    let mut devices = descriptions(&SIXTEEN);
    devices[3].alias = 99;
    devices[9].alias = 99;
    let network = || ring(devices.clone(), NetworkOptions::default());
    let mut world = declared(network(), |_, config| config);
    world.settle();
    let reports = |event: &Event| {
        matches!(event, Event::DuplicateAlias { alias: 99, first, second }
        if (first.0, second.0) == (3, 9))
    };
    assert!(world.saw(world.beginning(), reports));
    let text = refused(network(), |number, config| match number {
        3 => SubDeviceConfig::at_alias(99, 0),
        _ => config,
    });
    assert!(text.contains("alias 99 belongs to position 3 and to position 9"), "{text}");
}

// covers: declaration
#[test]
fn pdos_are_reassigned_if_the_subdevice_allows_it() {
    // The compact PDOs, without status.
    let compact = || (0..4).map(|channel| PdoMapping::from_sii(0x1A01 + 2 * channel)).collect();
    let mut world = declared(ring_of_16(FAST), |number, config| match number {
        3 => config.assign(3, Direction::Inputs, compact()),
        _ => config,
    });
    world.settle();
    world.run_cycles(100);
    assert_eq!(world.network().device(DeviceIndex(3)).inputs().len(), 8);
    assert_eq!(world.network().device(DeviceIndex(14)).inputs().len(), 16);
    let entry = world.application().entry(SubDeviceId(3), 0x6010, 0x11).expect("it is mapped");
    assert_eq!(entry.bit_length, 16);
    assert_eq!(world.application().entry(SubDeviceId(3), 0x6010, 1), None);
    assert_eq!(troubles(world.events(world.beginning())), Vec::<&Event>::new());
    let mark = world.mark();
    world.power_off(DeviceIndex(3));
    world.run_cycles(20);
    world.power_on(DeviceIndex(3));
    world.settle();
    assert_eq!(world.network().device(DeviceIndex(3)).inputs().len(), 8, "the assignment is back too");
    assert!(world.left_op(mark).iter().all(|device| device.0 == 3));
}

// covers: declaration
#[test]
fn pdos_are_remapped_if_the_subdevice_allows_it() {
    let outputs = || vec![PdoMapping::of(0x1600, [PdoEntry::new(0x60FF, 0, 32), PdoEntry::new(0x6040, 0, 16)])];
    let inputs = || vec![PdoMapping::of(0x1A00, [PdoEntry::new(0x6064, 0, 32)]), PdoMapping::from_sii(0x1A01)];
    let mut world = declared(ring_of_16(FAST), |number, config| match number {
        4 => config.assign(2, Direction::Outputs, outputs()).assign(3, Direction::Inputs, inputs()),
        _ => config,
    });
    world.settle();
    world.run_cycles(100);
    let servo = world.network().device(DeviceIndex(4));
    assert_eq!((servo.outputs().len(), servo.inputs().len()), (6, 6));
    assert_eq!(troubles(world.events(world.beginning())), Vec::<&Event>::new());
}

#[test]
fn a_terminal_that_copies_al_control_takes_outputs_without_a_watchdog_too() {
    let kinds = ["emulated-output-8", "emulated-input-8"];
    let mut world = declared(line(descriptions(&kinds), NetworkOptions::default()), |number, config| match number {
        0 => config.sync_manager(0, Direction::Outputs, Watchdog::Off),
        _ => config,
    });
    world.settle();
    world.run_cycles(200);
    assert_ne!(world.network().device(DeviceIndex(0)).outputs(), [0]);
}

// covers: declaration
#[test]
fn objects_are_downloaded_and_an_abort_is_reported_with_its_text() {
    let mut world = declared(ring_of_16(FAST), |number, config| match number {
        3 => config.sdo(0x8000, 2, 123_456u32.to_le_bytes()).sdo(0x8010, 3, *b"another 16 bytes"),
        14 => config.sdo(0x9999, 0, [1]),
        _ => config,
    });
    world.run_cycles(300);
    let dictionary = world.network().device(DeviceIndex(3)).application.dictionary();
    assert_eq!(dictionary.read(0x8000, 2), Ok(123_456u32.to_le_bytes().as_slice()));
    assert_eq!(dictionary.read(0x8010, 3), Ok(b"another 16 bytes".as_slice()));
    let aborted = |event: &Event| {
        matches!(event, Event::ConfigurationFailed { subdevice: SubDeviceId(14), reason }
            if reason.contains("SDO 0x9999:00: aborted by the SubDevice: 0x06020000"))
    };
    assert!(world.saw(world.beginning(), aborted), "the abort is named with object and code");
    let others = world.network().devices().enumerate().filter(|(number, _)| *number != 14);
    assert!(others.into_iter().all(|(_, device)| device.al_status().al_state() == Some(AlState::Op)));
}

#[test]
fn a_download_too_long_for_the_object_is_reported_and_retried() {
    let mut world = declared(ring_of_16(FAST), |number, config| match number {
        3 => config.sdo(0x8000, 3, vec![0x55; 500]),
        _ => config,
    });
    world.run_cycles(300);
    let reports = |event: &Event| {
        matches!(event, Event::ConfigurationFailed { subdevice: SubDeviceId(3), reason }
            if reason.contains("SDO 0x8000:03: aborted by the SubDevice"))
    };
    assert!(world.saw(world.beginning(), reports));
}

type Outcome = Rc<RefCell<Vec<Result<Vec<u8>, SdoError>>>>;

// covers: declaration, sdo
#[test]
fn objects_are_uploaded_and_downloaded_in_op_beside_process_data() {
    let mut world = World::in_op(3, ring_of_16(FAST));
    let mark = world.mark();
    let outcome = Outcome::default();
    let object = SdoAddress::new;
    let mailbox = world.application().engine().mailbox(SubDeviceId(3)).expect("it is declared");
    let results = outcome.clone();
    world.application_mut().engine_mut().spawn(async move {
        for address in [object(0x1018, 1), object(0x8000, 3), object(0x8000, 1), object(0x7777, 0)] {
            let result = read(&mailbox, address, LIMITS, 100).await;
            results.borrow_mut().push(result);
        }
        let result = write(&mailbox, object(0x8000, 1), &[0x34, 0x12], LIMITS).await;
        results.borrow_mut().push(result.map(|()| Vec::new()));
        let result = read(&mailbox, object(0x8000, 1), LIMITS, 100).await;
        results.borrow_mut().push(result);
        // This may be written only in PREOP.
        let result = write(&mailbox, object(0x8000, 2), &[1, 0, 0, 0], LIMITS).await;
        results.borrow_mut().push(result.map(|()| Vec::new()));
    });
    world.run_cycles(100);
    let results = outcome.borrow();
    assert_eq!(results[0], Ok(0x0C47u32.to_le_bytes().to_vec()));
    assert_eq!(results[1], Ok(b"channel text 16b".to_vec()));
    assert_eq!(results[2], Ok(vec![0, 0]));
    let text = results[3].clone().expect_err("there is no such object").to_string();
    assert!(text.starts_with("SDO 0x7777:00: aborted by the SubDevice: 0x06020000"), "{text}");
    assert_eq!((&results[4], &results[5]), (&Ok(Vec::new()), &Ok(vec![0x34, 0x12])));
    let text = results[6].clone().expect_err("it is write-protected now").to_string();
    assert!(text.contains("aborted by the SubDevice: 0x08000022"), "{text}");
    assert_eq!((world.incomplete(mark), world.left_op(mark)), (0, Vec::new()));
}

#[test]
fn all_types_of_controllers_are_read_with_the_same_result() {
    let scans: Vec<_> = [(true, true, true), (false, true, false), (true, false, true), (false, false, false)]
        .into_iter()
        .map(|(eight_byte_sii, wide, sii_cache)| {
            let mut devices = descriptions(&SIXTEEN);
            for device in &mut devices {
                // Devices of one type have the same strings in their SII; the cache relies on it.
                device.name = device.order_code.clone();
                device.eight_byte_sii = eight_byte_sii;
                if let Some(dc) = &mut device.dc {
                    dc.wide = wide;
                }
            }
            let network = ring(devices, NetworkOptions::default());
            let options = Options::default().with_sii_cache(sii_cache);
            let mut world =
                World::with(4, network, &options, |scan| automatic(&scan.subdevices, CYCLE)).expect("activation");
            world.settle();
            world.run_cycles(20);
            world.scan.clone()
        })
        .collect();
    for scan in &scans {
        assert_eq!(scan.topology, scans[0].topology);
        for (one, other) in scan.subdevices.iter().zip(&scans[0].subdevices) {
            assert_eq!((one.identity, &one.name, &one.pdos), (other.identity, &other.name, &other.pdos));
            assert_eq!((&one.sync_managers, &one.fmmu_usages), (&other.sync_managers, &other.fmmu_usages));
            assert_eq!((&one.mailbox, &one.dc_modes), (&other.mailbox, &other.dc_modes));
        }
    }
}
