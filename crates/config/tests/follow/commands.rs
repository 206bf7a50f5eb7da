//! Commands of a SubDevice: parts of the declaration, commands that are sent, commands that are not sent.

use std::net::Ipv4Addr;
use std::time::Duration;

use ringcat_engine::config::{
    IdnWrite, IpSettings, RegisterAccess, RegisterCommand, SdoDownload, SdoUpload, StartupAction, SubDeviceConfig,
    SyncManagerRole, SyncSignals, Transition,
};
use ringcat_wire::address::RegisterAddress;
use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::soe::Idn;

use crate::{SMALL, changed, configured, has_notice};

fn drive(configuration: &ringcat_config::Configuration) -> SubDeviceConfig {
    configuration.declaration.subdevices[3].clone()
}

/// Register commands, with their transitions.
fn registers(config: &SubDeviceConfig) -> Vec<(Transition, RegisterCommand)> {
    let register = |action: &StartupAction| match action {
        StartupAction::Register(command) => Some(command.clone()),
        _ => None,
    };
    config.startup.iter().filter_map(|command| Some((command.transition, register(&command.action)?))).collect()
}

// covers: 8.2, eni-image
#[test]
fn standard_commands_become_part_of_the_declaration() {
    let configuration = configured(SMALL);
    let drive = drive(&configuration);
    assert_eq!(drive.watchdog_divider, Some(0x09C2));
    assert_eq!(drive.pdi_watchdog_intervals, Some(1000));
    assert_eq!(drive.watchdog_intervals, Some(10_000));
    assert!(!drive.sii_to_pdi, "the MainDevice takes the EEPROM back");
    assert_eq!(drive.limit(AlState::Init, AlState::PreOp), Duration::from_secs(7));
    assert!(configuration.declaration.subdevices[0].startup.is_empty(), "no other commands for the coupler");
    assert_eq!(configuration.declaration.subdevices[0].declared, Some(Vec::new()));
}

// covers: 8.2, eni-image
#[test]
fn only_what_the_commands_compare_is_expected() {
    let configuration = configured(SMALL);
    let coupler = configuration.declaration.subdevices[0].expected;
    assert_eq!((coupler.vendor_id, coupler.product_code, coupler.revision), (Some(2), None, None));
    let terminal = configuration.declaration.subdevices[1].expected;
    assert_eq!(terminal, ringcat_engine::config::Expected::default(), "nothing is compared, nothing is expected");
}

// covers: ES-121, eni-image
#[test]
fn a_single_word_of_the_revision_is_a_rule_of_the_declaration() {
    let revision = |text: &str| format!("<Data>0001{text}000000</Data>");
    let check = ("<Data>02000000</Data>", "<Data>0300</Data>");
    let read = |word: &str| {
        let lookup = revision(word);
        let configuration = changed(&[("<Data>000108000000</Data>", lookup.as_str()), check]);
        let coupler = configuration.declaration.subdevices[0].clone();
        assert!(registers(&coupler).is_empty(), "the engine compares it");
        (coupler.expected.revision, coupler.expected.revision_mask)
    };
    assert_eq!(read("0c"), (Some(0x0012_0003), 0xFFFF), "the upper word is the one of Info");
    assert_eq!(read("0d"), (Some(0x0003_0000), 0xFFFF_0000));
    let whole = changed(&[("<Data>000108000000</Data>", revision("0c").as_str())]);
    let expected = whole.declaration.subdevices[0].expected;
    assert_eq!((expected.revision, expected.revision_mask), (Some(2), u32::MAX));
    assert!(registers(&whole.declaration.subdevices[0]).is_empty());
}

// covers: ES-121, eni-image
#[test]
fn both_words_of_a_revision_are_the_whole_one_and_masked_words_are_sent() {
    let lookup = "<Data>00010d000000</Data><Cnt>1</Cnt></InitCmd><InitCmd><Transition>IP</Transition>\
                  <Comment>check high word</Comment><Cmd>1</Cmd><Adp>0</Adp><Ado>1288</Ado><Data>0000</Data>\
                  <Cnt>1</Cnt><Validate><Data>0200</Data><Timeout>100</Timeout></Validate></InitCmd><InitCmd>\
                  <Transition>IP</Transition><Comment>look up low word</Comment><Cmd>2</Cmd><Adp>0</Adp>\
                  <Ado>1282</Ado><Data>00010c000000</Data>";
    let read = |low: &str| {
        let changes = [("<Data>000108000000</Data>", lookup), ("<Data>02000000</Data>", low)];
        changed(&changes).declaration.subdevices[0].clone()
    };
    let coupler = read("<Data>0500</Data>");
    assert_eq!((coupler.expected.revision, coupler.expected.revision_mask), (Some(0x0002_0005), u32::MAX));
    assert!(registers(&coupler).is_empty());
    let coupler = read("<Data>0500</Data><DataMask>0f00</DataMask>");
    assert_eq!((coupler.expected.revision, coupler.expected.revision_mask), (Some(0x0002_0000), 0xFFFF_0000));
    assert_eq!(registers(&coupler).len(), 2, "the address and the masked comparison");
}

// covers: 8.2, eni-image
#[test]
fn another_word_of_the_eeprom_is_compared_as_in_the_file() {
    let lookup = ("<Data>000108000000</Data>", "<Data>000104000000</Data>");
    for (check, bytes) in [("<Data>0000</Data>", vec![0, 0]), ("<Data>00</Data>", vec![0])] {
        let configuration = changed(&[lookup, ("<Data>02000000</Data>", check)]);
        let coupler = &configuration.declaration.subdevices[0];
        assert_eq!((coupler.expected.revision, coupler.expected.revision_mask), (None, u32::MAX));
        let commands = registers(coupler);
        assert_eq!(commands.len(), 2, "the address, then the comparison");
        assert_eq!(commands[0].1.address, RegisterAddress(0x0502));
        assert_eq!(commands[0].1.access, RegisterAccess::Write(vec![0x00, 0x01, 0x04, 0, 0, 0]));
        let limit = Duration::from_millis(100);
        assert_eq!(commands[1].1.access, RegisterAccess::Check { data: bytes, mask: None, limit });
    }
}

// covers: 3.11, eni-image
#[test]
fn sync_managers_result_from_all_writes_whatever_their_sizes() {
    let drive = drive(&configured(SMALL));
    let declared = drive.declared.expect("the file declares them");
    let found: Vec<_> = declared.iter().map(|sm| (sm.index, sm.role, sm.register.start, sm.register.length)).collect();
    let expected = [
        (0, SyncManagerRole::MailboxOut, 0x1000, 128),
        (1, SyncManagerRole::MailboxIn, 0x1080, 128),
        (2, SyncManagerRole::Outputs, 0x1100, 6),
        (3, SyncManagerRole::Inputs, 0x1180, 6),
    ];
    assert_eq!(found, expected);
    assert_eq!(declared[2].register.control.bits(), 0x64);
    assert!(declared.iter().all(|sm| sm.register.activate.enable));
    let entries: Vec<_> =
        declared[3].pdos[0].entries.iter().flatten().map(|entry| (entry.index, entry.bit_length)).collect();
    assert_eq!(entries, [(0x6041, 16), (0x6064, 32)]);
    let split = "<Data>001106006400</Data></InitCmd><InitCmd><Transition>PS</Transition><Cmd>5</Cmd><Adp>1004</Adp>\
                 <Ado>2070</Ado><Data>01008011060020000100</Data>";
    let in_pieces = changed(&[("<Data>00110600640001008011060020000100</Data>", split)]);
    assert_eq!(in_pieces.declaration.subdevices[3].declared.as_ref(), Some(&declared));
    let [out, back] = drive.declared_bootstrap.expect("BootStrap declares them");
    assert_eq!((out.register.start, out.register.length, out.register.control.bits()), (4096, 256, 0x26));
    assert_eq!((back.register.start, back.register.length, back.register.control.bits()), (4352, 256, 0x22));
}

// covers: eni-image
#[test]
fn a_sync_manager_activated_at_so_is_active_in_op_only() {
    let op_only = |configuration: &ringcat_config::Configuration, subdevice: usize| {
        configuration.declaration.subdevices[subdevice].declared.as_ref().unwrap()[0].op_only
    };
    let configuration = configured(SMALL);
    assert!(op_only(&configuration, 1), "left: at SO");
    assert!(!op_only(&configuration, 2), "right: at PS");
    let other = "<InitCmd><Transition>SO</Transition><Comment>set sm 0 of left</Comment>";
    let both = "<InitCmd><Transition>PS</Transition><Cmd>5</Cmd><Adp>1002</Adp><Ado>2048</Ado>\
        <Data>000f010004000100</Data></InitCmd>";
    let changed = changed(&[(other, &format!("{both}{other}"))]);
    assert!(!op_only(&changed, 1), "active in SAFEOP");
    assert!(has_notice(&changed, &["SyncManager 0 at SO", "set before SAFEOP"]));
}

// covers: eni-image
#[test]
fn long_entries_are_split_and_pdos_that_do_not_fit_have_no_positions() {
    let entry = "<Entry><Index>#x6064</Index><SubIndex>0</SubIndex><BitLen>32</BitLen></Entry>";
    let array = "<Entry><Index>#x2000</Index><SubIndex>1</SubIndex><BitLen>800</BitLen>\
        <DataType>ARRAY [0..99] OF BYTE</DataType></Entry>";
    let lengths = ("<Data>00110600640001008011060020000100</Data>", "<Data>00110600640001008011660020000100</Data>");
    let fmmu = ("<Data>00000010060000078011000101000000</Data>", "<Data>00000010660000078011000101000000</Data>");
    let place = ("<BitStart>0</BitStart><BitLength>48</BitLength>", "<BitStart>0</BitStart><BitLength>816</BitLength>");
    let datagram = ("<Addr>268435456</Addr><DataLength>6<", "<Addr>268435456</Addr><DataLength>102<");
    let room = ("<ByteSize>8</ByteSize>", "<ByteSize>102</ByteSize>");
    let configuration = changed(&[(entry, array), lengths, fmmu, place, datagram, room]);
    let declared = drive(&configuration).declared.unwrap();
    let bits: Vec<_> = declared[3].pdos[0].entries.iter().flatten().map(|e| (e.index, e.bit_length)).collect();
    assert_eq!(bits, [(0x6041, 16), (0x2000, 248), (0, 248), (0, 248), (0, 56)]);
    let too_long = changed(&[(entry, array)]);
    assert!(drive(&too_long).declared.unwrap()[3].pdos.is_empty());
    assert!(has_notice(&too_long, &["PDOs of SyncManager 3", "816 bits, more than its 48"]));
}

// covers: 7.3, eni-image
#[test]
fn sync_signals_result_from_the_registers_and_the_shift_from_the_element() {
    let configuration = configured(SMALL);
    let expected = SyncSignals::sync0(1_000_000, -20_000).with_assign_activate(0x0700).with_sync1(1_000_000, 250_000);
    assert_eq!(drive(&configuration).sync, Some(expected));
    assert_eq!(expected.sync1_register_ns(), 250_000);
    // 2,250,000 ns: SYNC1 occurs with every third SYNC0, a quarter of a cycle later.
    let slower = changed(&[("<Data>40420f0090d00300</Data>", "<Data>40420f0010552200</Data>")]);
    let signals = drive(&slower).sync.unwrap();
    assert_eq!((signals.sync1_cycle_ns, signals.sync1_shift_ns), (3_000_000, 250_000));
    assert_eq!(signals.sync1_register_ns(), 2_250_000);
    assert!(drive(&changed(&[("<Data>0007</Data>", "<Data>0000</Data>")])).sync.is_none());
}

// covers: 8.1, eni-image
#[test]
fn commands_through_the_mailbox_become_start_up_commands_in_document_order() {
    let drive = drive(&configured(SMALL));
    let mail: Vec<_> = drive.startup.iter().filter(|c| !matches!(c.action, StartupAction::Register(_))).collect();
    let sdo = |sub_index, complete_access, data: &[u8]| {
        StartupAction::Sdo(SdoDownload::new(0x1C12, sub_index, data.to_vec()).with_complete_access(complete_access))
    };
    let found: Vec<_> = mail.iter().map(|command| (command.transition, &command.action)).collect();
    let upload = SdoUpload::new(0x1018, 1).with_expected(vec![0x9A, 0, 0, 0]);
    let addresses = IpSettings::default()
        .with_mac([2, 0, 0, 0, 0, 4])
        .with_address(Ipv4Addr::new(192, 168, 1, 4))
        .with_mask(Ipv4Addr::new(255, 255, 255, 0));
    let expected = [
        (Transition::Ps, &sdo(0, false, &[0])),
        (Transition::Ps, &sdo(0, true, &[1, 0, 0, 0x16])),
        (Transition::Ps, &StartupAction::Upload(upload)),
        (Transition::Ip, &StartupAction::Idn(IdnWrite::new(1, Idn(2), vec![0xE8, 0x03]))),
        (Transition::Ip, &StartupAction::Ip(addresses)),
    ];
    assert_eq!(found, expected, "and not what is disabled");
    assert_eq!(mail[0].limit, None, "0 is the usual limit");
    assert_eq!(mail[1].limit, Some(Duration::from_millis(250)));
    assert_eq!(mail[1].comment.as_deref(), Some("assign"));
}

// covers: 8.2, eni-image
#[test]
fn a_file_with_only_ccs_2_means_downloads() {
    let upload = "<Comment>look</Comment><Ccs>2</Ccs><Index>#x1018</Index><SubIndex>1</SubIndex><Data>9A000000</Data>";
    let text = SMALL.replace("<Ccs>1</Ccs>", "<Ccs>2</Ccs>").replace("<Comment>not this</Comment>", "<Ccs>2</Ccs>");
    assert!(text.contains(upload));
    let configuration = configured(&text);
    let downloads = drive(&configuration).startup.iter().filter(|c| matches!(c.action, StartupAction::Sdo(_))).count();
    assert_eq!(downloads, 3);
    assert!(has_notice(&configuration, &["CoE/InitCmd/Ccs", "taken as downloads"]));
}

// covers: eni-image
#[test]
fn other_registers_are_written_and_compared_as_in_the_file() {
    let configuration = configured(SMALL);
    let commands = registers(&drive(&configuration));
    let write = RegisterCommand::new(RegisterAddress(0x0F00), RegisterAccess::Write(vec![0xC0, 0xDE]))
        .with_retries(5)
        .with_required(true);
    let check = RegisterCommand::new(
        RegisterAddress(0x0F04),
        RegisterAccess::Check { data: vec![1, 0], mask: Some(vec![3, 0]), limit: Duration::from_millis(40) },
    );
    let writes = [Transition::Ps, Transition::Sp, Transition::Oi].map(|transition| (transition, write.clone()));
    assert_eq!(commands, [&writes[..], &[(Transition::So, check)]].concat());
    assert!(!has_notice(&configuration, &["own register"]), "OP is on the way of SP, all others are sent");
}

// covers: eni-image
#[test]
fn a_command_for_another_subdevice_is_not_sent_and_noted() {
    let position = changed(&[("<Adp>1004</Adp><Ado>3840</Ado>", "<Adp>1003</Adp><Ado>3840</Ado>")]);
    assert!(has_notice(&position, &["own register", "FPWR with Adp 1003 goes to another SubDevice"]));
    assert!(registers(&drive(&position)).iter().all(|(_, command)| command.address != RegisterAddress(0x0F00)));
    let raw = ("<Comment>own register</Comment><Cmd>5</Cmd>", "<Comment>own register</Comment><Cmd>2</Cmd>");
    let mixed_up = changed(&[raw]);
    assert!(has_notice(&mixed_up, &["own register", "APWR counts positions", "Cmd 4 and 5 address by PhysAddr"]));
}

// covers: eni-image
#[test]
fn notices_list_commands_not_followed_but_not_those_of_the_engine() {
    let configuration = configured(SMALL);
    let found = crate::notices(&configuration);
    assert_eq!(found.len(), 1, "{found:#?}");
    assert!(has_notice(&configuration, &["1 variables of no SubDevice", "Inputs.DevState"]));
    let ports = changed(&[("<Ado>3840</Ado>", "<Ado>256</Ado>")]);
    assert!(has_notice(&ports, &["own register", "ports and forwarding"]));
}

/// Protocol 4.4, 8.2: outputs that a file activates at SO must not act in SAFEOP.
// covers: sync-managers-declared
#[test]
fn a_sync_manager_activated_at_so_is_op_only_and_one_changed_there_is_noted() {
    let op_only = |configuration: &ringcat_config::Configuration, index: usize| -> Vec<bool> {
        let declared = configuration.declaration.subdevices[index].declared.iter().flatten();
        declared.map(|sync_manager| sync_manager.op_only).collect()
    };
    let configuration = configured(SMALL);
    assert_eq!((op_only(&configuration, 1), op_only(&configuration, 2)), (vec![true], vec![false]));
    let at_so = "<InitCmd><Transition>SO</Transition><Comment>set sm 0 of left</Comment>";
    let at_ps = "<InitCmd><Transition>PS</Transition><Cmd>5</Cmd><Adp>1002</Adp><Ado>2048</Ado>\
                 <Data>000f010004000100</Data></InitCmd>";
    let twice = changed(&[(at_so, &format!("{at_ps}{at_so}"))]);
    assert_eq!(op_only(&twice, 1), [false]);
    assert!(has_notice(&twice, &["SyncManager 0 at SO", "set before SAFEOP"]));
}

// covers: 6.5, eni-image
#[test]
fn addresses_are_hexadecimal_dotted_decimal_or_a_whole_message() {
    let elements = "<Type>2</Type><MAC>020000000004</MAC><IP>c0a80104</IP><Subnet>ffffff00</Subnet>";
    let ip = |configuration: &ringcat_config::Configuration| {
        drive(configuration).startup.iter().find_map(|command| match &command.action {
            StartupAction::Ip(settings) => Some(settings.clone()),
            _ => None,
        })
    };
    let expected = ip(&configured(SMALL)).unwrap();
    let points = elements.replace("c0a80104", "192.168.1.4").replace("ffffff00", "255.255.255.0");
    assert_eq!(ip(&changed(&[(elements, &points)])), Some(expected.clone()));
    // Type 2, last fragment; flags for MAC, address and mask; addresses little-endian, all fields at their offsets.
    let message = format!("<Data>0201 0000 07000000 020000000004 0401a8c0 00ffffff {}</Data>", "00".repeat(40));
    assert_eq!(ip(&changed(&[(elements, &message)])).as_ref(), Some(&expected));
    // Without the header of the message: all fields, or only those that the flags name.
    let bare = message.replace("0201 0000 ", "");
    assert_eq!(ip(&changed(&[(elements, &bare)])).as_ref(), Some(&expected));
    let packed = bare.replace(&"00".repeat(40), "");
    assert_eq!(ip(&changed(&[(elements, &packed)])), Some(expected));
    let filter = changed(&[(elements, "<Data>04010000</Data>")]);
    assert!(ip(&filter).is_none() && has_notice(&filter, &["EoE/InitCmd \"addresses\"", "does not set addresses"]));
    assert!(
        crate::refused(&[(elements, &elements.replace("c0a80104", "300.1.1.1"))]).contains("expected an IP address")
    );
}

/// Protocol 8.2: PO is among the transitions; OP is reached through SAFEOP.
// covers: 8.2, eni-image
#[test]
fn a_path_over_two_transitions_is_sent_at_the_listed_one_or_noted() {
    let own = "<Transition>PS</Transition><Transition>OP</Transition>";
    let both = changed(&[(own, "<Transition>PO</Transition><Transition>PS</Transition><Transition>OP</Transition>")]);
    let transitions = |configuration: &ringcat_config::Configuration| -> Vec<Transition> {
        let own =
            registers(&drive(configuration)).into_iter().filter(|(_, one)| one.address == RegisterAddress(0x0F00));
        own.map(|(transition, _)| transition).collect()
    };
    assert_eq!(transitions(&both), [Transition::Ps, Transition::Sp, Transition::Oi]);
    assert!(!has_notice(&both, &["own register"]));
    let alone = changed(&[(own, "<Transition>PO</Transition><Transition>OP</Transition>")]);
    assert_eq!(transitions(&alone), [Transition::Sp, Transition::Oi]);
    assert!(has_notice(&alone, &["own register", "not sent at PO:", "by way of SAFEOP"]));
}

// covers: eni-image
#[test]
fn a_disabled_command_of_any_kind_is_not_sent() {
    let own = "<Comment>own register</Comment>";
    let disabled = changed(&[(own, &format!("{own}<Disabled>1</Disabled>"))]);
    assert!(registers(&drive(&disabled)).iter().all(|(_, command)| command.address != RegisterAddress(0x0F00)));
    assert!(crate::notices(&disabled).iter().all(|notice| !notice.contains("own register")));
    let enabled = changed(&[(own, &format!("{own}<Disabled>0</Disabled>"))]);
    assert_eq!(drive(&enabled).startup, drive(&configured(SMALL)).startup);
}

/// Protocol 6.6: the data of a write with several elements contains more than the value.
// covers: eni-image
#[test]
fn an_idn_is_written_if_the_command_has_only_its_value() {
    let value = "<Elements>64</Elements>";
    let idns = |configuration: &ringcat_config::Configuration| {
        drive(configuration).startup.iter().filter(|command| matches!(command.action, StartupAction::Idn(_))).count()
    };
    assert_eq!(idns(&configured(SMALL)), 1);
    let several = changed(&[(value, "<Elements>72</Elements>")]);
    assert_eq!(idns(&several), 0);
    assert!(has_notice(&several, &["SoE/InitCmd \"cycle time\"", "Elements 0x48", "only values (0x40)"]));
}

/// Protocol 8.2: document order within a transition, mailbox commands and registers alike.
// covers: 8.2, eni-image
#[test]
fn registers_and_mailbox_commands_of_a_transition_are_in_document_order() {
    let at_ps = |configuration: &ringcat_config::Configuration| -> Vec<Option<String>> {
        let startup = drive(configuration).startup.into_iter();
        startup.filter(|command| command.transition == Transition::Ps).map(|command| command.comment).collect()
    };
    let expected = ["clear assignment", "assign", "look", "own register"].map(|text| Some(text.to_owned()));
    assert_eq!(at_ps(&configured(SMALL)), expected);
    // The mailbox of the drive after its commands: no schema allows it, but some tools may write it.
    let begin = SMALL.find("      <Mailbox ").expect("it is there");
    let end = SMALL.find("</Mailbox>\n").expect("it is there") + "</Mailbox>\n".len();
    let mailbox = &SMALL[begin..end];
    let behind = SMALL.rfind("</InitCmds>\n").expect("it is there") + "</InitCmds>\n".len();
    let moved = format!("{}{}{mailbox}{}", &SMALL[..begin], &SMALL[end..behind], &SMALL[behind..]);
    let mut expected = expected;
    expected.rotate_right(1);
    assert_eq!(at_ps(&configured(&moved)), expected);
}
