//! Modules in slots: presets, classes, indices that shift.

use ringcat_config::esi::{EsiError, NoReferences, Part, PartsRoom, SlotIndex, parts, place_modules};

use crate::reading::acme;

fn choices(list: &[&str]) -> Vec<Option<String>> {
    list.iter().map(|it| Some((*it).to_owned())).collect()
}

// covers: ES-64, ES-65, ES-66, ES-176
#[test]
fn indices_shift_with_the_slot_and_presets_fill_slots() {
    let esi = acme();
    let drive = &esi.devices[3];
    let preset = place_modules(&esi, drive, &[]).unwrap();
    assert_eq!(preset.iter().map(|it| (it.slot, it.module.ident)).collect::<Vec<_>>(), [(0, 0x1_0001)]);
    let all = place_modules(&esi, drive, &choices(&["csp axis", "#x00010002", "csp axis"])).unwrap();
    let in_slot = |slot: usize, index| all[slot].index(SlotIndex { index, by_slot: true, by_group: false });
    assert_eq!([0, 1, 2].map(|slot| in_slot(slot, 0x1600)), [0x1600, 0x1610, 0x1620].map(Some));
    assert_eq!([0, 1, 2].map(|slot| in_slot(slot, 0x607A)), [0x607A, 0x687A, 0x707A].map(Some));
    assert_eq!(all[2].index(SlotIndex { index: 0xFF00, by_slot: true, by_group: false }), None);
    assert_eq!(all[2].index(SlotIndex { index: 0xFF00, by_slot: false, by_group: false }), Some(0xFF00));
    let pdos = all[2].pdos(&all[2].module.rx_pdos).unwrap();
    assert_eq!((pdos[0].index.index, pdos[0].entries[1].index.index), (0x1620, 0x707A));
    // The other set of vectors: 1 and 16.
    let other = crate::ACME.replacen(
        "SlotPdoIncrement=\"#x10\" SlotIndexIncrement=\"#x800\"",
        "SlotPdoIncrement=\"1\" SlotIndexIncrement=\"16\"",
        1,
    );
    let other = crate::reading::acme_of(&other);
    let placed = place_modules(&other, &other.devices[3], &choices(&["csp axis", "csp axis", "csp axis"])).unwrap();
    let index = |slot: usize, index| placed[slot].index(SlotIndex { index, by_slot: true, by_group: false });
    assert_eq!([0, 1, 2].map(|slot| index(slot, 0x1A00)), [0x1A00, 0x1A01, 0x1A02].map(Some));
    assert_eq!([0, 1, 2].map(|slot| index(slot, 0x6000)), [0x6000, 0x6010, 0x6020].map(Some));
    assert_eq!(all[2].commands().unwrap()[0].index.index, 0x7060);
    let skipped = place_modules(&esi, drive, &choices(&["csp axis", "-", "status axis"])).unwrap();
    assert_eq!(skipped.iter().map(|it| it.slot).collect::<Vec<_>>(), [0, 2]);
}

// covers: ES-71
#[test]
fn modules_that_do_not_fit_name_the_slot_and_the_line() {
    let esi = acme();
    let refused = |device: usize, list: &[&str]| -> String {
        let error: EsiError = place_modules(&esi, &esi.devices[device], &choices(list)).unwrap_err();
        error.to_string()
    };
    assert!(refused(3, &["-"]).starts_with("acme.xml:1"), "{}", refused(3, &["-"]));
    assert!(refused(3, &["-"]).contains("device \"AM01\": slot 0 \"Axis 1\" has to be filled"));
    assert!(refused(3, &["axis"]).contains("there is no module \"axis\": expected \"csp axis\", \"status axis\""));
    assert!(refused(3, &["csp axis"; 4]).contains("4 modules for 3 slots"));
    assert!(refused(1, &["csp axis"]).contains("it has no slots"));
    let alone = ringcat_config::esi::read_with("acme.xml", crate::ACME.as_bytes(), &NoReferences).unwrap();
    let error = place_modules(&alone, &alone.devices[3], &[]).unwrap_err().to_string();
    assert!(error.contains("and the file \"modules\\\\acme-modules.xml\" with modules is missing"), "{error}");
}

// covers: ES-22, ES-72, ES-73, ES-76
#[test]
fn objects_have_the_parts_of_their_types_with_defaults_and_access() {
    let esi = acme();
    let dictionary = esi.devices[2].profiles[0].dictionary.as_ref().unwrap();
    let room = PartsRoom::default;
    let of = |number: usize| parts(dictionary, &dictionary.objects[number], &mut room()).unwrap();
    let settings = of(3);
    let short = |part: &Part| (part.sub_index, part.data_type, part.default.clone(), part.flags.access_word());
    assert_eq!(short(&settings[1]), (1, 0x01, vec![1], 0x13F));
    assert_eq!(short(&settings[2]), (2, 0x06, vec![0, 0], 0x00F), "an enumeration has the code of its base");
    assert_eq!(short(&settings[3]), (3, 0x06, vec![0x64, 0], 0x03F), "without flags those of the object");
    let limits: Vec<_> = of(4).iter().map(|part| (part.sub_index, part.default.clone())).collect();
    assert_eq!(limits, [(0, vec![3]), (1, vec![10, 0]), (2, vec![20, 0]), (3, vec![30, 0])]);
    assert_eq!((of(1)[0].data_type, of(1)[0].default.clone()), (0x09, b"v1.4".to_vec()));
}
