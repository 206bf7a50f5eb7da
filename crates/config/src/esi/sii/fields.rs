//! An image as a list of named fields, so that two images can be compared field by field (protocol ES-102).

use ringcat_wire::sii::{Categories, CategoryKind, DcModes, General, Pdos, SiiHeader, SiiSyncManagers, Strings};

/// A field: name and value in words.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Field {
    pub name: String,
    pub value: String,
    /// Written in production or at commissioning, not from a description (protocol ES-80).
    pub is_individual: bool,
}

/// Bytes of the fixed area that are not from a description: words 0x10 to 0x13, and the words before the size.
const DELAYS: std::ops::Range<usize> = 32..40;
const PRODUCTION: std::ops::Range<usize> = 58..124;
/// Characters of long values.
const SHOWN: usize = 96;

/// The field that differs wherever a string is missing or too many.
pub(super) const ORDER_OF_STRINGS: &str = "order of the strings";

/// All fields of an image. Bytes that are not an image are one field.
pub(super) fn fields(image: &[u8]) -> Vec<Field> {
    let mut list = Fields::default();
    let Some((fixed, rest)) = image.split_first_chunk::<{ SiiHeader::LEN }>() else {
        list.add("image", hex(image));
        return list.0;
    };
    list.fixed(fixed);
    let categories: Vec<_> = categories(image).collect();
    let strings = categories.iter().find(|category| category.kind == CategoryKind::Strings);
    let strings = strings.map(|category| Strings::new(category.data)).unwrap_or_default();
    let order: Vec<String> = categories.iter().map(|category| category.kind.code().to_string()).collect();
    list.add("categories", order.join(" "));
    let mut place = Place::default();
    for category in &categories {
        let data = category.data;
        match category.kind {
            CategoryKind::Strings => list.strings(data),
            CategoryKind::General => list.general(data, &strings),
            CategoryKind::Fmmu => list.each("fmmu", data.iter().map(|byte| format!("{byte:#04x}"))),
            CategoryKind::SyncManager => list.sync_managers(data),
            CategoryKind::TxPdo => list.pdos("TxPDO", data, &strings, &mut place.tx),
            CategoryKind::RxPdo => list.pdos("RxPDO", data, &strings, &mut place.rx),
            CategoryKind::Dc => list.modes(data, &strings, &mut place.modes),
            other => list.add(format!("category {}", other.code()), hex(data)),
        }
    }
    let used = categories.last().map_or(SiiHeader::LEN, |last| last.data_offset() + last.data.len());
    list.tail(&rest[used - SiiHeader::LEN..]);
    list.0
}

/// Numbers of PDOs and modes that several categories contain.
#[derive(Default)]
struct Place {
    tx: usize,
    rx: usize,
    modes: usize,
}

/// Categories also where the checksum is not valid.
fn categories(image: &[u8]) -> impl Iterator<Item = ringcat_wire::sii::Category<'_>> {
    Categories::of_image(image)
}

#[derive(Default)]
struct Fields(Vec<Field>);

impl Fields {
    fn add(&mut self, name: impl Into<String>, value: impl Into<String>) {
        self.0.push(Field { name: name.into(), value: value.into(), is_individual: false });
    }

    fn individual(&mut self, name: &str, value: String) {
        self.0.push(Field { name: name.to_owned(), value, is_individual: true });
    }

    fn each(&mut self, name: &str, values: impl Iterator<Item = String>) {
        values.enumerate().for_each(|(number, value)| self.add(format!("{name} {number}"), value));
    }

    fn fixed(&mut self, fixed: &[u8; SiiHeader::LEN]) {
        let header = SiiHeader::decode(fixed);
        let identity = header.identity;
        self.add("configuration (words 0 to 3)", hex(&fixed[..8]));
        self.individual("alias", header.alias.to_string());
        self.add("configuration (words 5, 6)", hex(&fixed[10..14]));
        self.add("checksum", format!("{:#06x}", header.checksum));
        self.add("vendor id", format!("{:#010x}", identity.vendor_id));
        self.add("product code", format!("{:#010x}", identity.product_code));
        self.add("revision", format!("{:#010x}", identity.revision));
        self.individual("serial number", identity.serial.to_string());
        self.individual("words 0x10 to 0x13", hex(&fixed[DELAYS]));
        self.add("mailboxes in BOOT", hex(&fixed[40..48]));
        self.add("mailboxes", hex(&fixed[48..56]));
        self.add("mailbox protocols", format!("{:#06x}", header.protocols.0));
        self.individual("words 0x1d to 0x3d", hex(&fixed[PRODUCTION]));
        self.add("size in KBit, minus 1", header.size_kbit_minus_1.to_string());
        self.add("version", header.version.to_string());
    }

    fn strings(&mut self, data: &[u8]) {
        let strings = Strings::new(data);
        self.add("number of strings", strings.count().to_string());
        let mut used = 1;
        let mut order = Vec::new();
        for string in strings.iter() {
            used += 1 + string.len();
            order.push(latin_1(string));
            self.add(format!("string {}", latin_1(string)), "present");
        }
        self.add(ORDER_OF_STRINGS, order.join(" "));
        let pad = data.get(used..).unwrap_or_default();
        if !pad.is_empty() {
            self.add("padding of the strings", hex(pad));
        }
    }

    fn general(&mut self, data: &[u8], strings: &Strings<'_>) {
        let Some(general) = General::decode(data) else {
            return self.add("general", hex(data));
        };
        let mut add = |name: &str, value: String| self.add(format!("general: {name}"), value);
        add("group", text(strings, general.group));
        add("image", text(strings, general.image));
        add("order code", text(strings, general.order));
        add("name", text(strings, general.name));
        add("byte 0x04", format!("{:#04x}", general.reserved_04));
        add("CoE features", format!("{:#04x}", general.coe.0));
        add("FoE", general.foe.to_string());
        add("EoE", general.eoe.to_string());
        add("bytes 0x08 to 0x0a", hex(&data[8..11]));
        add("flags", format!("{:#04x}", general.flags.0));
        add("current from the E-bus", format!("{} mA", general.ebus_current_ma));
        add("group name", text(strings, general.group_again));
        add("byte 0x0f", format!("{:#04x}", general.reserved_0f));
        add("ports", format!("{:#06x}", general.physical_ports));
        add("address of the ID switch", format!("{:#06x}", general.id_switch_address));
        add("bytes from 0x14 on", hex(&data[0x14..]));
    }

    fn sync_managers(&mut self, data: &[u8]) {
        for (number, sm) in SiiSyncManagers::new(data).enumerate() {
            let mut add = |name: &str, value: String| self.add(format!("SM{number}: {name}"), value);
            add("start", format!("{:#06x}", sm.start));
            add("length", sm.length.to_string());
            add("control", format!("{:#04x}", sm.control));
            add("status", format!("{:#04x}", sm.status));
            add("enable", format!("{:#04x}", sm.enable));
            add("type", sm.kind.code().to_string());
        }
        let rest = data.len() % 8;
        if rest > 0 {
            self.add("SM: rest", hex(&data[data.len() - rest..]));
        }
    }

    fn pdos(&mut self, direction: &str, data: &[u8], strings: &Strings<'_>, count: &mut usize) {
        let mut pdos = Pdos::new(data);
        for pdo in pdos.by_ref() {
            let head = format!("{direction} {count}");
            *count += 1;
            let mut add = |name: &str, value: String| self.add(format!("{head}: {name}"), value);
            add("index", format!("{:#06x}", pdo.index));
            add("SyncManager", pdo.sync_manager.map_or("none".to_owned(), |number| number.to_string()));
            add("synchronisation", pdo.synchronisation.to_string());
            add("name", text(strings, pdo.name));
            add("flags", format!("{:#06x}", pdo.flags));
            add("entries", pdo.entry_count.to_string());
            for (number, entry) in pdo.entries().enumerate() {
                let mut add = |name: &str, value: String| add(&format!("entry {number}: {name}"), value);
                add("object", format!("{:#06x}:{:02x}", entry.index, entry.sub_index));
                add("name", text(strings, entry.name));
                add("type", format!("{:#04x}", entry.data_type));
                add("bits", entry.bit_length.to_string());
                add("flags", format!("{:#06x}", entry.flags));
            }
        }
        if !pdos.rest().is_empty() {
            self.add(format!("{direction}: rest"), hex(pdos.rest()));
        }
    }

    fn modes(&mut self, data: &[u8], strings: &Strings<'_>, count: &mut usize) {
        for mode in DcModes::new(data) {
            let head = format!("clock mode {count}");
            *count += 1;
            let mut add = |name: &str, value: String| self.add(format!("{head}: {name}"), value);
            add("name", text(strings, mode.name));
            add("description", text(strings, mode.description));
            add("AssignActivate", format!("{:#06x}", mode.assign_activate));
            add("cycle of SYNC0", mode.sync0_cycle_ns.to_string());
            add("factor of SYNC0", mode.sync0_cycle_factor.to_string());
            add("shift of SYNC0", (mode.sync0_shift_ns as i32).to_string());
            add("factor of SYNC1", mode.sync1_cycle_factor.to_string());
            add("shift of SYNC1", (mode.sync1_shift_ns as i32).to_string());
            add("reserved", hex(&mode.reserved));
        }
    }

    /// The end marker and what follows it.
    fn tail(&mut self, rest: &[u8]) {
        let (marker, rest) = rest.split_at(rest.len().min(2));
        self.add("end marker", hex(marker));
        let filled = rest.first().filter(|first| rest.iter().all(|byte| byte == *first));
        let value = match filled {
            Some(byte) => format!("{} bytes of {byte:#04x}", rest.len()),
            None => hex(rest),
        };
        self.add("behind the end marker", value);
    }
}

/// The text that an index names: other indices for the same text are no difference of the field.
fn text(strings: &Strings<'_>, index: u8) -> String {
    match (strings.string(index), index) {
        (Some(string), _) => latin_1(string),
        (None, 0) => "none".to_owned(),
        (None, index) => format!("no string {index}"),
    }
}

fn latin_1(bytes: &[u8]) -> String {
    let text: String = bytes.iter().map(|byte| char::from(*byte)).flat_map(char::escape_debug).collect();
    format!("\"{text}\"")
}

fn hex(bytes: &[u8]) -> String {
    let digits: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
    if digits.len() <= SHOWN { digits } else { format!("{}... ({} bytes)", &digits[..SHOWN], bytes.len()) }
}
