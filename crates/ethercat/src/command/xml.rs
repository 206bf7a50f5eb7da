//! `xml`: SubDevices as device descriptions.

use ringcat_control::is_hidden;
use ringcat_control::tool::{Description, PdoEntryLine, PdoLine};

use super::slaves::description;
use crate::append::append;
use crate::failure::Failure;
use crate::json;
use crate::json::texts::Text;
use crate::selection::Slave;
use crate::selection_help::SELECTION;
use crate::session::Session;
use crate::shape::{Command, Output};

/// The command.
pub const COMMAND: Command = Command {
    name: "xml",
    summary: "Generate slave information XML.",
    forms: &[""],
    help: "A description of the slaves in the form of an ESI, from their SIIs. The
output is well-formed UTF-8 whatever names hold.
",
    options: SELECTION,
    output: Output::Data,
    run,
};

fn run(session: &mut Session<'_>) -> Result<(), Failure> {
    let master = session.single_master()?;
    let slaves = session.slaves(master)?;
    let is_list = slaves.len() != 1;
    let mut text = "<?xml version=\"1.0\" ?>\n".to_owned();
    if is_list {
        text += "<EtherCATInfoList>\n";
    }
    let indent = if is_list { "  " } else { "" };
    for slave in slaves {
        let details = description(session, master, slave.line.position)?;
        text.extend(info(&slave, &details).lines().map(|line| format!("{indent}{line}\n")));
    }
    if is_list {
        text += "</EtherCATInfoList>\n";
    }
    if session.arguments.json {
        return json::print(session, &Text { master, text: &text });
    }
    session.write_text(&text)
}

fn info(slave: &Slave, details: &Description) -> String {
    let [vendor, product, revision, _] = slave.line.identity;
    let mut text = format!("<EtherCATInfo>\n  <!-- Slave {} -->\n", slave.line.position);
    append!(text, "  <Vendor>\n    <Id>{vendor}</Id>\n  </Vendor>\n");
    text += "  <Descriptions>\n    <Devices>\n      <Device>\n";
    append!(text, "        <Type ProductCode=\"#x{product:08x}\" RevisionNo=\"#x{revision:08x}\">");
    append!(text, "{}</Type>\n", escaped(&slave.line.order));
    if !slave.line.name.is_empty() {
        append!(text, "        <Name><![CDATA[{}]]></Name>\n", character_data(&slave.line.name));
    }
    for own in &details.sync_managers {
        append!(text, "        <Sm Enable=\"{}\" StartAddress=\"#x{:x}\"", own.enable, own.start);
        append!(text, " ControlByte=\"#x{:x}\" DefaultSize=\"{}\" />\n", own.control, own.length);
    }
    for (number, own) in details.sync_managers.iter().enumerate() {
        let kind = if own.is_output { "RxPdo" } else { "TxPdo" };
        own.pdos.iter().for_each(|pdo| text += &pdo_element(kind, number, pdo));
    }
    text + "      </Device>\n    </Devices>\n  </Descriptions>\n</EtherCATInfo>\n"
}

fn pdo_element(kind: &str, number: usize, pdo: &PdoLine) -> String {
    let mut text = format!("        <{kind} Sm=\"{number}\" Fixed=\"1\" Mandatory=\"1\">\n");
    append!(text, "          <Index>#x{:04x}</Index>\n          <Name>{}</Name>\n", pdo.index, escaped(&pdo.name));
    pdo.entries.iter().for_each(|entry| text += &entry_element(entry));
    text + &format!("        </{kind}>\n")
}

fn entry_element(entry: &PdoEntryLine) -> String {
    let PdoEntryLine { index, sub_index, bits, name } = entry;
    let mut text = format!("          <Entry>\n            <Index>#x{index:04x}</Index>\n");
    if *index != 0 {
        append!(text, "            <SubIndex>{sub_index}</SubIndex>\n");
    }
    append!(text, "            <BitLen>{bits}</BitLen>\n");
    if *index != 0 {
        let data_type = match bits {
            1 => "BOOL".to_owned(),
            8 | 16 | 32 | 64 => format!("UINT{bits}"),
            _ => format!("BIT{bits}"),
        };
        append!(text, "            <Name>{}</Name>\n            <DataType>{data_type}</DataType>\n", escaped(name));
    }
    text + "          </Entry>\n"
}

/// Characters that XML allows.
fn allowed(text: &str) -> String {
    let is_allowed = |it: char| !it.is_control() && !is_hidden(it) && !matches!(it, '\u{FFFE}' | '\u{FFFF}');
    text.chars().map(|it| if is_allowed(it) { it } else { ' ' }).collect()
}

fn escaped(text: &str) -> String {
    allowed(text).replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

fn character_data(text: &str) -> String {
    allowed(text).replace("]]>", "]]]]><![CDATA[>")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::selection::counted;
    use ringcat_control::tool::{SubDeviceLine, SyncManagerLine};

    // covers: daemon
    #[test]
    fn names_that_are_markup_stay_text_and_gaps_have_no_type() {
        let line = SubDeviceLine { order: "<&>\u{1}".to_owned(), name: "a]]>b".to_owned(), ..SubDeviceLine::default() };
        let gap = PdoEntryLine { bits: 6, ..PdoEntryLine::default() };
        let entry = PdoEntryLine { index: 0x7000, sub_index: 1, bits: 7, name: "x".to_owned() };
        let pdo = PdoLine { index: 0x1600, name: String::new(), entries: vec![entry, gap] };
        let own = SyncManagerLine { control: 0x44, start: 0xF00, pdos: vec![pdo], ..SyncManagerLine::default() };
        let details = Description { sync_managers: vec![own], ..Description::default() };
        let text = info(&counted(vec![line])[0], &details);
        for part in [
            ">&lt;&amp;&gt; </Type>",
            "<![CDATA[a]]]]><![CDATA[>b]]>",
            "<Sm Enable=\"0\" StartAddress=\"#xf00\" ControlByte=\"#x44\" DefaultSize=\"0\" />",
            "<DataType>BIT7</DataType>",
            "<Index>#x0000</Index>\n            <BitLen>6</BitLen>\n          </Entry>",
        ] {
            assert!(text.contains(part), "{part}\nis not in\n{text}");
        }
    }
}
