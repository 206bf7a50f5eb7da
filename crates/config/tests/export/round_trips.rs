//! ENI, declaration, ENI, declaration: the same.

use std::fs;
use std::path::Path;

use ringcat_config::network::Bytes;
use ringcat_config::network::model::{At, Startup, WriteFile};
use ringcat_config::{Configuration, ExportOptions, LrwUse, eni, follow};
use ringcat_engine::config::{FileRead, FileWrite, StartupAction, SubDeviceConfig};
use ringcat_wire::al::AlState;

use crate::{CELL, SMALL, again, configured, model, network};

/// A RingCAT example: packed outputs, a copy, a drive with its own mapping and SYNC0, one LRW for all.
const MACHINE: &str = include_str!("../../../ringcat/examples/machine.eni.xml");

const STATES: [AlState; 5] = [AlState::Init, AlState::PreOp, AlState::Boot, AlState::SafeOp, AlState::Op];

/// The example, the test file, and the real files, if they are there.
pub fn files() -> Vec<(String, String)> {
    let mut files = vec![("small".to_owned(), SMALL.to_owned()), ("machine".to_owned(), MACHINE.to_owned())];
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/eni");
    let Ok(entries) = fs::read_dir(&path) else {
        println!("skipped: {} is not there", path.display());
        return files;
    };
    for entry in entries.map(|entry| entry.unwrap().path()) {
        let name = entry.file_name().unwrap().to_string_lossy().into_owned();
        if !name.starts_with("beremiz") {
            let bytes = fs::read(&entry).unwrap();
            files.push((name, bytes.iter().map(|byte| char::from(*byte)).collect()));
        }
    }
    files
}

/// A model without its places, unknown elements and schema.
fn bare(text: &str) -> String {
    let mut eni = model(text);
    (eni.unknown, eni.more_unknown, eni.version) = (Vec::new(), 0, None);
    let shown = format!("{eni:?}");
    let mut parts = shown.split("Place { line: ");
    let first = parts.next().unwrap().to_owned();
    parts.fold(first, |all, part| all + part.split_once(" }").expect("a column").1)
}

/// What the file states of a SubDevice, in an order that does not depend on the file.
fn settings(config: &SubDeviceConfig) -> String {
    let mut config = config.clone();
    config.startup.sort_by_key(|command| command.transition as u8);
    let limits = STATES.map(|from| STATES.map(|to| config.limit(from, to)));
    config.state_timeouts.clear();
    format!("{config:#?} {limits:?}")
}

/// The same with the length of the exported images: both have the longer one, and room for time and states.
fn with_room(expected: &Configuration, got: &Configuration) -> Configuration {
    /// A time that sets the reference clock, one that is distributed, the states.
    const SERVICE: usize = 4 + 4 + 2;
    let mut expected = expected.clone();
    let (bytes, longest) = (got.image.inputs_len, expected.image.inputs_len.max(expected.image.outputs_len));
    if !got.declaration.domains.is_empty() || expected.cycle.is_some() || expected.declaration.clocks.is_some() {
        assert!((longest..=longest + SERVICE).contains(&bytes), "{bytes} for {longest}");
        (expected.image.inputs_len, expected.image.outputs_len) = (bytes, bytes);
    }
    expected
}

fn assert_same(name: &str, expected: &Configuration, got: &Configuration) {
    for (expected, got) in expected.declaration.subdevices.iter().zip(&got.declaration.subdevices) {
        assert_eq!(settings(expected), settings(got), "{name}");
    }
    assert_eq!(expected.subdevices.len(), got.subdevices.len(), "{name}");
    for (expected, got) in expected.subdevices.iter().zip(&got.subdevices) {
        assert_eq!((&expected.name, expected.plugged_into), (&got.name, got.plugged_into), "{name}");
        // 0 is no address.
        assert!(expected.station.is_none_or(|it| it == 0 || Some(it) == got.station), "{name}");
    }
    let domains = |of: &Configuration| format!("{:?}", of.declaration.domains);
    assert_eq!(domains(expected), domains(got), "{name}");
    assert_eq!(expected.declaration.clocks, got.declaration.clocks, "{name}");
    assert_eq!((&expected.groups, expected.cycle), (&got.groups, got.cycle), "{name}");
    assert_eq!(expected.image, got.image, "{name}");
    let lrw = |of: &Configuration| !of.declaration.explicit_lrw.is_empty();
    assert_eq!(lrw(expected), lrw(got), "{name}");
}

// covers: eni-run
#[test]
fn the_model_of_every_file_is_the_same_when_it_is_written_and_read() {
    for (name, text) in files() {
        let written = eni::write(&model(&text));
        let (got, expected) = (bare(&written), bare(&text));
        let at = got.bytes().zip(expected.bytes()).take_while(|(got, expected)| got == expected).count();
        let near = |text: &str| text.chars().skip(at.saturating_sub(200)).take(400).collect::<String>();
        assert!(got == expected, "{name}: {} instead of {}", near(&got), near(&expected));
    }
}

// covers: ES-142, eni-run
#[test]
fn every_eni_gives_the_same_declaration_when_it_is_exported_and_read() {
    for (name, text) in files() {
        let export = again(&text, &ExportOptions::default()).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_same(&name, &with_room(&configured(&text), &export.configuration), &export.configuration);
        assert_same(&name, &export.configuration, &configured(&export.text));
        let second = again(&export.text, &ExportOptions::default()).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(second.text, export.text, "{name}: the second export is the first one");
        assert_eq!(second.left_out, [], "{name}");
    }
}

// covers: eni-run
#[test]
fn an_eni_is_exported_with_lrw_and_without_it() {
    for (name, text) in files() {
        let before = configured(&text);
        let without = again(&text, &ExportOptions::default().with_lrw(LrwUse::Never)).unwrap();
        assert_eq!(without.configuration.declaration.explicit_lrw, [], "{name}");
        assert_eq!(without.configuration.image, with_room(&before, &without.configuration).image, "{name}");
        let with = again(&text, &ExportOptions::default().with_lrw(LrwUse::Always)).unwrap();
        let has_data = before.image.areas.iter().any(|area| area.sync_manager.is_some());
        assert_eq!(with.configuration.declaration.explicit_lrw.is_empty(), !has_data, "{name}");
        let commands = |text: &str, code: u8| text.matches(&format!("<Cmd>{code}</Cmd>")).count();
        assert_eq!((commands(&with.text, 10), commands(&with.text, 11)), (0, 0), "{name}: no LRD, no LWR");
        assert_eq!(commands(&without.text, 12), 0, "{name}: no LRW");
    }
}

/// The text with another number at each place where it has one.
fn mutants(text: &str) -> impl Iterator<Item = String> + '_ {
    let ends = text.match_indices("</").map(|(at, _)| at);
    let numbers = ends.filter_map(|end| {
        let begin = text[..end].rfind('>')? + 1;
        let number = &text[begin..end];
        (!number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit())).then_some((begin, end))
    });
    numbers.flat_map(move |(begin, end)| {
        let values = ["0", "1", "7", "0200", "65535", "4294967295"];
        values.into_iter().map(move |value| format!("{}{value}{}", &text[..begin], &text[end..]))
    })
}

// covers: eni-run
#[test]
fn a_changed_number_gives_the_same_declaration_again_or_a_refusal() {
    let (mut same, mut refused) = (0, 0);
    // A part of them: all take minutes without optimization.
    for text in mutants(SMALL).step_by(5) {
        let Ok(configuration) = eni::read(text.as_bytes()).and_then(|eni| follow(&eni)) else { continue };
        match again(&text, &ExportOptions::default()) {
            Ok(export) => {
                assert_same(&text, &with_room(&configuration, &export.configuration), &export.configuration);
                same += 1;
            }
            Err(error) => {
                assert!(!error.reason.is_empty() && !error.what.is_empty(), "{error}");
                refused += 1;
            }
        }
    }
    assert!(same > 100 && refused < same / 4, "{same} are the same, {refused} are refused");
}

/// Commands at all transitions, of all protocols.
// covers: 8.2, eni-run
#[test]
fn commands_at_all_transitions_and_messages_keep_their_place_when_exported() {
    let names = ["IP", "PP", "PS", "SS", "SO", "OS", "SP", "PI", "SI", "OI", "IB", "BI"];
    let all: String = names.iter().map(|name| format!("<Transition>{name}</Transition>")).collect();
    let ams = "050607080301e803050607080301008004000400000000000000000034120000";
    let register = format!(
        "<InitCmd><Transition>II</Transition>{all}<Comment>own</Comment><Cmd>5</Cmd><Adp>1004</Adp><Ado>3968</Ado>\
         <Data>01</Data></InitCmd>"
    );
    let message = |protocol: &str, data: &str| {
        let command = format!("<InitCmd>{all}<Timeout>5</Timeout><Data>{data}</Data></InitCmd>");
        format!("<{protocol}><InitCmds>{command}</InitCmds></{protocol}>")
    };
    let read = format!("<InitCmd>{all}<OpCode>2</OpCode><IDN>9</IDN><Elements>72</Elements></InitCmd>");
    let (head, rest) = SMALL.split_at(SMALL.find("<SoE><InitCmds>").expect("it is there"));
    let soe = rest.replacen("<SoE><InitCmds>", &format!("<SoE><InitCmds>{read}"), 1);
    let messages = message("AoE", ams) + &message("VoE", "470c00000700aa");
    let text = head.to_owned() + &soe.replacen("<AoE><NetId>5.6.7.8.3.1</NetId></AoE>", &messages, 1);
    let at = "<InitCmd><Transition>PS</Transition><Comment>set sm 2 and 3</Comment>";
    let text = text.replacen(at, &format!("{register}{at}"), 1);
    let expected = configured(&text);
    let export = again(&text, &ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    assert_same("all", &with_room(&expected, &export.configuration), &export.configuration);
    let count = export.configuration.declaration.subdevices[3].startup.len();
    assert_eq!(count, expected.declaration.subdevices[3].startup.len());
    assert!(count > 13 + 3 * 12, "{count}");
}

/// Files of no, some and several full packets.
// covers: 6.4, 8.2, eni-run
#[test]
fn transfers_of_files_keep_their_contents_when_exported() {
    let command = |data: &[u8]| {
        let data: String = data.iter().map(|byte| format!("{byte:02x}")).collect();
        format!("<InitCmd><Transition>PS</Transition><Timeout>5</Timeout><Data>{data}</Data></InitCmd>")
    };
    let packet = |number: u32, data: &[u8]| command(&[&[3, 0][..], &number.to_le_bytes(), data].concat());
    let file = |contents: &[u8]| {
        let packets = (1..).zip(contents.chunks(50)).map(|(number, data)| packet(number, data));
        let packets: String = if contents.is_empty() { packet(1, &[]) } else { packets.collect() };
        command(b"\x02\0\x04\x03\x02\x01gains") + &packets
    };
    for length in [0, 1, 40, 115, 116, 117, 232, 1000] {
        let contents: Vec<u8> = (0..length).map(|byte| byte as u8).collect();
        let commands = file(&contents) + &command(b"\x01\0\0\0\0\0log");
        let files = format!("<FoE><InitCmds>{commands}</InitCmds></FoE>");
        let text = SMALL.replacen("<AoE><NetId>5.6.7.8.3.1</NetId></AoE>", &files, 1);
        let expected = configured(&text);
        let export = again(&text, &ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
        assert_same(&length.to_string(), &with_room(&expected, &export.configuration), &export.configuration);
        let startup = &export.configuration.declaration.subdevices[3].startup;
        let kept = startup.iter().find_map(|command| match &command.action {
            StartupAction::FileWrite(write) => Some(write),
            _ => None,
        });
        assert_eq!(kept, Some(&FileWrite::new("gains", contents).with_password(0x0102_0304)));
        assert!(startup.iter().any(|command| command.action == StartupAction::FileRead(FileRead::new("log"))));
    }
}

/// In BOOT the mailbox has another size.
// covers: 6.4, 8.2, eni-run
#[test]
fn packets_of_a_file_are_as_large_as_the_mailbox_of_their_state_takes() {
    let mut file = network(CELL);
    let write = |at, name: &str| {
        let write_file = Some(WriteFile { name: name.to_owned(), password: 0, data: Bytes(vec![7; 1000]) });
        Startup { at, write_file, ..Startup::default() }
    };
    file.subdevice[1].startup.push(write(At::Ib, "firmware"));
    file.subdevice[1].startup.push(write(At::Ps, "gains"));
    file.subdevice[1].mailbox.as_mut().expect("mailboxes").boot_write.as_mut().expect("one of BOOT").length = 64;
    let export = file.to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    let mailbox = model(&export.text).subdevices[1].mailbox.clone().expect("a mailbox");
    let longest = |of: ringcat_config::eni::Transition| {
        let all = mailbox.others.iter().filter(|it| it.protocol == "FoE" && it.transitions == [of]);
        all.map(|it| it.data.len()).max()
    };
    assert_eq!(longest(ringcat_config::eni::Transition::Ib), Some(64 - 6));
    assert_eq!(longest(ringcat_config::eni::Transition::Ps), Some(128 - 6));
}
