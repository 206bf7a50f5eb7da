//! A station address that is unique and known, and names another SubDevice: another program has written it while no
//! application runs, and the SubDevice that had it loses its power; or a part of the segment was isolated during the
//! scan and comes in the place of another part.

use std::time::Duration;

use ringcat::{Event, MainDevice, Position};
use ringcat_sim::cable::{CableId, DeviceIndex, HostLink};
use ringcat_sim::fault::Fault;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::al::AlState;
use ringcat_wire::register::map;
use scenarios::calls::faults::write_as_another;
use scenarios::segments::{descriptions, line, ring};
use scenarios::tap::Tap;

use super::{FOLLOWED, PREOP, events, noticed, options, stations, statuses};

const KINDS: [&str; 4] = ["servo", "digital-output-8", "emulated-input-8", "all-protocols"];

fn networks(count: usize) -> [Network; 2] {
    let kinds: Vec<&str> = KINDS.into_iter().cycle().take(count).collect();
    let options = NetworkOptions::default;
    [line(descriptions(&kinds), options()), ring(descriptions(&kinds), options())]
}

fn idle(network: Network) -> MainDevice<Tap> {
    let mut main_device = MainDevice::request(Tap::new(network), &options());
    main_device.attend(FOLLOWED);
    while main_device.pop_event().is_some() {}
    main_device
}

/// The list of the MainDevice agrees with the bus: each address names the SubDevice that has it, with its identity.
fn assert_known(main_device: &mut MainDevice<Tap>, what: &str) {
    let found = main_device.subdevices();
    let network = main_device.links_mut().network();
    let stations = stations(network);
    for info in &found {
        let at = stations.iter().position(|station| *station == info.station.0);
        let device = network.device(DeviceIndex(at.unwrap_or_else(|| panic!("{what}: no {}", info.station))));
        let image = device.controller.sii_image();
        let product = u32::from_le_bytes([image[20], image[21], image[22], image[23]]);
        assert_eq!(info.identity.product_code, product, "{what}: {} at {}", device.name(), info.station);
    }
}

// covers: states, rescan
#[test]
fn an_address_that_another_program_has_moved_names_its_new_subdevice() {
    let mut cases = 0;
    for count in [2, 4, 9, 20] {
        let pairs = (0..count).flat_map(|one| [(one, one + 1), (one, (one + 5) % count)]);
        for (one, other) in pairs.filter(|(one, other)| *other < count && one != other) {
            for (number, network) in networks(count).into_iter().enumerate() {
                // On a line nothing behind a SubDevice without power answers.
                if number == 0 && other < one {
                    continue;
                }
                let what = format!("{count} SubDevices, ring {number}, {one} gets the address of {other}");
                let mut main_device = idle(network);
                let address = stations(main_device.links_mut().network())[other];
                let network = main_device.links_mut().network_mut();
                write_as_another(network, one as u16, map::STATION_ADDRESS, &address.to_le_bytes());
                network.advance_by(Duration::from_micros(50));
                network.apply(Fault::PowerOff(DeviceIndex(other)));
                main_device.attend(FOLLOWED);
                let reachable = if number == 0 { other } else { count - 1 };
                assert_eq!(main_device.subdevices().len(), reachable, "{what}");
                assert_known(&mut main_device, &what);
                let states = statuses(&mut main_device);
                assert_eq!(states[one], PREOP, "{what}");
                let network = main_device.links_mut().network_mut();
                network.apply(Fault::PowerOn(DeviceIndex(other)));
                main_device.attend(2 * FOLLOWED);
                assert_eq!(statuses(&mut main_device), vec![PREOP; count], "{what}");
                assert_eq!(main_device.subdevices().len(), count, "{what}");
                assert_known(&mut main_device, &what);
                for (at, info) in main_device.subdevices().iter().enumerate().filter(|(_, it)| it.protocols.coe()) {
                    let servo = main_device.subdevice(Position(at as u16));
                    let read = servo.sdo_read::<u32>(0x1018, 2).unwrap_or_else(|error| panic!("{what}: {error}"));
                    assert_eq!(read, info.identity.product_code, "{what}");
                }
                cases += 1;
            }
        }
    }
    println!("{cases} station addresses were moved");
    assert!(cases > 50);
}

// covers: states
#[test]
fn an_address_that_another_program_has_written_is_noticed_within_a_second() {
    for address in [0_u16, 0x1002, 0x1004, 0x4711] {
        for network in networks(4) {
            let has_ring = network.host_cable(HostLink::Redundant).is_some();
            let mut main_device = idle(network);
            let network = main_device.links_mut().network_mut();
            write_as_another(network, 2, map::STATION_ADDRESS, &address.to_le_bytes());
            let time = noticed(&mut main_device, |event| matches!(event, Event::SegmentChanged { .. }));
            assert!(time < Duration::from_millis(1_100), "{address:#06x}, ring {has_ring}: {time:?}");
            main_device.attend(FOLLOWED);
            assert_known(&mut main_device, &format!("{address:#06x}, ring {has_ring}"));
            assert_eq!(statuses(&mut main_device), [PREOP; 4]);
            assert_eq!(main_device.subdevices().len(), 4);
            events(&mut main_device);
            let servo = main_device.subdevice(Position(0));
            assert_eq!(servo.state().expect("it answers").status.al_state(), Some(AlState::PreOp));
        }
    }
}

/// The end of a ring has the addresses of an isolated part, because that part kept those of an earlier program. Then
/// the isolated part comes where the end was seen, and the end leaves, both between two broadcasts.
// covers: states, rescan
#[test]
fn an_isolated_part_that_comes_in_the_place_of_another_one_is_read() {
    let mut cases = 0;
    for count in [3, 6, 9, 12] {
        for (first, end) in (1..count - 1).flat_map(|first| (first + 1..count).map(move |end| (first, end))) {
            let [_, ring] = networks(count);
            let what = format!("{count} SubDevices, {first} to {end} isolated");
            let mut network = idle(ring).into_links().into_network();
            let (near, far) = (CableId(first), CableId(end));
            network.apply(Fault::Cut(near));
            network.apply(Fault::Cut(far));
            let mut main_device = idle(network);
            assert_eq!(main_device.subdevices().len(), count - (end - first), "{what}");
            let network = main_device.links_mut().network_mut();
            network.apply(Fault::Heal(near));
            network.apply(Fault::Cut(CableId(count)));
            main_device.attend(2 * FOLLOWED);
            assert_eq!(main_device.subdevices().len(), end, "{what}");
            assert_known(&mut main_device, &what);
            assert_eq!(statuses(&mut main_device)[..end], vec![PREOP; end], "{what}");
            let network = main_device.links_mut().network_mut();
            network.apply(Fault::Heal(far));
            network.apply(Fault::Heal(CableId(count)));
            main_device.attend(2 * FOLLOWED);
            assert_eq!(statuses(&mut main_device), vec![PREOP; count], "{what}");
            assert_known(&mut main_device, &what);
            cases += 1;
        }
    }
    assert!(cases > 50, "{cases}");
}
