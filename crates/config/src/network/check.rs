//! What the values of a network file say together: names that are unique and known, places, lengths, start-up commands.

use std::collections::BTreeMap;

use ringcat_engine::config::MailMessage;

use super::error::{Checked, Fault, Step, fault};
use super::model::{At, Junctions, NetworkFile, Startup, SubDevice, SyncManager};
use super::places;

/// Maximum number of SubDevices: positions have 16 bits, and the last one is reserved.
const MAX_SUBDEVICES: usize = 65_534;
/// Maximum number of domains.
const MAX_DOMAINS: usize = 64;
/// SyncManagers of a controller.
const SYNC_MANAGERS: u8 = 16;
/// Ports of a controller.
const PORTS: u8 = 4;
/// Cycles of a domain under way at once.
const MAX_UNDER_WAY: u8 = ringcat_engine::main_device::MAX_UNDER_WAY;
/// Longest cycle in seconds.
const LONGEST_PERIOD_S: u64 = 10;
/// Largest amount of a shift or a cycle of SYNC signals.
const LONGEST_SHIFT_NS: i64 = i32::MAX as i64;
/// Addresses of memory that may hold an identification: digital inputs, user RAM, process data RAM.
const DATA_WORDS: std::ops::RangeInclusive<u16> = 0x0F00..=0xFFFE;
/// Bytes of an IP host name.
const HOST_NAME: usize = 32;

/// Checks a file.
pub(super) fn check(file: &NetworkFile) -> Checked {
    domains(file)?;
    let names = names(file)?;
    clocks(file, &names)?;
    redundancy(file, &names)?;
    places::groups(file)?;
    places::positions(file)?;
    cables(file)?;
    for (index, subdevice) in file.subdevice.iter().enumerate() {
        of_subdevice(file, index, subdevice, &names).map_err(|fault| {
            let mut path = vec!["subdevice".into(), index.into()];
            path.extend(fault.path);
            Fault { path, ..fault }
        })?;
    }
    places::marks(file)
}

fn domains(file: &NetworkFile) -> Checked {
    let mut known = BTreeMap::new();
    if file.domain.is_empty() && !file.subdevice.is_empty() {
        return fault([], "expected at least one table [[domain]]");
    }
    if file.domain.len() > MAX_DOMAINS {
        return fault(["domain".into()], format!("expected at most {MAX_DOMAINS} domains, got {}", file.domain.len()));
    }
    for (index, domain) in file.domain.iter().enumerate() {
        let at = |key: &str| ["domain".into(), index.into(), key.into()];
        if domain.name.is_empty() {
            return fault(at("name"), "expected a name, got an empty text");
        }
        if let Some(first) = known.insert(&domain.name, index) {
            return fault(at("name"), format!("\"{}\" is also the name of domain[{first}]", domain.name));
        }
        if domain.period.0.is_zero() || domain.period.0.as_secs() >= LONGEST_PERIOD_S {
            let message = format!("expected more than 0s and less than {LONGEST_PERIOD_S}s, got {}", domain.period);
            return fault(at("period"), message);
        }
        if !(1..=MAX_UNDER_WAY).contains(&domain.under_way) {
            return fault(at("under_way"), format!("expected 1 to {MAX_UNDER_WAY}, got {}", domain.under_way));
        }
    }
    Ok(())
}

/// Names of the SubDevices with their indices.
fn names(file: &NetworkFile) -> Result<BTreeMap<&str, usize>, Fault> {
    let mut names = BTreeMap::new();
    if file.subdevice.len() > MAX_SUBDEVICES {
        let message = format!("expected at most {MAX_SUBDEVICES} SubDevices, got {}", file.subdevice.len());
        return Err(Fault { path: vec!["subdevice".into()], message });
    }
    for (index, subdevice) in file.subdevice.iter().enumerate() {
        let path = || vec!["subdevice".into(), index.into(), "name".into()];
        if subdevice.name.is_empty() {
            return Err(Fault { path: path(), message: "expected a name, got an empty text".to_owned() });
        }
        if let Some(first) = names.insert(subdevice.name.as_str(), index) {
            let message = format!("the name is also that of subdevice[{first}]");
            return Err(Fault { path: path(), message });
        }
    }
    Ok(names)
}

fn is_known(names: &BTreeMap<&str, usize>, name: &str, path: Vec<Step>) -> Checked {
    match names.contains_key(name) {
        true => Ok(()),
        false => Err(Fault {
            path,
            message: format!("expected the name of a SubDevice of the file, got \"{}\"", name.escape_debug()),
        }),
    }
}

/// A port has one cable. Groups and optional SubDevices may take turns at it.
fn cables(file: &NetworkFile) -> Checked {
    let mut known = BTreeMap::new();
    let fixed = file.subdevice.iter().enumerate().filter(|(_, it)| it.group.is_none() && !it.optional);
    for (index, subdevice) in fixed {
        let Some(into) = &subdevice.plugged_into else { continue };
        if let Some(first) = known.insert((into.subdevice.as_str(), into.port), index) {
            let message = format!("subdevice[{first}] is plugged into this port too");
            return fault(["subdevice".into(), index.into(), "plugged_into".into()], message);
        }
    }
    Ok(())
}

fn clocks(file: &NetworkFile, names: &BTreeMap<&str, usize>) -> Checked {
    let Some(clocks) = &file.clocks else {
        let with_sync = file.subdevice.iter().position(|subdevice| subdevice.sync.is_some());
        return match with_sync {
            Some(index) => fault(
                ["subdevice".into(), index.into(), "sync".into()],
                "SYNC signals need distributed clocks: expected a table [clocks]",
            ),
            None => Ok(()),
        };
    };
    match &clocks.reference {
        Some(reference) => is_known(names, reference, vec!["clocks".into(), "reference".into()]),
        None => Ok(()),
    }
}

fn redundancy(file: &NetworkFile, names: &BTreeMap<&str, usize>) -> Checked {
    let redundancy = &file.redundancy;
    let strict = redundancy.junctions == Junctions::Strict;
    if strict == redundancy.connection.is_empty() {
        return fault(
            ["redundancy".into(), "connection".into()],
            "expected connections with junctions = \"strict\", and only with it",
        );
    }
    for (index, connection) in redundancy.connection.iter().enumerate() {
        let at = |key: &str| vec!["redundancy".into(), "connection".into(), index.into(), key.into()];
        is_known(names, &connection.head, at("head"))?;
        is_known(names, &connection.tail, at("tail"))?;
        for (key, port) in [("head_port", connection.head_port), ("tail_port", connection.tail_port)] {
            if port >= PORTS {
                return Err(Fault { path: at(key), message: format!("expected a port from 0 to 3, got {port}") });
            }
        }
    }
    Ok(())
}

fn of_subdevice(file: &NetworkFile, index: usize, subdevice: &SubDevice, names: &BTreeMap<&str, usize>) -> Checked {
    let places = [subdevice.position, subdevice.alias, subdevice.identification];
    if places.iter().flatten().count() > 1 {
        return fault(["position".into()], "expected one of position, alias and identification");
    }
    if let Some(word) = subdevice.identification_word {
        if subdevice.identification.is_none() {
            return fault(["identification_word".into()], "expected a key identification, the value of the word");
        }
        if !DATA_WORDS.contains(&word) {
            let message = format!("expected an address from 0x0F00 to 0xFFFE, got {word:#06x}");
            return fault(["identification_word".into()], message);
        }
    }
    if subdevice.offset.is_some() && subdevice.alias.is_none() && subdevice.identification.is_none() {
        return fault(["offset".into()], "an offset counts from an alias or an identification");
    }
    if subdevice.check_revision != super::model::CheckRevision::None && subdevice.revision.is_none() {
        return fault(["check_revision".into()], "expected a key revision to compare with");
    }
    if !subdevice.ports.chars().all(|port| matches!(port, 'Y' | 'K' | 'H' | ' ')) || subdevice.ports.len() > 4 {
        let message = format!("expected up to four of Y, K, H and blank, got \"{}\"", subdevice.ports.escape_debug());
        return fault(["ports".into()], message);
    }
    if let Some(plugged) = &subdevice.plugged_into {
        is_known(names, &plugged.subdevice, vec!["plugged_into".into(), "subdevice".into()])?;
        if names.get(plugged.subdevice.as_str()).is_some_and(|before| *before >= index) {
            return fault(["plugged_into".into(), "subdevice".into()], "expected a SubDevice that is listed before");
        }
        if plugged.port >= PORTS {
            let message = format!("expected a port from 0 to 3, got {}", plugged.port);
            return fault(["plugged_into".into(), "port".into()], message);
        }
    }
    domain(file, subdevice.domain.as_deref(), &["domain".into()])?;
    mailbox(subdevice)?;
    sync(subdevice)?;
    let mut numbers = BTreeMap::new();
    for (at, sync_manager) in subdevice.sync_manager.iter().enumerate() {
        let under = |fault: Fault| {
            let mut path = vec!["sync_manager".into(), at.into()];
            path.extend(fault.path);
            Fault { path, ..fault }
        };
        if let Some(first) = numbers.insert(sync_manager.number, at) {
            let message = format!("{} is also the number of sync_manager[{first}]", sync_manager.number);
            return fault(["sync_manager".into(), at.into(), "number".into()], message);
        }
        of_sync_manager(file, sync_manager).map_err(under)?;
    }
    for (at, startup) in subdevice.startup.iter().enumerate() {
        command(startup).map_err(|fault| {
            let mut path = vec!["startup".into(), at.into()];
            path.extend(fault.path);
            Fault { path, ..fault }
        })?;
    }
    Ok(())
}

fn mailbox(subdevice: &SubDevice) -> Checked {
    let Some(mailbox) = &subdevice.mailbox else { return Ok(()) };
    let pairs = [Some((mailbox.write, mailbox.read)), mailbox.boot_write.zip(mailbox.boot_read)];
    if mailbox.boot_write.is_some() != mailbox.boot_read.is_some() {
        return fault(["mailbox".into(), "boot_write".into()], "expected boot_write and boot_read, or neither");
    }
    for (write, read) in pairs.into_iter().flatten() {
        for (key, buffer) in [("write", write), ("read", read)] {
            if u32::from(buffer.start) + u32::from(buffer.length) > 0x1_0000 || buffer.length == 0 {
                let message =
                    format!("expected an end within 64 KiB, got {:#06x} and {} bytes", buffer.start, buffer.length);
                return fault(["mailbox".into(), key.into()], message);
            }
        }
    }
    Ok(())
}

fn sync(subdevice: &SubDevice) -> Checked {
    let Some(sync) = &subdevice.sync else { return Ok(()) };
    for (key, time, least) in [
        ("sync0_cycle", sync.sync0_cycle, 0),
        ("sync0_shift", sync.sync0_shift, -LONGEST_SHIFT_NS),
        ("sync1_cycle", sync.sync1_cycle, 0),
        ("sync1_shift", sync.sync1_shift, -LONGEST_SHIFT_NS),
    ] {
        if !(least..=LONGEST_SHIFT_NS).contains(&time.0) {
            let message = format!("expected {least}ns to {LONGEST_SHIFT_NS}ns, got {time}");
            return fault(["sync".into(), key.into()], message);
        }
    }
    let (sync0, sync1) = (sync.sync0_cycle, sync.sync1_cycle);
    if sync0.0 > 0 && sync1.0 % sync0.0 != 0 {
        let message = format!("expected 0 or a multiple of sync0_cycle, {sync0}, got {sync1}");
        return fault(["sync".into(), "sync1_cycle".into()], message);
    }
    Ok(())
}

fn domain(file: &NetworkFile, name: Option<&str>, path: &[Step]) -> Checked {
    let Some(name) = name else { return Ok(()) };
    if file.domain.iter().any(|domain| domain.name == name) {
        return Ok(());
    }
    let known: Vec<String> = file.domain.iter().take(10).map(|domain| format!("\"{}\"", domain.name)).collect();
    let message = format!("expected a domain of the file ({}), got \"{}\"", known.join(", "), name.escape_debug());
    Err(Fault { path: path.to_vec(), message })
}

fn of_sync_manager(file: &NetworkFile, sync_manager: &SyncManager) -> Checked {
    if sync_manager.number >= SYNC_MANAGERS {
        return fault(["number".into()], format!("expected 0 to 15, got {}", sync_manager.number));
    }
    domain(file, sync_manager.domain.as_deref(), &["domain".into()])?;
    let mut bits = 0u32;
    let mut indices = BTreeMap::new();
    for (at, pdo) in sync_manager.pdo.iter().enumerate() {
        if pdo.index == 0 {
            return fault(["pdo".into(), at.into(), "index".into()], "expected the index of a PDO, got 0");
        }
        if let Some(first) = indices.insert(pdo.index, at) {
            let message = format!("{:#06x} is also the index of pdo[{first}]", pdo.index);
            return fault(["pdo".into(), at.into(), "index".into()], message);
        }
        for (number, entry) in pdo.entries.iter().flatten().enumerate() {
            if entry.bits == 0 {
                let path = ["pdo".into(), at.into(), "entries".into(), number.into(), "bits".into()];
                return fault(path, "expected 1 to 255 bits, got 0");
            }
            bits = bits.saturating_add(entry.bits.into());
        }
    }
    if bits.div_ceil(8) > u16::MAX.into() {
        return fault(["pdo".into()], format!("expected at most 65535 bytes, got {}", bits.div_ceil(8)));
    }
    let length = sync_manager.length.unwrap_or(0);
    if u32::from(sync_manager.start.unwrap_or(0)) + bits.div_ceil(8).max(length.into()) > 0x1_0000 {
        return fault(["start".into()], "expected an end of the process data within 64 KiB");
    }
    Ok(())
}

fn command(startup: &Startup) -> Checked {
    let given = [
        startup.sdo.is_some(),
        startup.upload.is_some(),
        startup.idn.is_some(),
        startup.read_idn.is_some(),
        startup.ip.is_some(),
        startup.aoe.is_some(),
        startup.voe.is_some(),
        startup.write_file.is_some(),
        startup.read_file.is_some(),
        startup.write.is_some(),
        startup.check.is_some(),
    ];
    let count = given.iter().filter(|is_given| **is_given).count();
    if count != 1 {
        let keys = "sdo, upload, idn, read_idn, ip, aoe, voe, write_file, read_file, write and check";
        return fault([], format!("expected one of {keys}, got {count} of them"));
    }
    time(startup)?;
    messages(startup)?;
    files(startup)?;
    complete(startup)?;
    if let Some(idn) = startup.idn.as_ref().filter(|idn| idn.drive > 7) {
        return fault(["idn".into(), "drive".into()], format!("expected 0 to 7, got {}", idn.drive));
    }
    if let Some(idn) = startup.read_idn.as_ref().filter(|idn| idn.drive > 7) {
        return fault(["read_idn".into(), "drive".into()], format!("expected 0 to 7, got {}", idn.drive));
    }
    if startup.read_idn.as_ref().is_some_and(|idn| idn.elements == Some(0)) {
        return fault(["read_idn".into(), "elements".into()], "expected at least one bit, got 0".to_owned());
    }
    if let Some(name) = startup.ip.as_ref().and_then(|ip| ip.name.as_ref()).filter(|name| name.len() > HOST_NAME) {
        let message = format!("expected at most {HOST_NAME} bytes, got {}", name.len());
        return fault(["ip".into(), "name".into()], message);
    }
    let register = [
        ("write", startup.write.as_ref().map(|write| (write.address, write.data.0.len()))),
        ("check", startup.check.as_ref().map(|check| (check.address, check.data.0.len()))),
    ];
    for (key, register) in register {
        let Some((address, length)) = register else { continue };
        let most = ringcat_wire::datagram::MAX_DATA.min(0x1_0000 - usize::from(address));
        if !(1..=most).contains(&length) {
            let message = format!("expected 1 to {most} bytes from address {address:#06x}, got {length}");
            return fault([key.into(), "data".into()], message);
        }
    }
    if let Some(check) = &startup.check
        && let Some(mask) = check.mask.as_ref().filter(|mask| mask.0.len() != check.data.0.len())
    {
        let message = format!("expected {} bytes as in data, got {}", check.data.0.len(), mask.0.len());
        return fault(["check".into(), "mask".into()], message);
    }
    Ok(())
}

/// When it is sent.
fn time(startup: &Startup) -> Checked {
    if startup.at == At::Ii && startup.write.is_none() && startup.check.is_none() {
        return fault(["at".into()], "II is in INIT, which has no mailbox: expected write or check");
    }
    if startup.after_pdos && startup.at != At::Ps {
        return fault(["after_pdos".into()], "PDOs are written at PS: expected no `at`, or \"PS\"");
    }
    Ok(())
}

/// Messages have the header of their protocol.
fn messages(startup: &Startup) -> Checked {
    let messages = [
        ("aoe", startup.aoe.as_ref().map(|data| MailMessage::Aoe(data.0.clone())), "an AMS header with a request"),
        ("voe", startup.voe.as_ref().map(|data| MailMessage::Voe(data.0.clone())), "vendor, type and data"),
    ];
    for (key, message, expected) in messages {
        if message.is_some_and(|message| !message.is_sound()) {
            return fault([key.into()], format!("expected {expected}"));
        }
    }
    Ok(())
}

/// Files have a name.
fn files(startup: &Startup) -> Checked {
    let names = [
        ("write_file", startup.write_file.as_ref().map(|file| &file.name)),
        ("read_file", startup.read_file.as_ref().map(|file| &file.name)),
    ];
    for (key, name) in names {
        if name.is_some_and(|name| name.is_empty() || name.contains('\0')) {
            return fault([key.into(), "name".into()], "expected the name of a file");
        }
    }
    Ok(())
}

/// Complete access begins at the first or second entry.
fn complete(startup: &Startup) -> Checked {
    let complete = [
        ("sdo", startup.sdo.as_ref().map(|sdo| (sdo.complete, sdo.sub))),
        ("upload", startup.upload.as_ref().map(|upload| (upload.complete, upload.sub))),
    ];
    for (key, sdo) in complete {
        if let Some((true, sub @ 2..)) = sdo {
            let message = format!("complete access begins at subindex 0 or 1, got {sub}");
            return fault([key.into(), "sub".into()], message);
        }
    }
    Ok(())
}
