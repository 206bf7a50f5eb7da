//! SubDevices that are found by a word of their memory which their SII does not name (protocol 4.3, 8.2).

use ringcat::{
    ConfigError, Declaration, DomainMember, Group, MainDevice, Options, Scan, SubDeviceConfig, SubDeviceInfo, automatic,
};
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::description::DeviceDescription;
use ringcat_sim::network::NetworkOptions;
use ringcat_wire::address::RegisterAddress;
use scenarios::segments::{descriptions, line};
use scenarios::tap::Tap;
use scenarios::world::{CYCLE, World};

use crate::hot_connect::{LIMIT, infos};

/// Address of the word, in process data RAM.
const WORD: RegisterAddress = RegisterAddress(0x1000);
const BASE: [&str; 2] = ["coupler", "digital-output-8"];
const TWIN: &str = "digital-output-16";

/// The base, and behind its first SubDevice two equal SubDevices that differ by the word only.
fn devices(words: [u16; 2]) -> Vec<DeviceDescription> {
    let mut devices = descriptions(&[BASE[0], TWIN, TWIN, BASE[1]]);
    for (device, word) in devices[1..3].iter_mut().zip(words) {
        (device.id_switch_address, device.data_word) = (None, Some((WORD.0, word)));
    }
    devices
}

/// The base by position, then a group for word 7 and one for word 8.
fn declare(_: &Scan) -> Declaration {
    let twin: Vec<SubDeviceInfo> = infos(&[TWIN]);
    let mut declaration = automatic(&infos(&BASE), CYCLE);
    for word in [7, 8] {
        let identity = &twin[0].identity;
        let head = SubDeviceConfig::at_data_word(WORD, word);
        let head = head.expect_product(identity.vendor_id, identity.product_code).pdos_of(&twin[0]);
        let members = declaration.add_group(Group::new(head)).members;
        declaration.domains[0].members.extend(members.into_iter().map(DomainMember::new));
    }
    declaration
}

fn world(words: [u16; 2]) -> World {
    let network = line(devices(words), NetworkOptions::default());
    let mut world = World::with(3, network, &Options::default(), declare).expect("scan and activation");
    world.until(LIMIT, "all that are there settled", |world| world.application().all_settled());
    world
}

/// The device of each declared SubDevice.
fn places(world: &World) -> Vec<Option<usize>> {
    (0..4).map(|index| world.device_of(index).map(|device| device.0)).collect()
}

// covers: 4.3, 8.2, hot-connect
#[test]
fn equal_subdevices_are_identified_by_a_word_that_their_sii_does_not_name() {
    for (words, expected) in [([7, 8], [0, 3, 1, 2]), ([8, 7], [0, 3, 2, 1])] {
        let mut world = world(words);
        world.settle();
        assert!(world.scan.subdevices.iter().all(|info| info.identification.is_none()), "no SII names it");
        assert!(world.application().groups().iter().all(|group| group.has_joined()), "{words:?}");
        assert_eq!(places(&world), expected.map(Some), "{words:?}");
        // They return in another order, while the others exchange process data.
        for device in [1, 2] {
            world.power_off(DeviceIndex(device));
        }
        world.run_cycles(50);
        for device in [2, 1] {
            world.power_on(DeviceIndex(device));
            world.run_cycles(100);
        }
        let joined = |world: &World| world.application().groups().iter().all(|group| group.has_joined());
        world.until(LIMIT, "both have joined", joined);
        world.settle();
        assert_eq!(places(&world), expected.map(Some), "{words:?}, after their return");
    }
}

// covers: 4.3, 8.2, hot-connect
#[test]
fn equal_subdevices_with_one_word_are_ambiguous_and_another_word_finds_none() {
    for (words, present) in [([7, 7], 0), ([7, 9], 1)] {
        let network = line(devices(words), NetworkOptions::default());
        let mut main_device = MainDevice::request(Tap::new(network), &Options::default());
        let mut scan = main_device.scan().expect("a scan");
        assert!(scan.subdevices.iter().all(|info| info.data_words.is_empty()), "no declaration needs a word");
        let mut declaration = declare(&scan);
        main_device.read_data_words(&declaration.subdevices, &mut scan);
        let read: Vec<Option<u16>> = scan.subdevices.iter().map(|info| info.data_word(WORD)).collect();
        assert_eq!(read[1..3], words.map(Some), "{words:?}");
        declaration.subdevices.retain(|config| config.address.data_word().is_some());
        let resolved = ringcat_engine::config::resolve(&declaration.subdevices, &scan.subdevices);
        let found = resolved.iter().filter(|it| matches!(it, ringcat_engine::config::Resolution::Found { .. }));
        assert_eq!(found.count(), present, "{words:?}");
        let ambiguous = resolved.iter().any(|it| match it {
            ringcat_engine::config::Resolution::Absent { error, .. } => {
                matches!(error, ConfigError::Ambiguous { .. })
            }
            _ => false,
        });
        assert_eq!(ambiguous, words == [7, 7], "{words:?}");
    }
}
