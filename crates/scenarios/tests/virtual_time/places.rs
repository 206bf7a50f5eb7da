//! Process data with places that are known before activation, checked against the memory of the devices.

use std::time::Duration;

use ringcat::{
    Declaration, Direction, DomainId, Entry, Error, LrwPolicy, Options, PdoEntry, PdoMapping, Scan, SubDeviceConfig,
    SubDeviceId,
};
use ringcat_engine::main_device::{ActivateError, RegisteredArea};
use ringcat_sim::cable::CableId;
use ringcat_sim::network::NetworkOptions;
use scenarios::check::Delivery;
use scenarios::segments::{descriptions, line, ring};
use scenarios::world::{CYCLE, World};

const KINDS: [&str; 8] =
    ["block", "servo", "digital-output-8", "block", "digital-input-8", "block", "servo", "analog-input-4"];

/// All scanned SubDevices without a domain.
fn bare(scan: &Scan) -> Declaration {
    let mut declaration = Declaration::default();
    for info in &scan.subdevices {
        declaration.add_without_domain(SubDeviceConfig::from_info(info));
    }
    declaration
}

/// Registers a SyncManager of a SubDevice where it has process data.
fn register(
    declaration: &mut Declaration,
    scan: &Scan,
    domain: DomainId,
    subdevice: usize,
    manager: u8,
) -> Option<RegisteredArea> {
    let info = declaration.found(&scan.subdevices, SubDeviceId(subdevice));
    declaration.register_sync_manager(domain, SubDeviceId(subdevice), manager, info).ok()
}

/// Numbers of SyncManagers, last ones first.
const BACKWARDS: [u8; 4] = [3, 2, 1, 0];

// covers: layout
#[test]
fn registered_places_hold_in_line_and_ring_over_several_frames_through_a_cut() {
    for (seed, policy, is_ring) in [
        (1, LrwPolicy::Automatic, false),
        (2, LrwPolicy::PerSubDevice, false),
        (3, LrwPolicy::Automatic, true),
        (4, LrwPolicy::PerSubDevice, true),
    ] {
        let mut places = Vec::new();
        let declare = |scan: &Scan| {
            let mut declaration = bare(scan).with_lrw(policy);
            let domain = declaration.add_domain(CYCLE);
            // By SyncManager and not by SubDevice: outputs and inputs alternate, and no SubDevice is in one piece.
            for manager in BACKWARDS {
                for subdevice in (0..KINDS.len()).rev() {
                    places.extend(register(&mut declaration, scan, domain, subdevice, manager));
                }
            }
            declaration
        };
        let network = if is_ring { ring } else { line };
        let mut world =
            World::with(seed, network(descriptions(&KINDS), NetworkOptions::default()), &Options::default(), declare)
                .unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        let mut end = 0;
        for place in places.iter().filter(|place| place.length > 0) {
            assert_eq!(place.start, end, "seed {seed}");
            end += u32::from(place.length);
            let areas = world.application().directory().areas(place.subdevice);
            let area = areas.iter().find(|area| area.placed.area.sync_manager == place.sync_manager).expect("placed");
            assert_eq!((area.placed.image_offset, area.placed.area.length), (place.start, place.length));
        }
        assert!(end > 2_000, "several frames: {end} bytes");
        assert_eq!(world.application().exchange().image(DomainId(0)).len(), end as usize);
        world.settle();
        let mark = world.mark();
        world.run_cycles(100);
        assert_eq!(world.incomplete(mark), 0, "seed {seed}");
        if is_ring {
            for cable in [0, 3, 8] {
                let mark = world.mark();
                world.cut(CableId(cable));
                world.run_cycles(40);
                world.heal(CableId(cable));
                world.run_cycles(40);
                assert_eq!(world.left_op(mark), []);
                assert!(world.incomplete(mark) <= 4, "cable {cable}: {}", world.incomplete(mark));
            }
        }
        assert!(world.proven() > 1_000, "{} areas in the devices' logs", world.proven());
    }
}

// covers: layout
#[test]
fn the_same_sync_manager_in_two_domains_delivers_to_both() {
    for is_ring in [false, true] {
        let declare = |scan: &Scan| {
            let mut declaration = bare(scan);
            let (fast, slow) = (declaration.add_domain(CYCLE), declaration.add_domain(4 * CYCLE));
            for subdevice in 0..3 {
                for manager in BACKWARDS {
                    register(&mut declaration, scan, fast, subdevice, manager);
                }
                // Inputs a second time.
                register(&mut declaration, scan, slow, subdevice, if subdevice == 1 { 3 } else { 1 });
            }
            declaration
        };
        let network = if is_ring { ring } else { line };
        let kinds = ["block", "servo", "block"];
        let network = network(descriptions(&kinds), NetworkOptions::default());
        let mut world = World::with(5, network, &Options::default(), declare).expect("activation");
        world.settle();
        // A slow domain reads blocks while newer outputs have reached them.
        world.evaluate_latched(false);
        let mark = world.mark();
        world.run_cycles(400);
        assert_eq!((world.incomplete(mark), world.evaluated(mark).len()), (0, 500));
        let directory = world.application().directory();
        let block = directory.areas(SubDeviceId(0));
        let domains: Vec<_> = block.iter().map(|area| (area.placed.area.sync_manager, area.domain)).collect();
        assert_eq!(domains, [(0, DomainId(0)), (1, DomainId(0)), (1, DomainId(1))]);
        let images = [0, 1].map(|domain| world.application().exchange().image(DomainId(domain)));
        assert!(images.iter().all(|image| image.iter().any(|byte| *byte != 0)), "both have inputs");
    }
}

// covers: layout
#[test]
fn sixty_four_domains_of_one_subdevice_each_with_and_without_a_period() {
    let kinds = ["digital-output-8", "servo", "digital-input-8", "analog-input-4"];
    let kinds: Vec<&str> = (0..64).map(|at| kinds[at % kinds.len()]).collect();
    for is_ring in [false, true] {
        let declare = |scan: &Scan| {
            let mut declaration = bare(scan);
            for subdevice in 0..64 {
                let period = [CYCLE, Duration::ZERO, 3 * CYCLE][subdevice % 3];
                let domain = declaration.add_domain(period);
                BACKWARDS.into_iter().for_each(|manager| {
                    register(&mut declaration, scan, domain, subdevice, manager);
                });
            }
            declaration
        };
        let network = if is_ring { ring } else { line };
        let network = network(descriptions(&kinds), NetworkOptions::default());
        let mut world = World::with(6, network, &Options::default(), declare).expect("activation");
        world.evaluate_latched(false);
        world.until(Duration::from_secs(5), "everything settled", |world| world.application().all_settled());
        world.run_cycles(30);
        let mark = world.mark();
        world.run_cycles(60);
        let late: Vec<_> =
            world.evaluated(mark).iter().filter(|evaluated| evaluated.delivery != Delivery::Complete).collect();
        assert!(late.is_empty(), "{late:?}");
        for domain in 0..64 {
            let evaluated =
                world.evaluated(mark).iter().filter(|evaluated| evaluated.domain == DomainId(domain)).count();
            assert_eq!(evaluated, if domain % 3 == 2 { 20 } else { 60 }, "domain {domain}");
        }
    }
}

// covers: layout, domains
#[test]
fn periods_that_are_no_multiples_of_each_other_keep_their_rates() {
    let micros = |us: u64| Duration::from_micros(us);
    let periods = [micros(1_000), micros(1_500), micros(2_700), Duration::ZERO];
    let declare = |scan: &Scan| {
        let mut declaration = bare(scan);
        for (subdevice, period) in periods.into_iter().enumerate() {
            let domain = declaration.add_domain(period);
            BACKWARDS.into_iter().for_each(|manager| {
                register(&mut declaration, scan, domain, subdevice, manager);
            });
        }
        declaration
    };
    let kinds = ["servo", "digital-output-8", "servo", "digital-input-8"];
    let network = line(descriptions(&kinds), NetworkOptions::default());
    let mut world = World::with(7, network, &Options::default(), declare).expect("activation");
    world.settle();
    let mark = world.mark();
    world.run_cycles(2_700);
    assert_eq!(world.incomplete(mark), 0);
    for (domain, expected) in [2_700, 1_800, 1_000, 2_700].into_iter().enumerate() {
        let evaluated = world.evaluated(mark).iter().filter(|evaluated| evaluated.domain == DomainId(domain)).count();
        assert!(evaluated.abs_diff(expected) <= 1, "domain {domain}: {evaluated} of {expected}");
    }
}

// covers: layout
#[test]
fn a_place_registered_for_another_size_is_refused_at_activation() {
    let pdo = |bits| vec![PdoMapping::of(0x1A00, [PdoEntry::new(0x6000, 1, bits)])];
    let declare = |scan: &Scan| {
        let mut declaration = Declaration::default();
        let config = SubDeviceConfig::from_info(&scan.subdevices[0]);
        let input = declaration.add_without_domain(config.assign(0, Direction::Inputs, pdo(16)));
        let domain = declaration.add_domain(CYCLE);
        let entry: Entry = declaration.register_entry(domain, input, 0x6000, 1, None).expect("it is declared");
        assert_eq!((entry.bit_offset, entry.bit_length), (0, 16));
        let config = SubDeviceConfig::from_info(&scan.subdevices[0]);
        declaration.subdevices[0] = config.assign(0, Direction::Inputs, pdo(8));
        declaration
    };
    let network = line(descriptions(&["digital-input-8"]), NetworkOptions::default());
    let error = World::with(8, network, &Options::default(), declare).unwrap_err();
    let Error::Activate(ActivateError::Registered { expected, got, .. }) = &error else { panic!("{error}") };
    assert_eq!((*expected, *got), ((Direction::Inputs, 2), Some((Direction::Inputs, 1))));
}
