//! Registration of entries without a segment: literal offsets, expected working counters, refusals.

use core::time::Duration;
use std::string::ToString;
use std::vec;
use std::vec::Vec;

use proptest::prelude::*;

use crate::config::{PdoEntry, PdoMapping, SubDeviceConfig};
use crate::declared::SubDeviceId;
use crate::domain::DomainId;
use crate::exchange::Entry;
use crate::info::Direction;
use crate::main_device::{Declaration, EntryPlace, RegisterError};

const PERIOD: Duration = Duration::from_millis(1);

/// Outputs at SyncManager 2 (object 0x7000) and inputs at SyncManager 3 (0x6000), in bits per subindex.
fn config(outputs: &[u8], inputs: &[u8]) -> SubDeviceConfig {
    let pdo = |pdo: u16, object: u16, bits: &[u8]| {
        let entries = (1..).zip(bits).map(|(sub_index, bits)| PdoEntry::new(object, sub_index, *bits));
        PdoMapping::of(pdo, entries.collect::<Vec<_>>())
    };
    let mut config = SubDeviceConfig::at_position(0);
    if !outputs.is_empty() {
        config = config.assign(2, Direction::Outputs, vec![pdo(0x1600, 0x7000, outputs)]);
    }
    if !inputs.is_empty() {
        config = config.assign(3, Direction::Inputs, vec![pdo(0x1A00, 0x6000, inputs)]);
    }
    config
}

fn declaration(configs: Vec<SubDeviceConfig>, domains: usize) -> Declaration {
    let mut declaration = Declaration::default();
    configs.into_iter().for_each(|config| {
        declaration.add_without_domain(config);
    });
    (0..domains).for_each(|_| {
        declaration.add_domain(PERIOD);
    });
    declaration
}

fn place(entry: Entry) -> (usize, u8, u16) {
    (entry.byte_offset(), entry.bit_position(), entry.bit_length)
}

// covers: layout
#[test]
fn a_whole_sync_manager_comes_behind_those_registered_before_padded_to_bytes() {
    let mut declaration = declaration(vec![config(&[1, 1, 1], &[16, 32]), config(&[16], &[8, 3])], 2);
    let mut at = |domain, subdevice, index, sub_index| {
        place(declaration.register_entry(DomainId(domain), SubDeviceId(subdevice), index, sub_index, None).unwrap())
    };
    // The second entry of the inputs first: the whole SyncManager is in the image.
    assert_eq!(at(0, 0, 0x6000, 2), (2, 0, 32));
    assert_eq!(at(0, 1, 0x7000, 1), (6, 0, 16));
    assert_eq!(at(0, 0, 0x7000, 3), (8, 2, 1));
    assert_eq!(at(0, 0, 0x6000, 1), (0, 0, 16), "its SyncManager has its place");
    assert_eq!(at(0, 1, 0x6000, 2), (10, 0, 3));
    assert_eq!(at(1, 1, 0x6000, 1), (0, 0, 8), "once per domain");
    let sizes =
        [0, 1].map(|domain| (declaration.image_start(DomainId(domain)), declaration.image_bytes(DomainId(domain))));
    assert_eq!(sizes, [(0, 11), (11, 2)]);
}

// covers: layout
#[test]
fn the_working_counter_of_igh_counts_two_for_outputs_and_one_for_inputs_of_an_lrw() {
    let mut declaration = declaration(vec![config(&[8], &[8]), config(&[], &[8]), config(&[16], &[])], 4);
    let mut register = |domain, subdevice, sync_manager| {
        declaration.register_sync_manager(DomainId(domain), SubDeviceId(subdevice), sync_manager, None).unwrap();
    };
    [(0, 2), (0, 3), (1, 3), (2, 2)].into_iter().for_each(|(subdevice, manager)| register(0, subdevice, manager));
    [(0, 3), (1, 3)].into_iter().for_each(|(subdevice, manager)| register(1, subdevice, manager));
    register(2, 2, 2);
    let expected = [0, 1, 2, 3].map(|domain| declaration.expected_wkc_as_igh(DomainId(domain)));
    // 2 SubDevices with outputs and 2 with inputs in an LRW; an LRD of two; an LWR of one; nothing.
    assert_eq!(expected, [6, 2, 1, 0]);
}

#[test]
fn an_image_beyond_a_datagram_counts_a_subdevice_in_each_piece() {
    let long = vec![64; 100];
    let mut declaration = declaration(vec![config(&long, &long), config(&[8], &[8])], 1);
    for (subdevice, sync_manager) in [(0, 2), (1, 2), (0, 3), (1, 3)] {
        declaration.register_sync_manager(DomainId(0), SubDeviceId(subdevice), sync_manager, None).unwrap();
    }
    // 800 and 1 bytes of outputs in an LWR; 800 and 1 bytes of inputs in an LRD.
    assert_eq!(declaration.expected_wkc_as_igh(DomainId(0)), 4);
}

#[test]
fn refusals_name_the_subdevice_and_register_nothing() {
    let mut refused = declaration(vec![config(&[8], &[8]), SubDeviceConfig::at_position(1)], 1);
    refused.add_to(DomainId(0), config(&[8], &[]));
    let domain = refused.add_domain(PERIOD);
    let mut error =
        |domain, subdevice, index| refused.register_entry(domain, SubDeviceId(subdevice), index, 1, None).unwrap_err();
    assert_eq!(
        error(domain, 0, 0x6001),
        RegisterError::NotMapped { subdevice: SubDeviceId(0), index: 0x6001, sub_index: 1 }
    );
    assert_eq!(error(DomainId(0), 0, 0x6000), RegisterError::Packed { domain: DomainId(0) });
    assert_eq!(error(DomainId(9), 0, 0x6000), RegisterError::NoSuchDomain { domain: DomainId(9) });
    assert_eq!(error(domain, 1, 0x6000), RegisterError::Unknown { subdevice: SubDeviceId(1) });
    assert_eq!(error(domain, 9, 0x6000), RegisterError::NoSuchSubDevice { subdevice: SubDeviceId(9) });
    assert_eq!(
        error(domain, 1, 0x6000).to_string(),
        "SubDevice 1: the scan has not found it, and its PDOs are not declared with their entries"
    );
    assert_eq!(refused.image_bytes(domain), 0);
    let at = |refused: &mut Declaration, place| refused.register_entry_at(domain, SubDeviceId(0), place, None);
    assert!(at(&mut refused, EntryPlace::new(3, 0, 1)).is_err() && at(&mut refused, EntryPlace::new(4, 0, 0)).is_err());
    assert_eq!(place(at(&mut refused, EntryPlace::new(3, 0, 0)).unwrap()), (0, 0, 8));
}

#[test]
fn more_places_than_fmmus_are_refused() {
    let mut declaration = declaration(vec![config(&[8], &[8])], 16);
    for domain in 0..15 {
        declaration.register_entry(DomainId(domain), SubDeviceId(0), 0x6000, 1, None).unwrap();
    }
    let error = declaration.register_entry(DomainId(15), SubDeviceId(0), 0x6000, 1, None).unwrap_err();
    assert_eq!(error, RegisterError::TooManyPlaces { subdevice: SubDeviceId(0), needed: 17, available: 16 });
}

proptest! {
    // covers: layout
    #[test]
    fn no_registration_moves_an_earlier_one(
        order in proptest::collection::vec((0usize..6, 0usize..4, any::<bool>()), 1..40),
        bits in proptest::collection::vec((1u8..64, 1u8..64), 6),
    ) {
        let mut declaration = declaration(bits.iter().map(|(out, inp)| config(&[*out], &[*inp])).collect(), 4);
        let mut known: Vec<(usize, usize, bool, Entry)> = Vec::new();
        for (subdevice, domain, is_input) in order {
            let index = if is_input { 0x6000 } else { 0x7000 };
            let bytes = declaration.image_bytes(DomainId(domain));
            let entry = declaration.register_entry(DomainId(domain), SubDeviceId(subdevice), index, 1, None).unwrap();
            let before = known.iter().find(|(s, d, i, _)| (*s, *d, *i) == (subdevice, domain, is_input));
            match before {
                Some((.., before)) => prop_assert_eq!(*before, entry),
                None => {
                    prop_assert_eq!(entry.byte_offset(), bytes);
                    known.push((subdevice, domain, is_input, entry));
                }
            }
            for (s, d, i, entry) in known.clone() {
                let index = if i { 0x6000 } else { 0x7000 };
                let again = declaration.register_entry(DomainId(d), SubDeviceId(s), index, 1, None).unwrap();
                prop_assert_eq!(again, entry);
            }
        }
    }
}
