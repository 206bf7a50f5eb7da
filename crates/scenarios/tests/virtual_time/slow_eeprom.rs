//! EEPROMs that are slow sometimes or always, and frames that are late or lost while they are read: a scan takes the
//! necessary time within a limit, and finds all SubDevices (protocol 3.8, 5.4).

use std::time::Duration;

use ringcat::{Error, Event, Instant, Links, MainDevice, Options, Scan};
use ringcat_sim::cable::{DeviceIndex, Direction, HostLink};
use ringcat_sim::description::DeviceDescription;
use ringcat_sim::fault::Fault;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_sim::time::SimTime;
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Header;
use ringcat_wire::frame::Frame;
use ringcat_wire::register::map;
use scenarios::dice::Dice;
use scenarios::segments::{describe, line};
use scenarios::tampered_links::{TamperedLinks, Verdict};
use scenarios::tap::Tap;

/// Limit of the virtual time of a scan.
const LIMIT: Instant = Instant(200_000_000_000);

fn network(terminals: Vec<DeviceDescription>) -> Network {
    line(terminals, NetworkOptions::default())
}

fn terminal(busy: Duration) -> DeviceDescription {
    DeviceDescription { sii_busy: busy, ..describe("digital-output-8", "terminal") }
}

/// The result of a scan, its time, and the number of counting broadcasts.
fn scan(network: Network) -> (Result<Scan, Error>, Duration, usize) {
    let mut tap = Tap::new(network);
    tap.set_limit(LIMIT);
    let mut main_device = MainDevice::request(tap, &Options::default());
    let mut counted = 0;
    let result = main_device.scan_with(|timed| counted += usize::from(matches!(timed.event, Event::Counted { .. })));
    let took = Duration::from_nanos(main_device.links_mut().now().0);
    (result, took, counted)
}

// covers: slow-eeproms
#[test]
fn an_eeprom_that_is_always_slow_is_given_up_after_30_s_with_its_word() {
    let mut slow = terminal(Duration::from_millis(99));
    let mut image = ringcat_sim::device::Device::new(slow.clone()).controller.sii_image()[..128].to_vec();
    // Strings without end, within the EEPROM's size of 16 KByte.
    image[0x7C..0x7E].copy_from_slice(&127u16.to_le_bytes());
    image.extend([10, 0, 0xFF, 0x0F]);
    slow.sii_image = Some(image);
    let mut main_device =
        MainDevice::request(Tap::new(network(vec![terminal(Duration::from_micros(500)), slow])), &Options::default());
    let mut reports = Vec::new();
    let result = main_device.scan_with(|timed| {
        if let Event::SiiWarning { position, what } = &timed.event {
            reports.push((position.0, what.clone()));
        }
    });
    let took = Duration::from_nanos(main_device.links_mut().now().0);
    // The other EEPROM is read nevertheless.
    let found = result.expect("a scan").subdevices;
    assert!(found[0].warnings.is_empty() && found[0].name == "terminal" && !found[0].is_blank());
    assert!(found[1].is_blank() && found[1].identity.vendor_id == u32::MAX);
    let (position, what) = &reports[0];
    let word = what.strip_prefix("the EEPROM is slow: at word 0x").and_then(|rest| rest.strip_suffix(" after 30 s"));
    let word = word.and_then(|word| u32::from_str_radix(word, 16).ok()).unwrap_or_else(|| panic!("{what}"));
    assert_eq!(*position, 1);
    assert!((0x40..0x1000).contains(&word), "{word:#x}");
    assert!((Duration::from_secs(30)..Duration::from_secs(31)).contains(&took), "{took:?}");
}

// covers: slow-eeproms
#[test]
fn one_slow_command_does_not_slow_down_the_following_words() {
    let (_, usual, _) = scan(network(vec![terminal(Duration::from_micros(500))]));
    for at_us in (1_000..30_000).step_by(2_900) {
        let mut network = network(vec![terminal(Duration::from_micros(500))]);
        let slow = Fault::SlowSii { device: DeviceIndex(0), busy: Duration::from_millis(60), times: 1 };
        network.schedule(SimTime(at_us * 1_000), slow);
        let (result, took, _) = scan(network);
        assert_eq!(result.expect("it can be read").subdevices.len(), 1);
        assert!(took < usual + Duration::from_millis(70), "slow at {at_us} us: {took:?}, usually {usual:?}");
    }
}

// covers: slow-eeproms
#[test]
fn a_scan_after_one_of_a_slow_eeprom_reads_quick_ones_quickly() {
    let mut terminals = vec![terminal(Duration::from_micros(500)); 2];
    terminals[1].sii_busy = Duration::from_millis(20);
    let options = Options::default().with_sii_cache(false);
    let mut main_device = MainDevice::request(Tap::new(network(terminals)), &options);
    main_device.scan().expect("both can be read");
    let cable = ringcat_sim::cable::CableId(1);
    main_device.links_mut().network_mut().apply(Fault::Cut(cable));
    let begin = main_device.links_mut().now();
    assert_eq!(main_device.scan().expect("the quick one can be read").subdevices.len(), 1);
    let took = main_device.links_mut().now().since(begin);
    assert!(took < Duration::from_millis(60), "{took:?}");
}

// covers: slow-eeproms
#[test]
fn late_and_lost_frames_during_eeprom_reads_restart_no_scan_seeds_0() {
    for seed in 0..40 {
        let mut dice = Dice::new(seed);
        let busy = [500, 2_000, 8_000][dice.below(3) as usize];
        let mut network = network(vec![terminal(Duration::from_micros(busy)); 1 + dice.below(3) as usize]);
        let cable = network.host_cable(HostLink::Main).expect("there is one");
        let direction = *dice.pick(&[Direction::AToB, Direction::BToA]);
        let mut at_us = 8_000;
        while at_us < 400_000 {
            let (direction, count) = (Some(direction), 1 + dice.below(2) as u32);
            let by = Duration::from_micros(500 + dice.below(12_000));
            let fault = match dice.below(3) {
                0 => Fault::Drop { cable, direction, count },
                _ => Fault::Delay { cable, direction, count, by },
            };
            network.schedule(SimTime(at_us * 1_000), fault);
            at_us += 6_000 + dice.below(40_000);
        }
        let expected = network.devices().count();
        let (result, _, counted) = scan(network);
        let found = result.unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        assert_eq!((found.subdevices.len(), counted), (expected, 1), "seed {seed}");
        assert!(found.subdevices.iter().all(|info| info.warnings.is_empty()), "seed {seed}: {:?}", found.subdevices);
    }
}

// covers: slow-eeproms
#[test]
fn an_sii_command_repeated_after_a_lost_response_has_no_effect() {
    for seed in 0..20 {
        let mut dice = Dice::new(seed);
        let busy = Duration::from_micros(*dice.pick(&[500, 3_000, 8_000]));
        let mut lost = 0;
        // One in four responses to frames with an EEPROM command is lost: the command is repeated while the EEPROM is
        // busy with it or has finished it.
        let links = TamperedLinks::new(network(vec![terminal(busy); 2]), LIMIT, |bytes| {
            let is_command = |it: &Header| it.command == Command::Fpwr && it.address >> 16 == map::SII_CONTROL.0.into();
            let frame = Frame::parse(bytes);
            let has_command = frame.is_ok_and(|frame| frame.datagrams().any(|it| is_command(&it.header)));
            let is_lost = has_command && dice.one_in(4);
            lost += u32::from(is_lost);
            if is_lost { Verdict::IsLost } else { Verdict::Arrives }
        });
        let mut main_device = MainDevice::request(links, &Options::default());
        let mut counted = 0;
        let result =
            main_device.scan_with(|timed| counted += usize::from(matches!(timed.event, Event::Counted { .. })));
        let found = result.unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        assert_eq!((found.subdevices.len(), counted), (2, 1), "seed {seed}");
        assert!(found.subdevices.iter().all(|info| info.warnings.is_empty() && info.name == "terminal"), "seed {seed}");
        drop(main_device);
        assert!(lost > 5, "seed {seed}: {lost}");
    }
}
