//! Segments with a limit of datagrams per frame, as behind some gateways and with other simulators: the MainDevice
//! detects it and reports the option to set, and with this option all else is as without a limit.

use std::time::Duration;

use ringcat::{
    ClockConfig, Declaration, Error, Event, FrameLimit, Links, LrwPolicy, MainDevice, Options, RingState, Scan,
    ScanError, automatic,
};
use ringcat_sim::cable::{CableId, DeviceIndex, Direction};
use ringcat_sim::fault::Fault;
use ringcat_sim::network::statistics::LossCause;
use ringcat_sim::network::{Beyond, DatagramLimit, Network, NetworkOptions};
use ringcat_sim::time::SimTime;
use scenarios::check::{Delivery, troubles};
use scenarios::dice::Dice;
use scenarios::segments::{descriptions, line, ring};
use scenarios::tap::Tap;
use scenarios::world::{CYCLE, World};

const KINDS: [&str; 6] =
    ["digital-output-8", "digital-input-8", "servo", "emulated-output-8", "digital-input-16", "digital-output-16"];
const BOTH: [Beyond; 2] = [Beyond::Unprocessed, Beyond::Dropped];
const LIMIT: Duration = Duration::from_secs(5);

fn kinds(count: usize) -> Vec<&'static str> {
    KINDS.into_iter().cycle().take(count).collect()
}

fn segment(count: usize, is_ring: bool, limit: Option<DatagramLimit>) -> Network {
    let options = NetworkOptions::default().with_max_datagrams(limit);
    let build = if is_ring { ring } else { line };
    build(descriptions(&kinds(count)), options)
}

fn limited(count: usize, is_ring: bool, datagrams: u16, beyond: Beyond) -> Network {
    segment(count, is_ring, Some(DatagramLimit { datagrams, beyond }))
}

fn limited_to(datagrams: u16) -> Options {
    Options::default().with_max_datagrams_per_frame(datagrams)
}

fn scan(network: Network, options: &Options) -> Result<Scan, Error> {
    let mut tap = Tap::new(network);
    tap.set_limit(tap.now() + Duration::from_secs(20));
    MainDevice::request(tap, options).scan()
}

fn too_many(world: &World) -> u64 {
    world.network().statistics().lost(LossCause::TooManyDatagrams)
}

// covers: frame-limit, sim-faults
#[test]
fn a_scan_that_exceeds_the_datagram_limit_reports_the_limit() {
    for beyond in BOTH {
        for is_ring in [false, true] {
            for (datagrams, count) in [(3, 5), (7, 5), (14, 40), (15, 40), (16, 300), (40, 100), (100, 300)] {
                let what = format!("{count}, ring {is_ring}, {datagrams} {beyond:?}");
                let error = match scan(limited(count, is_ring, datagrams, beyond), &Options::default()) {
                    Err(Error::Scan(error)) => error,
                    Err(other) => panic!("{what}: {other}"),
                    Ok(scan) => panic!("{what}: {} found", scan.subdevices.len()),
                };
                let returns = beyond == Beyond::Unprocessed;
                assert_eq!(error, ScanError::FrameLimit(FrameLimit::new(datagrams, returns)), "{what}");
                let text = error.to_string();
                assert!(text.contains(&format!("set max_datagrams_per_frame to {datagrams} (")), "{text}");
            }
        }
    }
}

// covers: frame-limit
#[test]
fn a_ring_check_that_exceeds_the_datagram_limit_reports_it() {
    for beyond in BOTH {
        let look = |options: &Options| {
            let mut tap = Tap::new(limited(12, true, 15, beyond));
            tap.set_limit(tap.now() + Duration::from_secs(20));
            MainDevice::request(tap, options).inspect_ring()
        };
        let error = look(&Options::default()).expect_err("more than 15 in a frame").to_string();
        assert!(error.contains("set max_datagrams_per_frame to 15"), "{error}");
        let counts = look(&limited_to(15)).expect("it is whole").counts;
        assert_eq!((counts.main, counts.redundant), (12, 0));
    }
}

// covers: frame-limit
#[test]
fn a_limit_that_was_set_too_high_is_reported() {
    for beyond in BOTH {
        let error = scan(limited(40, false, 15, beyond), &limited_to(16)).expect_err("one too many");
        assert!(error.to_string().contains("set max_datagrams_per_frame to 15"), "{error}");
    }
    let error = scan(limited(40, true, 2, Beyond::Dropped), &limited_to(3)).expect_err("never enough");
    assert!(error.to_string().contains("RingCAT needs 3"), "{error}");
}

// covers: frame-limit
#[test]
fn with_the_limit_set_no_frame_exceeds_it_and_all_else_is_unchanged() {
    for beyond in BOTH {
        for is_ring in [false, true] {
            for (datagrams, count) in [(3, 12), (15, 40), (15, 300)] {
                let what = format!("{count}, ring {is_ring}, {datagrams} {beyond:?}");
                let network = limited(count, is_ring, datagrams, beyond);
                let declare = |scan: &Scan| automatic(&scan.subdevices, CYCLE);
                let mut world = World::with(1, network, &limited_to(datagrams), declare).expect("it fits");
                world.settle();
                let mark = world.mark();
                world.run_cycles(50);
                assert_eq!((world.incomplete(mark), world.left_op(mark)), (0, vec![]), "{what}");
                world.power_off(DeviceIndex(count - 2));
                if is_ring {
                    world.cut(CableId(count / 2));
                }
                world.run_cycles(50);
                world.power_on(DeviceIndex(count - 2));
                if is_ring {
                    world.heal(CableId(count / 2));
                }
                world.until(LIMIT, "all back", |world| {
                    let last = world.evaluated(world.beginning()).last();
                    world.all_in_op() && last.is_some_and(|evaluated| evaluated.delivery == Delivery::Complete)
                });
                assert_eq!(too_many(&world), 0, "{what}");
                assert!(!world.saw(world.beginning(), |event| matches!(event, Event::FrameLimit { .. })), "{what}");
            }
        }
    }
}

/// Settings that give cyclic frames many datagrams.
fn busy(scan: &Scan) -> Declaration {
    let mut declaration = automatic(&scan.subdevices, CYCLE);
    declaration.lrw = LrwPolicy::PerSubDevice;
    declaration.clocks = Some(ClockConfig::default());
    declaration
}

// covers: frame-limit
#[test]
fn cyclic_frames_with_a_datagram_per_subdevice_keep_the_limit() {
    for datagrams in [3, 4, 15] {
        for is_ring in [false, true] {
            let network = limited(24, is_ring, datagrams, Beyond::Dropped);
            let mut world = World::with(2, network, &limited_to(datagrams), busy).expect("it fits");
            world.settle();
            world.run_cycles(20);
            assert!(world.all_in_op() && too_many(&world) == 0, "{datagrams}, ring {is_ring}");
            assert_eq!(troubles(world.events(world.beginning())), Vec::<&Event>::new());
        }
    }
}

// covers: frame-limit
#[test]
fn joining_subdevices_that_exceed_the_limit_are_explained_once() {
    const PRESENT: usize = 3;
    let all = scan(segment(40, false, None), &Options::default()).expect("a scan").subdevices;
    for beyond in BOTH {
        let mut network = limited(40, false, 15, beyond);
        (PRESENT..40).for_each(|device| network.apply(Fault::PowerOff(DeviceIndex(device))));
        let declare = |_: &Scan| {
            let mut declaration = automatic(&all, CYCLE);
            for (config, info) in declaration.subdevices.iter_mut().zip(&all).skip(PRESENT) {
                *config = config.clone().pdos_of(info);
                config.optional = true;
            }
            declaration
        };
        let mut world = World::with(3, network, &Options::default(), declare).expect("three are there");
        // Process data of absent SubDevices has its datagrams already.
        world.run_cycles(2_500);
        let limits = |world: &World| {
            let events = world.events(world.beginning()).iter();
            let limits = events.filter_map(|timed| match timed.event {
                Event::FrameLimit { limit } => Some(limit),
                _ => None,
            });
            limits.collect::<Vec<FrameLimit>>()
        };
        (PRESENT..40).for_each(|device| world.power_on(DeviceIndex(device)));
        world.run_cycles(2_500);
        assert_eq!(limits(&world), [FrameLimit::new(15, beyond == Beyond::Unprocessed)], "{beyond:?}");
    }
}

/// Scans a ring with frame loss and a cable that is cut and repaired.
fn disturbed(seed: u64) -> Option<String> {
    let mut dice = Dice::new(seed);
    let count = 3 + dice.below(30) as usize;
    let mut network = segment(count, dice.one_in(2), None);
    let cables = network.cables().len() as u64;
    let one_in = 1 + dice.below(8);
    for millisecond in 0..200 {
        let at = SimTime::ZERO + Duration::from_micros(millisecond * 1_000 + dice.below(1_000));
        if dice.one_in(one_in) {
            let cable = CableId(dice.below(cables) as usize);
            let direction = *dice.pick(&[None, Some(Direction::AToB), Some(Direction::BToA)]);
            network.schedule(at, Fault::Drop { cable, direction, count: 1 + dice.below(3) as u32 });
        }
        if dice.one_in(20) {
            let cable = CableId(dice.below(cables) as usize);
            network.schedule(at, Fault::Cut(cable));
            network.schedule(at + Duration::from_micros(1 + dice.below(8_000)), Fault::Heal(cable));
        }
    }
    match scan(network, &Options::default()) {
        Err(Error::Scan(ScanError::FrameLimit(limit))) => Some(format!("seed {seed}: {limit}")),
        Ok(_) | Err(_) => None,
    }
}

// covers: frame-limit
#[test]
fn random_frame_losses_are_not_mistaken_for_a_limit() {
    let mistaken: Vec<String> = (0..300).filter_map(disturbed).collect();
    assert_eq!(mistaken, Vec::<String>::new());
}

// covers: frame-limit
#[test]
fn a_ring_closes_again_with_a_limit_that_drops() {
    let declare = |scan: &Scan| automatic(&scan.subdevices, CYCLE);
    let mut world = World::with(4, limited(30, true, 15, Beyond::Dropped), &limited_to(15), declare).expect("it fits");
    world.settle();
    for cable in 0..=30 {
        world.cut(CableId(cable));
        world.run_cycles(10);
        assert_eq!(world.application().ring(), RingState::Open);
        world.heal(CableId(cable));
        world.run_cycles(10);
        assert_eq!(world.application().ring(), RingState::Closed);
    }
    assert_eq!((too_many(&world), world.left_op(world.beginning())), (0, vec![]));
}
