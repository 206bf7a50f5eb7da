//! PDOs of the dictionaries replace those of the SIIs, whole or not at all.

use ringcat::{Options, PdoInfo, ReadPdos, SubDeviceInfo};
use ringcat_sim::description::DeviceDescription;
use ringcat_sim::sii_image;
use scenarios::segments::describe;

use super::*;

/// A drive whose SII has other PDOs than its dictionary: half of their entries.
fn drive_with_another_sii() -> DeviceDescription {
    let mut device = describe("servo", "servo");
    let mut described = device.clone();
    described.pdos.iter_mut().for_each(|pdo| pdo.entries.truncate(2));
    device.sii_image = Some(sii_image::build(&described));
    device
}

fn idle_with(devices: Vec<DeviceDescription>, options: &Options) -> MainDevice<Tap> {
    let mut main_device = MainDevice::request(Tap::new(line(devices, NetworkOptions::default())), options);
    main_device.attend(FOLLOWED);
    main_device
}

/// Bits of the assigned outputs and inputs.
fn bits(info: &SubDeviceInfo) -> [u32; 2] {
    [2, 3].map(|number| info.assigned_pdos(number).map(PdoInfo::bit_length).sum())
}

const WHOLE: [u32; 2] = [96, 112];
const OF_SII: [u32; 2] = [48, 48];

// covers: states, odd-sii, 6.3
#[test]
fn pdos_of_the_dictionary_replace_those_of_the_sii_in_preop() {
    let devices = vec![describe("coupler", "coupler"), drive_with_another_sii(), drive_with_another_sii()];
    let mut main_device = idle_with(devices.clone(), &options());
    let said: Vec<String> = events(&mut main_device).iter().map(|timed| format!("{:?}", timed.event)).collect();
    assert_eq!(said.iter().filter(|text| text.contains("other PDOs of the dictionary")).count(), 4, "{said:?}");
    let found = main_device.subdevices();
    assert_eq!([&found[1], &found[2]].map(bits), [WHOLE; 2]);
    let snapshot = main_device.engine_mut().snapshot();
    assert_eq!(snapshot.subdevices.iter().map(|one| one.are_pdos_read).collect::<Vec<_>>(), [false, true, true]);
    // The default process data of an application is that of the dictionary.
    let mut application = activate(main_device, &[1, 2]);
    cycles(&mut application, 300);
    assert!(application.all_settled(), "{:?}", application.states());
    let lengths = application.directory().areas(SubDeviceId(0)).iter().map(|area| area.placed.area.length);
    assert_eq!(lengths.collect::<Vec<_>>(), [12, 14]);
    // By choice the SII counts.
    let unread = idle_with(devices, &options().with_pdos(ReadPdos::Never));
    assert_eq!(bits(&unread.subdevices()[1]), OF_SII);
}

/// One of two assignments is missing, or cannot be read: none is taken over.
// covers: states, odd-sii, 6.3
#[test]
fn a_dictionary_with_a_part_of_the_pdos_replaces_nothing() {
    for (left_out, is_reported) in
        [(vec![0x1C12], true), (vec![0x1C13], true), (vec![0x1A00], true), (vec![0x1C12, 0x1C13], false)]
    {
        let device = DeviceDescription { left_out: left_out.clone(), ..drive_with_another_sii() };
        let mut main_device = idle_with(vec![device], &options());
        assert_eq!(bits(&main_device.subdevices()[0]), OF_SII, "{left_out:x?}");
        let is_it = |what: &str| what.contains("cannot be read");
        let reports = |timed: &TimedEvent| matches!(&timed.event, Event::SiiWarning { what, .. } if is_it(what));
        assert_eq!(events(&mut main_device).iter().any(reports), is_reported, "{left_out:x?}");
        main_device.attend(Duration::from_secs(3));
        assert!(events(&mut main_device).is_empty(), "it is said once");
        assert_eq!(statuses(&mut main_device), [PREOP]);
    }
}

/// While others are in OP, a SubDevice comes that no application names.
// covers: states
#[test]
fn pdos_of_a_subdevice_that_comes_beside_an_application_are_read() {
    let mut network = line(vec![describe("servo", "first"), drive_with_another_sii()], NetworkOptions::default());
    network.apply(Fault::PowerOff(DeviceIndex(1)));
    network.advance_by(Duration::from_millis(10));
    let mut main_device = MainDevice::request(Tap::new(network), &options());
    main_device.attend(FOLLOWED);
    let mut application = activate(main_device, &[0]);
    cycles(&mut application, 300);
    application.links_mut().network_mut().apply(Fault::PowerOn(DeviceIndex(1)));
    cycles(&mut application, 1_500);
    let seen = application.engine_mut().snapshot();
    assert_eq!(seen.subdevices.iter().map(|one| one.are_pdos_read).collect::<Vec<_>>(), [true, true]);
    // SAFEOP and OP have the lengths of the dictionary.
    let request = ringcat::SubDevice::new(&mut application, Position(1)).request_state(AlState::Op);
    application.cycle_until(request, LIMIT, |_| ()).expect("it follows");
    let ended = application.deactivate(LastOutputs::Zero, LIMIT).expect("all follow");
    assert_eq!(bits(&ended.subdevices()[1]), WHOLE);
}

/// A drive that answers no mail is in PREOP with the PDOs of its SII, and delays no other one.
// covers: states
#[test]
fn a_dictionary_that_cannot_be_read_is_no_obstacle() {
    for lost in 1..30 {
        let network = line(vec![drive_with_another_sii(), describe("servo", "other")], NetworkOptions::default());
        let mut main_device = MainDevice::request(Tap::new(network), &options());
        // Frames are lost while the dictionaries are read.
        main_device.attend(Duration::from_millis(30 + lost));
        apply(&mut main_device, Fault::Drop { cable: CableId(1), direction: None, count: 3 + lost as u32 % 5 });
        main_device.attend(Duration::from_secs(1));
        assert_eq!(statuses(&mut main_device), [PREOP; 2], "{lost}");
        assert_eq!(main_device.subdevices().iter().map(bits).collect::<Vec<_>>(), [WHOLE; 2], "{lost}");
    }
}
