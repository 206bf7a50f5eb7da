//! Outputs of the original tool on real buses, as others published them, compared byte for byte with ours.
//!
//! They lie beside the repository; without them the test says so. Each part of a file (a command and what it printed)
//! becomes a simulated bus of the SubDevices that it shows (`real_bus`), on which our tool runs the same command. A
//! part that ours does not print has its reason here, and the test fails if it is the same after all.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use crate::bench::{Bench, directory};
use crate::real_bus::{Command, bus};
use crate::real_details::compared;

const PLACE: &str = "../../../shared/data/cli";

/// What its publisher did to an output.
#[derive(Clone, Copy, PartialEq)]
enum Edit {
    /// Nothing.
    None,
    /// The end is missing: ours begins with it.
    Cut,
    /// A prefix of comments was removed, with one blank of each line that begins with one.
    OneBlankLess,
    /// A prefix of comments was removed, and one blank of it is left.
    OneBlankMore,
    /// The end of the last line is missing.
    NoLineEnd,
    /// One SubDevice of a list of `xml` was left in it.
    OneOfList,
    /// Nothing, but only what `real_details::compared` has of each line is compared.
    Lines,
    /// Nothing, but the simulated SubDevice also has object 0x1001, which CoE requires.
    NoErrorRegister,
}

use Edit::{Cut, Lines, NoErrorRegister, NoLineEnd, OneBlankLess, OneBlankMore, OneOfList};

/// Parts that differ, by number, and why.
type Differences = &'static [(usize, &'static str)];

struct Sample(&'static str, Edit, Differences);

const FRAMES: &str = "frames and rates of that bus, and cut";

const SAMPLES: &[Sample] = &[
    Sample("T_master_100pct_loss_reference_none.txt", Cut, &[(0, FRAMES)]),
    Sample("T_master_49slaves_dc_operation_ess.txt", Edit::None, &[(0, "frames, rates and clocks of that bus")]),
    Sample("T_pdos_el6900_fsoe_partial.txt", Cut, &[]),
    Sample("T_slave-v_empty_sii_vs_good.txt", Cut, &[(0, "an older version shows one number, where no name is")]),
    Sample("T_slaves-v_el1252_dc64_ebus_ess.txt", Lines, &[]),
    Sample("T_slaves-v_ingenia_alias65535.txt", Lines, &[]),
    Sample("doc_help_domains_config_examples.txt", Edit::None, &[(0, "examples of help texts: ours are others")]),
    Sample("graph_empty_bus.txt", Edit::None, &[]),
    Sample("master_slaves_idle_6slaves_abbreviated.txt", Cut, &[(0, FRAMES)]),
    Sample("pdos_el9227-5500.txt", OneBlankLess, &[]),
    Sample("pdos_ep1918_twinsafe.txt", Edit::None, &[]),
    Sample("pdos_keyence.txt", Edit::None, &[]),
    Sample("pdos_microepsilon_capancdt6200.txt", Edit::None, &[]),
    Sample("pdos_realbus_slave0.txt", Edit::None, &[]),
    Sample("pdos_realbus_slave10.txt", Edit::None, &[]),
    Sample("pdos_realbus_slave9.txt", Edit::None, &[]),
    Sample("sdos_el6688_ptp.txt", NoErrorRegister, &[]),
    Sample("sdos_ep1918_twinsafe.txt", NoErrorRegister, &[]),
    Sample("sdos_realbus_slave10.txt", Edit::None, &[]),
    Sample("slaves-v_20slaves_l7ec_inovance_catio.txt", Lines, &[]),
    Sample("slaves-v_old_format_truncated_ek1101.txt", Cut, &[(0, "a version without the line of the device")]),
    Sample("slaves_23slaves_psi.txt", OneBlankMore, &[]),
    Sample("slaves_alias5555_igh_doc.txt", Edit::None, &[]),
    Sample(
        "slaves_pdos_blank_and_configured_eeprom.md",
        Edit::None,
        &[
            (0, "an older version shows numbers without 0x, where no name is"),
            (2, "its last quotation mark is missing"),
        ],
    ),
    Sample("slaves_pdos_ek1100_el4004_el6224_el3174.txt", Edit::None, &[]),
    Sample("xml_18slaves.xml", Edit::None, &[]),
    Sample("xml_1slave_el1252_tmt.xml", OneOfList, &[]),
    Sample("xml_2slaves_somanet.xml", NoLineEnd, &[]),
    Sample("xml_weidmueller_ur20_igh.xml", Edit::None, &[]),
];

/// A command and what it printed.
struct Part {
    command: Command,
    text: String,
}

/// The command of a line with a prompt.
fn prompted(line: &str) -> Option<Command> {
    let (prompt, words) = line.split_once("ethercat ")?;
    let words = words.split(" | ").next().unwrap_or_default();
    let is_prompt = prompt.is_empty() || ["$ ", "# ", "/bin/"].iter().any(|end| prompt.ends_with(end));
    if is_prompt { Command::of_words(words) } else { None }
}

/// The parts of a file; one without a prompt is one part, whose command its name has.
fn parts(name: &str, text: &str) -> Vec<Part> {
    let mut parts: Vec<Part> = Vec::new();
    let mut is_open = !text.lines().any(|line| prompted(line).is_some());
    if is_open {
        parts.push(Part { command: Command::of_file(name), text: String::new() });
    }
    for line in text.split_inclusive('\n') {
        if let Some(command) = prompted(line.trim_end()) {
            parts.push(Part { command, text: String::new() });
            is_open = true;
        } else if line.starts_with("```") {
            is_open = false;
        } else if let Some(part) = parts.last_mut().filter(|part| is_open && (line != "\n" || !part.text.is_empty())) {
            part.text += line;
        }
    }
    parts
}

/// The text as the tool printed it.
fn restored(text: &str, edit: Edit) -> String {
    let line = |line: &str| match edit {
        OneBlankLess if line.starts_with(' ') => format!(" {line}\n"),
        OneBlankMore => format!("{}\n", line.strip_prefix(' ').unwrap_or(line)),
        _ => format!("{line}\n"),
    };
    match edit {
        Edit::None | Lines => text.to_owned(),
        Cut => text.trim_end().trim_end_matches('.').trim_end().to_owned(),
        OneOfList => {
            let begin = text.find("  <EtherCATInfo>").expect("its begin");
            let end = "  </EtherCATInfo>\n";
            let length = text[begin..].find(end).expect("its end") + end.len();
            text[begin..begin + length].to_owned()
        }
        OneBlankLess | OneBlankMore | NoLineEnd | NoErrorRegister => text.lines().map(line).collect(),
    }
}

/// The lines that differ, in what is compared of them; ours begin with the first SubDevice that is shown.
fn different_lines(wanted: &str, got: &str) -> Option<String> {
    let begin = got.find(wanted.lines().next().unwrap_or_default()).unwrap_or(0);
    let (wanted, got): (Vec<&str>, Vec<&str>) = (wanted.lines().collect(), got[begin..].lines().collect());
    let differs = |(wanted, got): &(&&str, &&str)| match compared(wanted) {
        (begin, Some(_)) => !got.starts_with(begin),
        (whole, None) => **got != whole,
    };
    let lines: Vec<String> =
        wanted.iter().zip(&got).filter(differs).map(|(wanted, got)| format!("{got:?} for {wanted:?}")).collect();
    let is_same = lines.is_empty() && wanted.len() == got.len();
    (!is_same).then(|| format!("{} lines for {}: {}", got.len(), wanted.len(), lines.join(", ")))
}

/// Whether the tool prints it.
fn is_printed(wanted: &str, got: &str, edit: Edit) -> bool {
    match edit {
        Cut => got.starts_with(wanted),
        OneOfList => got.contains(wanted),
        NoErrorRegister => {
            let others = got.split_inclusive('\n').filter(|line| !line.contains("0x1001"));
            others.collect::<String>() == wanted
        }
        Edit::None | Lines | NoLineEnd | OneBlankLess | OneBlankMore => got == wanted,
    }
}

/// What the tool prints differently; nothing if it is the same.
fn difference(part: &Part, edit: Edit) -> Option<String> {
    let wanted = restored(&part.text, edit);
    let directory = directory();
    let segment = bus(part.command, &wanted, &directory);
    let bench = Bench::start_in(directory, vec![segment]);
    let is_in_op =
        part.command == Command::Slaves && wanted.contains("  OP  ") || edit == Lines && wanted.contains("State: OP\n");
    if is_in_op {
        bench.good(&["states", "OP"]);
        bench.wait_until("OP", || bench.good(&["slaves"]).contains("  OP  "));
    }
    let got = bench.good(part.command.words());
    if edit == Lines {
        return different_lines(&wanted, &got);
    }
    let is_same = is_printed(&wanted, &got, edit);
    let line = got.lines().zip(wanted.lines()).find(|(got, wanted)| got != wanted);
    let (ours, theirs) = line.unwrap_or_default();
    let lines = [got.lines().count(), wanted.lines().count()];
    (!is_same).then(|| format!("{:?} prints {lines:?} lines, first {ours:?} for {theirs:?}", part.command.words()))
}

fn compare(place: &Path, Sample(name, edit, differences): &Sample) -> Vec<String> {
    let bytes = fs::read(place.join(name)).expect(name);
    let parts = parts(name, &String::from_utf8_lossy(&bytes));
    let mut wrong: Vec<String> = Vec::new();
    for (number, part) in parts.iter().enumerate() {
        let reason = differences.iter().find(|(at, _)| *at == number).map(|(_, reason)| *reason);
        match (difference(part, *edit), reason) {
            (Some(difference), None) => wrong.push(format!("{name} {number}: {difference}")),
            (None, Some(reason)) => wrong.push(format!("{name} {number} is the same, but listed: {reason}")),
            (Some(_), Some(_)) | (None, None) => {}
        }
    }
    if let Some((number, _)) = differences.iter().find(|(number, _)| *number >= parts.len()) {
        wrong.push(format!("{name} has no part {number}"));
    }
    wrong
}

// covers: daemon
#[test]
fn outputs_of_real_buses_are_printed_byte_for_byte() {
    let place = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(PLACE);
    if !place.is_dir() {
        return println!("skipped: no {PLACE}");
    }
    let name = |entry: fs::DirEntry| entry.file_name().to_string_lossy().into_owned();
    let there: BTreeSet<String> = fs::read_dir(&place).expect("a directory").flatten().map(name).collect();
    let listed: BTreeSet<String> = SAMPLES.iter().map(|sample| sample.0.to_owned()).collect();
    assert_eq!(there, listed, "files and their samples here");
    let wrong: Vec<String> = SAMPLES.iter().flat_map(|sample| compare(&place, sample)).collect();
    assert!(wrong.is_empty(), "{}:\n{}", wrong.len(), wrong.join("\n"));
}
