//! Names of objects from descriptions, for messages and network files; modules that are in slots.

use ringcat_config::ObjectNames;
use ringcat_config::esi::{Choices, Esi, PlacedModule, detected_modules, select};
use ringcat_config::network::model::SubDevice;

use crate::reading::acme;

const ANALOG: usize = 2;
const DRIVE: usize = 3;
const CSP: u32 = 0x1_0001;
const STATUS: u32 = 0x1_0002;

fn places(modules: &[PlacedModule<'_>]) -> Vec<(u16, u32)> {
    modules.iter().map(|placed| (placed.slot, placed.module.ident)).collect()
}

fn names(esi: &Esi, device: usize, modules: &[PlacedModule<'_>], language: u32) -> ObjectNames {
    let mut names = ObjectNames::default();
    names.add_described(&esi.devices[device], modules, language);
    names
}

// covers: esi-use, ES-12, ES-22
#[test]
fn objects_have_the_names_of_pdos_then_of_the_dictionary_in_a_language() {
    let esi = acme();
    let english = names(&esi, ANALOG, &[], 1033);
    assert_eq!(english.object(0x1A00), Some("AI Standard Channel 1"));
    assert_eq!((english.entry(0x6000, 17), english.object(0x6000)), (Some("Value"), Some("AI Inputs Ch.1")));
    assert_eq!(english.entry(0x8000, 3), Some("AI Settings Ch.1: Filter time"));
    assert_eq!((english.entry(0x100A, 0), english.entry(0x9999, 1)), (Some("Software version"), None));
    assert_eq!(names(&esi, ANALOG, &[], 1031).object(0x8000), Some("AI Einstellungen Kanal 1"));
    assert_eq!(
        english.annotate("SDO 0x8000:03: value out of range; PDO 0x1a02"),
        "SDO 0x8000:03 \"AI Settings Ch.1: Filter time\": value out of range; PDO 0x1a02 \"AI Channel 2\""
    );
}

// covers: esi-use, ES-47
#[test]
fn pdos_with_the_entries_that_a_description_fixes_are_fixed_in_a_file() {
    let esi = acme();
    let device = &esi.devices[ANALOG];
    let choices = Choices::default();
    let selection = select(&esi, device, &choices).expect("it has defaults");
    let cycle = std::time::Duration::from_millis(1);
    let mut scanned = SubDevice::from_esi(&selection, cycle, 1033).expect("it is declared").subdevice;
    for pdo in scanned.sync_manager.iter_mut().flat_map(|sm| &mut sm.pdo) {
        pdo.fixed = false;
    }
    let mut other = scanned.clone();
    scanned.name_from_esi(device, &[], 1033);
    let fixed = |of: &SubDevice| of.sync_manager[1].pdo.iter().map(|pdo| pdo.fixed).collect::<Vec<_>>();
    assert_eq!(fixed(&scanned), [true, true]);
    other.sync_manager[1].pdo[1].entries.iter_mut().flatten().for_each(|entry| entry.bits += 1);
    other.name_from_esi(device, &[], 1033);
    assert_eq!(fixed(&other), [true, false], "the device has another mapping");
}

// covers: esi-use, ES-64, ES-69
#[test]
fn modules_are_in_the_slots_of_the_idents_that_a_device_has_detected() {
    let esi = acme();
    let drive = &esi.devices[DRIVE];
    let detected = |idents: &[u32]| places(&detected_modules(&esi, drive, idents, &[]));
    assert_eq!(detected(&[CSP, 0, STATUS]), [(0, CSP), (2, STATUS)]);
    assert_eq!(detected(&[0x99, CSP]), [(1, CSP)], "an ident that no module has");
    assert_eq!(detected(&[CSP, CSP, CSP, CSP, CSP]), [(0, CSP), (1, CSP), (2, CSP)], "more than the slots");
    assert_eq!((detected(&[]), detected(&[0, 0])), (vec![], vec![]));
    assert_eq!(places(&detected_modules(&esi, &esi.devices[ANALOG], &[CSP], &[])), [], "it has no slots");
}

// covers: esi-use, ES-64, ES-67
#[test]
fn pdos_of_modules_are_named_by_module_and_pdo_at_the_indices_of_their_slots() {
    let esi = acme();
    let drive = &esi.devices[DRIVE];
    let modules = detected_modules(&esi, drive, &[CSP, 0, STATUS], &[]);
    let names = names(&esi, DRIVE, &modules, 1033);
    assert_eq!((names.object(0x1600), names.object(0x1A20)), (Some("csp axis/Outputs"), Some("status axis/Inputs")));
    assert_eq!((names.entry(0x607A, 0), names.entry(0x7041, 0)), (Some("Target position"), Some("Statusword")));
    assert_eq!((names.entry(0x6060, 0), names.object(0x7060)), (Some("Modes of operation"), None), "of slot 0 only");

    let mut choices = Choices::default();
    choices.modules = ["csp axis", "-", "status axis"].map(|it| Some(it.to_owned())).into();
    let selection = select(&esi, drive, &choices).unwrap_or_else(|error| panic!("{error}"));
    let made = SubDevice::from_esi(&selection, std::time::Duration::from_millis(1), 1033).unwrap();
    let mut bare = made.subdevice;
    for pdo in bare.sync_manager.iter_mut().flat_map(|sm| &mut sm.pdo) {
        pdo.name.clear();
        pdo.entries.iter_mut().flatten().for_each(|entry| (entry.name, entry.data_type) = Default::default());
    }
    assert_eq!(bare.name_from_esi(drive, &[], 1033), 0, "the device itself has none");
    let filled = bare.name_from_esi(drive, &modules, 1033);
    let pdos: Vec<_> = bare.sync_manager.iter().flat_map(|sm| &sm.pdo).collect();
    assert_eq!(
        pdos.iter().map(|pdo| (pdo.index, pdo.name.as_str())).collect::<Vec<_>>(),
        [(0x1600, "csp axis/Outputs"), (0x1A00, "csp axis/Inputs"), (0x1A20, "status axis/Inputs")]
    );
    let entries: Vec<_> = pdos.iter().flat_map(|pdo| pdo.entries.iter().flatten()).collect();
    assert_eq!(filled, pdos.len() + entries.len(), "each has a name");
    let last = entries.last().expect("an entry");
    assert_eq!((last.index, last.name.as_str(), last.data_type.as_str()), (0x7041, "Statusword", "UINT"));
}
