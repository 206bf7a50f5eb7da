//! `cstruct`: PDOs as C structures for `ecrt_slave_config_pdos`.

use ringcat_control::tool::{Description, SyncManagerLine};

use super::slaves::description;
use crate::append::append;
use crate::failure::Failure;
use crate::json;
use crate::json::texts::Text;
use crate::selection::Slave;
use crate::selection_help::SELECTION;
use crate::session::Session;
use crate::shape::{Command, Output};

/// Bit of a control byte: writes retrigger the watchdog.
const WATCHDOG: u8 = 0x40;
/// Bits of a control byte: the direction.
const DIRECTION: u8 = 0x0C;
/// The MainDevice writes.
const WRITTEN: u8 = 0x04;

/// The command.
pub const COMMAND: Command = Command {
    name: "cstruct",
    summary: "Generate PDO information in C.",
    forms: &[""],
    help: "The output can be used with ecrt_slave_config_pdos(). Slaves without
sync managers are left out.
",
    options: SELECTION,
    output: Output::Data,
    run,
};

fn run(session: &mut Session<'_>) -> Result<(), Failure> {
    for master in session.masters()? {
        let mut whole = String::new();
        for slave in session.listed_slaves(master.master)? {
            let details = description(session, master.master, slave.line.position)?;
            let text = structures(master.master, &slave, &details);
            if session.arguments.json {
                whole += &text;
            } else {
                session.write_text(&text)?;
            }
        }
        if session.arguments.json {
            json::print(session, &Text { master: master.master, text: &whole })?;
        }
    }
    Ok(())
}

/// A text that ends no comment and no line of C.
fn comment(text: &str) -> String {
    text.replace("*/", "* /").replace("/*", "/ *").chars().map(|it| if it.is_control() { ' ' } else { it }).collect()
}

fn structures(master: u32, slave: &Slave, details: &Description) -> String {
    if details.sync_managers.is_empty() {
        return String::new();
    }
    let position = slave.line.position;
    let [vendor, product, revision, _] = slave.line.identity;
    let order =
        if slave.line.order.is_empty() { String::new() } else { format!(", \"{}\"", comment(&slave.line.order)) };
    let mut text = format!("/* Master {master}, Slave {position}{order}\n");
    append!(text, " * Vendor ID:       0x{vendor:08x}\n * Product code:    0x{product:08x}\n");
    append!(text, " * Revision number: 0x{revision:08x}\n */\n\n");
    let pdos = || details.sync_managers.iter().flat_map(|own| &own.pdos);
    if pdos().any(|pdo| !pdo.entries.is_empty()) {
        append!(text, "ec_pdo_entry_info_t slave_{position}_pdo_entries[] = {{\n");
        for entry in pdos().flat_map(|pdo| &pdo.entries) {
            let name = named(&entry.name);
            append!(text, "    {{0x{:04x}, 0x{:02x}, {}}},{name}\n", entry.index, entry.sub_index, entry.bits);
        }
        text += "};\n\n";
    }
    if pdos().next().is_some() {
        append!(text, "ec_pdo_info_t slave_{position}_pdos[] = {{\n");
        let mut first = 0;
        for pdo in pdos() {
            let count = pdo.entries.len();
            let entries =
                if count == 0 { "NULL".to_owned() } else { format!("slave_{position}_pdo_entries + {first}") };
            append!(text, "    {{0x{:04x}, {count}, {entries}}},{}\n", pdo.index, named(&pdo.name));
            first += count;
        }
        text += "};\n\n";
    }
    append!(text, "ec_sync_info_t slave_{position}_syncs[] = {{\n");
    let mut first = 0;
    for (number, own) in details.sync_managers.iter().enumerate() {
        text += &sync_manager(number, own, position, first);
        first += own.pdos.len();
    }
    text + "    {0xff}\n};\n\n"
}

fn named(name: &str) -> String {
    if name.is_empty() { String::new() } else { format!(" /* {} */", comment(name)) }
}

fn sync_manager(number: usize, own: &SyncManagerLine, position: u16, first: usize) -> String {
    let direction = match own.control & DIRECTION {
        WRITTEN => "EC_DIR_OUTPUT",
        0 => "EC_DIR_INPUT",
        _ => "EC_DIR_INVALID",
    };
    let watchdog = if own.control & WATCHDOG != 0 { "EC_WD_ENABLE" } else { "EC_WD_DISABLE" };
    let count = own.pdos.len();
    let pdos = if count == 0 { "NULL".to_owned() } else { format!("slave_{position}_pdos + {first}") };
    format!("    {{{number}, {direction}, {count}, {pdos}, {watchdog}}},\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::selection::counted;
    use ringcat_control::tool::{PdoLine, SubDeviceLine};

    // covers: daemon
    #[test]
    fn names_end_no_comment_and_pdos_without_entries_have_none() {
        let line = SubDeviceLine { order: "a*/b\nc".to_owned(), ..SubDeviceLine::default() };
        let pdo = PdoLine { index: 0x1A00, name: "*/".to_owned(), entries: Vec::new() };
        let own = SyncManagerLine { control: 0x20, pdos: vec![pdo], ..SyncManagerLine::default() };
        let details = Description { sync_managers: vec![own], ..Description::default() };
        let text = structures(0, &counted(vec![line])[0], &details);
        assert!(text.contains("Slave 0, \"a* /b c\"\n"), "{text}");
        assert!(text.contains("    {0x1a00, 0, NULL}, /* * / */\n") && !text.contains("pdo_entries"), "{text}");
        assert!(text.contains("    {0, EC_DIR_INPUT, 1, slave_0_pdos + 0, EC_WD_DISABLE},\n    {0xff}\n};\n\n"));
    }
}
