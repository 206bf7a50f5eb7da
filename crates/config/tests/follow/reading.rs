//! Reading: encodings, number formats, other kinds of files, limits, errors with their position.

use ringcat_config::eni::{self, EniError, MAX_DEPTH, Problem, Requires, Transition};

use crate::{SMALL, configured, has_notice, model, refusal, refused, with};

// covers: 8.2, eni-read
#[test]
fn the_order_of_elements_and_the_case_of_digits_do_not_matter() {
    let info = "<Name>Small</Name>\n        <Destination>ffffffffffff</Destination>";
    let turned = "<Destination>FF-FF-ff-ff-ff-ff</Destination>\n        <Name>Small</Name>";
    let (plain, other) = (model(SMALL), model(&with(&[(info, turned)])));
    assert_eq!(plain.main_device.name, other.main_device.name);
    assert_eq!((plain.main_device.destination, plain.main_device.source), (vec![0xFF; 6], vec![2, 0, 0, 0, 0, 1]));
    assert_eq!(other.main_device.destination, [0xFF; 6]);
    let (begin, end) = (SMALL.find("<Cyclic>").unwrap(), SMALL.find("</Cyclic>").unwrap() + "</Cyclic>".len());
    let first = format!("<Config>{}{}", &SMALL[begin..end], &SMALL[SMALL.find("<Config>").unwrap() + 8..begin]);
    let moved = format!("<EtherCATConfig>{first}{}", &SMALL[end..]);
    let (image, turned) = (configured(SMALL).image, configured(&moved).image);
    assert_eq!(image, turned);
    assert_eq!(plain.subdevices[3].vendor_id, Some(0x9A), "#x");
    assert_eq!(plain.subdevices[3].product_code, Some(0x30924), "0x");
    assert_eq!(plain.subdevices[0].name, "Coupler <1>", "CDATA");
    assert_eq!(plain.made_by.as_deref().map(|text| text.starts_with("Created by hand")), Some(true));
    assert_eq!(plain.version.as_deref(), Some("1.3"));
}

// covers: 8.2, eni-read
#[test]
fn a_command_keeps_the_whole_content_of_the_file() {
    let text = with(&[("<Comment>read count</Comment>", "<Comment>read count</Comment><Requires>cycle</Requires>")]);
    let command = &model(&text).main_device.init_commands[0];
    assert_eq!(command.requires, Some(Requires::Cycle));
    assert!(command.before_subdevices);
    assert_eq!((command.transitions.as_slice(), command.datagram.data.len()), (&[Transition::Ip][..], 2));
    assert_eq!(model(SMALL).main_device.init_commands[1].retries, 3);
}

// covers: eni-read
#[test]
fn files_in_utf_8_utf_16_and_one_byte_encodings_are_read() {
    let text = SMALL.replace("<Name>Left</Name>", "<Name>Türe</Name>");
    let name = |bytes: &[u8]| eni::read(bytes).unwrap_or_else(|error| panic!("{error}")).subdevices[1].name.clone();
    assert_eq!(name(text.as_bytes()), "Türe");
    assert_eq!(name(&[&[0xEF, 0xBB, 0xBF], text.as_bytes()].concat()), "Türe");
    for mark in [&[0xFF, 0xFE][..], &[]] {
        let units = text.replace("UTF-8", "utf-16");
        let bytes: Vec<u8> = mark.iter().copied().chain(units.encode_utf16().flat_map(u16::to_le_bytes)).collect();
        assert_eq!(name(&bytes), "Türe");
    }
    let big: Vec<u8> = [0xFE, 0xFF].into_iter().chain(text.encode_utf16().flat_map(u16::to_be_bytes)).collect();
    assert_eq!(name(&big), "Türe");
    for label in ["iso-8859-1", "windows-1252"] {
        let labelled = text.replace("UTF-8", label);
        let bytes: Vec<u8> = labelled.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect();
        assert_eq!(name(&bytes), "Türe");
    }
    // .NET writes this declaration into files that are UTF-8.
    assert_eq!(name(text.replace("UTF-8", "utf-16").as_bytes()), "Türe");
}

// covers: eni-read
#[test]
fn bytes_that_are_not_in_the_encoding_are_refused_with_their_line() {
    let mut bytes = SMALL.as_bytes().to_vec();
    let at = SMALL.find("Left").unwrap();
    bytes[at] = 0xFC;
    let error = eni::read(&bytes).unwrap_err();
    let line = SMALL[..at].matches('\n').count() as u32 + 1;
    assert_eq!(error.place.map(|place| place.line), Some(line));
    assert!(error.to_string().contains("not in UTF-8"), "{error}");
    assert!(refusal(&SMALL.replace("UTF-8", "klingon")).contains("\"klingon\" is not known"));
    // The reader of one-byte encodings would take it for windows-1252.
    let ascii = String::from_utf8_lossy(&bytes).replace("UTF-8", "US-ASCII");
    let at = ascii.find('\u{fffd}').expect("the wrong byte");
    let mut ascii = ascii.replace('\u{fffd}', "L").into_bytes();
    assert!(eni::read(&ascii).is_ok(), "without other bytes");
    ascii[at] = 0xFC;
    let error = eni::read(&ascii).unwrap_err();
    assert_eq!(error.place.map(|place| place.line), Some(line));
    assert!(error.to_string().contains("the byte 0xfc is not in US-ASCII, which the file declares"), "{error}");
}

// covers: eni-read
#[test]
fn other_files_are_refused_with_their_kind() {
    let said = |text: &str, what: &str| {
        let refusal = refusal(text);
        assert!(refusal.contains(what) && refusal.contains("An ENI has the root EtherCATConfig"), "{refusal}");
    };
    said("<EtherCATInfo Version=\"1.2\"><Vendor/></EtherCATInfo>", "a device description (ESI");
    said("<EtherCATInfoList><EtherCATInfo/></EtherCATInfoList>", "a device description (ESI");
    said("<EtherCATInfo>\n  <!-- Slave 0 -->\n  <Vendor/></EtherCATInfo>", "what `ethercat xml` prints");
    said("<masters><master idx=\"0\"/></masters>", "LinuxCNC");
    said("<TcSmProject/>", "TwinCAT project");
    let schema =
        "xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" xsi:noNamespaceSchemaLocation=\"EtherCATInfo.xsd\"";
    said(&format!("<EtherCATConfig {schema}><Config/></EtherCATConfig>"), "Beremiz");
    said("<svg/>", "the root \"svg\"");
    said("", "no XML file");
    said("\u{7f}ELF", "no XML file");
}

// covers: eni-read
#[test]
fn errors_name_line_column_element_expected_and_got() {
    let error = refused(&[("<BitStart>20</BitStart>", "<BitStart>twenty</BitStart>")]);
    let line = SMALL[..SMALL.find("<BitStart>20").unwrap()].matches('\n').count() + 1;
    let expected = format!(
        "line {line}, column 15: Config/Slave[3] \"Right\"/ProcessData/Send/BitStart: expected a number from 0 to \
         4294967295, got \"twenty\""
    );
    assert_eq!(error, expected);
    assert!(refused(&[("<Data>c209</Data>", "<Data>c20</Data>")]).contains("pairs of hexadecimal digits, got \"c20\""));
    assert!(refused(&[("<State>3</State>", "<State>8</State>")]).contains("INIT, PREOP, SAFEOP, OP"));
    assert!(refused(&[("<BitStart>20</BitStart>", "")]).contains("Send: <BitStart> is missing"));
    let wrong = refused(&[("<Cmd>14</Cmd>", "<Cmd>15</Cmd>")]);
    assert!(wrong.contains("Cyclic/Frame/Cmd[2] \"time\"/Cmd: expected a command from 0 (NOP) to 14"), "{wrong}");
    assert!(
        refused(&[("<PhysAddr>1002</PhysAddr><AutoIncAddr>", "<PhysAddr>70000</PhysAddr><AutoIncAddr>")])
            .contains("from 0 to 65535")
    );
    let mask = refused(&[("<DataMask>0300</DataMask>", "<DataMask>03</DataMask>")]);
    assert!(mask.contains("a mask of 2 bytes"), "{mask}");
    let broken = refused(&[("</Cyclic>", "</Cycle>")]);
    assert!(broken.starts_with("line ") && broken.contains("not well-formed XML"), "{broken}");
}

// covers: eni-read
#[test]
fn unknown_elements_are_listed_and_otherwise_ignored() {
    let text = with(&[("<Name>Right</Name>", "<Name>Right</Name><Colour>red</Colour>")]);
    let unknown = &model(&text).unknown;
    assert_eq!(unknown.len(), 1);
    assert_eq!(unknown[0].element, "Config/Slave[3] \"Right\"/Info/Colour");
    let configuration = configured(&text);
    assert!(has_notice(&configuration, &["Info/Colour", "not known"]));
    let many = with(&[("<Name>Right</Name>", &format!("<Name>Right</Name>{}", "<X/>".repeat(500)))]);
    let found = model(&many);
    assert_eq!((found.unknown.len(), found.more_unknown), (eni::MAX_UNKNOWN, 500 - eni::MAX_UNKNOWN));
}

// covers: eni-read
#[test]
fn files_beyond_the_limits_are_refused_at_little_cost() {
    let problem = |text: &str| match eni::read(text.as_bytes()) {
        Err(EniError { problem: Problem::TooMuch { what, .. }, .. }) => what,
        other => panic!("{other:?}"),
    };
    let deep = format!("<EtherCATConfig>{}", "<a>".repeat(MAX_DEPTH + 1));
    assert_eq!(problem(&deep), "levels of elements");
    let attributes: String = (0..100).map(|number| format!(" a{number}=\"\"")).collect();
    assert_eq!(problem(&format!("<EtherCATConfig{attributes}/>")), "attributes of an element");
    let namespaces = "<a xmlns:b=\"c\"/>".repeat(100);
    assert_eq!(problem(&format!("<EtherCATConfig>{namespaces}</EtherCATConfig>")), "namespaces");
    let entities = "<!DOCTYPE a [<!ENTITY b \"bb\">]><EtherCATConfig/>";
    assert!(refusal(entities).contains("document type definition"));
}

/// A short file must not cost much memory or time.
// covers: eni-read
#[test]
fn repetitions_do_not_multiply() {
    let transitions = "<Transition>PS</Transition>".repeat(1000);
    let assign = "<InitCmd CompleteAccess=\"1\"><Transition>PS</Transition>";
    let text = with(&[(assign, &format!("<InitCmd CompleteAccess=\"1\">{transitions}"))]);
    let startup = |text: &str| configured(text).declaration.subdevices[3].startup.len();
    assert_eq!(startup(&text), startup(SMALL));
    let pdos = format!("<Sm3><Type>Inputs</Type>{}</Sm3>", "<Pdo>6656</Pdo>".repeat(256));
    let assigned = refused(&[("<Sm3><Type>Inputs</Type><Pdo>6656</Pdo></Sm3>", &pdos)]);
    assert!(assigned.contains("more than 255 PDOs of a SyncManager"), "{assigned}");
    let pdo = "<TxPdo><Index>#x1a00</Index>";
    let described = refused(&[(pdo, &format!("{}{pdo}", "<TxPdo><Index>#x1a01</Index></TxPdo>".repeat(1023)))]);
    assert!(described.contains("more than 1024 PDOs of a SubDevice"), "{described}");
    let copy = "<CopyInfo><SrcBitOffs>8</SrcBitOffs><DstBitOffs>18</DstBitOffs><BitSize>4</BitSize></CopyInfo>";
    let copies = refused(&[(copy, &copy.repeat(4_097))]);
    assert!(copies.contains("more than 8192 copies"), "{copies}");
    let reads = "<Cmd><Cmd>10</Cmd><Addr>0</Addr><DataLength>1</DataLength></Cmd>";
    let slaves = "<Slave><Info/></Slave>".repeat(2_500);
    let many = format!(
        "<EtherCATConfig><Config>{slaves}<Cyclic><Frame>{}</Frame></Cyclic></Config></EtherCATConfig>",
        reads.repeat(2_001)
    );
    assert!(refusal(&many).contains("comparisons of cyclic commands"), "{}", refusal(&many));
}

// covers: eni-read
#[test]
fn lengths_with_too_large_a_sum_are_refused_or_omitted() {
    let all = "<Send><BitStart>0</BitStart><BitLength>4294967295</BitLength></Send>".repeat(3);
    let by_hand = |process_data: &str| {
        format!(
            "<EtherCATConfig><Config><Slave><Info/><ProcessData>{process_data}</ProcessData></Slave></Config>\
             </EtherCATConfig>"
        )
    };
    let text = refusal(&by_hand(&all));
    assert!(text.contains("ProcessData/Send: expected fewer than 2^32 bits"), "{text}");
    let entries = "<Entry><BitLen>65535</BitLen></Entry>".repeat(65_538);
    let sync_manager =
        "<Sm2><Type>Outputs</Type><StartAddress>4096</StartAddress><ControlByte>100</ControlByte><Pdo>5632</Pdo></Sm2>";
    let text = by_hand(&format!("{sync_manager}<RxPdo><Index>5632</Index>{entries}</RxPdo>"));
    let declared = configured(&text).declaration.subdevices[0].declared.clone().unwrap();
    assert_eq!(declared[0].register.length, u16::MAX, "and not the sum modulo 2^32");
    let assign = "<Mailbox><CoE><InitCmds><InitCmd CompleteAccess=\"1\"><Transition>PS</Transition><Index>7186</Index>\
                  <Data>01000016</Data></InitCmd></InitCmds></CoE></Mailbox>";
    let described = format!("<ProcessData><RxPdo><Index>5632</Index>{entries}</RxPdo></ProcessData>");
    let text = format!("<EtherCATConfig><Config><Slave><Info/>{described}{assign}</Slave></Config></EtherCATConfig>");
    let pdos = configured(&text).declaration.subdevices[0].pdos.clone().unwrap();
    assert_eq!(pdos[0].pdos[0].entries, None, "too long for a PDO: left to the SII");
}

// covers: eni-read
#[test]
fn a_truncated_file_is_refused_with_the_position_of_its_end() {
    let last = SMALL.rfind("</Config>").expect("it is there");
    for end in [last, last + 4, SMALL.len() / 2] {
        let text = refusal(&SMALL[..end]);
        assert!(text.contains("the file is truncated: an element has no end"), "{text}");
        let line = format!("line {}, column ", SMALL[..end].matches('\n').count() + 1);
        assert!(text.starts_with(&line), "{text}");
    }
}

// covers: eni-read
#[test]
fn an_encrypted_file_is_refused_with_the_tool_that_writes_such_files() {
    let mut state = 1_u64;
    let mut chance = || {
        state = state.wrapping_mul(0x5851_F42D_4C95_7F2D).wrapping_add(1);
        (state >> 56) as u8
    };
    let random: Vec<u8> = (0..4000).map(|_| chance()).collect();
    let xml = br#"<?xml version="1.0"?>
        <EncryptedData xmlns="http://www.w3.org/2001/04/xmlenc#"><CipherData/></EncryptedData>"#;
    let salted = [&b"Salted__"[..], &random].concat();
    let part = SMALL.replacen("<Slave>", "<Slave><EncryptedData><CipherData/></EncryptedData>", 1);
    let key = SMALL.replacen("<Slave>", "<Slave><EncryptedKey/>", 1);
    for (bytes, what) in [
        (part.as_bytes(), "XML encryption"),
        (key.as_bytes(), "XML encryption"),
        (&random[..], "random bytes"),
        (&salted[..], "encrypted with a password (OpenSSL)"),
        (&xml[..], "XML encryption"),
        (b"PK\x03\x04\x14\x00", "a ZIP archive"),
    ] {
        let error = eni::read(bytes).expect_err("it is no ENI").to_string();
        assert!(error.contains(&format!("this is an encrypted or packed file ({what})")), "{error}");
        assert!(error.contains("EC-Engineer of acontis") && error.contains("export it without encryption"), "{error}");
    }
    let text = "Just some words of a person, many of them. ".repeat(40);
    assert!(eni::read(text.as_bytes()).expect_err("it is no ENI").to_string().contains("this is no XML file"));
}

// covers: eni-read, ES-153
#[test]
fn a_signed_file_is_refused_by_name() {
    let signature = r#"<ds:Signature xmlns:ds="http://www.w3.org/2000/09/xmldsig#"><ds:SignedInfo/></ds:Signature>"#;
    for (text, place) in [
        (signature.to_owned(), "around the configuration"),
        (SMALL.replacen("<Config>", &format!("{signature}<Config>"), 1), "in the configuration"),
        (SMALL.replacen("<Master>", &format!("{signature}<Master>"), 1), "in the configuration"),
    ] {
        let error = refusal(&text);
        assert!(error.contains(&format!("this is a signed file (an XML signature {place})")), "{error}");
        assert!(error.contains("cannot check the signature") && error.contains("export it without one"), "{error}");
    }
}

// covers: eni-read
#[test]
fn names_and_comments_are_on_one_line() {
    let text = SMALL.replacen("</Name>", "\n\tleft</Name>", 3).replacen("</Comment>", "\r\nmore</Comment>", 9);
    let model = model(&text);
    let names = model.subdevices.iter().map(|subdevice| &subdevice.name);
    let all: String =
        names.chain(model.subdevices.iter().flat_map(|it| &it.init_commands).map(|it| &it.comment)).cloned().collect();
    assert!(all.contains("left") && all.contains("more") && !all.contains(char::is_control), "{all:?}");
}

// covers: eni-read, ES-113
#[test]
fn ids_above_2_to_the_31_may_be_written_as_negative_numbers() {
    let text = SMALL.replacen("<VendorId>2</VendorId>", "<VendorId>-268435455</VendorId>", 1);
    let text = text.replacen("<RevisionNo>1179648</RevisionNo>", "<RevisionNo>-1</RevisionNo>", 1);
    let coupler = &model(&text).subdevices[0];
    assert_eq!((coupler.vendor_id, coupler.revision), (Some(0xF000_0001), Some(u32::MAX)));
    for wrong in ["-2147483649", "4294967296"] {
        let error = refusal(&SMALL.replacen("<VendorId>2<", &format!("<VendorId>{wrong}<"), 1));
        assert!(error.contains("a number from 0 to 4294967295") && error.contains(wrong), "{error}");
    }
}
