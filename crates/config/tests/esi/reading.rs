//! What the reader keeps of a file, with modules and a dictionary.

use std::fs;
use std::path::{Path, PathBuf};

use ringcat_config::esi::{self, CoeCommand, Esi, References, RevisionCheck, SyncManagerRole, Transition};

use crate::ACME;

/// The folder of the files of these tests.
pub struct Folder(pub PathBuf);

impl References for Folder {
    fn open(&self, path: &str) -> Option<Vec<u8>> {
        fs::read(self.0.join(path)).ok()
    }
}

/// The file with its modules.
pub fn acme() -> Esi {
    acme_of(ACME)
}

/// A variant of the file with its modules.
pub fn acme_of(text: &str) -> Esi {
    let folder = Folder(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/files"));
    esi::read_with("acme.xml", text.as_bytes(), &folder).unwrap_or_else(|error| panic!("{error}"))
}

// covers: esi-read, ES-05, ES-12, ES-14, ES-15, ES-30
#[test]
fn vendor_groups_and_identities_are_those_of_the_file() {
    let esi = acme();
    assert_eq!((esi.vendor.id, esi.vendor.name.english()), (0xC47, "Acme Automation"));
    assert_eq!(esi.notices, []);
    let kinds: Vec<_> = esi.devices.iter().map(|it| (it.kind.as_str(), it.product_code, it.revision)).collect();
    let expected = [
        ("AK10", 0x1001, 0x1_0000),
        ("AD08", 0x1008, 0x12_0000),
        ("AA02", 0x2002, 0x11_0000),
        ("AM01", 0x3001, 0x1_0000),
    ];
    assert_eq!(kinds, expected);
    let coupler = &esi.devices[0];
    assert_eq!((coupler.vendor_id, coupler.hides[0].revision), (0xC47, Some(0)));
    assert_eq!((coupler.name.english(), coupler.name.in_language(1031)), ("AK10 Coupler", "AK10 Koppler"));
    let group = esi.group_of(coupler).unwrap();
    assert_eq!((group.key.as_str(), group.name.in_language(1031)), ("AcmeIo", "Acme Klemmen"));
    assert_eq!(esi.devices[1].check_revision, RevisionCheck::LowEqualHighEqualOrGreater);
}

// covers: ES-33, ES-39, ES-43, ES-47, ES-51, ES-55
#[test]
fn sync_managers_pdos_and_mailboxes_keep_their_settings_and_lines() {
    let esi = acme();
    let [_, outputs, analog, _] = &esi.devices[..] else { panic!("four devices") };
    let sm = outputs.sync_managers[0];
    assert_eq!((sm.role, sm.start, sm.control, sm.op_only), (SyncManagerRole::Outputs, Some(0xF00), Some(0x44), true));
    let pdo = &outputs.rx_pdos[0];
    assert_eq!((pdo.index.index, pdo.is_mandatory, pdo.is_fixed, pdo.sync_manager), (0x1600, true, true, Some(0)));
    assert_eq!((pdo.bit_length(), pdo.entries[3].name.english()), (4, "Output 4"));
    assert_eq!(
        ACME.lines().nth(pdo.line as usize - 1).map(str::trim),
        Some("<RxPdo Fixed=\"1\" Mandatory=\"1\" Sm=\"0\">")
    );
    assert_eq!(analog.tx_pdos[0].excludes[0].index, 0x1A01);
    assert_eq!(analog.info.state_times.safeop_op_ms, Some(9000));
    let mailbox = analog.mailbox.as_ref().unwrap();
    assert!(mailbox.data_link_layer && mailbox.foe && mailbox.eoe.is_none());
    let coe = mailbox.coe.as_ref().unwrap();
    assert!(coe.sdo_info && coe.pdo_assign && !coe.pdo_config && coe.complete_access);
    let CoeCommand { transitions, index, sub_index, data, comment, .. } = &coe.commands[0];
    assert_eq!((&transitions[..], index.index, *sub_index), (&[Transition::Ps][..], 0x8000, 3));
    assert_eq!((&data[..], comment.as_str()), (&[0xC8, 0][..], "filter time"));
}

// covers: ES-20, ES-22, ES-24, ES-72, ES-74
#[test]
fn a_dictionary_has_data_types_values_and_access_words() {
    let esi = acme();
    let dictionary = esi.devices[2].profiles[0].dictionary.as_ref().unwrap();
    assert_eq!(dictionary.objects.len(), 5);
    let settings = dictionary.data_type("DT8000").unwrap();
    let word = |number: usize| settings.sub_items[number].flags.map(|flags| flags.access_word());
    assert_eq!([word(1), word(2), word(3)], [Some(0x13F), Some(0x00F), None]);
    let filter = &dictionary.objects[3].sub_items[3];
    assert_eq!((&filter.name[..], filter.info.maximum.as_deref()), ("Filter time", Some(&[0xE8, 3][..])));
    assert_eq!(dictionary.data_type("DT8010ARR").unwrap().array.unwrap().elements, 3);
    assert_eq!(dictionary.data_type("DT8000EN02").unwrap().choices[1].1.english(), "Unsigned");
    assert_eq!(dictionary.objects[1].info.default.as_deref(), Some(&b"v1.4"[..]));
    assert!(dictionary.data_type("DT9999").is_none());
}

// covers: ES-07, ES-65, ES-66, ES-70
#[test]
fn modules_come_from_the_file_that_the_description_refers_to() {
    let esi = acme();
    let idents: Vec<_> = esi.modules.iter().map(|it| (it.ident, it.class.as_deref(), it.kind.as_str())).collect();
    assert_eq!(idents, [(0x1_0001, Some("axis"), "csp axis"), (0x1_0002, Some("axis"), "status axis")]);
    assert_eq!(esi.modules[0].op_mode.as_deref(), Some("DC"));
    let slots = esi.devices[3].slots.as_ref().unwrap();
    assert_eq!((slots.distances.pdo, slots.distances.object, slots.most), (Some(0x10), Some(0x800), Some(4)));
    assert!(slots.download_idents && slots.slots[0].modules[0].is_default);
    assert_eq!((slots.slots[1].most, slots.slots[1].classes[0].class.as_str()), (2, "axis"));
    let alone = esi::read_with("acme.xml", ACME.as_bytes(), &esi::NoReferences).unwrap();
    let notices: Vec<String> = alone.notices.iter().map(ToString::to_string).collect();
    assert!(notices[0].starts_with("line 4: InfoReference") && notices[0].contains("no such file"), "{notices:?}");
}

// covers: ES-08, ES-10, ES-11, ES-13, ES-17, ES-160
#[test]
fn unusual_files_are_read_and_noted() {
    let text = ACME
        .replacen("Version=\"1.6\"", "Version=\"9.9\"", 1)
        .replacen("RevisionNo=\"#x00010000\">AK10", "RevisionNo=\"0x00010000\" Colour=\"red\"> AK10 ", 1)
        .replacen(
            "<GroupType>AcmeIo</GroupType>",
            "<Smell/><VendorSpecific><Device><Sm>x</Sm></Device></VendorSpecific>\
             <GroupType>AcmeIo</GroupType>",
            1,
        );
    let bytes = [&[0xEF, 0xBB, 0xBF], text.as_bytes()].concat();
    let esi = esi::read("odd.xml", &bytes).unwrap();
    assert_eq!((esi.devices.len(), esi.devices[0].kind.as_str(), esi.devices[0].revision), (4, " AK10 ", 0x1_0000));
    assert!(esi.devices[0].sync_managers.is_empty(), "vendor data is not read");
    let notices: Vec<String> = esi.notices.iter().map(ToString::to_string).collect();
    for part in ["Device/Smell is not known", "Type@Colour is not known", "hexadecimal numbers begin with #x"] {
        assert!(notices.iter().any(|notice| notice.contains(part)), "{part}: {notices:?}");
    }
    let declared = text.replacen("UTF-8", "ISO8859-1", 1).replacen("Acme Klemmen", "Acme Kl\u{e4}mmen", 1);
    let esi = esi::read("utf8.xml", declared.as_bytes()).unwrap();
    assert_eq!(esi.groups[0].name.in_language(1031), "Acme Kl\u{e4}mmen");
    assert!(esi.notices[0].text.contains("UTF-8"));
    let latin: Vec<u8> = declared.chars().map(|character| character as u32 as u8).collect();
    assert_eq!(esi::read("latin.xml", &latin).unwrap().groups[0].name.in_language(1031), "Acme Kl\u{e4}mmen");
}

// covers: esi-read, ES-15, ES-20
#[test]
fn duplicate_definitions_and_undefined_names_are_notices_with_their_lines() {
    let acme = ACME;
    let object = "<Object><Index>#x8000</Index><Name>Second</Name><Type>UDINT</Type><BitSize>32</BitSize></Object>";
    let group = "<Group SortOrder=\"30\"><Type>AcmeIo</Type><Name>Second</Name></Group></Groups>";
    let item = "<SubItem><SubIdx>2</SubIdx><Name>Second</Name><Type>UINT</Type><BitSize>16</BitSize>\
                <BitOffs>48</BitOffs></SubItem></DataType>";
    let filter = "<Name>Filter time</Name>";
    let at = acme.find(filter).expect("it is there");
    let end = at + acme[at..].find("</DataType>").expect("it ends");
    let twice = [&acme[..end], item, &acme[end + "</DataType>".len()..]].concat();
    let plain = acme_of(acme).notices.len();
    for (text, expected) in [
        (acme.replacen("</Objects>", &format!("{object}</Objects>"), 1), "Object 0x8000 is defined in line 87 already"),
        (acme.replacen("</Groups>", group, 1), "Group \"AcmeIo\" is defined in line 11 already"),
        (acme.replacen("<GroupType>AcmeDrives<", "<GroupType>Acme<", 1), "GroupType \"Acme\": there is no such group"),
        (acme.replacen("<Type>DT6000</Type>", "<Type>NOTYPE</Type>", 1), "the type \"NOTYPE\" is not defined"),
        (acme.replacen("<BaseType>UINT<", "<BaseType>NOBASE<", 1), "the type \"NOBASE\" is not defined"),
        (twice, "SubIdx 2 is defined twice, the first one is used"),
    ] {
        let esi = acme_of(&text);
        let added: Vec<String> = esi.notices.iter().map(ToString::to_string).collect();
        assert_eq!(added.len(), plain + 1, "{expected}: {added:?}");
        assert!(added.iter().any(|notice| notice.contains(expected)), "{expected}: {added:?}");
    }
    // The first object is used.
    let text = acme.replacen("</Objects>", &format!("{object}</Objects>"), 1);
    let esi = acme_of(&text);
    let objects = esi.devices.iter().flat_map(|device| &device.profiles).flat_map(|it| it.dictionary.as_deref());
    let settings: Vec<_> = objects.flat_map(|it| &it.objects).filter(|it| it.index.index == 0x8000).collect();
    assert_eq!(settings.iter().map(|it| it.name.english()).collect::<Vec<_>>(), ["AI Settings Ch.1"]);
}
