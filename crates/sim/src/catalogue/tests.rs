use ringcat_wire::sii::{PdoDirection, Sii};

use super::*;
use crate::sii_image::{build, used_bytes};

#[test]
fn each_name_results_in_a_device_with_a_valid_image_of_256_to_1024_bytes() {
    for name in names() {
        let description = by_name(name).unwrap();
        let image = build(&description);
        let sii = Sii::parse(&image).unwrap();
        assert!((256..=1024).contains(&image.len()), "{name}: {} bytes", image.len());
        assert_eq!(image.len(), description.sii_size_bytes, "{name} needs {} bytes", used_bytes(&description));
        assert_eq!(sii.header().size_bytes(), image.len(), "{name}");
        assert_eq!(sii.header().identity, description.identity, "{name}");
        println!("{name}: image {} bytes, {} used", image.len(), used_bytes(&description));
    }
}

#[test]
fn a_plain_terminal_has_an_image_of_exactly_512_bytes() {
    assert_eq!(build(&by_name("digital-output-8").unwrap()).len(), 512);
    assert_eq!(build(&by_name("digital-input-8").unwrap()).len(), 512);
}

#[test]
fn product_codes_differ() {
    let mut seen = Vec::new();
    for name in names() {
        let identity = by_name(name).unwrap().identity;
        assert!(!seen.contains(&identity), "{name}");
        seen.push(identity);
    }
}

#[test]
fn sync_manager_lengths_match_the_assigned_pdos() {
    for name in names() {
        let description = by_name(name).unwrap();
        for (number, entry) in (0u8..).zip(&description.sync_managers) {
            let bits: u32 = description.default_assignment(number).map(|pdo| pdo.bit_length()).sum();
            if bits != 0 {
                assert_eq!(u32::from(entry.length), bits.div_ceil(8), "{name} SyncManager {number}");
            }
        }
    }
}

// covers: sim-devices
#[test]
fn a_description_is_restored_from_its_image() {
    for name in names() {
        let description = by_name(name).unwrap();
        let again = DeviceDescription::from_sii(build(&description), name).unwrap();
        assert_eq!(again.identity, description.identity, "{name}");
        assert_eq!(again.ports, description.ports, "{name}");
        // An odd number of FMMUs is padded to a word.
        assert!(again.fmmus.starts_with(&description.fmmus), "{name}");
        assert_eq!(again.sync_managers, description.sync_managers, "{name}");
        assert_eq!(again.emulation, description.emulation, "{name}");
        let of = |description: &DeviceDescription, direction| {
            let pdos = description.pdos.iter().filter(|pdo| pdo.direction == direction);
            pdos.cloned().collect::<Vec<_>>()
        };
        for direction in [PdoDirection::Rx, PdoDirection::Tx] {
            assert_eq!(of(&again, direction), of(&description, direction), "{name}");
        }
        assert_eq!(again.mailbox.map(|mailbox| mailbox.standard), description.mailbox.map(|mailbox| mailbox.standard));
    }
}

#[test]
fn an_unknown_name_is_none() {
    assert!(by_name("toaster").is_none());
}
