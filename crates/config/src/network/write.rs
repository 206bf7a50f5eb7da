//! The canonical text of a network file, and its digest.
//!
//! Canonical: keys in the order of the types, no key that has its default value, every place of a SubDevice,
//! hexadecimal numbers for identities and addresses, no comments. Two files with the same content have the same text.

use std::fmt::{self, Display, Write as _};

use sha2::{Digest as _, Sha256};

use super::model::{
    At, CheckRevision, Clocks, Direction, Domain, Entry, Junctions, Lrw, Mailbox, NetworkFile, Pdo, Protocol,
    Redundancy, Repeat, Required, Startup, SubDevice, SyncManager, Target, Timeouts,
};
use super::values::{Bytes, Shift, Time};

/// Digest of a network file: SHA-256 of its canonical text.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Digest(pub [u8; 32]);

impl Display for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl NetworkFile {
    /// The canonical text. Comments of the file that was read are lost.
    pub fn to_text(&self) -> String {
        let mut out = Text::default();
        out.number("ringcat_network", self.ringcat_network);
        out.text("name", &self.name);
        out.word("required", self.required, Required::default(), |required| match required {
            Required::All => "all",
            Required::Mandatory => "mandatory",
            Required::Nothing => "nothing",
        });
        out.word("lrw", self.lrw, Lrw::default(), |lrw| match lrw {
            Lrw::Automatic => "automatic",
            Lrw::Always => "always",
            Lrw::PerSubdevice => "per-subdevice",
        });
        redundancy(&mut out, &self.redundancy);
        if let Some(of) = &self.clocks {
            clocks(&mut out, of);
        }
        self.domain.iter().for_each(|of| domain(&mut out, of));
        let mut position = 0;
        for of in &self.subdevice {
            let is_placed = of.position.is_some() || of.alias.is_some() || of.identification.is_some();
            let implied = (!is_placed && of.group.is_none()).then_some(position);
            subdevice(&mut out, of, implied);
            position = next_position(position, of);
        }
        out.0
    }

    /// The digest, which identifies the configuration.
    pub fn digest(&self) -> Digest {
        Digest(Sha256::digest(self.to_text()).into())
    }
}

/// The position of a SubDevice without a place behind this one.
pub(super) fn next_position(position: u16, subdevice: &SubDevice) -> u16 {
    match (subdevice.position, &subdevice.group) {
        (Some(own), _) => own.saturating_add(1),
        (None, Some(_)) => position,
        (None, None) => position.saturating_add(1),
    }
}

/// Text that grows by tables and keys.
#[derive(Default)]
struct Text(String);

impl Text {
    fn line(&mut self, line: impl Display) {
        // Writing into a String cannot fail.
        let _ = writeln!(self.0, "{line}");
    }

    fn table(&mut self, name: &str) {
        self.line(format_args!("\n{name}"));
    }

    fn number(&mut self, key: &str, value: impl Display) {
        self.line(format_args!("{key} = {value}"));
    }

    fn some(&mut self, key: &str, value: Option<impl Display>) {
        if let Some(value) = value {
            self.number(key, value);
        }
    }

    fn flag(&mut self, key: &str, value: bool) {
        if value {
            self.number(key, true);
        }
    }

    fn text(&mut self, key: &str, value: &str) {
        if !value.is_empty() {
            self.number(key, Quoted(value));
        }
    }

    fn name(&mut self, key: &str, value: &Option<String>) {
        self.some(key, value.as_deref().map(Quoted));
    }

    fn time(&mut self, key: &str, value: Option<Time>) {
        self.some(key, value.map(InQuotes));
    }

    fn word<T: PartialEq + Copy>(&mut self, key: &str, value: T, default: T, word: impl Fn(T) -> &'static str) {
        if value != default {
            self.number(key, InQuotes(word(value)));
        }
    }
}

/// A value without characters that need an escape, in quotation marks.
struct InQuotes<T>(T);

impl<T: Display> Display for InQuotes<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "\"{}\"", self.0)
    }
}

/// A text of TOML.
struct Quoted<'a>(&'a str);

impl Display for Quoted<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_char('"')?;
        for character in self.0.chars() {
            match character {
                '"' => f.write_str("\\\"")?,
                '\\' => f.write_str("\\\\")?,
                '\n' => f.write_str("\\n")?,
                '\r' => f.write_str("\\r")?,
                '\t' => f.write_str("\\t")?,
                other if other.is_control() => write!(f, "\\u{:04X}", u32::from(other))?,
                other => f.write_char(other)?,
            }
        }
        f.write_char('"')
    }
}

/// A number in hexadecimal digits.
struct Hex(u32, usize);

impl Display for Hex {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "0x{:0width$x}", self.0, width = self.1)
    }
}

fn hex_2(value: u8) -> Hex {
    Hex(value.into(), 2)
}

fn hex_4(value: u16) -> Hex {
    Hex(value.into(), 4)
}

const fn hex_8(value: u32) -> Hex {
    Hex(value, 8)
}

fn redundancy(out: &mut Text, of: &Redundancy) {
    if *of == Redundancy::default() {
        return;
    }
    out.table("[redundancy]");
    out.flag("ring", of.ring);
    out.word("junctions", of.junctions, Junctions::default(), |junctions| match junctions {
        Junctions::Disabled => "disabled",
        Junctions::Automatic => "automatic",
        Junctions::Strict => "strict",
    });
    for connection in &of.connection {
        out.table("[[redundancy.connection]]");
        out.number("head", Quoted(&connection.head));
        out.number("head_port", connection.head_port);
        out.number("tail", Quoted(&connection.tail));
        out.number("tail_port", connection.tail_port);
    }
}

fn clocks(out: &mut Text, of: &Clocks) {
    out.table("[clocks]");
    out.name("reference", &of.reference);
    out.flag("bus_shift", of.bus_shift);
    out.some("sync_window_ns", of.sync_window_ns);
    out.some("lock_window_ns", of.lock_window_ns);
    out.time("lock_limit", of.lock_limit);
    out.flag("go_on_unlocked", of.go_on_unlocked);
    out.flag("estimate_delays", of.estimate_delays);
}

fn domain(out: &mut Text, of: &Domain) {
    out.table("[[domain]]");
    out.number("name", Quoted(&of.name));
    out.number("period", InQuotes(of.period));
    if of.under_way != 1 {
        out.number("under_way", of.under_way);
    }
    out.flag("send_again", of.send_again);
}

fn subdevice(out: &mut Text, of: &SubDevice, implied: Option<u16>) {
    out.table("[[subdevice]]");
    out.number("name", Quoted(&of.name));
    out.some("position", of.position.or(implied));
    out.some("alias", of.alias);
    out.some("identification", of.identification);
    out.some("identification_word", of.identification_word.map(hex_4));
    out.some("offset", of.offset.filter(|offset| *offset != 0));
    out.name("group", &of.group);
    out.flag("optional", of.optional);
    out.some("vendor", of.vendor.map(hex_8));
    out.some("product", of.product.map(hex_8));
    out.some("revision", of.revision.map(hex_8));
    out.word("check_revision", of.check_revision, CheckRevision::default(), |check| match check {
        CheckRevision::None => "none",
        CheckRevision::Equal => "equal",
        CheckRevision::EqualOrGreater => "equal-or-greater",
        CheckRevision::LowEqual => "low-equal",
        CheckRevision::LowEqualHighEqualOrGreater => "low-equal-high-equal-or-greater",
        CheckRevision::HighEqual => "high-equal",
        CheckRevision::HighEqualLowEqualOrGreater => "high-equal-low-equal-or-greater",
    });
    out.some("serial", of.serial);
    out.some("check_identification", of.check_identification);
    out.text("order_code", &of.order_code);
    out.text("firmware", &of.firmware);
    out.text("ports", &of.ports);
    if let Some(into) = &of.plugged_into {
        let subdevice = Quoted(&into.subdevice);
        out.number("plugged_into", format_args!("{{ subdevice = {subdevice}, port = {} }}", into.port));
    }
    out.name("domain", &of.domain);
    words(out, of);
    if let Some(passage) = of.passage {
        let (processing, forwarding) = (passage.processing_ns, passage.forwarding_ns);
        out.number("passage", format_args!("{{ processing_ns = {processing}, forwarding_ns = {forwarding} }}"));
    }
    out.some("watchdog_divider", of.watchdog_divider);
    out.some("watchdog_process_data", of.watchdog_process_data);
    out.some("watchdog_pdi", of.watchdog_pdi);
    out.flag("eeprom_to_pdi", of.eeprom_to_pdi);
    out.time("wait_before_safeop", of.wait_before_safeop);
    if let Some(of) = &of.mailbox {
        mailbox(out, of);
    }
    of.sync_manager.iter().for_each(|of| sync_manager(out, of));
    sync(out, of);
    timeouts(out, &of.timeouts);
    of.startup.iter().for_each(|of| startup(out, of));
}

fn words(out: &mut Text, of: &SubDevice) {
    out.word("target", of.target, Target::default(), |target| match target {
        Target::Init => "INIT",
        Target::Preop => "PREOP",
        Target::Safeop => "SAFEOP",
        Target::Op => "OP",
    });
    out.word("repeat", of.repeat, Repeat::default(), |repeat| match repeat {
        Repeat::Automatic => "automatic",
        Repeat::Everything => "everything",
        Repeat::Inputs => "inputs",
        Repeat::Nothing => "nothing",
    });
}

fn sync(out: &mut Text, of: &SubDevice) {
    if let Some(sync) = &of.sync {
        out.table("[subdevice.sync]");
        out.number("assign_activate", hex_4(sync.assign_activate));
        out.number("sync0_cycle", InQuotes(sync.sync0_cycle));
        for (key, shift) in
            [("sync0_shift", sync.sync0_shift), ("sync1_cycle", sync.sync1_cycle), ("sync1_shift", sync.sync1_shift)]
        {
            out.some(key, Some(shift).filter(|shift| *shift != Shift::default()).map(InQuotes));
        }
    }
}

fn mailbox(out: &mut Text, of: &Mailbox) {
    out.table("[subdevice.mailbox]");
    for (key, buffer) in
        [("write", Some(of.write)), ("read", Some(of.read)), ("boot_write", of.boot_write), ("boot_read", of.boot_read)]
    {
        if let Some(buffer) = buffer {
            let (start, length) = (hex_4(buffer.start), buffer.length);
            out.number(key, format_args!("{{ start = {start}, length = {length} }}"));
        }
    }
    let protocols: Vec<&str> = of
        .protocols
        .iter()
        .map(|protocol| match protocol {
            Protocol::AoE => "\"AoE\"",
            Protocol::EoE => "\"EoE\"",
            Protocol::CoE => "\"CoE\"",
            Protocol::FoE => "\"FoE\"",
            Protocol::SoE => "\"SoE\"",
            Protocol::VoE => "\"VoE\"",
        })
        .collect();
    if !protocols.is_empty() {
        out.number("protocols", format_args!("[{}]", protocols.join(", ")));
    }
    out.flag("complete_access", of.complete_access);
    out.flag("pdo_assign", of.pdo_assign);
    out.flag("pdo_config", of.pdo_config);
}

fn sync_manager(out: &mut Text, of: &SyncManager) {
    out.table("[[subdevice.sync_manager]]");
    out.number("number", of.number);
    let direction = match of.direction {
        Direction::Outputs => "outputs",
        Direction::Inputs => "inputs",
    };
    out.number("direction", InQuotes(direction));
    out.some("start", of.start.map(hex_4));
    out.some("control", of.control.map(hex_2));
    out.flag("op_only", of.op_only);
    out.some("watchdog", of.watchdog);
    out.name("domain", &of.domain);
    out.some("length", of.length);
    of.pdo.iter().for_each(|of| pdo(out, of));
}

fn pdo(out: &mut Text, of: &Pdo) {
    out.table("[[subdevice.sync_manager.pdo]]");
    out.number("index", hex_4(of.index));
    out.text("name", &of.name);
    out.flag("fixed", of.fixed);
    let Some(entries) = &of.entries else { return };
    if entries.is_empty() {
        return out.number("entries", "[]");
    }
    out.line("entries = [");
    entries.iter().for_each(|of| entry(out, of));
    out.line("]");
}

fn entry(out: &mut Text, of: &Entry) {
    let mut keys = Vec::new();
    if of.index != 0 {
        keys.push(format!("index = {}", hex_4(of.index)));
    }
    if of.sub != 0 {
        keys.push(format!("sub = {}", of.sub));
    }
    keys.push(format!("bits = {}", of.bits));
    if !of.name.is_empty() {
        keys.push(format!("name = {}", Quoted(&of.name)));
    }
    if !of.data_type.is_empty() {
        keys.push(format!("type = {}", Quoted(&of.data_type)));
    }
    out.line(format_args!("    {{ {} }},", keys.join(", ")));
}

fn timeouts(out: &mut Text, of: &Timeouts) {
    if *of == Timeouts::default() {
        return;
    }
    out.table("[subdevice.timeouts]");
    for (key, time) in [
        ("preop", of.preop),
        ("safeop_op", of.safeop_op),
        ("back_to_init", of.back_to_init),
        ("back_to_safeop", of.back_to_safeop),
        ("mailbox_request", of.mailbox_request),
        ("sdo", of.sdo),
        ("soe", of.soe),
        ("eoe", of.eoe),
    ] {
        out.time(key, time);
    }
}

const fn transition(at: At) -> &'static str {
    match at {
        At::Ip => "IP",
        At::Ps => "PS",
        At::So => "SO",
        At::Os => "OS",
        At::Sp => "SP",
        At::Ii => "II",
        At::Pp => "PP",
        At::Ss => "SS",
        At::Pi => "PI",
        At::Si => "SI",
        At::Oi => "OI",
        At::Ib => "IB",
        At::Bi => "BI",
    }
}

/// Transfers of files, as inline tables.
fn files(of: &Startup) -> Vec<(&'static str, Vec<Option<String>>)> {
    let head = |name: &str, password: u32| {
        let password = (password != 0).then(|| format!("password = {password}"));
        vec![Some(format!("name = {}", Quoted(name))), password]
    };
    let write = of.write_file.as_ref().map(|file| {
        let data = vec![Some(format!("data = \"{}\"", file.data))];
        ("write_file", [head(&file.name, file.password), data].concat())
    });
    let read = of.read_file.as_ref().map(|file| ("read_file", head(&file.name, file.password)));
    write.into_iter().chain(read).collect()
}

fn startup(out: &mut Text, of: &Startup) {
    out.table("[[subdevice.startup]]");
    out.word("at", of.at, At::default(), transition);
    out.flag("after_pdos", of.after_pdos);
    let bytes = |bytes: &Bytes| format!("\"{bytes}\"");
    let mut inline = |key: &str, pairs: Vec<Option<String>>| {
        let pairs: Vec<String> = pairs.into_iter().flatten().collect();
        out.number(key, format_args!("{{ {} }}", pairs.join(", ")));
    };
    let pair = |key: &str, value: String| Some(format!("{key} = {value}"));
    let flag = |key: &str, is_set: bool| is_set.then(|| format!("{key} = true"));
    let large = |key: &str, value: u16| (value != 0).then(|| format!("{key} = {value}"));
    let small = |key: &str, value: u8| large(key, value.into());
    if let Some(sdo) = &of.sdo {
        let index = pair("index", hex_4(sdo.index).to_string());
        let data = pair("data", bytes(&sdo.data));
        inline("sdo", vec![index, small("sub", sdo.sub), flag("complete", sdo.complete), data]);
    }
    if let Some(upload) = &of.upload {
        let index = pair("index", hex_4(upload.index).to_string());
        let data = upload.data.as_ref().and_then(|data| pair("data", bytes(data)));
        inline("upload", vec![index, small("sub", upload.sub), flag("complete", upload.complete), data]);
    }
    if let Some(idn) = &of.idn {
        let (number, data) = (pair("idn", hex_4(idn.idn).to_string()), pair("data", bytes(&idn.data)));
        inline("idn", vec![small("drive", idn.drive), number, data]);
    }
    if let Some(read) = &of.read_idn {
        let (number, data) = (pair("idn", hex_4(read.idn).to_string()), read.data.as_ref());
        let elements = read.elements.and_then(|elements| pair("elements", format!("{elements:#04x}")));
        let data = data.and_then(|data| pair("data", bytes(data)));
        inline("read_idn", vec![small("drive", read.drive), number, elements, data]);
    }
    if let Some(ip) = &of.ip {
        let address = |key: &str, value: Option<std::net::Ipv4Addr>| value.map(|value| format!("{key} = \"{value}\""));
        let mac = ip.mac.map(|mac| format!("mac = \"{mac}\""));
        let name = ip.name.as_deref().map(|name| format!("name = {}", Quoted(name)));
        let (own, mask) = (address("address", ip.address), address("mask", ip.mask));
        inline("ip", vec![mac, own, mask, address("gateway", ip.gateway), address("dns", ip.dns), name]);
    }
    files(of).into_iter().for_each(|(key, pairs)| inline(key, pairs));
    if let Some(write) = &of.write {
        let address = pair("address", hex_4(write.address).to_string());
        let data = pair("data", bytes(&write.data));
        inline("write", vec![address, data, large("retries", write.retries), flag("required", write.required)]);
    }
    if let Some(check) = &of.check {
        let address = pair("address", hex_4(check.address).to_string());
        let (data, mask) = (pair("data", bytes(&check.data)), check.mask.as_ref().and_then(|m| pair("mask", bytes(m))));
        let within = check.within.and_then(|within| pair("within", InQuotes(within).to_string()));
        let (retries, required) = (large("retries", check.retries), flag("required", check.required));
        inline("check", vec![address, data, mask, within, retries, required]);
    }
    out.some("aoe", of.aoe.as_ref().map(bytes));
    out.some("voe", of.voe.as_ref().map(bytes));
    out.time("limit", of.limit);
    out.name("comment", &of.comment);
}
