//! Order and number of the elements in written files (protocol 8.1, ES-113). The same check is applied to files
//! of TwinCAT and EC-Engineer, if they are there: it is not narrower than what these tools write.

use std::path::Path;

use ringcat_config::{ExportOptions, LrwUse};
use roxmltree::Node;

use crate::{CELL, SMALL, again, network, round_trips};

const ECAT: &str = "Transition* BeforeSlave? Comment? Requires? Cmd Adp? Ado? Addr? Data? DataLength? Cnt? Retries? \
                    Validate? Timeout?";
const PDO: &str = "Index Name+ Exclude* Entry*";
const SYNC_MANAGER: &str =
    "Type MinSize? MaxSize? DefaultSize? StartAddress ControlByte Enable Virtual? Watchdog? Pdo*";
const RAW: &str = "Transition+ Comment? Timeout Data Disabled?";

/// Elements by the end of their path, and their children in their order.
const SEQUENCES: &[(&str, &str)] = &[
    ("EtherCATConfig", "Config"),
    ("Config", "Master Slave* Cyclic* ProcessImage?"),
    ("Config/Master", "Info MailboxStates? EoE? InitCmds?"),
    ("Master/Info", "Name Destination Source EtherType?"),
    ("Master/MailboxStates", "StartAddr Count"),
    ("Master/EoE", "MaxPorts MaxFrames MaxMACs"),
    ("Slave", "Info ProcessData? Mailbox? InitCmds? PreviousPort* HotConnect? DC?"),
    ("Slave/Info", "Name PhysAddr? AutoIncAddr? Physics? VendorId ProductCode RevisionNo SerialNo ProductRevision?"),
    (
        "ProcessData",
        "Send* Recv* Sm0? Sm1? Sm2? Sm3? Sm4? Sm5? Sm6? Sm7? Sm8? Sm9? Sm10? Sm11? Sm12? Sm13? Sm14? Sm15? \
         RxPdo|TxPdo*",
    ),
    ("ProcessData/Send", "BitStart BitLength"),
    ("ProcessData/Recv", "BitStart BitLength"),
    ("RxPdo", PDO),
    ("TxPdo", PDO),
    ("Entry", "Index SubIndex? BitLen Name* Comment? DataType?"),
    ("Slave/Mailbox", "Send Recv BootStrap? Protocol* CoE? SoE? AoE? EoE? FoE? VoE?"),
    ("Mailbox/Send", "Start Length ShortSend?"),
    ("Mailbox/Recv", "Start Length PollTime? StatusBitAddr?"),
    ("Mailbox/BootStrap", "Send Recv"),
    ("BootStrap/Send", "Start Length"),
    ("BootStrap/Recv", "Start Length"),
    ("Mailbox/CoE", "InitCmds? Profile?"),
    ("CoE/Profile", "ChannelInfo+"),
    ("ChannelInfo", "ProfileNo AddInfo? DisplayName*"),
    ("Mailbox/SoE", "InitCmds?"),
    ("Mailbox/AoE", "InitCmds? NetId?"),
    ("Mailbox/EoE", "InitCmds?"),
    ("Mailbox/FoE", "InitCmds?"),
    ("Mailbox/VoE", "InitCmds?"),
    ("InitCmds", "InitCmd*"),
    ("CoE/InitCmds/InitCmd", "Transition+ Comment? Timeout Ccs Index SubIndex Data? Disabled?"),
    ("SoE/InitCmds/InitCmd", "Transition+ Comment? Timeout OpCode DriveNo IDN Elements Attribute Data? Disabled?"),
    ("AoE/InitCmds/InitCmd", RAW),
    ("EoE/InitCmds/InitCmd", RAW),
    ("FoE/InitCmds/InitCmd", RAW),
    ("VoE/InitCmds/InitCmd", RAW),
    ("InitCmd", ECAT),
    ("IdentifyCmd", ECAT),
    ("Validate", "Data DataMask? Timeout"),
    ("PreviousPort", "DeviceId? Port PhysAddr?"),
    ("HotConnect", "GroupName? GroupMemberCnt IdentifyCmd+"),
    ("DC", "PotentialReferenceClock? ReferenceClock CycleTime0 CycleTime1 ShiftTime"),
    ("Cyclic", "Comment? CycleTime? Priority? TaskId? Frame+"),
    ("Frame", "Comment? Cmd+"),
    ("Frame/Cmd", "State+ Comment? Cmd Adp? Ado? Addr? Data? DataLength? Cnt? InputOffs OutputOffs CopyInfos?"),
    ("CopyInfos", "CopyInfo+"),
    ("CopyInfo", "SrcBitOffs DstBitOffs BitSize"),
    ("ProcessImage", "Inputs? Outputs?"),
    ("Inputs", "ByteSize Variable*"),
    ("Outputs", "ByteSize Variable*"),
    ("Variable", "Name Comment? DataType? BitSize BitOffs"),
];

/// The sequence of an element: that with the longest matching path.
fn sequence(node: Node<'_, '_>) -> Option<&'static str> {
    let path: Vec<&str> = node.ancestors().filter(|it| it.is_element()).map(|it| it.tag_name().name()).collect();
    let matches = |of: &&(&str, &str)| of.0.split('/').rev().enumerate().all(|(at, name)| path.get(at) == Some(&name));
    let found = SEQUENCES.iter().filter(matches).max_by_key(|(of, _)| of.split('/').count());
    match found {
        Some((_, sequence)) => Some(sequence),
        None if path.first().is_some_and(|name| name.starts_with("Sm")) => Some(SYNC_MANAGER),
        None => None,
    }
}

/// What is wrong with the children of an element.
fn fault(node: Node<'_, '_>) -> Option<String> {
    let names: Vec<&str> = node.children().filter(Node::is_element).map(|it| it.tag_name().name()).collect();
    let Some(sequence) = sequence(node) else {
        return (!names.is_empty()).then(|| format!("{} has no children", node.tag_name().name()));
    };
    let mut rest = names.as_slice();
    for part in sequence.split(' ') {
        let (name, most, least) = match part.split_at(part.len() - 1) {
            (name, "?") => (name, 1, 0),
            (name, "*") => (name, usize::MAX, 0),
            (name, "+") => (name, usize::MAX, 1),
            _ => (part, 1, 1),
        };
        let is_it = |it: &&&str| name.split('|').any(|name| name == **it);
        let count = rest.iter().take_while(is_it).take(most).count();
        if count < least {
            return Some(format!("{}: {name} is missing in {names:?}", node.tag_name().name()));
        }
        rest = &rest[count..];
    }
    (!rest.is_empty()).then(|| format!("{}: {rest:?} behind its sequence in {names:?}", node.tag_name().name()))
}

/// Everything that is wrong in a file.
fn faults(text: &str) -> Vec<String> {
    let document = roxmltree::Document::parse(text).unwrap_or_else(|error| panic!("{error}"));
    document.descendants().filter(Node::is_element).filter_map(fault).collect()
}

// covers: ES-112, ES-113, eni-run
#[test]
fn exported_files_have_the_elements_of_the_format_in_their_order() {
    for lrw in [LrwUse::AsDeclared, LrwUse::Always, LrwUse::Never] {
        let mut options = ExportOptions::default();
        options.lrw = lrw;
        let of_network = network(CELL).to_eni(&options).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(faults(&of_network.text), Vec::<String>::new(), "{lrw:?}");
        for (name, text) in round_trips::files() {
            let of_eni = again(&text, &options).unwrap_or_else(|error| panic!("{name}: {error}"));
            // A sample that leaves its mailboxes to the EEPROM has an export that does so too.
            let leaves_mailboxes = name == "synthetic_soem_sample.xml";
            let is_known = |fault: &String| leaves_mailboxes && fault.starts_with("Mailbox: Send is missing in ");
            let faults: Vec<String> = faults(&of_eni.text).into_iter().filter(|fault| !is_known(fault)).collect();
            assert_eq!(faults, Vec::<String>::new(), "{name}: {lrw:?}");
        }
    }
}

/// Files of tools pass the same check, but for what they are known to break (ES-112).
// covers: ES-112
#[test]
fn files_of_tools_have_the_same_elements_in_the_same_order() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/eni");
    let Ok(entries) = std::fs::read_dir(&folder) else {
        println!("skipped: {} is not there", folder.display());
        return;
    };
    let is_of_tool = |name: &str| name.starts_with("rocos") || name.starts_with("twincat");
    for entry in entries.flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        if !is_of_tool(&name) {
            continue;
        }
        let bytes = std::fs::read(entry.path()).expect("it can be read");
        let text: String = match String::from_utf8(bytes) {
            Ok(text) => text,
            Err(latin) => latin.as_bytes().iter().map(|byte| char::from(*byte)).collect(),
        };
        let found = faults(text.trim_start_matches('\u{feff}'));
        assert_eq!(found, Vec::<String>::new(), "{name}");
    }
}

// covers: ES-113
#[test]
fn a_missing_and_a_misplaced_element_are_found() {
    let text = again(SMALL, &ExportOptions::default()).unwrap_or_else(|error| panic!("{error}")).text;
    let without = text.replacen("<InputOffs>", "<Other>", 1).replacen("</InputOffs>", "</Other>", 1);
    assert!(faults(&without).iter().any(|fault| fault.contains("InputOffs is missing")));
    let swapped = text.replacen("<Name>", "<Name/><Name>", 1);
    assert!(!faults(&swapped).is_empty());
}

/// Both images have room for each command, and the process data is not in the room of others.
// covers: ES-128, eni-run
#[test]
fn each_cyclic_command_has_a_place_of_its_own_in_both_images() {
    let text = network(CELL).to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}")).text;
    let document = roxmltree::Document::parse(&text).expect("it is XML");
    let number = |node: Node<'_, '_>, name: &str| -> usize {
        let child = node.children().find(|it| it.has_tag_name(name)).unwrap_or_else(|| panic!("{name}"));
        child.text().expect("a number").parse().expect("a number")
    };
    let sizes: Vec<usize> = ["Inputs", "Outputs"]
        .map(|name| number(document.descendants().find(|it| it.has_tag_name(name)).expect(name), "ByteSize"))
        .to_vec();
    assert_eq!(sizes[0], sizes[1]);
    let frames = document.descendants().filter(|it| it.has_tag_name("Frame"));
    let mut service = Vec::new();
    let mut data_end = 0;
    for command in frames.flat_map(|frame| frame.children().filter(|it| it.has_tag_name("Cmd"))) {
        let begin = number(command, "InputOffs");
        assert_eq!(begin, number(command, "OutputOffs"));
        let data = command.children().find(|it| it.has_tag_name("Data")).and_then(|it| it.text()).expect("data");
        let end = begin + data.len() / 2;
        assert!(end <= sizes[0], "{end} of {sizes:?}");
        match command.children().any(|it| it.has_tag_name("Addr")) {
            true => data_end = data_end.max(end),
            false => service.push((begin, end)),
        }
    }
    assert!(service.len() >= 2 && service.is_sorted(), "{service:?}");
    assert!(service[0].0 >= data_end && service.windows(2).all(|pair| pair[0].1 <= pair[1].0), "{service:?}");
}
