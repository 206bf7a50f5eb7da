//! Generated bad files: each is refused with file, line and reason, in bounded time and memory.

use std::time::{Duration, Instant};

use ringcat_config::esi;

use crate::ACME;

/// The error of a file.
fn refusal(text: impl AsRef<[u8]>) -> String {
    let begin = Instant::now();
    let error = esi::read("bad.xml", text.as_ref()).expect_err("it is refused").to_string();
    assert!(begin.elapsed() < Duration::from_secs(20), "in bounded time");
    assert!(error.starts_with("bad.xml:") && error.len() < 600, "{error}");
    error
}

/// The error of the file with a text replaced.
fn changed(from: &str, to: &str) -> String {
    assert!(ACME.contains(from), "{from}");
    refusal(ACME.replacen(from, to, 1))
}

// covers: esi-read, ES-04
#[test]
fn a_truncated_file_is_refused_at_every_length() {
    for length in (1..ACME.trim_end().len()).step_by(97) {
        let Some(text) = ACME.get(..length) else { continue };
        refusal(text);
    }
    assert!(refusal(&ACME[..9000]).contains("truncated"));
}

// covers: esi-read, ES-04
#[test]
fn nested_elements_and_entities_are_refused_before_they_cost_memory() {
    let nested = format!("{}{}", "<a>".repeat(1_000_000), "</a>".repeat(1_000_000));
    assert_eq!(refusal(nested), "bad.xml:1: too much for a device description: more than 64 levels of elements");
    let entities = "<!ENTITY a \"aaaaaaaaaa\"><!ENTITY b \"&a;&a;&a;&a;&a;&a;&a;&a;\">";
    let bomb = format!("<!DOCTYPE a [{entities}]>\n<EtherCATInfo>&b;</EtherCATInfo>");
    assert!(refusal(bomb).contains("document type definition"));
    let entities: String = (0..100).map(|n| format!("<!ENTITY a{n} \"x\">")).collect();
    let many = refusal(format!("<?xml version=\"1.0\"?>\n<!DOCTYPE a [{entities}]>\n<EtherCATInfo/>"));
    assert!(many.starts_with("bad.xml:2: ") && many.contains("document type definition"), "{many}");
    assert!(changed("Acme drives", "&unknown;").contains("bad.xml:12: not well-formed"));
    assert!(changed("Acme drives", &"x".repeat(1_100_000)).contains("bytes of a text"));
    let attributes: String = (0..200).map(|n| format!(" a{n}=\"1\"")).collect();
    assert!(changed("<Groups", &format!("<Groups{attributes}")).contains("attributes of an element"));
}

/// A number that is there without a digit is none, in an attribute as in an element.
// covers: esi-read, ES-170
#[test]
fn an_empty_number_is_refused_and_an_empty_flag_is_noted() {
    for (from, to, attribute) in [
        ("<Name LcId=\"1033\">", "<Name LcId=\"\">", "LcId"),
        (" Sm=\"0\"", " Sm=\" \"", "Sm"),
        ("ProductCode=\"#x", "ProductCode=\"\" Other=\"#x", "ProductCode"),
    ] {
        let error = changed(from, to);
        let expected = format!("in the attribute {attribute}, decimal or #x and hexadecimal digits");
        assert!(error.contains(&expected) && error.contains("got \""), "{error}");
    }
    assert!(changed("<SubIndex>3</SubIndex>", "<SubIndex></SubIndex>").contains("a number of 8 bits"));
    let text = ACME.replacen(" Mandatory=\"1\"", " Mandatory=\"\"", 1);
    assert_ne!(text, ACME);
    let esi = esi::read("flag.xml", text.as_bytes()).expect("it is read");
    let notices: Vec<String> = esi.notices.iter().map(ToString::to_string).collect();
    assert!(
        notices.iter().any(|it| it.contains("RxPdo@Mandatory is empty: read as if it were missing")),
        "{notices:?}"
    );
}

// covers: esi-read, ES-05
#[test]
fn wrong_encodings_and_other_files_are_named() {
    assert!(refusal([0xFF, 0xFE, b'<', 0, 0]).contains("not readable as text"), "half a character of UTF-16");
    let mut bytes = ACME.as_bytes().to_vec();
    bytes[600] = 0xFF;
    assert!(refusal(&bytes).contains("the bytes are not in UTF-8"));
    assert!(refusal(ACME.replacen("UTF-8", "klingon", 1)).contains("encoding"));
    let mut ascii = ACME.replacen("UTF-8", "US-ASCII", 1).into_bytes();
    ascii[600] = 0xFF;
    assert!(refusal(&ascii).contains("the byte 0xff is not in US-ASCII, which the file declares"));
    for (text, kind) in [
        ("", "no XML file"),
        ("\u{7f}ELF", "no XML file"),
        ("<EtherCATConfig/>", "a network configuration (ENI), which `ringcat eni` reads"),
        ("<EtherCATInfoList/>", "a list that `ethercat xml` prints"),
        ("<EtherCATDict/>", "an object dictionary"),
        ("<html/>", "an XML file with the root \"html\""),
    ] {
        let error = refusal(text);
        assert!(error.contains(kind), "{error}");
    }
}

/// The bytes of a text in units of UTF-16, UTF-32.
fn wide(text: &str, bytes_of: impl Fn(char) -> Vec<u8>) -> Vec<u8> {
    text.chars().flat_map(bytes_of).collect()
}

// covers: esi-read, ES-05
#[test]
fn encodings_that_are_not_read_or_damaged_are_named_with_their_line() {
    let text = "<?xml version=\"1.0\"?>\n<EtherCATInfo>\n<Vendor>x</Vendor></EtherCATInfo>";
    let units = |c: char, at: fn(u16) -> [u8; 2]| -> Vec<u8> {
        c.encode_utf16(&mut [0; 2]).iter().flat_map(|unit| at(*unit)).collect()
    };
    for (name, mark, at) in [
        ("UTF-16LE", [0xFF, 0xFE], u16::to_le_bytes as fn(u16) -> [u8; 2]),
        ("UTF-16BE", [0xFE, 0xFF], u16::to_be_bytes),
    ] {
        let whole = wide(text, |c| units(c, at));
        // Half a surrogate pair in place of the x, and half a unit at the end, with and without a byte order mark.
        let place = 2 * (text.find(">x<").expect("it is there") + 1);
        let mut half = whole.clone();
        half[place..place + 2].copy_from_slice(&at(0xD800));
        let truncated = &whole[..whole.len() - 1];
        for bytes in [&half[..], truncated] {
            for marked in [bytes.to_vec(), [&mark[..], bytes].concat()] {
                let error = refusal(&marked);
                assert!(error.starts_with("bad.xml:3: not readable as text: "), "{error}");
                assert!(error.contains(&format!("a character is not complete in {name}")), "{error}");
            }
        }
    }
    for (name, mark, at) in [
        ("UTF-32LE", [0xFF, 0xFE, 0, 0], u32::to_le_bytes as fn(u32) -> [u8; 4]),
        ("UTF-32BE", [0, 0, 0xFE, 0xFF], u32::to_be_bytes),
    ] {
        let whole = wide(text, |c| at(c.into()).to_vec());
        for bytes in [whole.clone(), [&mark[..], &whole].concat()] {
            let error = refusal(&bytes);
            assert!(error.starts_with(&format!("bad.xml:1: not readable as text: the bytes are in {name}")), "{error}");
        }
    }
    let ebcdic = [0x4C, 0x6F, 0xA7, 0x94, 0x93, 0x40, 0xA5, 0x85, 0x99];
    assert!(refusal(ebcdic).starts_with("bad.xml:1: not readable as text: the bytes are in EBCDIC"));
    let korean = [&b"<?xml version=\"1.0\" encoding=\"EUC-KR\"?>\n<EtherCATInfo>\n"[..], &[0xC7, 0xFF, b'<']].concat();
    let error = refusal(korean);
    assert!(error.starts_with("bad.xml:3: not readable as text: the bytes are not in EUC-KR"), "{error}");
}

// covers: esi-read, ES-10, ES-11, ES-25
#[test]
fn values_out_of_range_and_duplicates_name_line_and_device() {
    for (from, to, expected) in [
        ("#x00000C47", "#x1000000C47", "bad.xml:6: EtherCATInfo/Vendor/Id: expected a number of 32 bits"),
        ("#x00001008", "#x1334910000", "bad.xml:25: device \"AD08\": Device/Type: expected a number of 32 bits in the"),
        (
            "<ByteSize>512<",
            "<ByteSize>99999999<",
            "device \"AD08\": Device/Eeprom/ByteSize: expected 1 to 8388608 bytes",
        ),
        ("<BitLen>4</BitLen>", "<BitLen>70000</BitLen>", "Device/RxPdo/Entry/BitLen: expected a number of 16 bits"),
        (
            "<ByteSize>512</ByteSize>",
            "<ByteSize>512</ByteSize><Category><CatNo>65535</CatNo><Data>01</Data></Category>",
            "Device/Eeprom/Category/CatNo: expected a category: 65535 is the end of an EEPROM, got 65535",
        ),
        ("<ConfigData>0401", "<ConfigData>401", "expected bytes as pairs of hexadecimal digits"),
        ("<Elements>3<", "<Elements>4000000000<", "more than 65536 elements of an array"),
        ("<Transition>PS<", "<Transition>XY<", "expected a transition IP, PS, SO, SP, OP or OS, got \"XY\""),
        ("Physics=\"KK\"", "Physics=\"KQ\"", "expected up to 4 of Y, K, H and blank"),
        ("LW_EQ_HW_EQ_OR_G", "SOMETIMES", "expected a rule such as EQ"),
        ("SdoInfo=\"true\"", "SdoInfo=\"maybe\"", "expected 0, 1, true or false in the attribute SdoInfo"),
        ("<Index>#x1600</Index>", "", "bad.xml:32: device \"AD08\": Device/RxPdo: Index is missing"),
        (
            "#x00001008\" RevisionNo=\"#x00120000",
            "#x00001001\" RevisionNo=\"#x00010000",
            "the device with product code 0x00001001, revision 0x00010000 is defined in line 15 already",
        ),
        ("<Id>", "<Idd>", "not well-formed XML"),
    ] {
        let error = changed(from, to);
        assert!(error.contains(expected), "{error}");
    }
}

/// Time that this thread has had a processor for, in ns: other programs do not count. Elapsed time where the kernel
/// does not report it.
fn thread_time_ns(begin: Instant) -> u128 {
    let reports = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let of_thread = reports.and_then(|text| text.split(' ').next()?.parse().ok());
    of_thread.unwrap_or_else(|| begin.elapsed().as_nanos())
}

// covers: esi-read, ES-160
#[test]
fn many_pdos_take_a_time_that_grows_with_their_number() {
    let begin = Instant::now();
    let read = |count: u32| {
        let pdo = |index: u32| format!("<RxPdo><Index>{}</Index><Name>x</Name></RxPdo>", index & 0xFFFF);
        let pdos: String = (0..count).map(pdo).collect();
        let text = ACME.replacen("<RxPdo Fixed", &format!("{pdos}<RxPdo Fixed"), 1);
        let before = thread_time_ns(begin);
        let esi = esi::read("many.xml", text.as_bytes()).unwrap();
        (esi, thread_time_ns(begin) - before)
    };
    let (_, few) = read(30_000);
    let (esi, many) = read(120_000);
    assert!(many < 10 * few, "{few} ns for a quarter, {many} ns for all: linear, not quadratic");
    assert_eq!(esi.devices[1].rx_pdos.len(), 0x1_0000);
    assert!(esi.notices.iter().map(|notice| notice.times).sum::<usize>() > 50_000, "the second ones are noted");
}

// covers: esi-read, ES-153
#[test]
fn encrypted_and_signed_files_are_named() {
    for (text, kind) in [
        ("<EncryptedData xmlns=\"http://www.w3.org/2001/04/xmlenc#\"/>", "an encrypted file"),
        ("<ds:Signature xmlns:ds=\"http://www.w3.org/2000/09/xmldsig#\"/>", "a signed file"),
        ("<EtherCATInfo><Signature/></EtherCATInfo>", "a signed file"),
        ("<EtherCATInfo><Vendor><EncryptedData/></Vendor></EtherCATInfo>", "an encrypted file"),
        ("<EtherCATInfo><Vendor><EncryptedKey/></Vendor></EtherCATInfo>", "an encrypted file"),
        ("PK\u{3}\u{4}\u{14}", "an encrypted or packed file (a ZIP archive)"),
        ("-----BEGIN CMS-----", "an encrypted or packed file (a PEM container)"),
    ] {
        let error = refusal(text);
        assert!(error.contains(kind), "{error}");
    }
    let gzip = [0x1F, 0x8B, 8, 0, 0xFF];
    let error = esi::read("packed.xml", &gzip).expect_err("it is no XML").to_string();
    assert!(error.contains("an encrypted or packed file (compressed with gzip)"), "{error}");
}
