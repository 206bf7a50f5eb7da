//! SII images from descriptions: literal images of three small descriptions, and the images of vendors if they are
//! beside the repository.

use std::fs;

use ringcat_config::esi::index::{Index, IndexedFile, Stamp};
use ringcat_config::esi::sii::{self, Likeness, SiiOptions, SiiProfile};
use ringcat_config::esi::{self, Device, Esi};
use ringcat_wire::sii::Sii;

use crate::real_files::{files, model, name};

/// A terminal with two outputs of one bit (protocol ES-179).
const OUTPUTS: &str = include_str!("../files/outputs.xml");

/// A drive with mailbox and clock (protocol ES-181).
const DRIVE: &str = include_str!("../files/drive.xml");

fn read(text: &str) -> Esi {
    esi::read("acme.xml", text.as_bytes()).unwrap_or_else(|error| panic!("{error}"))
}

fn bytes(text: &str) -> Vec<u8> {
    let digits: Vec<u8> = text.chars().filter_map(|c| c.to_digit(16)).map(|digit| digit as u8).collect();
    digits.chunks(2).map(|pair| pair[0] << 4 | pair[1]).collect()
}

fn built(text: &str, change: impl Fn(&mut SiiOptions)) -> Vec<u8> {
    let esi = read(text);
    let mut options = SiiOptions::default();
    options.physical_layer = Some(0);
    change(&mut options);
    let image = sii::build(&esi, &esi.devices[0], &options).unwrap_or_else(|error| panic!("{error}"));
    assert!(Sii::parse(&image.bytes).is_ok());
    image.bytes
}

// covers: esi-use, ES-80, ES-86, ES-87, ES-91, ES-92, ES-93, ES-94, ES-78, ES-83, ES-179
#[test]
fn a_terminal_has_the_literal_image_of_twincat() {
    let image = built(OUTPUTS, |_| {});
    let mut expected = vec![0xFF; 512];
    let mut put = |at: usize, text: &str| {
        let data = bytes(text);
        expected[at..at + data.len()].copy_from_slice(&data);
    };
    put(0, "04010000000001000000000000002A00 FF010000020001000300000000000000");
    put(0x20, &"00".repeat(0x5C));
    put(0x7C, "03000100");
    put(0x80, "0A001200 0702413202496F0741636D6520494F064132203243680443682031034F75740443682032");
    put(0xA8, "1E001000 020001040000000000000000 88FF0300 1100 0000 000000000000000000000000");
    put(0xCC, "28000100 01FF 29000400 000F010044000903 2B000100 F0FF");
    put(0xE4, "33001400 0016010000051100 0070010601010000 0116020000071000 0000000000030000 1070010601010000 FFFF");
    assert_eq!(image, expected);
}

// covers: ES-13, ES-88
#[test]
fn blanks_of_a_name_are_in_the_image_and_not_in_comparisons() {
    let text = OUTPUTS.replacen(">A2<", "> A2 <", 1);
    assert_ne!(text, OUTPUTS);
    let image = built(&text, |_| {});
    let has = |part: &[u8]| image.windows(part.len()).any(|window| window == part);
    assert!(has(b"\x04 A2 ") && !has(b"\x02A2"), "the length of the text counts its blanks");
    let esi = read(&text);
    assert_eq!(esi.devices[0].kind, " A2 ");
    let index = Index::new(vec![IndexedFile::of("acme.xml", Stamp::default(), &esi)]);
    let kinds: Vec<&str> = index.devices().map(|(_, device)| device.kind.as_str()).collect();
    assert_eq!(kinds, ["A2"]);
}

// covers: ES-88, ES-180
#[test]
fn another_language_changes_its_strings_only() {
    let english = built(OUTPUTS, |_| {});
    let german = built(OUTPUTS, |options| options.language = 1031);
    let found = sii::compare(&english, &german);
    let fields: Vec<_> = found.differences.iter().map(|it| (it.field.as_str(), it.got.as_str())).collect();
    let expected =
        [("string \"Acme IO\"", ""), ("general: group name", "\"Acme EA\""), ("string \"Acme EA\"", "present")];
    assert_eq!(fields, expected);
    assert_eq!(english.len(), german.len());
}

// covers: ES-82, ES-89, ES-97, ES-180
#[test]
fn siitool_has_another_order_and_a_category_per_pdo() {
    let image = built(OUTPUTS, |options| options.profile = SiiProfile::Siitool);
    let sii = Sii::parse(&image).unwrap();
    let strings: Vec<_> = sii.strings().iter().map(String::from_utf8_lossy).collect();
    assert_eq!(strings, ["Io", "A2 2Ch", "Ch 1", "Out", "Ch 2", "Out"]);
    let general = sii.general().unwrap();
    assert_eq!([general.group, general.order, general.name, general.group_again], [1, 0, 2, 1]);
    let kinds: Vec<u16> = sii.categories().map(|category| category.kind.code()).collect();
    assert_eq!(kinds, [10, 30, 40, 41, 51, 51]);
    assert_eq!(image.len(), sii.used(), "it ends with the end marker");
}

// covers: ES-80, ES-91, ES-93, ES-98, ES-99, ES-100, ES-171, ES-181
#[test]
fn a_drive_has_mailboxes_clock_modes_and_a_category_of_its_vendor() {
    let image = built(DRIVE, |options| options.sync1_factor = true);
    assert_eq!(
        image[..0x3A],
        bytes(
            "050C0100640000000000000000003500 FF010000100000000000010000000000 0000000000000000 0010F400F410F400 \
         0010800080108000 0E00"
        )
    );
    let category = |code: u16| {
        let sii = Sii::parse(&image).unwrap();
        sii.categories().find(|it| it.kind.code() == code).map(|it| it.data.to_vec()).unwrap_or_default()
    };
    assert_eq!(category(10), bytes("0602443102447206447269766573084431204472697665074672656552756E024443"));
    assert_eq!(category(30), bytes("02000104 00 27 01 01 000000 1C 0000 03 00 3101 3401 000000000000000000000000"));
    assert_eq!(category(40), bytes("010203FF"));
    assert_eq!(category(41), bytes("0010800026000101 8010800022000102 0011020064000103 0014000020000004"));
    assert_eq!(
        category(60),
        bytes("000000000000000000000000000000000000050000000000 00000000E0B1FFFF00000000FFFF00030100060000000000")
    );
    assert_eq!(category(2), bytes("0100"));
    let twincat = built(DRIVE, |_| {});
    let fields: Vec<_> = sii::compare(&image, &twincat).differences.into_iter().map(|it| it.field).collect();
    assert_eq!(fields, ["clock mode 1: factor of SYNC1"]);
}

// covers: ES-82
#[test]
fn a_category_of_the_device_precedes_the_standard_ones_of_twincat_only() {
    let own = OUTPUTS.replace("</ByteSize>", "</ByteSize><Category><CatNo>3</CatNo><Data>0100</Data></Category>");
    let codes = |profile: SiiProfile| {
        let image = built(&own, |options| options.profile = profile);
        let sii = Sii::parse(&image).unwrap();
        sii.categories().map(|it| it.kind.code()).collect::<Vec<_>>()
    };
    assert_eq!(codes(SiiProfile::TwinCat)[..2], [3, 10]);
    assert_eq!(codes(SiiProfile::Siitool).last(), Some(&3));
}

// covers: ES-84, ES-85, ES-96
#[test]
fn an_image_that_does_not_fit_is_refused_unless_the_pdos_are_left_out() {
    let small = OUTPUTS.replace("<ByteSize>512<", "<ByteSize>256<");
    let esi = read(&small);
    let refused = sii::build(&esi, &esi.devices[0], &SiiOptions::default()).unwrap_err().to_string();
    assert!(refused.starts_with("acme.xml:8: device \"A2\": the image needs 274 bytes, ByteSize is 256"), "{refused}");
    let without = built(&small, |options| options.without_pdos = true);
    let sii = Sii::parse(&without).unwrap();
    assert_eq!(sii.categories().map(|it| it.kind.code()).collect::<Vec<_>>(), [10, 30, 40, 41, 43]);
    assert_eq!(sii.strings().count(), 4, "their strings are left out too");
    let wide = OUTPUTS.replacen("<BitLen>1<", "<BitLen>300<", 1);
    let esi = read(&wide);
    let refused = sii::build(&esi, &esi.devices[0], &SiiOptions::default()).unwrap_err().to_string();
    assert!(refused.contains("acme.xml:5: device \"A2\": PDO 0x1600 has an entry of 300 bits"), "{refused}");
}

// covers: ES-81
#[test]
fn a_whole_image_of_a_description_is_taken_as_it_is() {
    let image = built(OUTPUTS, |_| {});
    let digits: String = image.iter().map(|byte| format!("{byte:02X}")).collect();
    let parts = OUTPUTS.split_once("<Eeprom>").unwrap();
    let rest = parts.1.split_once("</Eeprom>").unwrap().1;
    let text = format!("{}<Eeprom><Data>{digits}</Data></Eeprom>{rest}", parts.0);
    assert_eq!(built(&text, |_| {}), image);
    let own = built(&text, |options| {
        options.serial = Some(0x0102_0304);
        options.alias = Some(0x1001);
    });
    assert_eq!((&own[28..32], &own[8..10]), (&[4, 3, 2, 1][..], &[1, 0x10][..]), "serial number and alias are its own");
    assert_eq!(sii::compare(&image, &own).likeness, Likeness::Individual);
}

// covers: ES-105
#[test]
fn a_description_made_of_an_image_gives_the_same_image() {
    for text in [OUTPUTS, DRIVE] {
        let image = built(text, |options| options.sync1_factor = true);
        let again = built(&sii::skeleton(&image).unwrap().text, |options| options.sync1_factor = true);
        assert_eq!(sii::compare(&image, &again).differences, []);
        assert_eq!(image, again);
    }
}

/// The drive with a mailbox that has no protocol.
fn without_protocol() -> String {
    let (before, rest) = DRIVE.split_once("<Mailbox").unwrap();
    let (_, after) = rest.split_once("</Mailbox>").unwrap();
    format!("{before}<Mailbox DataLinkLayer=\"1\"/>{after}")
}

// covers: ES-80, ES-105
#[test]
fn a_description_of_an_image_keeps_mailboxes_without_a_protocol() {
    let image = built(&without_protocol(), |options| options.sync1_factor = true);
    assert_eq!((&image[48..52], &image[56..58]), (&[0, 0x10, 0x80, 0][..], &[0, 0][..]));
    let again = built(&sii::skeleton(&image).unwrap().text, |options| options.sync1_factor = true);
    assert_eq!(sii::compare(&image, &again).differences, []);
    assert_eq!(image, again);
    assert!(sii::skeleton(&image).unwrap().notices.is_empty());
}

// covers: ES-80, ES-105
#[test]
fn mailboxes_that_a_description_cannot_express_are_notices() {
    let mut image = built(&without_protocol(), |_| {});
    image[50] = 0x60;
    image[56] = 0x84;
    let made = sii::skeleton(&image).unwrap();
    assert!(made.text.contains("<CoE") && made.text.contains("<Mailbox"), "{}", made.text);
    let mailboxes = "the mailboxes of the fixed area, 0x1000 (96 bytes) and 0x1080 (128 bytes), are not those of the \
                     SyncManagers, 0x1000 (128 bytes) and 0x1080 (128 bytes), which the description has";
    let coe = "general: CoE features: 0x00 has no place in a description; an image made of it has 0x01";
    assert_eq!(made.notices, [mailboxes, "the protocols 0x0080 have no element in a description", coe]);
}

/// All real descriptions.
fn descriptions() -> Vec<Esi> {
    files("esi").iter().map(|path| model(path)).collect()
}

/// The description of an identity: the same revision, or the one with the same low word and the nearest high word.
fn description_of(all: &[Esi], vendor: u32, product: u32, revision: u32) -> Option<(&Esi, &Device)> {
    let devices = all.iter().flat_map(|esi| esi.devices.iter().map(move |device| (esi, device)));
    let same = devices.filter(|(_, it)| (it.vendor_id, it.product_code) == (vendor, product));
    same.min_by_key(|(_, it)| (it.revision as u16 != revision as u16, it.revision.abs_diff(revision)))
}

/// Each image of a vendor with a description, and each field in which that gives another value, individual ones aside:
/// fields of other editions of a description, and habits of single devices.
const LISTED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/files/sii-differences.txt");

// covers: ES-101, ES-102, esi-use
#[test]
fn images_of_vendors_are_built_byte_for_byte_or_differ_in_listed_fields() {
    let all = descriptions();
    if all.is_empty() {
        return;
    }
    let mut found = String::new();
    for path in files("sii").iter().filter(|path| path.extension().is_some_and(|ending| ending == "bin")) {
        let image = fs::read(path).unwrap();
        let Ok(parsed) = Sii::parse(&image) else { continue };
        let identity = parsed.header().identity;
        let described = description_of(&all, identity.vendor_id, identity.product_code, identity.revision);
        let Some((esi, device)) = described else { continue };
        let (options, compared) = sii::most_alike(esi, device, &image).unwrap_or_else(|error| panic!("{error}"));
        let (image, esi) = (name(path), &esi.file);
        let likeness = match compared.likeness {
            Likeness::Identical => "identical",
            Likeness::Individual => "individual fields differ",
            _ => "differs",
        };
        let (profile, language) = (options.profile, options.language);
        found.push_str(&format!("{image} {esi} {:#010x} {profile} {language}: {likeness}\n", device.revision));
        for it in compared.differences.iter().filter(|it| !it.is_individual) {
            let word = |text: &str| if text.is_empty() { "nothing".into() } else { text.chars().take(90).collect() };
            let [image, built]: [String; 2] = [word(&it.expected), word(&it.got)];
            found.push_str(&format!("    {}\n        image {image}\n        built {built}\n", it.field));
        }
    }
    if std::env::var_os("RINGCAT_WRITE_SII_DIFFERENCES").is_some() {
        fs::write(LISTED, &found).unwrap();
    }
    let listed = fs::read_to_string(LISTED).unwrap();
    let other = found.lines().zip(listed.lines()).find(|(found, listed)| found != listed);
    assert!(
        found == listed,
        "{other:?}: read the difference; RINGCAT_WRITE_SII_DIFFERENCES=1 cargo test -p ringcat-config images lists it"
    );
}

// covers: ES-177
#[test]
fn the_size_word_is_that_of_the_size_in_kibit() {
    let empty = OUTPUTS.replace("<ByteSize>512<", "<ByteSize>SIZE<");
    assert_ne!(empty, OUTPUTS);
    let sizes = [(128, None), (256, None), (512, Some(3)), (1024, Some(7)), (2048, Some(0x0F)), (4096, Some(0x1F))];
    for (size, word) in sizes.into_iter().chain([(15_360, Some(0x77))]) {
        let esi = read(&empty.replace("SIZE", &size.to_string()));
        let mut options = SiiOptions::default();
        options.physical_layer = Some(0);
        let image = sii::build(&esi, &esi.devices[0], &options);
        let Some(word) = word else {
            assert!(image.is_err(), "{size}: the image is longer");
            continue;
        };
        let image = image.unwrap_or_else(|error| panic!("{error}")).bytes;
        assert_eq!((image.len(), &image[0x7C..0x7E]), (size, &[word, 0][..]));
    }
}
