//! Segments of SII images of real devices, if `../shared/data` is present beside the repository: every image that the
//! simulator accepts reaches OP and exchanges process data; every refused one has a reason.

use std::path::Path;
use std::time::Duration;

use ringcat::{Event, Options, automatic};
use ringcat_sim::application::{Behaviour, InputSource};
use ringcat_sim::cable::CableId;
use ringcat_sim::description::DeviceDescription;
use ringcat_sim::network::NetworkOptions;
use scenarios::check::{Delivery, ring_events, troubles};
use scenarios::segments::{line, ring};
use scenarios::world::{CYCLE, World};

/// Descriptions from all images, and the reasons of those that are refused.
fn images() -> Option<(Vec<DeviceDescription>, Vec<String>)> {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/sii");
    let Ok(entries) = std::fs::read_dir(&directory) else {
        println!("skipped: {} is not there", directory.display());
        return None;
    };
    let mut names: Vec<_> = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok()).collect();
    names.retain(|name| name.ends_with(".bin"));
    names.sort();
    let (mut taken, mut refused) = (Vec::new(), Vec::new());
    for (number, name) in names.iter().enumerate() {
        let image = std::fs::read(directory.join(name)).expect("an image can be read");
        match DeviceDescription::from_sii(image, name.trim_end_matches(".bin")) {
            Ok(mut description) => {
                // Values to compare in the inputs.
                let pattern = (0..64).map(|at: u8| at.wrapping_mul(13) ^ number as u8 | 1).collect();
                description.behaviour = Behaviour::Terminal(InputSource::Constant(pattern));
                description.clock_start_ns = 1_000_003 * (number as u64 + 1);
                taken.push(description);
            }
            Err(error) => refused.push(format!("{name}: the simulator refuses it: {error}")),
        }
    }
    Some((taken, refused))
}

/// Images that reach OP in a segment of their own; the others with the reason.
fn usable(descriptions: Vec<DeviceDescription>, refused: &mut Vec<String>) -> Vec<DeviceDescription> {
    let mut usable = Vec::new();
    for description in descriptions {
        let network = line(vec![description.clone()], NetworkOptions::default());
        let started = World::with(0, network, &Options::default(), |scan| automatic(&scan.subdevices, CYCLE));
        match started {
            Err(error) => refused.push(format!("{}: {error}", description.name)),
            Ok(mut world) => {
                world.settle();
                world.run_cycles(20);
                assert!(world.all_in_op(), "{}", description.name);
                assert_eq!(troubles(world.events(world.beginning())), Vec::<&Event>::new(), "{}", description.name);
                let expected = world.evaluated(world.beginning()).last().map(|evaluated| evaluated.status.expected);
                println!("{}: in OP, working counter {}", description.name, expected.unwrap_or(0));
                usable.push(description);
            }
        }
    }
    usable
}

/// Runs until all are in OP and then for a while; inputs and outputs are compared all the time.
fn exchange(mut world: World, what: &str) {
    world.settle();
    let mark = world.mark();
    world.run_cycles(200);
    assert!(world.all_in_op());
    assert_eq!(troubles(world.events(world.beginning())), Vec::<&Event>::new());
    assert!(world.evaluated(mark).iter().all(|evaluated| evaluated.delivery == Delivery::Complete));
    let status = world.evaluated(mark).last().expect("cycles went by").status;
    assert_eq!(status.wkc, status.expected);
    println!(
        "{what}: {} SubDevices in OP, working counter {} of {}, {} bytes compared",
        world.scan.subdevices.len(),
        status.wkc,
        status.expected,
        world.compared()
    );
}

// covers: sim-files
#[test]
fn segments_of_all_real_images_come_to_op_and_exchange_process_data() {
    let Some((taken, mut refused)) = images() else { return };
    let usable = usable(taken, &mut refused);
    for reason in &refused {
        println!("refused: {reason}");
    }
    assert!(usable.len() >= 30, "{} images come to OP", usable.len());
    let options = NetworkOptions::default;
    exchange(World::new(1, line(usable.clone(), options())), "line of real images");
    exchange(World::new(2, ring(usable.clone(), options())), "ring of real images");

    let mut world = World::in_op(3, ring(usable.clone(), options()));
    for cable in [0, usable.len() / 2, usable.len()] {
        let mark = world.mark();
        world.cut(CableId(cable));
        world.run_cycles(60);
        world.heal(CableId(cable));
        world.run_cycles(60);
        assert_eq!(world.left_op(mark), []);
        assert_eq!(ring_events(world.events(mark)).len(), 3);
        assert!(world.incomplete(mark) <= 2, "{}", world.incomplete(mark));
    }
}

// covers: sim-files
#[test]
fn real_images_are_read_alike_with_and_without_cache_in_4_and_8_bytes() {
    let Some((taken, _)) = images() else { return };
    let scans: Vec<_> = [(true, true), (true, false), (false, true), (false, false)]
        .into_iter()
        .map(|(sii_cache, eight_byte_sii)| {
            // Twice, so that the cache is used.
            let mut descriptions = taken.clone();
            descriptions.extend(taken.clone());
            for (number, description) in descriptions.iter_mut().enumerate() {
                description.eight_byte_sii = eight_byte_sii;
                description.name = format!("{}-{number}", description.name);
            }
            let network = line(descriptions, NetworkOptions::default());
            let options = Options::default().with_sii_cache(sii_cache);
            let mut main_device = ringcat::MainDevice::request(scenarios::tap::Tap::new(network), &options);
            let scan = main_device.scan().expect("a scan");
            (scan.subdevices, main_device.links_mut().network().now())
        })
        .collect();
    for (subdevices, at) in &scans {
        println!("scan of {} real images: {:.1} ms", subdevices.len(), at.0 as f64 / 1e6);
        for (one, other) in subdevices.iter().zip(&scans[0].0) {
            assert_eq!((&one.identity, &one.name, &one.pdos), (&other.identity, &other.name, &other.pdos));
            assert_eq!((&one.sync_managers, &one.warnings), (&other.sync_managers, &other.warnings));
        }
    }
    assert!(scans[0].1.since(ringcat_sim::time::SimTime::ZERO) < Duration::from_secs(5));
}
