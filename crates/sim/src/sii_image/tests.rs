use proptest::prelude::*;
use ringcat_wire::sii::{Identity, PhysicalPort, Sii, SyncManagerKind};

use super::*;
use crate::catalogue;
use crate::description::{DeviceDescription, PdoEntryDescription};

#[test]
fn the_image_of_a_coupler_begins_with_the_expected_bytes() {
    let mut description = catalogue::by_name("coupler").unwrap();
    description.alias = 0x1234;
    let image = build(&description);
    // PDI none, device emulation, alias; the checksum is that of protocol 4.1.
    assert_eq!(image[..10], [0x00, 0x01, 0, 0, 0, 0, 0, 0, 0x34, 0x12]);
    assert_eq!(image[14], ringcat_wire::sii::checksum(image.first_chunk().unwrap()));
    assert_eq!(image[0x7C..0x80], [0x01, 0x00, 0x01, 0x00], "2 KBit, version 1");
    let ports = Sii::parse(&image).unwrap().general().unwrap().ports();
    assert_eq!(ports, [PhysicalPort::Mii, PhysicalPort::Ebus, PhysicalPort::Mii, PhysicalPort::Unused]);
}

#[test]
fn the_first_string_is_the_order_code() {
    let image = build(&catalogue::by_name("servo").unwrap());
    let sii = Sii::parse(&image).unwrap();
    let general = sii.general().unwrap();
    assert_eq!((general.order, sii.strings().string(1)), (1, Some("servo".as_bytes())));
    assert_eq!(sii.strings().string(general.group), Some("Drives".as_bytes()));
}

#[test]
fn a_real_image_is_kept_byte_for_byte() {
    let image = build(&catalogue::by_name("servo").unwrap());
    let description = DeviceDescription::from_sii(image.clone(), "copy").unwrap();
    assert_eq!(build(&description), image);
}

#[test]
fn a_real_image_receives_alias_and_serial_number_of_its_description() {
    let image = build(&catalogue::by_name("servo").unwrap());
    let mut description = DeviceDescription::from_sii(image.clone(), "copy").unwrap();
    description.alias = 0x0042;
    description.identity.serial = 7;
    let changed = build(&description);
    let again = DeviceDescription::from_sii(changed.clone(), "again").unwrap();
    assert_eq!((again.alias, again.identity.serial), (0x0042, 7));
    assert_eq!(changed[32..], image[32..]);
}

#[test]
fn a_wrong_checksum_is_refused_with_a_reason() {
    let mut image = build(&catalogue::by_name("servo").unwrap());
    image[14] ^= 0xFF;
    let error = DeviceDescription::from_sii(image, "broken").unwrap_err();
    assert!(error.to_string().starts_with("SII checksum: expected"), "{error}");
}

#[test]
fn more_sync_managers_than_the_controller_has_are_refused() {
    let mut description = catalogue::by_name("digital-output-8").unwrap();
    description.sync_managers = vec![description.sync_managers[0]; 17];
    let error = DeviceDescription::from_sii(build(&description), "many").unwrap_err();
    assert_eq!(error.to_string(), "SII declares 17 SyncManagers, expected at most 16");
    description.sync_managers.truncate(9);
    let many = DeviceDescription::from_sii(build(&description), "many").unwrap();
    assert_eq!((many.sync_manager_count(), many.sync_managers.len()), (9, 9));
}

#[test]
fn the_image_grows_with_its_content() {
    let mut description = catalogue::by_name("digital-output-16").unwrap();
    description.sii_size_bytes = 128;
    let image = build(&description);
    assert_eq!(image.len(), 768);
    assert_eq!(Sii::parse(&image).unwrap().header().size_bytes(), 768);
}

#[test]
fn strings_that_are_too_long_are_truncated_at_a_character() {
    let mut description = DeviceDescription::plain(&"ä".repeat(200), Identity::default());
    description.group = "x".repeat(300);
    let image = build(&description);
    let again = DeviceDescription::from_sii(image, "cut").unwrap();
    assert_eq!(again.group.len(), 255);
    assert_eq!(again.order_code, "ä".repeat(127));
}

#[test]
fn substitute_pdos_replace_pdos_that_are_only_in_the_dictionary() {
    let mut description = catalogue::by_name("servo").unwrap();
    description.pdos.clear();
    let again = DeviceDescription::from_sii(build(&description), "silent").unwrap();
    let number = again.sync_manager_of(SyncManagerKind::Outputs).unwrap();
    assert_eq!(again.default_length(number), 12);
    assert_eq!(again.default_assignment(number).count(), 1);
}

proptest! {
    #[test]
    fn any_pdo_round_trips(entries in prop::collection::vec((any::<u16>(), any::<u8>(), any::<u8>(), 1u8..), 0..40)) {
        let mut description = catalogue::by_name("digital-output-8").unwrap();
        description.pdos.truncate(1);
        let entries = entries.into_iter().map(|(index, sub_index, data_type, bit_length)| PdoEntryDescription {
            index, sub_index, name: format!("{}", index % 50), data_type, bit_length,
        });
        description.pdos[0].entries = entries.collect();
        let again = DeviceDescription::from_sii(build(&description), "again").unwrap();
        prop_assert_eq!(again.pdos, description.pdos);
    }

    // covers: robust
    #[test]
    fn any_image_results_in_a_device_or_an_error(
        mut image in prop::collection::vec(any::<u8>(), 128..700),
        small in any::<bool>()
    ) {
        if small {
            // Increase the probability of valid categories.
            for place in (0x80..image.len().saturating_sub(1)).step_by(20) {
                image[place] = [10, 30, 40, 41, 50, 51, 60][place % 7];
                image[place + 1] = 0;
            }
        }
        image[14..16].copy_from_slice(&0x88A4u16.to_le_bytes());
        if let Ok(device) = crate::device::Device::from_sii(image.clone(), "any") {
            prop_assert_eq!(device.controller.sii_image(), &image[..]);
        }
    }
}
