//! Hostile segments: EEPROMs with any content, responses with any data, working counters, lengths and bytes. Nothing
//! panics, nothing hangs, virtual time and memory stay bounded, and after the end of the wrong responses the next scan
//! finds all SubDevices.
//!
//! `SEED=17 cargo test -p scenarios --test hostile environment -- --nocapture` runs one seed of each.

use std::cell::Cell;
use std::ops::Range;
use std::rc::Rc;
use std::time::Duration;

use ringcat::{Application, Instant, Knowledge, LastOutputs, Links, MainDevice, Options, automatic};
use ringcat_engine::knowledge::seal;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::al::AlState;
use ringcat_wire::datagram::HEADER_LEN;
use ringcat_wire::frame::Frame;
use scenarios::counting_allocator::{CountingAllocator, counts, restart_peak};
use scenarios::dice::Dice;
use scenarios::fuzz_targets::knowledge;
use scenarios::seeds;
use scenarios::segments::{descriptions, line, ring};
use scenarios::tampered_links::{TamperedLinks, Verdict};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

const KINDS: [&str; 6] =
    ["coupler", "digital-input-8", "digital-output-16", "analog-input-4", "servo", "emulated-output-8"];
/// Limit of the virtual time of a seed: three attempts of a scan, each within the limits of its EEPROMs, and the run
/// after it.
const LIMIT: Instant = Instant(150_000_000_000);
/// Maximum memory of MainDevice and segment, in bytes.
const MEMORY: i64 = 64 << 20;

/// A segment, and the product codes of its devices.
fn segment(dice: &mut Dice, seed: u64) -> (Network, Vec<u32>) {
    let kinds: Vec<&str> = (0..1 + dice.below(5)).map(|_| *dice.pick(&KINDS)).collect();
    let options = NetworkOptions::default().with_seed(seed);
    let descriptions = descriptions(&kinds);
    let products = descriptions.iter().map(|description| description.identity.product_code).collect();
    (if dice.one_in(2) { ring(descriptions, options) } else { line(descriptions, options) }, products)
}

fn bytes(dice: &mut Dice, count: u64) -> Vec<u8> {
    let any = |dice: &mut Dice| match dice.below(4) {
        0 => 0x00,
        1 => 0xFF,
        _ => dice.roll() as u8,
    };
    (0..count).map(|_| any(dice)).collect()
}

/// Any content: random bytes, an image with inverted bytes, truncated, or with categories of any type and length.
fn image(dice: &mut Dice, right: &[u8]) -> Vec<u8> {
    let mut image = right.to_vec();
    match dice.below(5) {
        0 => {
            let count = dice.below(5_000);
            image = bytes(dice, count);
        }
        1 => image.truncate(dice.below(right.len() as u64) as usize),
        2 => {
            for _ in 0..1 + dice.below(20) {
                let at = dice.below(right.len() as u64) as usize;
                image[at] = dice.roll() as u8;
            }
        }
        3 => {
            image.truncate(128);
            // An impossible size.
            image[0x7C..0x7E].copy_from_slice(&(dice.roll() as u16).to_le_bytes());
            for _ in 0..dice.below(40) {
                let kind: u16 = *dice.pick(&[10, 30, 40, 41, 50, 51, 60, 0, 0x8001, 0x1234]);
                let (words, there) = (dice.below(200) as u16, dice.below(400));
                image.extend(kind.to_le_bytes());
                image.extend(words.to_le_bytes());
                let data = bytes(dice, there);
                image.extend(data);
            }
        }
        _ => {}
    }
    image
}

/// Activates the result of a scan and runs it for a while; a refusal is a valid result too. `stop` is called before the
/// end.
fn work<L: Links>(mut main_device: MainDevice<L>, cycles: u32, stop: impl Fn()) -> MainDevice<L> {
    let Ok(scan) = main_device.scan() else { return main_device };
    let declaration = automatic(&scan.subdevices, Duration::from_millis(1));
    let mut application: Application<L> = match main_device.activate(declaration) {
        Ok(application) => application,
        Err(refused) => return refused.main_device,
    };
    for number in 0..cycles {
        application.cycle(|data| {
            data.fill_outputs(number as u8);
        });
        while application.pop_event().is_some() {}
    }
    stop();
    application
        .stop(LastOutputs::Zero, AlState::Init, Duration::from_secs(1))
        .unwrap_or_else(|error| panic!("all go to INIT: {error}"))
}

/// Runs seeds, and checks the memory of each.
fn runs(seeds: Range<u64>, run: impl Fn(u64) + std::panic::RefUnwindSafe) {
    for seed in seeds {
        restart_peak();
        let before = counts().bytes;
        if let Err(panic) = std::panic::catch_unwind(|| run(seed)) {
            println!("seed {seed}");
            std::panic::resume_unwind(panic);
        }
        let counts = counts();
        assert!(counts.peak - before < MEMORY, "seed {seed}: {} bytes", counts.peak - before);
    }
}

fn eeproms(seed: u64) {
    let mut dice = Dice::new(seed);
    let (mut network, _) = segment(&mut dice, seed);
    for device in 0..network.devices().count() {
        let device = ringcat_sim::cable::DeviceIndex(device);
        let right = network.device(device).controller.sii_image().to_vec();
        *network.device_mut(device).controller.sii_image_mut() = image(&mut dice, &right);
    }
    let options = Options::default().with_sii_cache(!dice.one_in(3));
    let links = TamperedLinks::new(network, LIMIT, |_| Verdict::Arrives);
    work(MainDevice::request(links, &options), 200, || ());
}

/// Offset and data length of each datagram of a frame.
fn datagrams(frame: &[u8]) -> Vec<(usize, usize)> {
    let Ok(parsed) = Frame::parse(frame) else { return Vec::new() };
    let mut at = parsed.payload_offset();
    let place = |length: usize| {
        let begin = at;
        at += HEADER_LEN + length + 2;
        (begin, length)
    };
    parsed.datagrams().map(|datagram| datagram.data.len()).map(place).collect()
}

/// Changes a response of the segment.
fn lie(dice: &mut Dice, frame: &mut Vec<u8>) -> Verdict {
    let places = datagrams(frame);
    let Some(&(begin, length)) = places.get(dice.below(places.len() as u64) as usize) else {
        return Verdict::Arrives;
    };
    let (data, wkc) = (begin + HEADER_LEN, begin + HEADER_LEN + length);
    match dice.below(12) {
        0..=3 => {
            let said = bytes(dice, length as u64);
            frame[data..data + length].copy_from_slice(&said);
        }
        4..=6 => {
            let said = if dice.one_in(2) { dice.below(4) as u16 } else { dice.roll() as u16 };
            frame[wkc..wkc + 2].copy_from_slice(&said.to_le_bytes());
        }
        7 => {
            let said = dice.roll() as u16;
            frame[wkc - length - 2..wkc - length].copy_from_slice(&said.to_le_bytes());
        }
        8 => {
            let at = dice.below(frame.len() as u64) as usize;
            frame[at] = dice.roll() as u8;
        }
        9 => frame.truncate(dice.below(frame.len() as u64) as usize),
        10 => {
            let count = dice.below(1_600);
            *frame = bytes(dice, count);
        }
        _ => return if dice.one_in(2) { Verdict::IsLost } else { Verdict::ArrivesTwice },
    }
    Verdict::Arrives
}

fn lies(seed: u64) {
    let mut dice = Dice::new(seed);
    let (network, expected) = segment(&mut dice, seed);
    let options = Options::default().with_sii_cache(dice.one_in(2));
    let (one_in, left) = (*dice.pick(&[2, 10, 100]), Rc::new(Cell::new(0)));
    let changes_left = left.clone();
    let mut tamperer = dice;
    let links = TamperedLinks::new(network, LIMIT, move |frame| {
        if changes_left.get() == 0 || !tamperer.one_in(one_in) {
            return Verdict::Arrives;
        }
        changes_left.set(changes_left.get() - 1);
        lie(&mut tamperer, frame)
    });
    let mut main_device = MainDevice::request(links, &options);
    for _ in 0..3 {
        left.set(20 + dice.below(200));
        main_device = work(main_device, 200, || left.set(0));
    }
    left.set(0);
    let scan = main_device.scan().unwrap_or_else(|error| panic!("the responses are right again: {error}"));
    let found: Vec<u32> = scan.subdevices.iter().map(|info| info.identity.product_code).collect();
    assert_eq!(found, expected);
    // The cache may keep wrong contents that were read with a right fixed area.
    if !options.sii_cache {
        let declaration = automatic(&scan.subdevices, Duration::from_millis(1));
        let mut application = main_device.activate(declaration).map_err(|refused| refused.error).expect("fits");
        (0..300).for_each(|_| application.cycle(|_| ()));
        assert!(application.all_settled(), "{:?}", application.states());
    }
}

// covers: robust
#[test]
fn eeproms_of_any_content_are_read_or_refused_seeds_0_to_149() {
    runs(0..150, eeproms);
}

// covers: robust
#[test]
fn wrong_responses_have_no_lasting_effect_seeds_0_to_149() {
    runs(0..150, lies);
}

#[test]
fn seeds_from_the_environment() {
    let Some(seeds) = seeds::from_environment() else { return println!("skipped: no SEED given") };
    runs(seeds.clone(), eeproms);
    runs(seeds, lies);
}

/// Most memory for the bytes of a knowledge: 32 times their length, and an error.
fn check_memory(content: &[u8]) {
    let bytes = seal(content);
    let before = counts().bytes;
    restart_peak();
    let knowledge = Knowledge::from_bytes(&bytes);
    let peak = counts().peak - before;
    assert!(peak <= 32 * bytes.len() as i64 + 1024, "{peak} bytes of memory for {}", bytes.len());
    drop(knowledge);
    assert_eq!(counts().bytes, before);
}

// covers: states
#[test]
fn memory_for_knowledge_is_bounded_by_the_length_of_the_bytes() {
    for seed in seeds::from_environment().unwrap_or(0..2_000) {
        let mut dice = Dice::new(seed);
        let mut content = knowledge::SMALL[knowledge::HEADER..].to_vec();
        // Lengths of lists lie anywhere; behind them are many elements of the fewest bytes.
        let at = dice.below(content.len() as u64 - 4) as usize;
        let filling = if dice.one_in(2) { 0 } else { dice.roll() as u8 };
        content.truncate(at);
        let count = if dice.one_in(4) { u32::MAX } else { dice.below(40_000) as u32 };
        content.extend(count.to_le_bytes());
        content.resize(at + dice.below(60_000) as usize, filling);
        check_memory(&content);
        let any = bytes(&mut dice, 5_000);
        check_memory(&any);
    }
}
