//! Lines about events name the right SubDevice, though positions are no indices of the declaration.

use ringcat::simulated::SimulatedSegment;
use ringcat::text::{Names, describe};
use ringcat::{Application, Event, MainDevice, Options, SubDeviceConfig, SubDeviceId, automatic};
use ringcat_sim::cable::CableId;

const RING: &str = "[segment]\nring = true\n[[device]]\ntype = \"coupler\"\n[[device]]\ntype = \"digital-output-8\"\n\
                    [[device]]\ntype = \"digital-input-8\"\n";
const ABSENT: u16 = 99;

/// Lines of the events since the last call.
fn lines(application: &mut Application<SimulatedSegment>, names: &Names) -> Vec<String> {
    for _ in 0..150 {
        application.cycle(|_| ());
    }
    std::iter::from_fn(|| application.pop_event()).map(|event| describe(&event, names)).collect()
}

/// The first declared SubDevice is optional and absent, so that each position is one less than the index.
// covers: CR-12, ring-events
#[test]
fn a_break_is_reported_with_names_and_station_of_the_subdevices_at_its_ends() {
    let segment = SimulatedSegment::from_toml(RING).expect("it is a segment");
    let mut main_device = MainDevice::request(segment, &Options::default());
    let found = main_device.scan().expect("it is whole").subdevices;
    let mut declaration = automatic(&found, std::time::Duration::from_millis(1));
    let mut absent = SubDeviceConfig::at_alias(ABSENT, 0).optional();
    absent.pdos = Some(Vec::new());
    declaration.subdevices.insert(0, absent);
    declaration.domains.iter_mut().flat_map(|domain| &mut domain.members).for_each(|member| member.subdevice.0 += 1);
    let names = Names(["absent", "head", "lamps", "buttons"].map(str::to_owned).to_vec());
    let mut application = main_device.activate(declaration).expect("it fits");
    lines(&mut application, &names);
    let ends = [
        "the MAIN interface and SubDevice 0 \"head\" port 0 (0x1001)",
        "SubDevice 0 \"head\" port 1 and SubDevice 1 \"lamps\" port 0 (0x1002)",
        "SubDevice 1 \"lamps\" port 1 and SubDevice 2 \"buttons\" port 0 (0x1003)",
        "SubDevice 2 \"buttons\" port 1 (0x1003) and the REDUNDANT interface",
    ];
    for (cable, ends) in ends.into_iter().enumerate() {
        application.links_mut().network_mut().cut(CableId(cable));
        let reported = lines(&mut application, &names);
        assert!(reported.contains(&format!("Line break between {ends}")), "{reported:?}");
        let status = application.ring_status();
        let polled = status.place.map(|place| names.cable(place, status.place_ends));
        assert_eq!(polled, Some(format!("between {ends}")), "status of the ring");
        application.links_mut().network_mut().heal(CableId(cable));
        let reported = lines(&mut application, &names);
        let fixed = format!("Line is fixed between {ends}: ring closed, 3 SubDevices on MAIN");
        assert!(reported.contains(&fixed), "{reported:?}");
    }
}

/// A SubDevice that is not declared has no name of the declaration, whatever its position.
// covers: ring-events
#[test]
fn positions_with_an_unknown_subdevice_have_no_names() {
    let names = Names(vec!["pump".into(), "valve".into()]);
    let line = |event| describe(&ringcat::TimedEvent::new(ringcat::Instant(0), event), &names);
    let (position, identity) = (ringcat_wire::address::Position(1), Default::default());
    let unexpected = line(Event::Unexpected { position, identity });
    assert_eq!(unexpected, "position 1: not declared: vendor 0x00000000, product 0x00000000");
    let crossed = Event::LineCrossed { position: Some(position), entry_port: Some(1) };
    assert_eq!(line(crossed.clone()), "position 1: line crossed, frames enter at port 1");
    let pump = ringcat::Occupant::new(ringcat_wire::address::StationAddress(0x1002), Some(SubDeviceId(0)));
    let timed = ringcat::TimedEvent::new(ringcat::Instant(0), crossed).with_occupants([Some(pump), None]);
    assert_eq!(describe(&timed, &names), "position 1 \"pump\" (0x1002): line crossed, frames enter at port 1");
}

/// As on real devices: devices of one kind have one name in their SII, and its contents are read once for all of them.
/// A device with a name of its own keeps it, though nothing else is different.
// covers: sim-files
#[test]
fn simulated_devices_have_the_names_of_their_segment_file_and_copies_one_for_all() {
    let text = "[[device]]\ntype = \"block\"\nname = \"member\"\ncount = 3\n[[device]]\ntype = \"block\"\n\
                name = \"pump-1\"\n[[device]]\ntype = \"block\"\nname = \"pump-2\"\n";
    let segment = SimulatedSegment::from_toml(text).expect("it is a segment");
    let found = MainDevice::request(segment, &Options::default()).scan().expect("it is whole").subdevices;
    let names: Vec<&str> = found.iter().map(|info| info.name.as_str()).collect();
    assert_eq!(names, ["member", "member", "member", "pump-1", "pump-2"]);
}
