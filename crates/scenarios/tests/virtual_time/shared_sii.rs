//! SubDevices of one type share the reading of their SIIs. Whatever frames are lost, and wherever longer names move the
//! data behind them, a scan takes for each SubDevice what its own EEPROM contains.

use std::time::Duration;

use ringcat::{Links, MainDevice, Options, Scan, SubDeviceInfo};
use ringcat_sim::cable::{CableId, Direction};
use ringcat_sim::description::DeviceDescription;
use ringcat_sim::fault::Fault;
use ringcat_sim::network::{Beyond, DatagramLimit, Network, NetworkOptions};
use ringcat_sim::time::SimTime;
use ringcat_wire::sii::Identity;
use scenarios::dice::Dice;
use scenarios::segments::{describe, line, ring};
use scenarios::tap::Tap;

const KINDS: [&str; 5] = ["servo", "digital-output-8", "emulated-output-8", "digital-input-16", "analog-input-4"];
const LIMITS: [Option<u16>; 3] = [None, Some(15), Some(5)];

/// A segment of one type and the options to scan it.
struct Case {
    descriptions: Vec<DeviceDescription>,
    is_ring: bool,
    limit: Option<u16>,
}

impl Case {
    fn roll(dice: &mut Dice) -> Case {
        let kind = *dice.pick(&KINDS);
        let count = 10 + dice.below(31) as usize;
        let lengths = 1 + dice.below(4) as usize;
        // Names of several lengths: the rest of such an SII has another place.
        let name = |dice: &mut Dice| "drive-and-more"[..5 + 3 * dice.below(lengths as u64) as usize].to_owned();
        let descriptions = (0..count).map(|_| describe(kind, &name(dice))).collect();
        Case { descriptions, is_ring: dice.one_in(2), limit: *dice.pick(&LIMITS) }
    }

    fn network(&self) -> Network {
        let max_datagrams = self.limit.map(|datagrams| DatagramLimit { datagrams, beyond: Beyond::Dropped });
        let build = if self.is_ring { ring } else { line };
        build(self.descriptions.clone(), NetworkOptions::default().with_max_datagrams(max_datagrams))
    }

    fn scan(&self, network: Network, cache: bool) -> Result<Scan, ringcat::Error> {
        let options = Options::default().with_sii_cache(cache);
        let options = match self.limit {
            Some(limit) => options.with_max_datagrams_per_frame(limit),
            None => options,
        };
        let mut tap = Tap::new(network);
        tap.set_limit(tap.now() + Duration::from_secs(20));
        MainDevice::request(tap, &options).scan()
    }
}

/// What comes from the SII.
fn from_sii(scan: Scan) -> Vec<SubDeviceInfo> {
    let without_time = |mut info: SubDeviceInfo| {
        info.receive_times = None;
        info
    };
    scan.subdevices.into_iter().map(without_time).collect()
}

/// Frames are lost, spoilt, late or doubled on any cable while the EEPROMs are read.
fn disturb(network: &mut Network, dice: &mut Dice) {
    let cables = network.cables().len() as u64;
    let most_us = 200 + dice.below(3_000);
    let mut at_us = 5_500;
    while at_us < 60_000 {
        let cable = CableId(dice.below(cables) as usize);
        let direction = *dice.pick(&[None, Some(Direction::AToB), Some(Direction::BToA)]);
        let count = 1 + dice.below(2) as u32;
        let by = Duration::from_micros(100 + dice.below(4_000));
        let fault = match dice.below(6) {
            0 => Fault::Delay { cable, direction, count, by },
            1 => Fault::Duplicate { cable, direction, count },
            2 => Fault::Corrupt { cable, direction, count },
            _ => Fault::Drop { cable, direction, count },
        };
        network.schedule(SimTime(at_us * 1_000), fault);
        at_us += 50 + dice.below(most_us);
    }
}

fn every_accepted_sii_is_the_own_one(seeds: std::ops::Range<u64>) {
    let (total, mut accepted) = (seeds.end - seeds.start, 0);
    for seed in seeds {
        let dice = &mut Dice::new(seed);
        let case = Case::roll(dice);
        let expected = from_sii(case.scan(case.network(), false).expect("nothing is lost"));
        let quiet = from_sii(case.scan(case.network(), true).expect("nothing is lost"));
        assert!(quiet == expected, "seed {seed}: without losses");
        let mut network = case.network();
        disturb(&mut network, dice);
        let Ok(found) = case.scan(network, true) else { continue };
        accepted += 1;
        assert_eq!(found.subdevices.len(), expected.len(), "seed {seed}");
        for (found, expected) in from_sii(found).iter().zip(&expected) {
            assert_eq!(found, expected, "seed {seed}");
        }
    }
    assert!(4 * accepted >= 3 * total, "{accepted} of {total} scans");
}

// covers: scan, frame-limit
#[test]
fn lost_frames_give_no_subdevice_words_of_another_seeds_0() {
    every_accepted_sii_is_the_own_one(0..40);
}

// covers: scan, frame-limit
#[test]
fn lost_frames_give_no_subdevice_words_of_another_seeds_1() {
    every_accepted_sii_is_the_own_one(1_000..1_040);
}

// covers: scan
#[test]
fn names_of_two_lengths_move_no_word_of_the_other_ones() {
    for longer in 0..1 << 6 {
        let name = |number: usize| if longer >> number & 1 == 1 { "a-drive" } else { "drive" };
        let descriptions = (0..6).map(|number| describe("emulated-output-8", name(number))).collect();
        let case = Case { descriptions, is_ring: false, limit: None };
        let [alone, shared] = [false, true].map(|cache| from_sii(case.scan(case.network(), cache).expect("all there")));
        assert_eq!(shared, alone, "{longer:#b}");
    }
}

/// Names of one length: the headers of all categories are equal.
const NAMES: [&str; 8] = ["valve", "valve", "drive", "light", "scale", "drive", "meter", "valve"];

// covers: scan
#[test]
fn subdevices_without_a_vendor_have_the_names_of_their_own_siis() {
    let description = |name: &&str| {
        let mut description = describe("emulated-output-8", name);
        description.identity = Identity::default();
        description
    };
    let case = Case { descriptions: NAMES.iter().map(description).collect(), is_ring: false, limit: None };
    let found = case.scan(case.network(), true).expect("all are there");
    let names: Vec<String> = found.subdevices.iter().map(|info| info.name.clone()).collect();
    assert_eq!(names, NAMES);
}
