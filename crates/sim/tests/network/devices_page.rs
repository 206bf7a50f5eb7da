//! `docs/devices.md` has the PDOs and objects of every device of the catalogue.
//! `RINGCAT_WRITE_DEVICES=1 cargo test -p ringcat-sim --test network devices_page` writes it.

use std::fmt::Write;

use ringcat_sim::application::dictionary::{Access, Dictionary, Object, ObjectRole};
use ringcat_sim::catalogue;
use ringcat_sim::data_type;
use ringcat_sim::description::{DeviceDescription, PdoDescription};
use ringcat_wire::sii::{MailboxProtocols, PdoDirection};

const PAGE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/devices.md");
/// Communication objects that the page names for all devices with CoE.
const COMMUNICATION: [u16; 9] = [0x1000, 0x1001, 0x1008, 0x1009, 0x100A, 0x1018, 0x1C00, 0x1C12, 0x1C13];
/// Entries of a list beyond this number are given by the last one.
const LISTED: usize = 16;

const OPENING: &str = "\
# Devices of the simulator

PDOs and objects of the catalogue, for `type` in [segment files](segments.md). The page is written from the catalogue by
`RINGCAT_WRITE_DEVICES=1 cargo test -p ringcat-sim --test network devices_page`.

Vendor is 0x00000C47 for all. Every device with CoE also has the communication objects 0x1000, 0x1001, 0x1008 to 0x100A,
0x1018, 0x1C00, the PDO assignments 0x1C12 and 0x1C13 and the mappings of its PDOs.
";

fn page() -> String {
    let mut text = OPENING.to_owned();
    for name in catalogue::names() {
        let description = catalogue::by_name(name).expect("the catalogue has its names");
        assert_eq!(description.identity.vendor_id, catalogue::VENDOR_ID, "{name}");
        let (product, revision) = (description.identity.product_code, description.identity.revision);
        let _ = write!(text, "\n## {name}\n\nProduct 0x{product:08X}, revision 0x{revision:08X}");
        let mailbox = description.mailbox.map(|mailbox| mailbox.standard);
        let _ = match mailbox {
            Some(layout) => writeln!(text, ", mailboxes of {} and {} bytes.", layout.receive_size, layout.send_size),
            None => writeln!(text, ", no mailbox."),
        };
        pdos(&mut text, &description);
        if description.mailbox.is_some_and(|mailbox| mailbox.protocols.0 & MailboxProtocols::COE != 0) {
            objects(&mut text, &description);
        }
    }
    text
}

fn pdos(text: &mut String, description: &DeviceDescription) {
    if description.pdos.is_empty() {
        return;
    }
    text.push_str("\n| PDO | SyncManager | entries |\n|---|---|---|\n");
    for pdo in &description.pdos {
        let direction = if pdo.direction == PdoDirection::Rx { "outputs" } else { "inputs" };
        let manager = pdo.sync_manager.map_or_else(|| "not assigned".to_owned(), |number| number.to_string());
        let _ = writeln!(text, "| 0x{:04X} \"{}\", {direction} | {manager} | {} |", pdo.index, pdo.name, entries(pdo));
    }
}

fn entries(pdo: &PdoDescription) -> String {
    let one = |at: usize| {
        let entry = &pdo.entries[at];
        match entry.index {
            0 => format!("gap of {} bits", entry.bit_length),
            index => {
                let kind = type_word(entry.data_type, usize::from(entry.bit_length));
                format!("0x{index:04X}:{:02X} {} ({kind})", entry.sub_index, entry.name)
            }
        }
    };
    let count = pdo.entries.len();
    let mut all: Vec<String> = (0..count.min(LISTED)).map(one).collect();
    if count > LISTED {
        all.truncate(2);
        all.push(format!("... {count} in all, the last one {}", one(count - 1)));
    }
    all.join("; ")
}

fn objects(text: &mut String, description: &DeviceDescription) {
    let dictionary = Dictionary::new(description);
    for index in COMMUNICATION {
        assert!(dictionary.object(index).is_some(), "{}: {index:#06x}", description.order_code);
    }
    let is_own = |object: &&Object| object.index >= 0x2000 && object.role == ObjectRole::Plain;
    let own: Vec<&Object> = dictionary.objects().iter().filter(is_own).collect();
    if own.is_empty() {
        return;
    }
    text.push_str("\n| object | entries |\n|---|---|\n");
    for object in own {
        let one = |at: usize| {
            let entry = &object.entries[at];
            let name = if entry.name.is_empty() { String::new() } else { format!(" {}", entry.name) };
            let access = match entry.access {
                Access::ReadOnly => "ro",
                Access::ReadWrite => "rw",
                Access::ReadWritePreOp => "rw in PREOP",
                Access::WriteOnly => "wo",
            };
            let kind = type_word(entry.data_type, 8 * entry.value.len());
            format!(":{:02X}{name} ({kind}, {access})", entry.sub_index)
        };
        let count = object.entries.len();
        let mut all: Vec<String> = (0..count.min(LISTED)).map(one).collect();
        if count > LISTED {
            all.truncate(3);
            all.push(format!("... {count} in all, the last one {}", one(count - 1)));
        }
        let _ = writeln!(text, "| 0x{:04X} {} | {} |", object.index, object.name, all.join("; "));
    }
}

fn type_word(code: u8, bits: usize) -> String {
    let word = match code {
        data_type::BOOL => "BOOL",
        data_type::I8 => "SINT",
        data_type::I16 => "INT",
        data_type::I32 => "DINT",
        data_type::U8 => "USINT",
        data_type::U16 => "UINT",
        data_type::U32 => "UDINT",
        data_type::VISIBLE_STRING => "STRING",
        data_type::OCTET_STRING => return format!("OCTET STRING of {} bytes", bits / 8),
        _ => return format!("type 0x{code:02X}, {bits} bits"),
    };
    word.to_owned()
}

// covers: sim-devices
#[test]
fn the_page_of_devices_agrees_with_the_catalogue() {
    if std::env::var("RINGCAT_WRITE_DEVICES").is_ok_and(|value| value == "1") {
        std::fs::write(PAGE, page()).expect("the page can be written");
    }
    let written = std::fs::read_to_string(PAGE).expect("the page exists");
    assert!(written == page(), "run RINGCAT_WRITE_DEVICES=1 cargo test -p ringcat-sim --test network devices_page");
}
