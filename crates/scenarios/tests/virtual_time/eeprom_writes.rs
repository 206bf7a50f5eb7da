//! EEPROMs are written word by word, read back, with every failure named; aliases; loading again (protocol 3.8, 4).

use std::time::Duration;

use ringcat::simulated::SimulatedSegment;
use ringcat::{AliasSource, Error, MainDevice, Options, ServiceError, SubDeviceConfig, SubDeviceId, automatic};
use ringcat_engine::{SiiProgramError, SiiWritten};
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::fault::{Fault, SpoiltWrite};
use ringcat_sim::network::NetworkOptions;
use ringcat_wire::address::Position;
use ringcat_wire::register::map;
use ringcat_wire::sii::{SiiError, checksum};
use scenarios::segments::{descriptions, line};
use scenarios::world::{CYCLE, World};

const KINDS: [&str; 3] = ["coupler", "digital-input-8", "analog-input-4"];
const DEVICE: DeviceIndex = DeviceIndex(2);
const LIMIT: Duration = Duration::from_secs(20);

fn world(seed: u64) -> World {
    World::in_op(seed, line(descriptions(&KINDS), NetworkOptions::default()))
}

fn image(world: &World) -> Vec<u8> {
    world.network().device(DEVICE).controller.sii_image().to_vec()
}

fn write(world: &mut World, image: &[u8], force: bool) -> Result<SiiWritten, SiiProgramError> {
    let work = world.application_mut().engine_mut().start_sii_write(SubDeviceId(DEVICE.0), image.to_vec(), force);
    world.finish(LIMIT, work).map_err(sii)
}

fn sii(error: ServiceError) -> SiiProgramError {
    match error {
        ServiceError::Sii(error) => error,
        other => panic!("{other}"),
    }
}

// covers: eeprom
#[test]
fn an_eeprom_image_is_written_beside_process_data_and_verified() {
    let mut world = world(1);
    let mark = world.mark();
    let mut new = image(&world);
    let read = world.application_mut().engine_mut().start_sii_read(SubDeviceId(DEVICE.0));
    assert_eq!(world.finish(LIMIT, read), Ok(new.clone()));
    let words = new.len() / 2;
    assert_eq!(write(&mut world, &new, false), Ok(SiiWritten::new(0, words)));
    // The serial number, and a word of a category.
    new[0x1C..0x20].copy_from_slice(&0x1234_5678u32.to_le_bytes());
    new[0x90] ^= 0x20;
    let result = write(&mut world, &new, false);
    assert_eq!(result, Ok(SiiWritten::new(3, words - 3)));
    assert_eq!(image(&world), new);
    assert_eq!((world.incomplete(mark), world.left_op(mark)), (0, Vec::new()));
}

// covers: eeprom
#[test]
fn an_invalid_eeprom_image_is_refused_unless_forced() {
    let mut world = world(2);
    let before = image(&world);
    let mut wrong = before.clone();
    wrong[4] ^= 1;
    assert!(matches!(write(&mut world, &wrong, false), Err(SiiProgramError::Image(SiiError::Checksum { .. }))));
    assert!(matches!(write(&mut world, &before[..100], false), Err(SiiProgramError::Image(SiiError::Short { .. }))));
    let mut endless = before.clone();
    endless.truncate(0x80);
    assert_eq!(write(&mut world, &endless, false), Err(SiiProgramError::EndMarker));
    assert_eq!(write(&mut world, &before[..101], true), Err(SiiProgramError::Length { bytes: 101 }));
    assert_eq!(write(&mut world, &[], true), Err(SiiProgramError::Length { bytes: 0 }));
    assert_eq!(write(&mut world, &vec![0; 1 << 17], true), Err(SiiProgramError::Length { bytes: 1 << 17 }));
    assert_eq!(image(&world), before, "nothing was written");
    assert_eq!(write(&mut world, &wrong, true).map(|done| done.written), Ok(1));
    assert_eq!(image(&world), wrong);
    // The controller refuses to load this, and reports the reason.
    let reload = world.application_mut().engine_mut().start_sii_reload(SubDeviceId(DEVICE.0));
    let error = sii(world.finish(LIMIT, reload).expect_err("the checksum is wrong"));
    assert!(matches!(error, SiiProgramError::NotLoaded { .. }), "{error}");
    assert!(error.to_string().contains("checksum"), "{error}");
    assert!(write(&mut world, &before, false).is_ok());
    let reload = world.application_mut().engine_mut().start_sii_reload(SubDeviceId(DEVICE.0));
    assert_eq!(world.finish(LIMIT, reload), Ok(()));
}

// covers: eeprom
#[test]
fn the_image_of_another_device_is_refused_unless_forced_or_the_eeprom_is_erased() {
    let mut world = world(3);
    let before = image(&world);
    let changed = |at: usize, value: &[u8]| {
        let mut other = before.clone();
        other[at..at + value.len()].copy_from_slice(value);
        other[14] = checksum(other.first_chunk().expect("it is long"));
        other
    };
    let refused = |world: &mut World, image: &[u8]| write(world, image, false).expect_err("of another device");
    let error = refused(&mut world, &changed(0x14, &[0xEF, 0xBE]));
    assert!(matches!(error, SiiProgramError::OtherProduct { present: [_, here], image: [_, there] } if here != there));
    let unnamed = changed(0x10, &[0xFF; 8]);
    assert!(matches!(refused(&mut world, &unnamed), SiiProgramError::OtherProduct { image: [u32::MAX, u32::MAX], .. }));
    let pdi = changed(0, &[before[0] ^ 0x0D]);
    assert!(matches!(refused(&mut world, &pdi), SiiProgramError::OtherPdi { .. }));
    let size = changed(0x7C, &[0xFF, 0xFF]);
    assert!(matches!(refused(&mut world, &size), SiiProgramError::OtherSize { image: 0x1_0000, .. }));
    assert_eq!(image(&world), before, "nothing was written");
    // What an erased EEPROM contains says nothing about the device.
    assert!(write(&mut world, &unnamed, true).is_ok());
    assert!(write(&mut world, &pdi, false).is_ok());
    assert_eq!(image(&world), pdi);
}

// covers: eeprom
#[test]
fn an_image_longer_than_the_eeprom_is_refused_before_a_word_is_written() {
    let mut world = world(7);
    let before = image(&world);
    let there = before.len() / 2;
    let mut longer = before.clone();
    longer[0x90] ^= 0x20;
    longer.extend([0x34, 0x12]);
    let too_long = SiiProgramError::TooLong { words: there + 1, there };
    assert_eq!(write(&mut world, &longer, false), Err(too_long));
    assert_eq!(image(&world), before, "nothing was written");
    assert_eq!(
        too_long.to_string(),
        format!("SII: the image has {} words, the EEPROM says in word 0x3e that it has {there}", there + 1)
    );
    // With force it is tried: what the EEPROM has, is written, and where it ends, is reported.
    let forced = write(&mut world, &longer, true);
    assert!(matches!(forced, Err(SiiProgramError::Command { word, .. }) if word as usize == there), "{forced:?}");
    assert_eq!(image(&world)[0x90], longer[0x90]);
}

// covers: eeprom
#[test]
fn a_slow_busy_or_protected_eeprom_is_waited_for_or_reported() {
    let mut world = world(3);
    let mut new = image(&world);
    let word = new.len() / 2 - 1;
    let mut change = |byte: u8| {
        new[2 * word] = byte;
        new.clone()
    };
    let spoil = |how, times| Fault::SpoilSiiWrites { device: DEVICE, how, times };
    world.fault(spoil(SpoiltWrite::NotAcknowledged, 2));
    assert_eq!(write(&mut world, &change(1), false).map(|done| done.written), Ok(1));
    world.fault(spoil(SpoiltWrite::NotAcknowledged, 100));
    let error = write(&mut world, &change(2), false).expect_err("it never acknowledges");
    assert!(matches!(error, SiiProgramError::Command { .. }), "{error}");
    world.fault(spoil(SpoiltWrite::NotStored, 1));
    assert_eq!(write(&mut world, &change(3), false).map(|done| done.written), Ok(1));
    world.fault(spoil(SpoiltWrite::NotStored, 100));
    let error = write(&mut world, &change(4), false).expect_err("it is protected");
    let is_last = |error: &SiiProgramError| match *error {
        SiiProgramError::Mismatch { word: at, .. } => at as usize == word,
        _ => false,
    };
    assert!(is_last(&error), "{error}");
    world.fault(spoil(SpoiltWrite::NotStored, 0));
    world.fault(Fault::SlowSii { device: DEVICE, busy: Duration::from_millis(20), times: 30 });
    assert_eq!(write(&mut world, &change(5), false).map(|done| done.written), Ok(1));
    world.fault(Fault::SlowSii { device: DEVICE, busy: Duration::from_millis(500), times: 1 });
    let error = write(&mut world, &change(6), false).expect_err("it is busy for too long");
    assert!(matches!(error, SiiProgramError::Busy { .. } | SiiProgramError::Read(_)), "{error}");
}

// covers: 4.7, eeprom
#[test]
fn a_written_alias_has_a_checksum_and_is_used_after_a_restart() {
    let mut world = world(4);
    let alias = |world: &mut World, force| {
        let work = world.application_mut().engine_mut().start_alias_write(SubDeviceId(DEVICE.0), 0x0ABC, force);
        world.finish(LIMIT, work)
    };
    // The PDI has the EEPROM, and gets it back.
    let to_pdi = world.application_mut().engine_mut().start_register_write(
        SubDeviceId(DEVICE.0),
        map::SII_CONFIGURATION,
        vec![1],
    );
    assert_eq!(world.finish(LIMIT, to_pdi), Ok(()));
    assert_eq!(alias(&mut world, false), Ok(SiiWritten::new(2, 6)));
    let register = |world: &World, at| world.network().device(DEVICE).controller.register(at, 2).to_vec();
    assert_eq!(register(&world, map::SII_CONFIGURATION)[0], 1);
    let of_image = image(&world);
    assert_eq!(of_image[8..10], [0xBC, 0x0A]);
    assert!(ringcat_wire::sii::Sii::parse(&of_image).is_ok(), "the checksum is right");
    let from_pdi = world.application_mut().engine_mut().start_register_write(
        SubDeviceId(DEVICE.0),
        map::SII_CONFIGURATION,
        vec![0],
    );
    assert_eq!(world.finish(LIMIT, from_pdi), Ok(()));
    let reload = world.application_mut().engine_mut().start_sii_reload(SubDeviceId(DEVICE.0));
    assert_eq!(world.finish(LIMIT, reload), Ok(()));
    assert_eq!(register(&world, map::STATION_ALIAS), [0, 0], "a reload does not bring it");
    world.power_off(DEVICE);
    world.run_cycles(50);
    world.power_on(DEVICE);
    world.run_cycles(50);
    assert_eq!(register(&world, map::STATION_ALIAS), [0xBC, 0x0A]);
    world.settle();
    // A wrong checksum is not corrected as a side effect.
    world.fault(Fault::CorruptSii { device: DEVICE, offset: 0x0E, mask: 0x55 });
    let error = sii(alias(&mut world, false).expect_err("the checksum was wrong before"));
    assert!(matches!(error, SiiProgramError::Checksum { .. }), "{error}");
    assert!(alias(&mut world, true).is_ok());
    assert!(ringcat_wire::sii::Sii::parse(&image(&world)).is_ok());
}

// covers: 2.7, 4.7, declaration, eeprom
#[test]
fn a_written_alias_counts_at_once_in_the_sii_and_after_power_on_in_the_register() {
    const AT: usize = 1;
    for (source, before_power_on) in [(AliasSource::Sii, 77), (AliasSource::Register, 0)] {
        for idle_operation in [false, true] {
            let options = Options::default().with_alias_source(source).with_idle_operation(idle_operation);
            let links = SimulatedSegment::from_toml("[[device]]\ntype = \"digital-output-8\"\ncount = 3\n");
            let mut main_device = MainDevice::request(links.expect("it is right"), &options);
            let alias = |main_device: &mut MainDevice<SimulatedSegment>| {
                main_device.scan().expect("a scan").subdevices[AT].alias
            };
            assert_eq!(alias(&mut main_device), 0);
            main_device.subdevice(Position(AT as u16)).write_alias(77, false).expect("it is written");
            assert_eq!(alias(&mut main_device), before_power_on, "{source:?}");
            main_device.links_mut().network_mut().apply(Fault::PowerOff(DeviceIndex(AT)));
            main_device.links_mut().network_mut().apply(Fault::PowerOn(DeviceIndex(AT)));
            assert_eq!(alias(&mut main_device), 77, "{source:?}");
            // An activation finds it by the alias.
            let mut declaration = automatic(&main_device.subdevices(), CYCLE);
            declaration.subdevices[AT] = SubDeviceConfig::at_alias(77, 0);
            let application = main_device.activate(declaration).map_err(Error::from).expect("it is found");
            drop(application);
        }
    }
}

// covers: 4.1, eeprom
#[test]
fn an_erased_sii_that_is_written_with_force_has_no_alias() {
    const AT: usize = 1;
    let options = Options::default().with_alias_source(AliasSource::Sii).with_idle_operation(true);
    let segment = "[[device]]\ntype = \"digital-output-8\"\ncount = 3\n";
    let links = SimulatedSegment::from_toml(segment).expect("it is right");
    let mut main_device = MainDevice::request(links, &options);
    assert_eq!(main_device.scan().expect("a scan").subdevices[AT].alias, 0);
    main_device.subdevice(Position(AT as u16)).write_alias(77, false).expect("it is written");
    assert_eq!(main_device.subdevices()[AT].alias, 77);
    main_device.subdevice(Position(AT as u16)).sii_write(vec![0xFF; 256], true).expect("it is written");
    assert_eq!(main_device.subdevices()[AT].alias, 0, "0xFFFF of an erased EEPROM is no alias");
}
