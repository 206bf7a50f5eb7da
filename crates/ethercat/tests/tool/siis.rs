//! SIIs that were read before: shown again only where the EEPROM is unchanged.

use std::time::{Duration, Instant};

use ringcat::automatic;
use ringcat::sim::cable::DeviceIndex;
use ringcat::sim::fault::Fault;
use ringcat_wire::register::map;

use crate::bench::{Bench, Driver};
use crate::several::ring;

const CYCLE: Duration = Duration::from_millis(1);
/// A byte behind the words that are read anew each time.
const BEHIND: usize = 100;
/// The low byte of the serial number.
const SERIAL: usize = 0x0E * 2;

fn whole(bench: &Bench, position: u16) -> Vec<u8> {
    let done = bench.tool(&["sii_read", "-p", &position.to_string()]);
    assert!(done.code == Some(0) && done.err.is_empty() && done.bytes.len() > BEHIND, "{done:?}");
    done.bytes
}

/// An image with another byte.
fn with(image: &[u8], at: usize, mask: u8) -> Vec<u8> {
    let mut image = image.to_vec();
    image[at] ^= mask;
    image
}

/// Changes a byte of the EEPROM without a command, which no real EEPROM does.
fn flip(bench: &Bench, position: usize, offset: usize, mask: u8) {
    let fault = Fault::CorruptSii { device: DeviceIndex(position), offset, mask };
    bench.inside(0, move |segment| segment.network_mut().apply(fault));
}

/// Writes bytes into registers.
fn registers(bench: &Bench, position: u16, address: &str, bytes: &[u8]) {
    let file = bench.directory.join("registers");
    std::fs::write(&file, bytes).expect("it can be written");
    let path = file.to_str().expect("it is text");
    assert_eq!(bench.good(&["reg_write", "-p", &position.to_string(), address, path]), "");
}

/// An image is shown again, and its first words are read anew.
fn kept(bench: &Bench) {
    let image = whole(bench, 1);
    flip(bench, 1, BEHIND, 0x10);
    assert_eq!(whole(bench, 1), image, "it is not read again");
    assert_eq!(whole(bench, 1), image, "nor a third time");
    flip(bench, 1, SERIAL, 0x20);
    let anew = with(&with(&image, BEHIND, 0x10), SERIAL, 0x20);
    assert_eq!(whole(bench, 1), anew, "another serial number is another SubDevice");
    flip(bench, 1, BEHIND, 0x10);
    flip(bench, 1, SERIAL, 0x20);
    assert_eq!(whole(bench, 1), image);
}

/// The EEPROM is written by others: through the registers, by the PDI, by the tool.
fn written(bench: &Bench) {
    let image = whole(bench, 1);
    // It may still be offered to the PDI from the round before.
    registers(bench, 1, "0x0500", &[0]);
    let word = |value: u8| [value, image[BEHIND + 1]];
    let address = ((BEHIND / 2) as u32).to_le_bytes();
    let command = [&[0x01, 0x02][..], &address, &word(0xA5)].concat();
    registers(bench, 1, "0x0502", &command);
    let wanted = with(&image, BEHIND, image[BEHIND] ^ 0xA5);
    bench.wait_until("a word written by registers", || whole(bench, 1) == wanted);
    // The PDI takes the offered EEPROM, writes it, and releases it.
    registers(bench, 1, "0x0500", &[1]);
    bench.inside(0, move |segment| {
        let network = segment.network_mut();
        let now = network.now();
        let controller = &mut network.device_mut(DeviceIndex(1)).controller;
        assert!(controller.pdi_write(map::SII_PDI_ACCESS, &[1], now));
        assert!(controller.pdi_write(map::SII_ADDRESS, &[&address[..], &[0x5A, 0]].concat(), now));
        assert!(controller.pdi_write(map::SII_CONTROL, &[0, 2], now));
    });
    assert_ne!(whole(bench, 1), wanted, "the tool takes the EEPROM from the PDI");
    bench.wait_until("the word of the PDI", || whole(bench, 1)[BEHIND..BEHIND + 2] == [0x5A, 0]);
    let file = bench.directory.join("image");
    std::fs::write(&file, &image).expect("it can be written");
    assert_eq!(bench.good(&["sii_write", "-f", "-p1", file.to_str().expect("it is text")]), "");
    assert_eq!(whole(bench, 1), image);
    assert_eq!(bench.good(&["alias", "-f", "-p1", "0x1234"]), "");
    assert_eq!(whole(bench, 1)[8..10], [0x34, 0x12]);
    assert_eq!(bench.good(&["sii_write", "-f", "-p1", file.to_str().expect("it is text")]), "");
    assert_eq!(whole(bench, 1), image);
}

/// Another SubDevice with the same numbers comes to the place of one that was read.
fn exchanged(bench: &Bench, state: &str) {
    let image = whole(bench, 2);
    let device = DeviceIndex(2);
    bench.inside(0, move |segment| segment.network_mut().apply(Fault::PowerOff(device)));
    bench.wait_until("it has left", || !bench.good(&["slaves", "-p2"]).contains(state));
    let gone = bench.tool(&["sii_read", "-p2"]);
    assert!(gone.code == Some(1) && gone.bytes.is_empty() && !gone.err.is_empty(), "{gone:?}");
    flip(bench, 2, BEHIND, 0x40);
    bench.inside(0, move |segment| segment.network_mut().apply(Fault::PowerOn(device)));
    bench.wait_until("it is back", || bench.good(&["slaves", "-p2"]).contains(state));
    assert_eq!(whole(bench, 2), with(&image, BEHIND, 0x40));
}

/// Two SubDevices with the same numbers change places and keep their power, and with it what was in their registers.
fn moved(bench: &Bench) {
    let images = [whole(bench, 0), whole(bench, 1)];
    let of = |position: usize| {
        bench.inside(0, move |segment| {
            let network = segment.network_mut();
            let now = network.now();
            let device = network.device_mut(DeviceIndex(position));
            let mut registers = [0; 6];
            device.controller.pdi_read(map::SII_ADDRESS, &mut registers, now);
            (device.controller.sii_image().to_vec(), registers)
        })
    };
    let there = [of(0), of(1)];
    assert_ne!(there[0].1, there[1].1, "each has a number of its own");
    for (position, (image, marks)) in (0..).zip(there.into_iter().rev()) {
        registers(bench, position, "0x0504", &marks);
        let device = DeviceIndex(position.into());
        bench.inside(0, move |segment| {
            *segment.network_mut().device_mut(device).controller.sii_image_mut() = image;
        });
    }
    assert_eq!([whole(bench, 1), whole(bench, 0)], images);
}

// covers: daemon, 3.8
#[test]
fn an_sii_that_was_read_is_shown_again_only_while_it_is_unchanged() {
    let bench = Bench::start(vec![ring(3, true)]);
    for is_active in [false, true] {
        let driver = is_active.then(|| Driver::start(&bench, |found| automatic(found, CYCLE)));
        let state = if is_active { "  OP  " } else { "  PREOP  " };
        bench.wait_until("its state", || bench.good(&["slaves"]).matches(state).count() == 3);
        kept(&bench);
        written(&bench);
        exchanged(&bench, state);
        drop(driver);
    }
    bench.wait_until("idle", || bench.good(&["slaves"]).matches("  PREOP  ").count() == 3);
    kept(&bench);
}

// covers: daemon, 3.8
#[test]
fn subdevices_that_change_places_under_power_are_distinguished() {
    let segment = "[segment]\n[[device]]\ntype = \"digital-input-8\"\n[[device]]\ntype = \"digital-input-8\"\n";
    let segment = ringcat::sim::segment::Segment::from_toml(segment, std::path::Path::new("."));
    let bench = Bench::start(vec![segment.expect("it is right")]);
    flip(&bench, 1, BEHIND, 0x80);
    assert_ne!(whole(&bench, 0)[BEHIND..], whole(&bench, 1)[BEHIND..]);
    moved(&bench);
}

/// Runs of a measurement.
const RUNS: usize = 21;
/// `ethercat sii_read` of 100 SIIs that were read before, from its start to its end.
const BAR: Duration = Duration::from_millis(50);

/// The bar holds where nothing else runs (`.ci/run`), and is shown otherwise.
fn measure(bench: &Bench, what: &str) {
    let begin = Instant::now();
    let first = bench.good(&["sii_read", "--json"]);
    let anew = begin.elapsed();
    assert_eq!(first.lines().count(), 100);
    let mut times: Vec<Duration> = (0..RUNS)
        .map(|_| {
            let begin = Instant::now();
            assert!(bench.good(&["sii_read", "--json"]) == first);
            begin.elapsed()
        })
        .collect();
    times.sort();
    let middle = times[RUNS / 2];
    println!("ethercat sii_read, 100 SIIs, {what}: read {anew:?}; kept {middle:?}, longest {:?}", times[RUNS - 1]);
    assert!(middle < anew, "{what}");
    assert!(middle <= BAR || std::env::var_os("RINGCAT_ON_THE_WIRE").is_none(), "{what}: {middle:?}");
}

// covers: daemon
#[test]
fn siis_of_100_slaves_that_were_read_come_within_50_ms() {
    let bench = Bench::start(vec![ring(100, true)]);
    measure(&bench, "idle");
    let driver = Driver::start(&bench, |found| automatic(found, CYCLE));
    measure(&bench, "beside cycles of 1 ms");
    println!("cycles: {}", driver.end());
    // A SubDevice that does not answer does not keep the others from being shown.
    bench.inside(0, |segment| segment.network_mut().apply(Fault::PowerOff(DeviceIndex(99))));
    let done = bench.tool(&["sii_read", "--json"]);
    assert!(done.out.lines().count() >= 99, "{} {}", done.out.lines().count(), done.err);
}
