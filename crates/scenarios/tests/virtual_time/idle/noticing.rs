//! A change is noticed within 100 ms: with 100 SubDevices, also one that other SubDevices hide, and while a slow EEPROM
//! is read.

use ringcat_sim::description::DeviceDescription;
use scenarios::calls::faults::write_as_another;
use scenarios::dice::Dice;
use scenarios::segments::{SIXTEEN, describe};

use super::*;

const COUNT: usize = 100;

fn hundred() -> [Network; 2] {
    let kinds: Vec<&str> = SIXTEEN.into_iter().cycle().take(COUNT).collect();
    let options = NetworkOptions::default;
    [line(descriptions(&kinds), options()), ring(descriptions(&kinds), options())]
}

/// All are in PREOP, and nothing has happened since.
fn settled(network: Network) -> MainDevice<Tap> {
    let mut main_device = MainDevice::request(Tap::new(network), &options());
    main_device.attend(Duration::from_secs(2));
    assert!(statuses(&mut main_device).iter().all(|status| *status == PREOP));
    events(&mut main_device);
    main_device
}

/// Waits some milliseconds, so that the change comes at any moment of a period.
fn any_moment(main_device: &mut MainDevice<Tap>, dice: &mut Dice) {
    main_device.attend(Duration::from_millis(700) + Duration::from_micros(dice.below(100_000)));
    let before = events(main_device);
    assert!(before.is_empty(), "{before:?}");
}

// covers: states
#[test]
fn changes_among_100_are_noticed_within_100_ms() {
    let mut dice = Dice::new(17);
    let mut slowest = Duration::ZERO;
    for (number, network) in hundred().into_iter().enumerate() {
        let mut main_device = settled(network);
        let mut note = |time: Duration, what: &str| {
            assert!(time < NOTICED, "{what}, network {number}: {time:?}");
            slowest = slowest.max(time);
        };
        for _ in 0..6 {
            let device = DeviceIndex(dice.below(COUNT as u64) as usize);
            any_moment(&mut main_device, &mut dice);
            apply(&mut main_device, Fault::PowerOff(device));
            note(noticed(&mut main_device, |event| matches!(event, Event::Counted { .. })), "power off");
            any_moment_after(&mut main_device, &mut dice);
            apply(&mut main_device, Fault::PowerOn(device));
            note(noticed(&mut main_device, |event| matches!(event, Event::Counted { .. })), "power on");
            any_moment_after(&mut main_device, &mut dice);
            // Off and on between two broadcasts: its address is lost.
            apply(&mut main_device, Fault::PowerOff(device));
            apply(&mut main_device, Fault::PowerOn(device));
            note(noticed(&mut main_device, |event| matches!(event, Event::SegmentChanged { .. })), "restart");
            any_moment_after(&mut main_device, &mut dice);
        }
        for _ in 0..6 {
            let at = dice.below(COUNT as u64) as u16;
            any_moment(&mut main_device, &mut dice);
            write_as_another(main_device.links_mut().network_mut(), at, map::AL_CONTROL, &[1, 0]);
            let is_left = |event: &Event| matches!(event, Event::UndeclaredState { .. });
            note(noticed(&mut main_device, is_left), "a state");
            any_moment_after(&mut main_device, &mut dice);
        }
    }
    println!("100 SubDevices: a change is noticed within {slowest:?}");
}

// covers: states
#[test]
fn cut_cables_and_unplugged_links_among_100_are_noticed_within_100_ms() {
    let mut dice = Dice::new(71);
    let mut slowest = Duration::ZERO;
    for (number, network) in hundred().into_iter().enumerate() {
        let is_ring = number == 1;
        let mut main_device = settled(network);
        let mut note = |time: Duration, what: &str| {
            assert!(time < NOTICED, "{what}, ring {is_ring}: {time:?}");
            slowest = slowest.max(time);
        };
        let inner = (0..8).map(|_| 1 + dice.below(COUNT as u64 - 1) as usize);
        let mut cables: Vec<usize> = inner.chain([0, 0]).collect();
        cables.extend(is_ring.then_some([COUNT; 2]).into_iter().flatten());
        for cable in cables {
            let is_link = cable == 0 || cable == COUNT;
            any_moment(&mut main_device, &mut dice);
            apply(&mut main_device, Fault::Cut(CableId(cable)));
            let is_cut = |event: &Event| match event {
                Event::LinkDown { .. } => is_link,
                Event::RingOpened { .. } => is_ring,
                Event::Counted { .. } => !is_ring,
                _ => false,
            };
            note(noticed(&mut main_device, is_cut), &format!("cut of cable {cable}"));
            any_moment_after(&mut main_device, &mut dice);
            let reachable = if is_ring { COUNT } else { cable };
            assert_eq!(main_device.subdevices().len(), reachable, "cable {cable}");
            any_moment(&mut main_device, &mut dice);
            apply(&mut main_device, Fault::Heal(CableId(cable)));
            let is_healed = |event: &Event| match event {
                Event::LinkUp { .. } => is_link,
                Event::RingClosed { .. } => is_ring,
                Event::Counted { .. } => !is_ring,
                _ => false,
            };
            note(noticed(&mut main_device, is_healed), &format!("cable {cable} again"));
            main_device.attend(Duration::from_secs(2));
            any_moment_after(&mut main_device, &mut dice);
            assert_eq!(main_device.subdevices().len(), COUNT, "cable {cable}");
            assert!(statuses(&mut main_device).iter().all(|status| *status == PREOP), "cable {cable}");
        }
    }
    println!("100 SubDevices: a cut cable or an unplugged link is noticed within {slowest:?}");
}

/// Follows a change, and waits for any moment of a period.
fn any_moment_after(main_device: &mut MainDevice<Tap>, dice: &mut Dice) {
    main_device.attend(Duration::from_secs(1) + Duration::from_micros(dice.below(100_000)));
    events(main_device);
}

/// Others are in OP, SAFEOP and INIT: the OR of the states stays the same.
// covers: states
#[test]
fn a_state_that_others_hide_is_noticed_within_100_ms() {
    let mut dice = Dice::new(4);
    for network in hundred() {
        let mut main_device = settled(network);
        let states = [AlState::Init, AlState::SafeOp, AlState::Op];
        for (at, state) in (0..6).zip(states.into_iter().cycle()) {
            main_device.subdevice(Position(at)).request_state(state).expect("it follows");
        }
        events(&mut main_device);
        for at in [7, 33, 99, 4, 5, 1] {
            any_moment(&mut main_device, &mut dice);
            // To INIT, which others show as well.
            write_as_another(main_device.links_mut().network_mut(), at, map::AL_CONTROL, &[1, 0]);
            let is_left = |event: &Event| matches!(event, Event::UndeclaredState { position, .. } if position.0 == at);
            let time = noticed(&mut main_device, is_left);
            assert!(time < NOTICED, "{at}: {time:?}");
            any_moment_after(&mut main_device, &mut dice);
        }
    }
}

// covers: states
#[test]
fn an_address_among_100_that_another_program_has_written_is_noticed_within_100_ms() {
    let mut dice = Dice::new(9);
    for network in hundred() {
        let mut main_device = settled(network);
        for address in [0_u16, 0x1002, 0x4711] {
            let at = 10 + dice.below(80) as u16;
            any_moment(&mut main_device, &mut dice);
            write_as_another(main_device.links_mut().network_mut(), at, map::STATION_ADDRESS, &address.to_le_bytes());
            let time = noticed(&mut main_device, |event| matches!(event, Event::SegmentChanged { .. }));
            println!("an address among 100: {time:?}");
            assert!(time < NOTICED, "{address:#06x} at {at}: {time:?}");
            any_moment_after(&mut main_device, &mut dice);
            assert!(statuses(&mut main_device).iter().all(|status| *status == PREOP));
        }
    }
}

/// Six SubDevices, the fourth of which has an EEPROM that takes 30 s.
fn with_slow_eeprom() -> Vec<DeviceDescription> {
    let mut devices: Vec<DeviceDescription> = MIXED.iter().map(|kind| describe(kind, kind)).collect();
    devices[3] = DeviceDescription { sii_busy: Duration::from_millis(90), ..devices[3].clone() };
    // Another serial number: its words are not those of another one.
    devices[3].identity.serial = 4_711;
    devices
}

// covers: states, slow-eeproms
#[test]
fn changes_are_noticed_and_followed_while_a_slow_eeprom_is_read() {
    for first_scan in [true, false] {
        for what in 0..4 {
            let mut network = ring(with_slow_eeprom(), NetworkOptions::default());
            if !first_scan {
                network.apply(Fault::PowerOff(DeviceIndex(3)));
                network.advance_by(Duration::from_millis(10));
            }
            let mut main_device = MainDevice::request(Tap::new(network), &options());
            if !first_scan {
                main_device.attend(FOLLOWED);
                apply(&mut main_device, Fault::PowerOn(DeviceIndex(3)));
            }
            main_device.attend(Duration::from_millis(1_500));
            assert!(main_device.subdevices().iter().all(|info| info.identity.serial != 4_711), "it is being read");
            events(&mut main_device);
            let text = format!("first scan {first_scan}, change {what}");
            match what {
                0 | 1 => {
                    let fault = if what == 0 { Fault::PowerOff(DeviceIndex(5)) } else { Fault::Cut(CableId(2)) };
                    apply(&mut main_device, fault);
                    let is_it = |event: &Event| matches!(event, Event::Counted { .. });
                    let time = noticed(&mut main_device, is_it);
                    assert!(time < NOTICED, "{text}: {time:?}");
                }
                // Nothing is kept in its state before the first scan has ended.
                _ if first_scan => {}
                2 => {
                    write_as_another(main_device.links_mut().network_mut(), 1, map::AL_CONTROL, &[1, 0]);
                    let is_it = |event: &Event| matches!(event, Event::UndeclaredState { .. });
                    let time = noticed(&mut main_device, is_it);
                    assert!(time < NOTICED, "{text}: {time:?}");
                    main_device.attend(FOLLOWED);
                    assert_eq!(statuses(&mut main_device)[1], PREOP, "{text}");
                }
                _ => {
                    apply(&mut main_device, Fault::PowerOff(DeviceIndex(1)));
                    apply(&mut main_device, Fault::PowerOn(DeviceIndex(1)));
                    main_device.attend(Duration::from_millis(100));
                    let network = main_device.links_mut().network();
                    let station = network.device(DeviceIndex(1)).controller.register(map::STATION_ADDRESS, 2).to_vec();
                    assert_ne!(station, [0, 0], "{text}: it has an address again");
                }
            }
            // At last all are known, the slow one too.
            main_device.attend(Duration::from_secs(40));
            let present = if what == 0 { MIXED.len() - 1 } else { MIXED.len() };
            assert_eq!(main_device.subdevices().len(), present, "{text}");
            let now = statuses(&mut main_device);
            let in_preop = now.iter().filter(|status| **status == PREOP).count();
            assert!(in_preop >= present, "{text}: {now:?}");
        }
    }
}
