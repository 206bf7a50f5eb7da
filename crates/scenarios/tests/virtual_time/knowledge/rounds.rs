//! Two processes hand a segment to each other again and again, with SDOs and process data, while cables are cut: no
//! output stays as it was when the owner is gone.

use super::*;
use std::ops::Range;

use ringcat::{Direction, SubDeviceId};
use ringcat_sim::cable::CableId;
use ringcat_sim::fault::Fault;
use scenarios::dice::Dice;
use scenarios::seeds::from_environment;

const ROUNDS: usize = 1_000;
const KINDS: [&str; 5] = ["digital-output-8", "servo", "digital-output-16", "digital-input-8", "servo"];
/// The watchdog of outputs expires 100 ms after the last frame.
const WATCHDOG: Duration = Duration::from_millis(101);
/// From the first frame of the next owner on all outputs end within this time, if they have not before.
const ENDED: Duration = Duration::from_millis(60);

/// What has ended the outputs of a device.
#[derive(Debug, Default)]
struct Ends {
    by_watchdog: u32,
    by_owner: u32,
    with_former: u32,
    slowest_watchdog: Duration,
    slowest_owner: Duration,
}

/// Devices whose outputs are neither safe nor empty.
fn driven(network: &Network) -> usize {
    network.devices().filter(|device| device.outputs().iter().any(|byte| *byte != 0)).count()
}

/// Lets time pass without an owner; notes when the outputs ended.
fn unowned(links: &mut Tap, time: Duration, ends: &mut Ends) {
    let begun = links.network().now();
    let end = begun + time;
    while links.network().now() < end && driven(links.network()) > 0 {
        links.network_mut().advance_by(Duration::from_micros(500));
        if driven(links.network()) == 0 {
            ends.by_watchdog += 1;
            let took = Duration::from_nanos(links.network().now().0 - begun.0);
            ends.slowest_watchdog = ends.slowest_watchdog.max(took);
        }
        let took = Duration::from_nanos(links.network().now().0 - begun.0);
        assert!(took < WATCHDOG || driven(links.network()) == 0, "outputs without an owner after {took:?}");
    }
    let rest = end.0.saturating_sub(links.network().now().0);
    links.network_mut().advance_by(Duration::from_nanos(rest));
}

/// Cycles with outputs that are never zero.
fn drive(application: &mut Application<Tap>, count: usize) {
    let areas = (0..KINDS.len()).flat_map(|at| application.directory().areas(SubDeviceId(at)));
    let outputs = areas.filter(|area| area.direction == Direction::Outputs);
    let ranges: Vec<Range<usize>> = outputs
        .map(|area| {
            let start = area.placed.image_offset as usize;
            start..start + usize::from(area.placed.area.length)
        })
        .collect();
    for number in 0..count {
        application.cycle(|data| {
            for range in &ranges {
                let bytes = data.outputs_mut(DomainId(0), range.clone()).expect("they are outputs");
                bytes.fill(1 + (number % 250) as u8);
            }
        });
    }
}

struct Round<'a> {
    dice: &'a mut Dice,
    with_faults: bool,
    ends: &'a mut Ends,
    cut: Option<CableId>,
}

impl Round<'_> {
    /// Cuts a cable of the ring, or heals it.
    fn disturb(&mut self, network: &mut Network) {
        if !self.with_faults || !self.dice.one_in(3) {
            return;
        }
        let fault = match self.cut.take() {
            Some(cable) => Fault::Heal(cable),
            None => {
                let cable = CableId(self.dice.below(KINDS.len() as u64 + 1) as usize);
                self.cut = Some(cable);
                Fault::Cut(cable)
            }
        };
        network.apply(fault);
    }

    /// One owner: SDOs, process data, and its end. Returns the links and its bytes.
    fn own(&mut self, mut main_device: MainDevice<Tap>) -> (Tap, Vec<u8>, Handover) {
        self.disturb(main_device.links_mut().network_mut());
        for position in with_objects(&main_device) {
            let vendor = main_device.subdevice(position).sdo_read::<u32>(0x1018, 1);
            assert!(vendor.is_ok() || self.with_faults, "{vendor:?}");
        }
        let stale = to_bytes(&main_device);
        if main_device.subdevices().len() < KINDS.len() || self.dice.one_in(5) {
            let bytes = to_bytes(&main_device);
            return (main_device.into_links(), bytes, Handover::Orderly);
        }
        let mut application = activate(main_device);
        let ran = self.dice.below(150) as usize;
        drive(&mut application, ran);
        self.disturb(application.links_mut().network_mut());
        drive(&mut application, 20);
        match self.dice.below(3) {
            0 => {
                let ended = application.deactivate(LastOutputs::Held, LIMIT);
                let main_device = ended.unwrap_or_else(|refused| refused.main_device);
                let bytes = to_bytes(&main_device);
                (main_device.into_links(), bytes, Handover::Orderly)
            }
            1 => {
                let bytes = application.engine().knowledge().expect("it is scanned").to_bytes();
                (application.into_links(), bytes, Handover::Orderly)
            }
            _ => (application.into_links(), stale, Handover::AfterCrash),
        }
    }

    /// The next owner takes the segment after some time.
    fn take(&mut self, (mut links, bytes, handover): (Tap, Vec<u8>, Handover)) -> MainDevice<Tap> {
        if driven(links.network()) == 0 {
            self.ends.with_former += 1;
        }
        let longest = if self.dice.one_in(2) { 250_000 } else { 5_000 };
        let pause = Duration::from_micros(self.dice.below(longest));
        unowned(&mut links, pause, self.ends);
        self.disturb(links.network_mut());
        let begun = links.network().now();
        let was_driven = driven(links.network()) > 0;
        let mut main_device = resumed(links, &bytes, handover);
        // Devices behind a cut are ended by their watchdogs.
        let limit = if self.with_faults { ENDED + WATCHDOG } else { ENDED };
        while driven(main_device.links_mut().network()) > 0 {
            main_device.attend(Duration::from_micros(500));
            let took = Duration::from_nanos(main_device.now().0 - begun.0);
            assert!(took < limit, "outputs {took:?} after the next owner began");
        }
        if was_driven {
            self.ends.by_owner += 1;
            let took = Duration::from_nanos(main_device.now().0 - begun.0);
            self.ends.slowest_owner = self.ends.slowest_owner.max(took);
        }
        main_device
    }
}

fn rounds(with_faults: bool, count: usize, seed: u64) {
    let (mut dice, mut ends) = (Dice::new(seed), Ends::default());
    let mut main_device = idle(ring(descriptions(&KINDS), NetworkOptions::default()));
    let mut round = Round { dice: &mut dice, with_faults, ends: &mut ends, cut: None };
    for number in 0..count {
        let handed = round.own(main_device);
        main_device = round.take(handed);
        main_device.attend(Duration::from_millis(if with_faults { 400 } else { 60 }));
        let reachable = main_device.subdevices().len();
        assert_eq!(reachable, KINDS.len(), "seed {seed}, round {number}: a ring tolerates one break");
        assert_eq!(statuses(&mut main_device), [PREOP; KINDS.len()], "seed {seed}, round {number}");
        events(&mut main_device);
    }
    println!("{count} rounds, cable faults {with_faults}: {ends:?}");
    assert!(ends.by_watchdog > 0 && ends.by_owner > 0 && ends.with_former > 0, "{ends:?}");
}

// covers: states
#[test]
fn a_segment_is_handed_over_1000_times_and_no_output_stays() {
    rounds(false, ROUNDS, 1);
}

// covers: states
#[test]
fn a_segment_is_handed_over_while_cables_fail_and_no_output_stays() {
    for seed in from_environment().unwrap_or(0..2) {
        rounds(true, ROUNDS / 4, seed);
    }
}
