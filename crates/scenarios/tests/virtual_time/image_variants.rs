//! Many inconsistent or damaged SII images: made by a seeded generator from those of the catalogue, and from those of
//! real devices if `../shared/data` is present beside the repository.
//!
//! One of four SubDevices has such an image. It reaches OP with complete working counters, or a reason is reported for
//! it; all others are in OP and exchange process data in any case. `SEED` and `VARIANTS` choose others, and how many
//! per image.

use std::path::Path;
use std::time::Duration;

use ringcat::{DomainId, Event, Freshness, Options, SubDeviceId, automatic};
use ringcat_sim::application::{Behaviour, InputSource};
use ringcat_sim::catalogue;
use ringcat_sim::description::DeviceDescription;
use ringcat_sim::network::NetworkOptions;
use ringcat_sim::sii_image;
use ringcat_wire::al::{AlState, AlStatus};
use ringcat_wire::sii::{Identity, SiiHeader};
use scenarios::check::Delivery;
use scenarios::dice::Dice;
use scenarios::odd_images::{Change, Variant, variant};
use scenarios::seeds;
use scenarios::segments::{describe, line};
use scenarios::world::{CYCLE, World};

/// The SubDevice with the changed image.
const ODD: usize = 2;
/// Variants of an image of the catalogue, and of one of a real device.
const SOME: u64 = 24;
const MANY: u64 = 50;
/// Longer than any time limit of a state change.
const LIMIT: Duration = Duration::from_secs(15);

/// Behaviour of the SubDevice with the changed image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Truth {
    /// The SubDevice behaves as before its EEPROM was damaged.
    Damaged,
    /// The SubDevice behaves as its image describes.
    AsItSays,
}

/// Result for this SubDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Outcome {
    /// In OP, all domains complete.
    Complete,
    /// Reported by the MainDevice before any write.
    Refused,
    /// The SubDevice refused a state.
    RefusedByDevice,
}

#[derive(Default, Debug)]
struct Tally {
    complete: usize,
    refused: usize,
    by_device: usize,
    no_device: usize,
    warned: usize,
    /// SubDevices that behave as their image describes and refuse the configuration of the MainDevice.
    disagree: Vec<String>,
    failures: Vec<String>,
}

/// Variants of each image and seed: as many as VARIANTS in the environment says, otherwise `usual`.
fn variants(usual: u64) -> u64 {
    std::env::var("VARIANTS").ok().map_or(usual, |text| text.parse().expect("VARIANTS=50"))
}

/// A segment around this SubDevice.
fn around(odd: DeviceDescription) -> Vec<DeviceDescription> {
    let mut devices = vec![
        describe("digital-output-8", "before"),
        describe("all-protocols", "speaks"),
        odd,
        describe("digital-input-8", "behind"),
    ];
    devices[3].behaviour = Behaviour::Terminal(InputSource::Constant(vec![0xA5]));
    devices
}

fn with_image(mut description: DeviceDescription, image: &[u8]) -> DeviceDescription {
    // The simulator writes these into images.
    if let Some(header) = image.first_chunk().map(SiiHeader::decode) {
        (description.alias, description.identity.serial) = (header.alias, header.identity.serial);
    }
    description.sii_image = Some(image.to_vec());
    description
}

/// Checks that hold in every case, and the result for this SubDevice.
fn evaluate(made: &Variant, odd: DeviceDescription) -> Result<(Outcome, bool), String> {
    let network = line(around(odd), NetworkOptions::default());
    let started = World::with(1, network, &Options::default(), |scan| automatic(&scan.subdevices, CYCLE));
    let mut world = started.map_err(|error| format!("the activation fails: {error}"))?;
    let begin = world.application().now();
    let reason = |world: &World| {
        let own = |event: &Event| match event {
            Event::ConfigurationFailed { subdevice: SubDeviceId(ODD), .. } => Some(Outcome::Refused),
            Event::StateError { subdevice: SubDeviceId(ODD), .. } => Some(Outcome::RefusedByDevice),
            _ => None,
        };
        world.events(world.beginning()).iter().find_map(|timed| own(&timed.event))
    };
    let all_complete = |world: &World| {
        let last = world.evaluated(world.beginning()).last();
        world.application().all_settled()
            && world.all_in_op()
            && last.is_some_and(|last| last.delivery == Delivery::Complete && last.status.wkc == last.status.expected)
    };
    let outcome = loop {
        if all_complete(&world) {
            break Outcome::Complete;
        }
        if let Some(outcome) = reason(&world) {
            break outcome;
        }
        if world.application().now() >= begin + LIMIT {
            let states: Vec<_> = world.network().devices().map(|device| device.al_status().al_state()).collect();
            let status = world.evaluated(world.beginning()).last().map(|evaluated| evaluated.status);
            return Err(format!("neither in OP nor a reason: {states:?} {status:?}"));
        }
        world.run_cycles(10);
    };
    world.run_cycles(50);
    let mark = world.mark();
    let latched: Vec<u64> = world.network().devices().map(|device| device.outputs_latched()).collect();
    world.run_cycles(50);
    others_work(&world, &latched)?;
    if world.evaluated(mark).iter().any(|evaluated| evaluated.delivery.is_incomplete()) {
        return Err(format!("{outcome:?}, and cycles are incomplete"));
    }
    if outcome == Outcome::Complete && !all_complete(&world) {
        return Err("complete only for a while".to_owned());
    }
    let oddity = |event: &Event| matches!(event, Event::SiiWarning { position, .. } if usize::from(position.0) == ODD);
    let warned = world.saw(world.beginning(), oddity);
    if let Change::Cut { is_inside: true, .. } = made.change
        && !warned
    {
        return Err("cut short, and no warning".to_owned());
    }
    let at_byte_0 = |event: &Event| {
        matches!(event, Event::SiiWarning { position, what } if usize::from(position.0) == ODD
            && what.contains("byte 0:"))
    };
    if world.saw(world.beginning(), at_byte_0) {
        return Err("a warning that names byte 0".to_owned());
    }
    Ok((outcome, warned))
}

/// The other SubDevices are in OP, their inputs are fresh, and they have accepted outputs since.
fn others_work(world: &World, latched: &[u64]) -> Result<(), String> {
    for other in [0, 1, 3] {
        let device = world.network().device(ringcat_sim::cable::DeviceIndex(other));
        if device.al_status() != AlStatus::new(AlState::Op) {
            return Err(format!("{} is in {:?}", device.name(), device.al_status()));
        }
        let freshness = world.application().exchange().freshness(DomainId(0), SubDeviceId(other));
        if !device.inputs().is_empty() && freshness != Freshness::Fresh {
            return Err(format!("{} is not fresh", device.name()));
        }
        if !device.outputs().is_empty() && device.outputs_latched() < latched[other] + 40 {
            return Err(format!("{} took no outputs", device.name()));
        }
    }
    Ok(())
}

/// Checks all variants of an image, of seed 1 or of those in the environment.
fn evaluate_all(sound: &DeviceDescription, count: u64, tally: &mut Tally) {
    for seed in seeds::from_environment().unwrap_or(1..2) {
        check_seed(sound, seed, count, tally);
    }
}

fn check_seed(sound: &DeviceDescription, seed: u64, count: u64, tally: &mut Tally) {
    let image = sii_image::build(sound);
    let mut dice = Dice::new(seed);
    for number in 0..count {
        let made = variant(&image, number, &mut dice);
        for truth in [Truth::Damaged, Truth::AsItSays] {
            let odd = match truth {
                Truth::Damaged => with_image(sound.clone(), &made.image),
                Truth::AsItSays => match DeviceDescription::from_sii(made.image.clone(), &sound.name) {
                    Ok(mut odd) => {
                        // It has the same place as before.
                        (odd.behaviour, odd.ports) = (sound.behaviour.clone(), sound.ports);
                        odd
                    }
                    Err(_) => {
                        tally.no_device += 1;
                        continue;
                    }
                },
            };
            let evaluated = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| evaluate(&made, odd)));
            let evaluated = evaluated.unwrap_or_else(|_| Err("it panics, or image and SubDevice differ".to_owned()));
            match evaluated {
                Ok((outcome, warned)) => {
                    tally.warned += usize::from(warned);
                    match outcome {
                        Outcome::Complete => tally.complete += 1,
                        Outcome::Refused => tally.refused += 1,
                        Outcome::RefusedByDevice => {
                            tally.by_device += 1;
                            if truth == Truth::AsItSays {
                                tally.disagree.push(format!("{} number {number}: {}", sound.name, made.change));
                            }
                        }
                    }
                }
                Err(what) => {
                    let line = format!("seed {seed} {} number {number} {truth:?} {}: {what}", sound.name, made.change);
                    println!("{line}");
                    tally.failures.push(line);
                }
            }
        }
    }
}

fn finish(tally: &Tally, what: &str) {
    println!(
        "{what}: {} in OP and complete, {} with the reason from the SII, {} with the reason from the SubDevice, {} \
         make no device; {} warned of",
        tally.complete, tally.refused, tally.by_device, tally.no_device, tally.warned
    );
    for what in &tally.disagree {
        println!("MainDevice and simulator read it differently: {what}");
    }
    assert!(tally.failures.is_empty(), "{} fail, the first: {}", tally.failures.len(), tally.failures[0]);
}

// covers: odd-sii
#[test]
fn damaged_catalogue_images_are_explained_and_stop_no_other_subdevice() {
    let mut tally = Tally::default();
    for name in catalogue::names() {
        evaluate_all(&describe(name, name), variants(SOME), &mut tally);
    }
    finish(&tally, "images of the catalogue");
}

// covers: odd-sii
#[test]
fn damaged_images_of_real_devices_stop_no_other_subdevice() {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/sii");
    let Ok(entries) = std::fs::read_dir(&directory) else {
        println!("skipped: {} is not there", directory.display());
        return;
    };
    let mut paths: Vec<_> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "bin"));
    paths.sort();
    let mut tally = Tally::default();
    for path in paths {
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let image = std::fs::read(&path).expect("an image can be read");
        match DeviceDescription::from_sii(image.clone(), &name) {
            Ok(mut sound) => {
                sound.behaviour = Behaviour::Terminal(InputSource::Outputs);
                evaluate_all(&sound, variants(MANY), &mut tally);
            }
            Err(error) => {
                println!("{name}: {error}");
                let plain = DeviceDescription::plain(&name, Identity::default());
                evaluate_all(&with_image(plain, &image), variants(MANY), &mut tally);
            }
        }
    }
    finish(&tally, "images of real devices");
}
