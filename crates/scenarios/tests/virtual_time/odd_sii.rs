//! SubDevices with an unusual SII: without PDOs, with other PDOs than the dictionary, without end marker, with
//! SyncManagers in another order or without a type, blank, or invalid.

use std::time::Duration;

use ringcat::{
    Event, Limits, MainDevice, Options, PdoMapping, Position, ReadPdos, SubDeviceId, SubDeviceInfo, automatic,
};
use ringcat_engine::mail::coe::{self, SdoAddress, pdo};
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::description::DeviceDescription;
use ringcat_sim::network::NetworkOptions;
use ringcat_sim::sii_image;
use ringcat_wire::al::{AlState, AlStatus};
use ringcat_wire::mailbox::coe::Emergency;
use ringcat_wire::sii::{FmmuUsage, PdoDirection, SyncManagerKind};
use scenarios::check::troubles;
use scenarios::loss::Loss;
use scenarios::segments::{descriptions, line};
use scenarios::tap::Tap;
use scenarios::world::{CYCLE, World};

const KINDS: [&str; 4] = ["coupler", "digital-output-8", "all-protocols", "digital-input-8"];
/// The SubDevice with the unusual SII.
const ODD: usize = 2;

/// A segment in which one device has this SII.
fn with_sii(kind: &str, other: impl FnOnce(&mut DeviceDescription)) -> Vec<DeviceDescription> {
    let mut kinds = KINDS;
    kinds[ODD] = kind;
    let mut devices = descriptions(&kinds);
    let mut described = devices[ODD].clone();
    other(&mut described);
    devices[ODD].sii_image = Some(sii_image::build(&described));
    devices
}

fn world(devices: Vec<DeviceDescription>, pdos: ReadPdos) -> World {
    let options = Options::default().with_pdos(pdos);
    let network = line(devices, NetworkOptions::default());
    World::with(1, network, &options, |scan| automatic(&scan.subdevices, CYCLE)).expect("scan and activation")
}

fn odd(world: &World) -> &SubDeviceInfo {
    &world.scan.subdevices[ODD]
}

fn reports(world: &World, text: &str) -> bool {
    world.saw(world.beginning(), |event| {
        matches!(event, Event::SiiWarning { position, what } if usize::from(position.0) == ODD && what.contains(text))
    })
}

// covers: 6.3, odd-sii
#[test]
fn pdos_that_the_sii_leaves_out_are_read_from_the_dictionary() {
    let devices = || with_sii("servo", |described| described.pdos.clear());
    let mut read = world(devices(), ReadPdos::Missing);
    read.settle();
    read.run_cycles(50);
    let pdos: Vec<(u16, Option<u8>)> = odd(&read).pdos.iter().map(|pdo| (pdo.index, pdo.sync_manager)).collect();
    assert_eq!(pdos, [(0x1600, Some(2)), (0x1A00, Some(3))]);
    assert!(read.application().entry(SubDeviceId(ODD), 0x6041, 0).is_some(), "entries have names by index");
    assert_eq!(troubles(read.events(read.beginning())), Vec::<&Event>::new());
    assert!(!reports(&read, "dictionary"), "missing data is not a contradiction");
    read.power_off(DeviceIndex(ODD));
    read.run_cycles(20);
    read.power_on(DeviceIndex(ODD));
    read.settle();
    let unread = world(devices(), ReadPdos::Never);
    assert_eq!(odd(&unread).pdos, []);
}

// covers: odd-sii
#[test]
fn the_dictionary_has_priority_over_the_sii_which_is_reported() {
    // The SII has a PDO of half the size.
    let devices = || {
        with_sii("all-protocols", |described| {
            for pdo in &mut described.pdos {
                pdo.entries[0].bit_length = 16;
            }
        })
    };
    let mut asked = world(devices(), ReadPdos::Always);
    asked.settle();
    asked.run_cycles(50);
    assert!(reports(&asked, "SM 3: 16 bits of process data in the SII, but 32 bits in other PDOs of the dictionary"));
    let areas = asked.application().directory().areas(SubDeviceId(ODD));
    assert_eq!(areas.iter().map(|area| area.placed.area.length).collect::<Vec<_>>(), [4, 4]);
    let mut trusting = world(devices(), ReadPdos::Missing);
    trusting.run_cycles(100);
    // The SubDevice refuses, and the reason is found.
    let explained = |event: &Event| {
        matches!(event, Event::DeclarationWarning { subdevice: SubDeviceId(ODD), what }
            if what == "SM 2: 2 bytes are configured, the PDOs in the dictionary have 4")
    };
    assert!(trusting.saw(trusting.beginning(), explained), "{:?}", troubles(trusting.events(trusting.beginning())));
    // Each attempt is refused, and the difference is named once.
    trusting.run_cycles(5000);
    let events = trusting.events(trusting.beginning());
    let count = |wanted: &dyn Fn(&Event) -> bool| events.iter().filter(|timed| wanted(&timed.event)).count();
    let refused = count(&|event| matches!(event, Event::StateError { subdevice: SubDeviceId(ODD), .. }));
    assert!(refused > 1, "{:?}", troubles(events));
    assert_eq!(count(&explained), 1, "{:?}", troubles(events));
}

// covers: odd-sii
#[test]
fn a_former_pdo_assignment_is_restored_after_a_loss_of_power() {
    let mut devices = descriptions(&KINDS);
    devices[ODD] = descriptions(&["analog-input-4"]).remove(0);
    let links = Tap::new(line(devices, NetworkOptions::default()));
    let options = Options::default().with_pdos(ReadPdos::Always);
    let mut main_device = MainDevice::request(links, &options);
    main_device.scan().expect("a scan");
    main_device.subdevice(Position(ODD as u16)).request_state(AlState::PreOp).expect("it goes there");
    let mailbox = main_device.engine().mailbox(Position(ODD as u16)).expect("it was visited");
    // The compact PDOs, without status.
    let compact: Vec<PdoMapping> = (0..4).map(|channel| PdoMapping::from_sii(0x1A01 + 2 * channel)).collect();
    let limits = Limits::new(Duration::from_millis(100), Duration::from_secs(1));
    let written = main_device.run(async move { pdo::write_assignment(&mailbox, 3, &compact, limits).await });
    assert_eq!(written, Ok(()));
    let found = main_device.scan().expect("a scan");
    let mut application = main_device.activate(automatic(&found.subdevices, CYCLE)).expect("activation");
    let mut settle = |power: Option<bool>| {
        match power {
            Some(true) => application.links_mut().network_mut().power_on(DeviceIndex(ODD)),
            Some(false) => application.links_mut().network_mut().power_off(DeviceIndex(ODD)),
            None => {}
        }
        (0..300).for_each(|_| application.cycle(|_| ()));
        let device = application.links().network().device(DeviceIndex(ODD));
        (device.al_status(), device.inputs().len())
    };
    assert_eq!(settle(None), (AlStatus::new(AlState::Op), 8));
    settle(Some(false));
    assert_eq!(settle(Some(true)), (AlStatus::new(AlState::Op), 8), "not the sixteen bytes of its default");
}

// covers: 4.4, odd-sii
#[test]
fn sync_managers_in_another_order_are_used_as_in_the_sii() {
    let mut devices = descriptions(&KINDS);
    let device = &mut devices[ODD];
    device.sync_managers.swap(2, 3);
    for pdo in &mut device.pdos {
        pdo.sync_manager = pdo.sync_manager.map(|number| 5 - number);
    }
    assert_eq!(device.sync_managers[2].kind, SyncManagerKind::Inputs);
    let mut world = world(devices, ReadPdos::Missing);
    world.settle();
    let mark = world.mark();
    world.run_cycles(50);
    assert_eq!(world.incomplete(mark), 0);
    assert!(world.compared() > 0);
}

// covers: 3.11, odd-sii
#[test]
fn mailboxes_on_other_sync_managers_work_as_in_the_sii() {
    for shows_mail in [true, false] {
        let mut devices = descriptions(&KINDS);
        let device = &mut devices[ODD];
        // Process data on 0 and 1, then the mailboxes, the send mailbox first.
        device.sync_managers.rotate_left(2);
        device.sync_managers.swap(2, 3);
        for pdo in &mut device.pdos {
            pdo.sync_manager = pdo.sync_manager.map(|number| number - 2);
        }
        if !shows_mail {
            device.fmmus.retain(|usage| *usage != FmmuUsage::MailboxStatus);
        }
        let kinds = device.sync_managers.iter().map(|manager| manager.kind);
        let (inward, out) = (SyncManagerKind::MailboxIn, SyncManagerKind::MailboxOut);
        assert!(kinds.eq([SyncManagerKind::Outputs, SyncManagerKind::Inputs, inward, out]));
        let send = device.mailbox.as_ref().expect("it has one").standard.send_offset;
        let mut world = world(devices, ReadPdos::Missing);
        world.settle();
        let mark = world.mark();
        let mailbox = world.mailbox(ODD);
        let mailboxes = world.scan.subdevices[ODD].mailbox_sync_managers();
        assert_eq!((mailboxes.written, mailboxes.read), (3, 2));
        // A lost response is repeated, unsolicited mail is found.
        world.lose(Loss::of_read(world.station_of(ODD), send).on_the_way_back());
        let limits = Limits::new(Duration::from_millis(100), Duration::from_secs(1));
        let own = mailbox.clone();
        let vendor = world.run(async move { coe::read(&own, SdoAddress::new(0x1018, 1), limits, 4).await });
        assert_eq!(vendor.map(|vendor| vendor.len()), Ok(4));
        assert_eq!((mailbox.counters().repeats, world.application().links().losses_left()), (1, 0));
        let emergency = Emergency { error_code: 0x8130, error_register: 1, data: [0; 5] };
        assert!(world.network_mut().device_mut(DeviceIndex(ODD)).application.emergency(&emergency));
        world.run_cycles(50);
        assert_eq!(
            mailbox.pop_emergency().map(|received| received.emergency),
            Some(emergency),
            "shows mail: {shows_mail}"
        );
        world.power_off(DeviceIndex(ODD));
        world.run_cycles(20);
        world.power_on(DeviceIndex(ODD));
        world.settle();
        assert!(world.compared() > 0 && world.incomplete(mark) > 0);
    }
}

// covers: odd-sii
#[test]
fn an_sii_without_an_end_marker_is_reported_and_used() {
    let mut devices = descriptions(&KINDS);
    let used = sii_image::used_bytes(&devices[ODD]);
    let mut image = sii_image::build(&devices[ODD]);
    // The rest of an older image instead of the end marker.
    for (at, byte) in image[used - 2..].iter_mut().enumerate() {
        *byte = [0x01, 0x80, 0x02, 0x00, 0xAA, 0xAA, 0x55, 0x55][at % 8];
    }
    devices[ODD].sii_image = Some(image);
    let mut world = world(devices, ReadPdos::Missing);
    world.settle();
    assert!(reports(&world, "no end marker"), "{:?}", world.events(world.beginning()));
}

// covers: odd-sii
#[test]
fn a_blank_eeprom_is_reported_and_the_others_reach_op() {
    for blank in [0x00, 0xFF] {
        let mut devices = descriptions(&KINDS);
        devices[ODD].sii_image = Some(vec![blank; 512]);
        // The simulator writes these into images.
        devices[ODD].alias = u16::from_le_bytes([blank; 2]);
        devices[ODD].identity.serial = u32::from_le_bytes([blank; 4]);
        let mut world = world(devices, ReadPdos::Always);
        world.run_cycles(300);
        assert!(reports(&world, "the EEPROM is blank"));
        let others = world.network().devices().enumerate().filter(|(number, _)| *number != ODD);
        assert!(others.into_iter().all(|(_, device)| device.al_status() == AlStatus::new(AlState::Op)));
    }
}

/// Checks the reported reason of the SubDevice, while the others exchange process data.
fn others_run_and_it_says(mut world: World, reason: &str) {
    world.run_cycles(400);
    let failed = |event: &Event| {
        matches!(event, Event::ConfigurationFailed { subdevice: SubDeviceId(ODD), reason: got }
        if got.contains(reason))
    };
    assert!(world.saw(world.beginning(), failed), "{:?}", troubles(world.events(world.beginning())));
    let mark = world.mark();
    let compared = world.compared();
    world.run_cycles(50);
    assert!(world.compared() > compared && world.incomplete(mark) == 0);
    let others = world.network().devices().enumerate().filter(|(number, _)| *number != ODD);
    assert!(others.into_iter().all(|(_, device)| device.al_status() == AlStatus::new(AlState::Op)));
    let reports = world.events(mark).iter().filter(|timed| matches!(timed.event, Event::ConfigurationFailed { .. }));
    assert_eq!(reports.count(), 0, "it is reported once");
}

// covers: odd-sii
#[test]
fn an_invalid_sii_stops_only_its_own_subdevice() {
    // Random mailbox words with a wrong checksum.
    let mut devices = descriptions(&KINDS);
    let mut image = sii_image::build(&devices[ODD]);
    image[0x30..0x38].copy_from_slice(&[0x78, 0x78, 0x78, 0x29, 0x21, 0x45, 0x4C, 0x32]);
    image[14] ^= 0xFF;
    devices[ODD].sii_image = Some(image);
    let mut garbage = world(devices, ReadPdos::Missing);
    assert!(reports(&garbage, "byte 0x0030: mailboxes of 10616 bytes at 0x7878 and 12876 bytes at 0x4521 are ignored"));
    garbage.run_cycles(100);
    // Process data where there is no memory.
    let mut devices = descriptions(&KINDS);
    let mut beyond = devices[ODD].clone();
    beyond.sync_managers[3].start = 0x2FFE;
    devices[ODD].sii_image = Some(sii_image::build(&beyond));
    let reason =
        "its SII cannot be used: SM 3: 12 bytes (all buffers) at 0x2ffe exceed the memory, which ends at 0x3000";
    others_run_and_it_says(world(devices, ReadPdos::Missing), reason);
    // More process data than a datagram carries.
    let mut devices = descriptions(&KINDS);
    let mut long = devices[ODD].clone();
    long.pdos.retain(|pdo| pdo.sync_manager != Some(3));
    (long.sync_managers[3].start, long.sync_managers[3].length) = (0x1A00, 1_600);
    devices[ODD].sii_image = Some(sii_image::build(&long));
    let reason = "its SII cannot be used: SM 3: 1600 bytes of process data, a datagram carries at most 1486";
    others_run_and_it_says(world(devices, ReadPdos::Never), reason);
    // A blank EEPROM.
    let mut devices = descriptions(&KINDS);
    devices[ODD].sii_image = Some(Vec::new());
    let reason = "its SII cannot be used: the EEPROM is blank or cannot be read, and nothing is declared";
    others_run_and_it_says(world(devices, ReadPdos::Missing), reason);
}

/// An event reports once that it has no place before the next activation and stays in SAFEOP; the others continue.
// covers: odd-sii
#[test]
fn an_sii_repaired_in_operation_is_reported_without_a_place() {
    let mut devices = descriptions(&KINDS);
    let sound = sii_image::build(&devices[ODD]);
    let mut beyond = devices[ODD].clone();
    beyond.sync_managers[3].start = 0x2FFE;
    devices[ODD].sii_image = Some(sii_image::build(&beyond));
    let mut world = world(devices, ReadPdos::Missing);
    world.run_cycles(400);
    let write = world.application_mut().engine_mut().start_sii_write(SubDeviceId(ODD), sound, false);
    world.finish(Duration::from_secs(20), write).expect("it can be written");
    let mark = world.mark();
    world.power_off(DeviceIndex(ODD));
    world.run_cycles(100);
    world.power_on(DeviceIndex(ODD));
    let is_safe =
        |world: &World| world.network().device(DeviceIndex(ODD)).al_status() == AlStatus::new(AlState::SafeOp);
    world.until(Duration::from_secs(5), "it is in SAFEOP", is_safe);
    world.until(Duration::from_secs(5), "all settled", |world| world.application().all_settled());
    let says = |event: &Event| {
        matches!(event, Event::DeclarationWarning { subdevice: SubDeviceId(ODD), what }
            if what.contains("it has no place in the process image before the next activation, and stays in SAFEOP"))
    };
    let reports = world.events(mark).iter().filter(|timed| says(&timed.event));
    assert_eq!(reports.count(), 1, "{:?}", world.events(mark));
    assert_eq!(world.application().directory().areas(SubDeviceId(ODD)).len(), 0);
    let (mark, compared) = (world.mark(), world.compared());
    world.run_cycles(3_000);
    assert!(world.compared() > compared && world.incomplete(mark) == 0 && is_safe(&world));
    assert_eq!(troubles(world.events(mark)), Vec::<&Event>::new());
}

/// Declared places in the process image stay, as for an absent SubDevice.
// covers: odd-sii
#[test]
fn a_damaged_sii_without_declared_parts_keeps_its_places_and_blocks_no_other() {
    let mut devices = descriptions(&KINDS);
    let mut cut = sii_image::build(&devices[ODD]);
    cut[128..].fill(0xFF);
    devices[ODD].sii_image = Some(cut);
    let network = line(devices, NetworkOptions::default());
    let started = World::with(1, network, &Options::default(), |scan| {
        let mut declaration = automatic(&scan.subdevices, CYCLE);
        let config = declaration.subdevices[ODD].clone();
        let entries = vec![ringcat::PdoEntry::new(0x7000, 1, 32)];
        let pdos = vec![PdoMapping::of(0x1600, entries)];
        declaration.subdevices[ODD] = config.assign(2, ringcat::Direction::Outputs, pdos);
        declaration
    });
    let mut world = started.expect("one bad EEPROM stops no other SubDevice");
    assert!(reports(&world, "no category follows the fixed area: the image is truncated"));
    assert!(world.application().entry(SubDeviceId(ODD), 0x7000, 1).is_some());
    world.run_cycles(300);
    let others = world.network().devices().enumerate().filter(|(number, _)| *number != ODD);
    assert!(others.into_iter().all(|(_, device)| device.al_status() == AlStatus::new(AlState::Op)));
    let failed = |event: &Event| {
        matches!(event, Event::ConfigurationFailed { subdevice: SubDeviceId(ODD), reason }
            if reason.contains("SM 2 has process data, the SII describes 0 SyncManagers only"))
    };
    assert!(world.saw(world.beginning(), failed));
}

/// Three identical SubDevices that share the contents of their SIIs; any one of them has damage inside a category.
#[test]
fn damage_inside_a_category_does_not_affect_identical_subdevices() {
    for damaged in 1..4 {
        let mut devices = descriptions(&["coupler", "digital-input-16", "digital-input-16", "digital-input-16"]);
        let mut other = devices[damaged].clone();
        other.sync_managers[0].start += 0x0100;
        let mut image = sii_image::build(&devices[damaged]);
        let wrong = sii_image::build(&other);
        // The first SyncManager entry, in place.
        let at = image.iter().zip(&wrong).position(|(one, other)| one != other).expect("they differ");
        image[at] ^= 0x40;
        devices[damaged].sii_image = Some(image);
        let mut world = world(devices, ReadPdos::Never);
        world.run_cycles(300);
        for index in (1..4).filter(|index| *index != damaged) {
            let info = &world.scan.subdevices[index];
            assert_eq!(info.sync_managers[0].start, 0x1000, "{damaged} is damaged, {index} is not");
            assert_eq!(info.pdos.len(), 16, "{damaged} is damaged, {index} is not");
            assert_eq!(world.network().device(DeviceIndex(index)).al_status(), AlStatus::new(AlState::Op));
        }
    }
}

// covers: odd-sii
#[test]
fn unusual_pdos_and_default_lengths_are_read_alike_on_both_sides() {
    for kind in ["digital-input-8", "digital-output-8", "analog-input-4", "servo", "all-protocols"] {
        for change in 0..6 {
            let mut described = descriptions(&[kind]).remove(0);
            for manager in described.sync_managers.iter_mut().filter(|it| !is_mailbox(it.kind)) {
                manager.length = if change < 4 { 4 } else { 0 };
                manager.enable = u8::from(change != 3);
            }
            match change {
                0 => described.pdos.retain(|pdo| pdo.direction == PdoDirection::Rx),
                1 => described.pdos.retain(|pdo| pdo.direction == PdoDirection::Tx),
                2 | 4 => described.pdos.iter_mut().for_each(|pdo| pdo.entries.clear()),
                3 => described.pdos.clear(),
                _ => described.pdos.iter_mut().for_each(|pdo| pdo.sync_manager = None),
            }
            in_op_as_it_says(&described, &format!("{kind}, change {change}"));
        }
    }
}

// covers: odd-sii
#[test]
fn sync_managers_without_a_type_are_read_alike_everywhere() {
    for kind in ["digital-input-8", "digital-output-8", "analog-input-4", "servo", "all-protocols"] {
        for without_pdos in [false, true] {
            let mut described = descriptions(&[kind]).remove(0);
            // A disabled SyncManager without a type has no use.
            let kinds =
                described.sync_managers.iter().map(|it| if it.enable == 0 { SyncManagerKind::Unused } else { it.kind });
            let kinds: Vec<SyncManagerKind> = kinds.collect();
            for manager in &mut described.sync_managers {
                manager.kind = SyncManagerKind::Unused;
                manager.length = manager.length.max(1);
            }
            if without_pdos {
                described.pdos.clear();
            }
            let world = in_op_as_it_says(&described, &format!("{kind}, without PDOs: {without_pdos}"));
            let found: Vec<_> = odd(&world).sync_managers.iter().map(|manager| manager.kind).collect();
            assert_eq!(found, kinds, "{kind}");
            assert!(reports(&world, "has type 0, assumed to be for"));
        }
    }
}

fn is_mailbox(kind: SyncManagerKind) -> bool {
    matches!(kind, SyncManagerKind::MailboxOut | SyncManagerKind::MailboxIn)
}

/// A segment with a SubDevice that behaves as its SII describes, in OP with complete working counters for any use of
/// dictionaries.
fn in_op_as_it_says(described: &DeviceDescription, what: &str) -> World {
    let mut devices = descriptions(&KINDS);
    let mut described = DeviceDescription { emulation: false, ..described.clone() };
    // With the fixed area of another SubDevice it would count as identical and not be read.
    described.identity.serial = 1;
    let image = sii_image::build(&described);
    devices[ODD] = DeviceDescription::from_sii(image, "odd").expect("it makes a device");
    let [_, last] = [ReadPdos::Always, ReadPdos::Missing].map(|pdos| {
        let mut world = world(devices.clone(), pdos);
        world.run_cycles(300);
        assert_eq!(troubles(world.events(world.beginning())), Vec::<&Event>::new(), "{what}");
        let last = world.evaluated(world.beginning()).last().expect("cycles went by").status;
        assert!(world.all_in_op() && last.wkc == last.expected, "{what}: {last:?}");
        world
    });
    last
}

// covers: odd-sii
#[test]
fn process_ram_beyond_eight_kibibytes_exists_if_the_sii_uses_it() {
    let mut described = descriptions(&["all-protocols"]).remove(0);
    described.sync_managers[2].start = 0x4000;
    described.sync_managers[3].start = 0x7000;
    let mut world = in_op_as_it_says(&described, "SyncManagers at 0x4000 and 0x7000");
    assert_eq!(odd(&world).controller.ram_kib, 25);
    let compared = world.compared();
    world.run_cycles(50);
    assert!(world.compared() > compared);
}

// covers: odd-sii
#[test]
fn a_dictionary_that_does_not_respond_delays_only_its_subdevice() {
    let devices = with_sii("servo", |described| described.pdos.clear());
    let mut network = line(devices, NetworkOptions::default());
    network.apply(ringcat_sim::fault::Fault::Hang(DeviceIndex(ODD), true));
    let options = Options::default();
    let world = World::with(1, network, &options, |scan| automatic(&scan.subdevices, CYCLE)).expect("scan");
    assert!(reports(&world, "the PDOs in its dictionary cannot be read"));
    let seconds = Duration::from_nanos(world.now().0).as_secs();
    assert!(seconds < 10, "{seconds} s");
    assert_eq!(world.application().entry(SubDeviceId(ODD), 0x6041, 0), None);
}
