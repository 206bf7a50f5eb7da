//! A scan that reads only what operation needs of the SIIs: what it leaves out follows, in the background or on
//! request, and is the same as after a whole scan.

use std::time::Duration;

use ringcat::{
    Application, Error, Links, MainDevice, MapError, Options, Scan, ScanError, Services, SiiExtent, SubDeviceId,
    SubDeviceInfo, automatic,
};
use ringcat_engine::info::InfoWarning;
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::description::DeviceDescription;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::sii::Sii;
use scenarios::dice::Dice;
use scenarios::odd_images::variant;
use scenarios::segments::{describe, descriptions, line};
use scenarios::tap::Tap;
use scenarios::terminals::sii_bytes_used;
use scenarios::world::{CYCLE, World};

const KINDS: [&str; 6] = ["coupler", "servo", "servo", "servo", "digital-output-8", "all-protocols"];
const DRIVE: SubDeviceId = SubDeviceId(1);
const LIMIT: Duration = Duration::from_secs(20);

fn options(extent: SiiExtent) -> Options {
    Options::default().with_sii_extent(extent)
}

fn network() -> Network {
    // SubDevices of one type share names, as in real SIIs.
    line(KINDS.map(|kind| describe(kind, kind)).to_vec(), NetworkOptions::default())
}

/// What comes from the SII, warnings in one order.
fn from_sii(subdevices: Vec<SubDeviceInfo>) -> Vec<SubDeviceInfo> {
    let normal = |mut info: SubDeviceInfo| {
        info.receive_times = None;
        info.warnings.sort_by_key(|warning| format!("{warning:?}"));
        info
    };
    subdevices.into_iter().map(normal).collect()
}

fn scanned(network: Network, extent: SiiExtent) -> (MainDevice<Tap>, Vec<SubDeviceInfo>) {
    let mut tap = Tap::new(network);
    tap.set_limit(tap.now() + LIMIT);
    let mut main_device = MainDevice::request(tap, &options(extent));
    let found = main_device.scan().expect("nothing is lost").subdevices;
    (main_device, found)
}

fn active(extent: SiiExtent) -> Application<Tap> {
    let (main_device, found) = scanned(network(), extent);
    main_device.activate(automatic(&found, CYCLE)).expect("it fits")
}

/// What operation needs.
fn needed(info: &SubDeviceInfo) -> SubDeviceInfo {
    let mut info = info.clone();
    info.extent = SiiExtent::Operation;
    info.dc_modes.clear();
    for name in [&mut info.name, &mut info.order_code, &mut info.group, &mut info.image] {
        name.clear();
    }
    for pdo in &mut info.pdos {
        pdo.name.clear();
        pdo.entries.iter_mut().for_each(|entry| entry.name.clear());
    }
    info.warnings.clear();
    info.receive_times = None;
    info
}

// covers: scan
#[test]
fn names_and_modes_follow_in_the_background_when_all_are_in_op() {
    let expected = from_sii(scanned(network(), SiiExtent::Complete).1);
    let mut application = active(SiiExtent::Operation);
    let named = application.output_named::<i8>(DRIVE, "Mode of operation");
    assert!(matches!(named, Err(MapError::NamesNotRead { subdevice: DRIVE, .. })), "{named:?}");
    application.wait_until_op(LIMIT).expect("all reach OP");
    let begin = application.now();
    while application.engine().subdevices().iter().any(|info| info.extent < SiiExtent::Complete) {
        application.cycle(|_| ());
        assert!(application.now().since(begin) < Duration::from_secs(1), "{:?}", application.engine().subdevices());
    }
    assert_eq!(from_sii(application.engine().subdevices()), expected);
    assert!(application.output_named::<i8>(DRIVE, "Mode of operation").is_ok());
}

// covers: scan
#[test]
fn a_start_in_one_step_reads_what_operation_needs_and_names_follow() {
    let expected = from_sii(scanned(network(), SiiExtent::Complete).1);
    for (extent, known) in [
        (None, SiiExtent::Operation),
        (Some(SiiExtent::Clocks), SiiExtent::Clocks),
        (Some(SiiExtent::Complete), SiiExtent::Complete),
    ] {
        let mut options = Options::default();
        options.sii_extent = extent;
        let main_device = MainDevice::request(Tap::new(network()), &options);
        let mut scanned = Vec::new();
        let declare = |scan: &Scan| {
            scanned.clone_from(&scan.subdevices);
            automatic(&scan.subdevices, CYCLE)
        };
        let mut application = main_device.bring_up(declare).expect("nothing is lost");
        assert!(scanned.iter().all(|info| info.extent == known), "{extent:?}");
        assert_eq!(scanned[1].name.is_empty(), known < SiiExtent::Complete);
        application.wait_until_op(LIMIT).expect("all reach OP");
        let named = application.output_named::<i8>(DRIVE, "Mode of operation");
        assert_eq!(named.is_ok(), known == SiiExtent::Complete, "{extent:?}");
        let begin = application.now();
        while application.engine().subdevices().iter().any(|info| info.extent < SiiExtent::Complete) {
            application.cycle(|_| ());
            assert!(application.now().since(begin) < Duration::from_secs(1), "{extent:?}");
        }
        assert_eq!(from_sii(application.engine().subdevices()), expected);
        assert!(application.output_named::<i8>(DRIVE, "Mode of operation").is_ok());
    }
}

// covers: scan
#[test]
fn a_start_in_one_step_that_fails_returns_the_main_device_for_another() {
    let mut tap = Tap::new(network());
    tap.network_mut().power_off(DeviceIndex(0));
    let main_device = MainDevice::request(tap, &Options::default().with_patience(Duration::from_millis(50)));
    let declare = |scan: &Scan| automatic(&scan.subdevices, CYCLE);
    let refused = main_device.bring_up(declare).expect_err("nothing answers");
    assert!(matches!(refused.error, Error::Scan(ScanError::NoAnswer)), "{}", refused.error);
    let mut main_device = refused.main_device;
    main_device.links_mut().network_mut().power_on(DeviceIndex(0));
    let mut application = main_device.bring_up(declare).expect("all answer");
    application.wait_until_op(LIMIT).expect("all reach OP");
    assert_eq!(application.states().len(), KINDS.len());
}

// covers: scan
#[test]
fn the_rest_of_the_siis_is_read_on_request_before_and_after_activation() {
    let expected = from_sii(scanned(network(), SiiExtent::Complete).1);
    for extent in [SiiExtent::Operation, SiiExtent::Clocks] {
        let (mut main_device, found) = scanned(network(), extent);
        assert!(found.iter().all(|info| info.extent == extent && info.name.is_empty()));
        assert_eq!(found[1].dc_modes.is_empty(), extent == SiiExtent::Operation);
        assert_eq!(from_sii(main_device.complete_siis().expect("it reads")), expected);
        let begin = main_device.links_mut().now();
        assert_eq!(from_sii(main_device.complete_siis().expect("nothing is missing")), expected);
        assert_eq!(main_device.links_mut().now(), begin, "no frame is needed");
        let application = main_device.activate(automatic(&expected, CYCLE)).expect("it fits");
        assert!(application.output_named::<i8>(DRIVE, "Mode of operation").is_ok());
    }
    let mut application = active(SiiExtent::Operation);
    let mut pending = application.complete_siis();
    let read = loop {
        application.cycle(|_| ());
        if let Some(read) = pending.take() {
            break read.expect("it reads");
        }
        assert!(application.now().0 < LIMIT.as_nanos() as u64);
    };
    assert_eq!(from_sii(read), expected);
    assert!(application.output_named::<i8>(DRIVE, "Mode of operation").is_ok());
}

// covers: scan, eeprom
#[test]
fn an_eeprom_that_is_written_is_not_read_in_between() {
    let device = DeviceIndex(1);
    for delay in 0..40 {
        let options = options(SiiExtent::Operation);
        let mut world =
            World::with(1, network(), &options, |scan| automatic(&scan.subdevices, CYCLE)).expect("it fits");
        world.settle();
        world.run_cycles(delay);
        let image = world.network().device(device).controller.sii_image().to_vec();
        let mut new = image.clone();
        (0x90..0x110).for_each(|at| new[at] ^= 0x20);
        let engine = world.application_mut().engine_mut();
        let work = engine.start_sii_write(SubDeviceId(device.0), new.clone(), true);
        let completed = world.application_mut().engine_mut().start_sii_completion();
        assert!(world.finish(LIMIT, work).is_ok(), "{delay}");
        assert!(world.finish(LIMIT, completed).is_ok(), "{delay}");
        assert_eq!(world.network().device(device).controller.sii_image(), new, "{delay}");
    }
}

fn with_image(kind: &str, number: usize, image: &[u8]) -> DeviceDescription {
    let mut description = describe(kind, &format!("odd-{number}"));
    description.sii_image = Some(image.to_vec());
    description
}

// covers: scan, odd-sii
#[test]
fn a_damaged_sii_gives_the_same_for_operation_with_and_without_names() {
    let (mut odd, mut warned) = (0, 0);
    for seed in 0..120 {
        let dice = &mut Dice::new(seed);
        let kind = *dice.pick(&["servo", "digital-output-8", "all-protocols", "analog-input-4"]);
        let good = line(vec![describe(kind, "good")], NetworkOptions::default());
        let image = good.device(DeviceIndex(0)).controller.sii_image().to_vec();
        let made = variant(&image, seed, dice);
        let network = || line(vec![with_image(kind, 0, &made.image)], NetworkOptions::default());
        let whole = from_sii(scanned(network(), SiiExtent::Complete).1);
        let (mut main_device, part) = scanned(network(), SiiExtent::Operation);
        assert_eq!(part.iter().map(needed).collect::<Vec<_>>(), whole.iter().map(needed).collect::<Vec<_>>(), "{seed}");
        // Each fault of the part is one of the whole; what is left out may hold more.
        let of_whole = |warning: &InfoWarning| whole[0].warnings.contains(warning);
        let warnings = [&part[0].warnings, &whole[0].warnings];
        assert!(part[0].warnings.iter().all(of_whole), "{seed} {:?}: {warnings:?}", made.change);
        assert_eq!(part[0].is_blank(), whole[0].is_blank(), "{seed}");
        let completed = main_device.complete_siis().expect("it reads");
        assert_eq!(from_sii(completed), whole, "{seed} {:?}", made.change);
        odd += 1;
        warned += usize::from(!whole[0].warnings.is_empty());
    }
    assert!(odd == 120 && warned > 30, "{warned} of {odd}");
}

// covers: scan
#[test]
fn only_words_that_operation_needs_are_read_before_op() {
    for kind in ["servo", "digital-output-8", "analog-input-4"] {
        let network = || line(descriptions(&[kind]), NetworkOptions::default());
        let used = sii_bytes_used(network().device(DeviceIndex(0)));
        let names = Sii::parse(network().device(DeviceIndex(0)).controller.sii_image()).map(|sii| {
            sii.categories().filter(|it| !SiiExtent::Operation.contains(it.kind)).map(|it| it.data.len()).sum::<usize>()
        });
        let time = |extent| Duration::from_nanos(scanned(network(), extent).0.links_mut().now().0);
        let saved = time(SiiExtent::Complete).saturating_sub(time(SiiExtent::Operation));
        // A command of half a millisecond reads 8 bytes.
        let expected = Duration::from_micros(500) * (names.unwrap() / 8) as u32;
        assert!(saved >= expected, "{kind}, {used} bytes: {saved:?} instead of {expected:?}");
    }
}
