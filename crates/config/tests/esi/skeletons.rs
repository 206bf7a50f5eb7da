//! Descriptions made of images: each field that is lost on the way has a notice.

use std::fs;
use std::time::{Duration, Instant};

use ringcat_config::esi;
use ringcat_config::esi::sii::{self, Comparison, SiiOptions, SiiProfile};
use ringcat_wire::sii::{Pdo, Sii};

use crate::real_files::{files, name};

/// A terminal with two outputs of one bit (protocol ES-179).
const OUTPUTS: &str = include_str!("../files/outputs.xml");

/// What each image of a vendor loses on its way through a description, and the notices about it.
const LISTED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/files/sii-skeletons.txt");

/// Fields that a tool decides: order and padding.
const OF_A_TOOL: [&str; 3] = ["order of the strings", "behind the end marker", "padding of the strings"];

/// The description of an image, and the image of that description compared with it.
fn again(image: &[u8]) -> (sii::Skeleton, SiiOptions, Comparison) {
    let made = sii::skeleton(image).unwrap_or_else(|error| panic!("{error}"));
    let esi = esi::read("skeleton.xml", made.text.as_bytes()).unwrap_or_else(|error| panic!("{error}\n{}", made.text));
    let (options, compared) = sii::most_alike(&esi, &esi.devices[0], image).unwrap_or_else(|error| panic!("{error}"));
    (made, options, compared)
}

/// An image of the terminal.
fn terminal(change: impl Fn(&mut Vec<u8>)) -> Vec<u8> {
    let esi = esi::read("outputs.xml", OUTPUTS.as_bytes()).unwrap_or_else(|error| panic!("{error}"));
    let mut options = SiiOptions::of(SiiProfile::Plain, 1033);
    options.sync1_factor = true;
    let mut image = sii::build(&esi, &esi.devices[0], &options).unwrap_or_else(|error| panic!("{error}")).bytes;
    change(&mut image);
    image
}

/// The place of the first PDO: its category has a header of four bytes.
fn first_pdo(image: &[u8]) -> usize {
    let sii = Sii::parse(image).unwrap_or_else(|error| panic!("{error}"));
    let pdos = sii.categories().find(|it| [50, 51].contains(&it.kind.code())).expect("PDOs");
    pdos.data_offset()
}

// covers: ES-105, ES-94
#[test]
fn all_flags_of_pdos_are_kept_in_a_description() {
    let all = Pdo::MANDATORY | Pdo::FIXED | Pdo::VIRTUAL | Pdo::BY_SLOT | Pdo::BY_SLOT_GROUP;
    for flags in [all, Pdo::OVERWRITTEN_BY_MODULE, Pdo::OVERSAMPLING, Pdo::BY_SLOT, Pdo::BY_SLOT_GROUP] {
        let image = terminal(|image| {
            let at = first_pdo(image);
            image[at + 6..at + 8].copy_from_slice(&flags.to_le_bytes());
        });
        let (made, _, compared) = again(&image);
        assert_eq!(compared.differences, [], "{flags:#06x}");
        let expected = usize::from(flags & Pdo::OVERSAMPLING != 0);
        assert_eq!(made.notices.len(), expected, "{flags:#06x}: {:?}", made.notices);
        assert!(made.notices.iter().all(|it| it.contains("OSFac is 1")), "{:?}", made.notices);
    }
}

// covers: ES-105
#[test]
fn each_flag_without_a_place_in_a_description_is_a_notice() {
    let of = |change: &dyn Fn(&mut Vec<u8>)| sii::skeleton(&terminal(change)).unwrap().notices;
    let general = |image: &[u8]| {
        let sii = Sii::parse(image).unwrap();
        sii.categories().find(|it| it.kind.code() == 30).expect("general").data_offset()
    };
    assert_eq!(of(&|_| {}), [""; 0]);
    let unknown = of(&|image| {
        let at = first_pdo(image);
        image[at + 7] |= 0x80;
    });
    assert_eq!(unknown.len(), 1, "{unknown:?}");
    assert!(unknown[0].contains("flags: 0x8") && unknown[0].contains("no place"), "{unknown:?}");
    for (offset, bits, word) in [(4, 0x01, "byte 0x04"), (0x0B, 0x80, "flags"), (8, 1, "bytes 0x08 to 0x0a")] {
        let found = of(&|image| {
            let at = general(image) + offset;
            image[at] |= bits;
        });
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(found[0].starts_with(&format!("general: {word}: ")), "{found:?}");
    }
}

// covers: ES-105, ES-82
#[test]
fn categories_of_vendors_are_kept_whatever_their_number() {
    for code in [3_u16, 20, 0x0800, 0x7FFF, 0xFFFE] {
        let image = terminal(|image| {
            let used = Sii::parse(image).unwrap().used();
            let own = [&code.to_le_bytes()[..], &[1, 0, 0xAB, 0xCD, 0xFF, 0xFF]].concat();
            image[used - 2..used - 2 + own.len()].copy_from_slice(&own);
        });
        let (made, _, compared) = again(&image);
        assert_eq!(made.notices, [""; 0], "{code}");
        assert!(compared.differences.iter().all(|it| it.field == "categories"), "{code}: {:?}", compared.differences);
    }
}

// covers: esi-use, ES-72
#[test]
fn a_description_of_30000_categories_is_made_in_linear_time() {
    const COUNT: u16 = 30_000;
    let image = terminal(|image| {
        image.truncate(Sii::parse(image).unwrap().used() - 2);
        (0..COUNT).for_each(|number| image.extend([(number + 1_000).to_le_bytes(), [1, 0], [7, 7]].concat()));
        image.extend([0xff; 2]);
    });
    let begin = Instant::now();
    let made = sii::skeleton(&image).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(made.text.matches("<Category>").count(), COUNT.into(), "{:?}", made.notices.first());
    // A search among all categories for each took 30 s.
    assert!(begin.elapsed() < Duration::from_secs(5), "{:?}", begin.elapsed());
}

// covers: ES-105, esi-use
#[test]
fn fields_of_vendor_images_without_a_place_in_a_description_are_listed() {
    let mut found = String::new();
    for path in files("sii").iter().filter(|path| path.extension().is_some_and(|ending| ending == "bin")) {
        let image = fs::read(path).unwrap();
        // One image is damaged.
        if Sii::parse(&image).is_err() {
            continue;
        }
        let (made, options, compared) = again(&image);
        found.push_str(&format!("{} {}: {:?}\n", name(path), options.profile, compared.likeness));
        for it in compared.differences.iter().filter(|it| !it.is_individual) {
            let short = |text: &str| text.chars().take(40).collect::<String>();
            found.push_str(&format!("    {}: {} / {}\n", it.field, short(&it.expected), short(&it.got)));
        }
        made.notices.iter().for_each(|notice| found.push_str(&format!("    notice: {notice}\n")));
        let has_notice = |field: &str| made.notices.iter().any(|notice| notice.starts_with(field));
        let is_lost = |it: &&sii::FieldDifference| {
            let field = it.field.as_str();
            let counts = !it.is_individual && !it.expected.is_empty() && !OF_A_TOOL.contains(&field);
            // Another tool may write a field that the most similar tool leaves out.
            counts && !has_notice(field) && !is_written(&made, &image, field)
        };
        let silent: Vec<_> = compared.differences.iter().filter(is_lost).collect();
        assert!(silent.iter().all(|it| it.field == "number of strings"), "{}: {silent:?}", name(path));
    }
    if found.is_empty() {
        return;
    }
    if std::env::var_os("RINGCAT_WRITE_SII_DIFFERENCES").is_some() {
        fs::write(LISTED, &found).unwrap();
    }
    let listed = fs::read_to_string(LISTED).unwrap_or_default();
    let other = found.lines().zip(listed.lines()).find(|(found, listed)| found != listed);
    assert!(
        found == listed,
        "{other:?}: read the difference; RINGCAT_WRITE_SII_DIFFERENCES=1 cargo test -p ringcat-config lists it"
    );
}

/// Whether the image that some tool makes of a description has this field of the image.
fn is_written(made: &sii::Skeleton, image: &[u8], field: &str) -> bool {
    let esi = esi::read("skeleton.xml", made.text.as_bytes()).unwrap();
    SiiProfile::ALL.into_iter().any(|profile| {
        let built = sii::build(&esi, &esi.devices[0], &SiiOptions::of(profile, 1033));
        built.is_ok_and(|built| sii::compare(image, &built.bytes).differences.iter().all(|it| it.field != field))
    })
}
