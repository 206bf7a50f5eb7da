//! Simulated buses of the SubDevices that an output of the original tool shows.

use std::path::Path;

use ringcat::sim::application::dictionary::{Access, Dictionary, Entry, Object, ObjectRole};
use ringcat::sim::segment::Segment;
use ringcat::wire::sii::{
    CoeDetails, General, Identity, MailboxLayout, MailboxProtocols, PdoDescription, PdoDirection, PdoEntry, SiiHeader,
    SiiSyncManager, SiiWriter, SyncManagerKind,
};

use crate::real_details::{self, Details};
use crate::real_xml;

/// Commands with samples.
#[derive(Clone, Copy, PartialEq)]
pub enum Command {
    Slaves,
    Details,
    Pdos,
    Sdos,
    Xml,
    Graph,
    Master,
    Domains,
}

impl Command {
    /// The command of a command line without the name of the tool.
    pub fn of_words(words: &str) -> Option<Command> {
        let is_verbose = words.split(' ').any(|word| word == "-v");
        Some(match words.split(' ').next()? {
            "slaves" | "slave" if is_verbose => Command::Details,
            "slaves" | "slave" => Command::Slaves,
            "pdos" => Command::Pdos,
            "sdos" => Command::Sdos,
            "master" => Command::Master,
            _ => return None,
        })
    }

    /// The command of a file.
    pub fn of_file(name: &str) -> Command {
        match name.trim_start_matches("T_").split('_').next() {
            Some("slaves") => Command::Slaves,
            Some("slaves-v") => Command::Details,
            Some("pdos") => Command::Pdos,
            Some("sdos") => Command::Sdos,
            Some("xml") => Command::Xml,
            Some("graph") => Command::Graph,
            Some("master") => Command::Master,
            _ => Command::Domains,
        }
    }

    pub fn words(self) -> &'static [&'static str] {
        match self {
            Command::Slaves => &["slaves"],
            Command::Details => &["slaves", "-v"],
            Command::Pdos => &["pdos"],
            Command::Sdos => &["sdos"],
            Command::Xml => &["xml"],
            Command::Graph => &["graph"],
            Command::Master => &["master"],
            Command::Domains => &["domains"],
        }
    }
}

/// What an output shows of a SubDevice.
#[derive(Default)]
pub struct Shown {
    pub alias: u16,
    pub identity: [u32; 3],
    pub name: String,
    pub order: String,
    pub sync_managers: Vec<SyncManager>,
    objects: Vec<Object>,
    pub details: Option<Details>,
}

/// A SyncManager with its PDOs.
#[derive(Default)]
pub struct SyncManager {
    pub start: u16,
    pub length: u16,
    pub control: u8,
    pub enable: u8,
    pub pdos: Vec<Pdo>,
}

#[derive(Default)]
pub struct Pdo {
    pub is_output: bool,
    pub index: u16,
    pub name: String,
    pub entries: Vec<(u16, u8, u8, String)>,
}

/// A number with or without `0x`.
pub fn number(text: &str) -> u32 {
    let text = text.trim().trim_end_matches(',');
    match text.strip_prefix("0x").or(text.strip_prefix("#x")) {
        Some(digits) => u32::from_str_radix(digits, 16),
        None => text.parse(),
    }
    .unwrap_or_else(|error| panic!("{text:?}: {error}"))
}

/// The text between quotation marks.
fn quoted(line: &str) -> String {
    let text = line.split_once('"').map_or("", |(_, rest)| rest);
    text.strip_suffix('"').unwrap_or(text).to_owned()
}

/// The bus on which a command printed this.
pub fn bus(command: Command, text: &str, directory: &Path) -> Segment {
    let shown = match command {
        Command::Slaves => slaves(text),
        Command::Details => real_details::slaves(text),
        Command::Pdos => pdos(text),
        Command::Sdos => vec![Shown { objects: objects(text), ..Shown::default() }],
        Command::Xml => real_xml::slaves(text),
        Command::Graph | Command::Master | Command::Domains => Vec::new(),
    };
    let mut file = "[segment]\n".to_owned();
    for (position, one) in shown.iter().enumerate() {
        std::fs::write(directory.join(format!("{position}.bin")), image(one)).expect("it can be written");
        file += &format!("[[device]]\nsii = \"{position}.bin\"\n");
    }
    if shown.is_empty() {
        file += "[[device]]\ntype = \"coupler\"\n";
    }
    let mut segment = Segment::from_toml(&file, directory).expect("it is right");
    if shown.is_empty() {
        segment.devices.clear();
        segment.cables.clear();
    }
    for (device, details) in
        segment.devices.iter_mut().zip(&shown).filter_map(|(it, one)| Some((it, one.details.as_ref()?)))
    {
        details.change_controller(device);
    }
    for (device, one) in segment.devices.iter_mut().zip(shown).filter(|(_, one)| !one.objects.is_empty()) {
        device.objects = one.objects;
        let all = Dictionary::new(device);
        let is_more = |index: &u16| device.objects.iter().all(|own| own.index != *index);
        device.left_out = all.objects().iter().map(|object| object.index).filter(is_more).collect();
    }
    segment
}

fn slaves(text: &str) -> Vec<Shown> {
    let row = |line: &str| {
        let words: Vec<&str> = line.split_whitespace().collect();
        let (alias, relative) = words.get(1)?.split_once(':')?;
        let name = line.split_once("  +  ").map_or("", |(_, name)| name);
        // What stands there without a name.
        let is_number = name.chars().all(|it| it.is_ascii_hexdigit() || it == ':');
        let name = if is_number { String::new() } else { name.to_owned() };
        let alias = if number(relative) == 0 { number(alias) as u16 } else { 0 };
        Some(Shown { alias, name, ..Shown::default() })
    };
    text.lines().filter_map(row).collect()
}

fn pdos(text: &str) -> Vec<Shown> {
    let mut all: Vec<Shown> = Vec::new();
    for line in text.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        if let Some(position) = line.strip_prefix("=== Master 0, Slave ") {
            let position = number(position.trim_end_matches(" ==="));
            all.resize_with(position as usize + 1, Shown::default);
        } else if all.is_empty() {
            all.push(Shown::default());
        }
        let managers = &mut all.last_mut().expect("it is there").sync_managers;
        match words[..] {
            [name, "PhysAddr", start, "DefaultSize", length, "ControlRegister", control, "Enable", enable]
                if name.starts_with("SM") =>
            {
                let [start, length, control, enable] = [start, length, control, enable].map(number);
                let (start, length, control) = (start as u16, length as u16, control as u8);
                managers.push(SyncManager { start, length, control, enable: enable as u8, pdos: Vec::new() });
            }
            [kind @ ("RxPDO" | "TxPDO"), index, ..] => {
                let (is_output, index) = (kind == "RxPDO", number(index) as u16);
                let pdo = Pdo { is_output, index, name: quoted(line), entries: Vec::new() };
                managers.last_mut().expect("a SyncManager").pdos.push(pdo);
            }
            ["PDO", "entry", place, bits, ..] => {
                let (index, sub_index) = place.split_once(':').expect("two numbers");
                let sub_index = number(&format!("0x{sub_index}")) as u8;
                let entry = (number(index) as u16, sub_index, number(bits) as u8, quoted(line));
                managers.last_mut().and_then(|own| own.pdos.last_mut()).expect("a PDO").entries.push(entry);
            }
            _ => {}
        }
    }
    all
}

/// Names of data types and their codes, as in dictionaries.
const TYPES: [(&str, u16); 14] = [
    ("bool", 1),
    ("int8", 2),
    ("int16", 3),
    ("int32", 4),
    ("uint8", 5),
    ("uint16", 6),
    ("uint32", 7),
    ("float", 8),
    ("string", 9),
    ("octet_string", 0x0A),
    ("unicode_string", 0x0B),
    ("double", 0x11),
    ("int64", 0x15),
    ("uint64", 0x1B),
];

fn objects(text: &str) -> Vec<Object> {
    let mut all: Vec<Object> = Vec::new();
    for line in text.lines() {
        if let Some(rest) = line.strip_prefix("SDO ") {
            let (index, _) = rest.split_once(',').expect("an index");
            let (index, name) = (number(index) as u16, quoted(line));
            all.push(Object { index, name, role: ObjectRole::Plain, entries: Vec::new() });
        } else if let Some(rest) = line.strip_prefix("  0x") {
            let fields: Vec<&str> = rest.splitn(5, ", ").collect();
            let [place, rights, kind, bits, _] = fields[..] else { panic!("{line}") };
            let sub_index = number(&format!("0x{}", place.split_once(':').expect("two numbers").1)) as u8;
            let bits = number(bits.trim_end_matches(" bit")) as u16;
            let known = TYPES.iter().find(|(name, _)| *name == kind).map(|(_, code)| *code);
            let kind = known.unwrap_or_else(|| number(&format!("0x{}", kind.trim_start_matches("type "))) as u16);
            // Pairs of read and write for PREOP, SAFEOP, OP.
            let right = |at: usize, letter: char| u16::from(rights.chars().nth(at) == Some(letter));
            let rights = (0..3).map(|state| right(2 * state, 'r') << state | right(2 * state + 1, 'w') << (state + 3));
            let value = vec![0; usize::from(bits).div_ceil(8)];
            let entry = Entry::new(sub_index, 0, Access::ReadOnly, &value).named(&quoted(line)).of_bits(bits);
            all.last_mut().expect("an object").entries.push(entry.stated(kind, rights.sum()));
        }
    }
    all
}

/// Strings of an SII: each once, from number 1.
#[derive(Default)]
pub struct Strings(Vec<String>);

impl Strings {
    pub fn number(&mut self, text: &str) -> u8 {
        if text.is_empty() {
            return 0;
        }
        let place = self.0.iter().position(|own| own == text).unwrap_or_else(|| {
            self.0.push(text.to_owned());
            self.0.len() - 1
        });
        u8::try_from(place + 1).expect("few strings")
    }
}

fn manager(own: &SyncManager) -> SiiSyncManager {
    let SyncManager { start, length, control, enable, .. } = *own;
    let is_mailbox = control & 3 == 2 && own.pdos.is_empty();
    let kind = match (is_mailbox, control >> 2 & 3) {
        (true, 1) => SyncManagerKind::MailboxOut,
        (true, _) => SyncManagerKind::MailboxIn,
        (false, 1) => SyncManagerKind::Outputs,
        (false, _) => SyncManagerKind::Inputs,
    };
    SiiSyncManager { start, length, control, status: 0, enable, kind }
}

/// PDOs of one direction, with what their descriptions refer to.
fn described(own: &Shown, is_output: bool, strings: &mut Strings) -> Vec<(u8, u16, u8, Vec<PdoEntry>)> {
    let mut all = Vec::new();
    for (number, manager) in (0..).zip(&own.sync_managers) {
        for pdo in manager.pdos.iter().filter(|pdo| pdo.is_output == is_output) {
            let entry = |(index, sub_index, bit_length, name): &(u16, u8, u8, String)| PdoEntry {
                index: *index,
                sub_index: *sub_index,
                name: strings.number(name),
                bit_length: *bit_length,
                ..PdoEntry::default()
            };
            let entries = pdo.entries.iter().map(entry).collect();
            all.push((number, pdo.index, strings.number(&pdo.name), entries));
        }
    }
    all
}

/// The SII that holds what is shown.
fn image(own: &Shown) -> Vec<u8> {
    let [vendor_id, product_code, revision] = own.identity;
    let identity = Identity { vendor_id, product_code, revision, serial: 0 };
    let mut header = SiiHeader { pdi_control: 0x0C05, alias: own.alias, identity, ..SiiHeader::default() };
    let mut general = General::default();
    if !own.objects.is_empty() {
        let mailbox = MailboxLayout { receive_offset: 0x1000, receive_size: 512, send_offset: 0x1200, send_size: 512 };
        header.standard_mailbox = mailbox;
        header.protocols = MailboxProtocols(MailboxProtocols::COE);
        general.coe = CoeDetails(CoeDetails::SDO | CoeDetails::SDO_INFORMATION);
    }
    let mut strings = Strings::default();
    if let Some(details) = &own.details {
        details.change_header(&mut header);
        details.change_general(&mut general, &mut strings);
    }
    (general.name, general.order) = (strings.number(&own.name), strings.number(&own.order));
    let both = [(PdoDirection::Tx, false), (PdoDirection::Rx, true)];
    let pdos = both.map(|(direction, is_output)| (direction, described(own, is_output, &mut strings)));
    let mut bytes = vec![0xFF; 16384];
    let mut writer = SiiWriter::new(&mut bytes, &header).expect("it fits");
    let texts: Vec<&str> = strings.0.iter().map(String::as_str).collect();
    writer.strings(&texts).expect("it fits");
    writer.general(&general).expect("it fits");
    let mut managers: Vec<SiiSyncManager> = own.sync_managers.iter().map(manager).collect();
    let MailboxLayout { receive_offset, receive_size, send_offset, send_size } = header.standard_mailbox;
    if receive_size != 0 {
        let mailbox = |start, length, control| SyncManager { start, length, control, enable: 1, pdos: Vec::new() };
        let both = [mailbox(receive_offset, receive_size, 0x26), mailbox(send_offset, send_size, 0x22)];
        managers = both.iter().map(manager).collect();
    }
    writer.sync_managers(&managers).expect("it fits");
    for (direction, all) in &pdos {
        let all: Vec<PdoDescription<'_>> = all
            .iter()
            .map(|(number, index, name, entries)| PdoDescription {
                index: *index,
                sync_manager: Some(*number),
                synchronisation: 0,
                name: *name,
                flags: 0,
                entries,
            })
            .collect();
        writer.pdos(*direction, &all).expect("it fits");
    }
    writer.finish().expect("it fits");
    bytes
}
