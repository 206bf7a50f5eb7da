//! The former owner crashes in any phase: the next one has all SubDevices in PREOP with usable mailboxes.

use super::*;
use ringcat::{Limits, SdoAddress};
use scenarios::segments::describe;
use scenarios::uploads::start_upload;

const LIMITS: Limits = Limits::new(Duration::from_millis(100), Duration::from_millis(500));

/// Goes on after a crash: all SubDevices in PREOP, mailboxes and EEPROMs usable, a declaration reaches OP.
fn go_on(links: Tap, bytes: &[u8], what: &str) -> MainDevice<Tap> {
    let mut main_device = resumed(links, bytes, Handover::AfterCrash);
    let begun = main_device.now();
    while !statuses(&mut main_device).iter().all(|status| *status == PREOP) {
        let now = statuses(&mut main_device);
        assert!(main_device.now().since(begun) < FOLLOWED, "{what}: {now:?}");
        main_device.attend(Duration::from_millis(1));
    }
    main_device.attend(Duration::from_millis(200));
    let now = statuses(&mut main_device);
    assert!(now.iter().all(|status| *status == PREOP), "{what}: {now:?}, {:?}", events(&mut main_device));
    exchange_sdos(&mut main_device);
    let left: usize = main_device.links_mut().network().devices().map(left_behind).sum();
    assert_eq!(left, 0, "{what}: FMMUs, SYNC signals or ports of the former owner");
    main_device
}

/// Bytes that an application would leave: FMMUs, SYNC signals, port control.
fn left_behind(device: &Device) -> usize {
    let fmmus = register(device, map::FMMU_BASE, 16 * usize::from(device.controller.config().fmmu_count));
    let sync = register(device, map::DC_ACTIVATION, 1);
    let ports = register(device, map::DL_CONTROL.offset(1), 1);
    fmmus.iter().chain(&sync).chain(&ports).filter(|byte| **byte != 0).count()
}

// covers: states
#[test]
fn a_crash_during_a_scan_leaves_nothing_behind() {
    for network in 0..all_networks().len() {
        for after_us in (0..40_000).step_by(2_300) {
            let network = all_networks().swap_remove(network);
            let former = idle(network);
            let bytes = to_bytes(&former);
            let mut scanning = MainDevice::request(former.into_links(), &options());
            scanning.attend(Duration::from_micros(after_us));
            go_on(scanning.into_links(), &bytes, &format!("after {after_us} us"));
        }
    }
}

// covers: states
#[test]
fn a_crash_while_an_application_starts_or_runs_leaves_nothing_behind() {
    for (number, count) in [(0, 90), (1, 90)] {
        for ran in (0..count).step_by(3) {
            let network = networks().into_iter().nth(number).expect("two networks");
            let former = idle(network);
            let bytes = to_bytes(&former);
            let declaration = automatic(&former.subdevices(), CYCLE).with_clocks(ringcat::ClockConfig::default());
            let mut application = former.activate(declaration).map_err(Error::from).expect("it fits");
            cycles(&mut application, ran);
            let main_device = go_on(application.into_links(), &bytes, &format!("after {ran} cycles"));
            let mut application = activate(main_device);
            settle(&mut application);
            cycles(&mut application, 20);
            let status = application.process(DomainId(0));
            assert_eq!(status.wkc, status.expected);
        }
    }
}

// covers: states
#[test]
fn a_crash_during_the_end_of_an_application_leaves_nothing_behind() {
    for network in 0..2 {
        for after_us in (0..20_000).step_by(1_100) {
            let former = idle(networks().into_iter().nth(network).expect("two networks"));
            let bytes = to_bytes(&former);
            let mut application = activate(former);
            settle(&mut application);
            let now = application.now();
            application.engine_mut().start_deactivate(LIMIT, now).expect("it is active");
            let end = now + Duration::from_micros(after_us);
            while application.now() < end {
                application.cycle(|_| ());
            }
            go_on(application.into_links(), &bytes, &format!("after {after_us} us"));
        }
    }
}

// covers: states, eeprom
#[test]
fn a_crash_during_the_reading_of_an_eeprom_leaves_it_usable() {
    for network in 0..2 {
        for after_us in (0..6_000).step_by(370) {
            let mut former = idle(networks().into_iter().nth(network).expect("two networks"));
            let bytes = to_bytes(&former);
            let reading = former.engine_mut().start_sii_read(Position(3));
            former.attend(Duration::from_micros(after_us));
            drop(reading);
            let mut main_device = go_on(former.into_links(), &bytes, &format!("after {after_us} us"));
            let image = main_device.subdevice(Position(3)).sii_read().expect("it can be read");
            let network = main_device.links_mut().network();
            assert_eq!(image, network.device(DeviceIndex(3)).controller.sii_image());
        }
    }
}

// covers: states, foe
#[test]
fn a_crash_in_boot_and_during_a_file_leaves_the_mailbox_usable() {
    let kinds = ["coupler", "all-protocols", "digital-output-8"];
    for after_us in (0..30_000).step_by(1_900) {
        let devices = kinds.map(|kind| describe(kind, kind));
        let mut former = idle(line(devices.into(), NetworkOptions::default()));
        let bytes = to_bytes(&former);
        let boot = former.engine_mut().start_state_request(Position(1), AlState::Boot);
        former.attend(Duration::from_micros(after_us / 2));
        drop(boot);
        let mailbox = former.engine().mailbox(Position(1)).expect("it has one");
        mailbox.bus().clone().spawn(async move {
            let mut source = ringcat_engine::mail::stream::Bytes::new(&[0x5A; 20_000]);
            let options = ringcat_engine::mail::foe::FoeOptions::default();
            let _ = ringcat_engine::mail::foe::write(&mailbox, "any.bin", options, &mut source, |_| ()).await;
        });
        former.attend(Duration::from_micros(after_us));
        go_on(former.into_links(), &bytes, &format!("after {after_us} us"));
    }
}

// covers: states, mailbox
#[test]
fn a_crash_during_segments_of_an_object_leaves_the_mailbox_usable() {
    let object = SdoAddress::new(0x1008, 0);
    for network in 0..2 {
        for after_us in (0..8_000).step_by(330) {
            let mut former = idle(networks().into_iter().nth(network).expect("two networks"));
            let bytes = to_bytes(&former);
            for position in [Position(0), Position(3)] {
                drop(start_upload(former.engine_mut(), position, object, LIMITS, 1_000));
            }
            let read = start_upload(former.engine_mut(), Position(3), object, LIMITS, 1_000);
            former.attend(Duration::from_micros(after_us));
            drop(read);
            go_on(former.into_links(), &bytes, &format!("after {after_us} us"));
        }
    }
}
