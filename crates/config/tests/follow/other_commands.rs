//! Commands beside those of every file: at all transitions, for the whole bus, of AoE, FoE and VoE, reads of IDNs.

use ringcat_engine::config::{
    FileRead, FileWrite, IdnRead, MailMessage, RegisterAccess, StartupAction, StartupCommand, SubDeviceConfig,
    Transition,
};
use ringcat_wire::mailbox::soe::{Idn, SoeElements};

use crate::{SMALL, changed, configured, has_notice, notices};

/// Before the commands of the drive.
const DRIVE: &str = "<InitCmd><Transition>IP</Transition><Comment>watchdog divider</Comment>";
/// In the mailbox of the drive.
const MAILBOX: &str = "<AoE><NetId>5.6.7.8.3.1</NetId></AoE>";
/// An AMS header with a request of the state.
const AMS: &str = "050607080301e803050607080301008004000400000000000000000034120000";

fn drive(configuration: &ringcat_config::Configuration) -> SubDeviceConfig {
    configuration.declaration.subdevices[3].clone()
}

fn commented<'a>(config: &'a SubDeviceConfig, comment: &str) -> Vec<&'a StartupCommand> {
    config.startup.iter().filter(|command| command.comment.as_deref() == Some(comment)).collect()
}

fn transitions(config: &SubDeviceConfig, comment: &str) -> Vec<Transition> {
    commented(config, comment).into_iter().map(|command| command.transition).collect()
}

/// Two commands with all transitions: a register, and an object.
fn everywhere() -> ringcat_config::Configuration {
    let names = ["II", "IP", "PP", "PS", "SS", "SO", "OS", "SP", "PI", "SI", "OI", "IB", "BI"];
    let all: String = names.iter().map(|name| format!("<Transition>{name}</Transition>")).collect();
    let register = format!(
        "<InitCmd>{all}<Comment>everywhere</Comment><Cmd>5</Cmd><Adp>1004</Adp><Ado>3968</Ado><Data>01</Data></InitCmd>"
    );
    let first = "<InitCmd><Transition>PS</Transition><Comment>clear assignment</Comment>";
    let object = format!(
        "<InitCmd>{all}<Comment>object</Comment><Ccs>1</Ccs><Index>8192</Index><Data>01</Data></InitCmd>{first}"
    );
    changed(&[(DRIVE, &format!("{register}{DRIVE}")), (first, &object)])
}

// covers: 8.2, eni-image
#[test]
fn a_command_is_sent_at_each_transition_that_it_names() {
    let configuration = everywhere();
    assert_eq!(transitions(&drive(&configuration), "everywhere"), Transition::ALL);
    let with_mailbox: Vec<_> = Transition::ALL.into_iter().filter(|it| *it != Transition::Ii).collect();
    assert_eq!(transitions(&drive(&configuration), "object"), with_mailbox);
    let reports = notices(&configuration);
    assert!(has_notice(&configuration, &["CoE/InitCmd \"object\"", "not sent at II: INIT has no mailbox", "line "]));
    assert_eq!(reports.iter().filter(|notice| notice.contains("not sent")).count(), 1, "{reports:#?}");
}

// covers: 8.2, eni-image
#[test]
fn a_register_before_the_request_of_init_and_a_command_without_transition_are_noted() {
    let request = "<InitCmd><Transition>OI</Transition><Transition>SI</Transition><Comment>to INIT</Comment>\
        <Cmd>5</Cmd><Adp>1004</Adp><Ado>288</Ado><Data>1100</Data></InitCmd>";
    let own = |transition: &str| {
        format!(
            "<InitCmd>{transition}<Comment>own</Comment><Cmd>5</Cmd><Adp>1004</Adp><Ado>3968</Ado>\
             <Data>01</Data></InitCmd>"
        )
    };
    let at_oi = own("<Transition>OI</Transition><Transition>PI</Transition>");
    let early = changed(&[(DRIVE, &format!("{at_oi}{request}{DRIVE}"))]);
    assert!(has_notice(&early, &["InitCmd \"own\"", "at OI: sent in INIT", "before the request of INIT"]));
    let behind = changed(&[(DRIVE, &format!("{request}{at_oi}{DRIVE}"))]);
    assert!(!has_notice(&behind, &["InitCmd \"own\""]));
    for configuration in [&early, &behind] {
        assert_eq!(transitions(&drive(configuration), "own"), [Transition::Oi, Transition::Pi]);
    }
    let nowhere = changed(&[(DRIVE, &format!("{}{DRIVE}", own("")))]);
    assert!(has_notice(&nowhere, &["InitCmd \"own\"", "it has no Transition: not sent"]));
}

// covers: 6.6, 8.2, eni-image
#[test]
fn idns_are_read_and_compared_if_the_command_has_data() {
    let write = "<OpCode>3</OpCode><DriveNo>1</DriveNo><IDN>2</IDN><Elements>64</Elements><Attribute>0</Attribute>\
        <Data>e803</Data>";
    let with = |op_code: u8, elements: u8, data: &str| {
        let command =
            format!("<OpCode>{op_code}</OpCode><DriveNo>1</DriveNo><IDN>2</IDN><Elements>{elements}</Elements>{data}");
        changed(&[(write, &command)])
    };
    let action = |configuration: &ringcat_config::Configuration| {
        commented(&drive(configuration), "cycle time").first().map(|command| command.action.clone())
    };
    let read = || IdnRead::new(1, Idn(2));
    assert_eq!(action(&with(2, 64, "")), Some(StartupAction::IdnRead(read())));
    let several = read().with_elements(SoeElements(0x48)).with_expected(vec![0xE8, 3]);
    assert_eq!(action(&with(2, 72, "<Data>e803</Data>")), Some(StartupAction::IdnRead(several)));
    for (op_code, elements, reason) in [(2, 0, "there is nothing to read"), (5, 64, "OpCode 5: only reads (2) and")] {
        let refused = with(op_code, elements, "");
        assert_eq!(action(&refused), None);
        assert!(has_notice(&refused, &["SoE/InitCmd \"cycle time\"", reason, "line "]));
    }
}

// covers: 6.7, 6.8, 8.2, eni-image
#[test]
fn messages_of_aoe_and_voe_are_sent_and_other_bytes_are_noted() {
    let command = |protocol: &str, data: &str| {
        let command = format!(
            "<InitCmd><Transition>PS</Transition><Comment>{protocol}</Comment><Timeout>70</Timeout>\
             <Data>{data}</Data></InitCmd>"
        );
        format!("<{protocol}><InitCmds>{command}</InitCmds></{protocol}>")
    };
    let all = [command("AoE", AMS), command("VoE", "470c00000700aa")].concat();
    let configuration = changed(&[(MAILBOX, &all)]);
    let config = drive(&configuration);
    let action = |comment: &str| commented(&config, comment).first().map(|command| command.action.clone());
    let aoe: Vec<u8> = (0..AMS.len()).step_by(2).map(|at| u8::from_str_radix(&AMS[at..at + 2], 16).unwrap()).collect();
    assert_eq!(action("AoE"), Some(StartupAction::Mail(MailMessage::Aoe(aoe))));
    let voe = MailMessage::Voe(vec![0x47, 0x0C, 0, 0, 7, 0, 0xAA]);
    assert_eq!(action("VoE"), Some(StartupAction::Mail(voe)));
    assert_eq!(commented(&config, "AoE")[0].limit, Some(std::time::Duration::from_millis(70)));
    // The answer to a request is no request.
    let wrong = [command("AoE", &AMS.replace("04000400", "04000500")), command("VoE", "470c")].concat();
    let wrong = changed(&[(MAILBOX, &wrong)]);
    for (subject, reason) in
        [("AoE/InitCmd \"AoE\"", "no AMS header with a request"), ("VoE/InitCmd \"VoE\"", "no VoE header")]
    {
        assert!(has_notice(&wrong, &[subject, reason]));
    }
}

/// A command of FoE with a message.
fn file(at: &str, comment: &str, data: &str) -> String {
    format!(
        "<InitCmd><Transition>{at}</Transition><Comment>{comment}</Comment><Timeout>70</Timeout><Data>{data}</Data>\
         </InitCmd>"
    )
}

/// A request to write "a.txt" with the password 7, and two packets of it; a request to read it.
const WRITE: &str = "020007000000612e747874";
const PACKET_1: &str = "0300010000003132";
const PACKET_2: &str = "030002000000";
const READ: &str = "010000000000612e74787400";

fn files(commands: &[String]) -> ringcat_config::Configuration {
    changed(&[(MAILBOX, &format!("<FoE><InitCmds>{}</InitCmds></FoE>", commands.concat()))])
}

// covers: 6.4, 8.2, eni-image
#[test]
fn the_messages_of_a_file_are_one_transfer() {
    let both = files(&[
        file("PS", "gains", WRITE),
        file("PS", "", PACKET_1),
        file("PS", "", PACKET_2),
        file("PS", "log", READ),
        file("PS", "", "040001000000"),
        file("IP", "early", READ),
    ]);
    assert!(!has_notice(&both, &["FoE/InitCmd"]), "{:#?}", notices(&both));
    let config = drive(&both);
    let [gains, log, early] = ["gains", "log", "early"].map(|comment| commented(&config, comment)[0]);
    let write = FileWrite::new("a.txt", b"12").with_password(7);
    assert_eq!((gains.transition, &gains.action), (Transition::Ps, &StartupAction::FileWrite(write)));
    assert_eq!(gains.limit, Some(std::time::Duration::from_millis(70)));
    assert_eq!(log.action, StartupAction::FileRead(FileRead::new("a.txt")));
    assert_eq!((early.transition, &early.action), (Transition::Ip, &log.action));
}

// covers: 6.4, 8.2, eni-image
#[test]
fn messages_that_are_no_whole_file_are_noted() {
    let cases: [(&[(&str, &str)], &str); 7] = [
        (&[("PS", WRITE)], "no packet with the contents of the file follows: not sent"),
        (&[("PS", WRITE), ("IP", PACKET_1)], "no packet with the contents of the file follows: not sent"),
        (&[("PS", WRITE), ("PS", PACKET_2)], "packet 2 follows where packet 1 is expected: not sent"),
        (&[("PS", WRITE), ("PS", "0600")], "packet 1 is no packet of a file: not sent"),
        (&[("PS", PACKET_1)], "its Data is no request of a file, and none is before it: not sent"),
        (&[("PS", READ), ("PS", PACKET_1)], "only acknowledgements follow the request of a file: not sent"),
        (&[("PS", "010000000000ff")], "the name of the file is no text: not sent"),
    ];
    for (commands, reason) in cases {
        let commands: Vec<String> = commands.iter().map(|(at, data)| file(at, "file", data)).collect();
        let noted = files(&commands);
        assert!(has_notice(&noted, &["FoE/InitCmd \"file\"", reason, "line "]), "{reason}: {:#?}", notices(&noted));
        assert!(commented(&drive(&noted), "file").is_empty(), "{reason}");
    }
}

// covers: 6.4, 8.2, eni-image
#[test]
fn a_disabled_request_of_a_file_ends_the_transfer_before_it() {
    let disabled =
        |comment: &str, data: &str| file("PS", comment, data).replace("</Data>", "</Data><Disabled>1</Disabled>");
    let off = WRITE.replace("612e747874", "6f6666");
    let all = files(&[
        file("PS", "keep", WRITE),
        file("PS", "", PACKET_1),
        disabled("", PACKET_2),
        disabled("off", &off),
        disabled("", PACKET_1),
        file("PS", "", PACKET_2),
    ]);
    let config = drive(&all);
    let keep = FileWrite::new("a.txt", b"12").with_password(7);
    assert_eq!(commented(&config, "keep")[0].action, StartupAction::FileWrite(keep));
    assert!(commented(&config, "off").is_empty());
    assert!(has_notice(&all, &["FoE/InitCmd \"off\"", "its request is disabled, packets behind it are not: not sent"]));
    let quiet =
        files(&[file("PS", "keep", WRITE), file("PS", "", PACKET_1), disabled("off", &off), disabled("", PACKET_1)]);
    assert!(!has_notice(&quiet, &["FoE/InitCmd"]), "{:#?}", notices(&quiet));
}

/// Commands of the MainDevice before the first SubDevice.
fn with_bus(commands: &str) -> ringcat_config::Configuration {
    let at = SMALL.find("<Slave>").unwrap();
    let (head, rest) = SMALL.split_at(at);
    assert_eq!(head.matches("</Master>").count(), 1);
    let text = match head.contains("</InitCmds>") {
        true => head.replace("</InitCmds>", &format!("{commands}</InitCmds>")),
        false => head.replace("</Master>", &format!("<InitCmds>{commands}</InitCmds></Master>")),
    };
    configured(&(text + rest))
}

fn bus(code: u8, ado: u16, rest: &str) -> String {
    format!(
        "<InitCmd><Transition>IP</Transition><Transition>OI</Transition><Comment>all</Comment><Cmd>{code}</Cmd>\
         <Adp>0</Adp><Ado>{ado}</Ado><Data>3412</Data><Cnt>1</Cnt>{rest}</InitCmd>"
    )
}

// covers: 8.2, eni-image
#[test]
fn a_command_to_the_whole_bus_is_sent_to_each_subdevice_before_or_behind_its_own() {
    let configuration = with_bus(&bus(8, 3968, "<Retries>300</Retries>"));
    let first = with_bus(&bus(8, 3968, "<BeforeSlave>1</BeforeSlave>"));
    for config in &configuration.declaration.subdevices {
        let commands = commented(config, "all");
        let transitions: Vec<_> = commands.iter().map(|command| command.transition).collect();
        assert_eq!(transitions, [Transition::Ip, Transition::Oi]);
        let StartupAction::Register(register) = &commands[0].action else { panic!("a register") };
        assert_eq!(register.access, RegisterAccess::Write(vec![0x34, 0x12]));
        assert_eq!((register.address.0, register.retries, register.required), (3968, 300, true));
    }
    let ends = |config: &SubDeviceConfig| {
        let comment = |command: Option<&StartupCommand>| command.and_then(|command| command.comment.clone());
        (comment(config.startup.first()), comment(config.startup.last()))
    };
    let all = Some("all".to_owned());
    assert_eq!(ends(&drive(&configuration)).1, all);
    assert_eq!(ends(&drive(&first)).0, all);
    assert!(!has_notice(&configuration, &["Master/InitCmd"]));
}

// covers: 3.7, 8.2, eni-image
#[test]
fn watchdogs_of_the_whole_bus_are_declared_where_a_subdevice_has_none_of_its_own() {
    let configuration = with_bus(&bus(8, 1056, ""));
    let intervals: Vec<_> = configuration.declaration.subdevices.iter().map(|it| it.watchdog_intervals).collect();
    assert_eq!(intervals, [Some(0x1234), Some(0x1234), Some(0x1234), Some(10_000)]);
}

// covers: 8.2, eni-image
#[test]
fn a_command_of_the_maindevice_may_address_one_subdevice() {
    let configuration = with_bus(&bus(5, 3968, "").replace("<Adp>0</Adp>", "<Adp>1003</Adp>"));
    let counts: Vec<_> = configuration.declaration.subdevices.iter().map(|it| commented(it, "all").len()).collect();
    assert_eq!(counts, [0, 0, 2, 0]);
    let unknown = with_bus(&bus(5, 3968, "").replace("<Adp>0</Adp>", "<Adp>1099</Adp>"));
    assert!(has_notice(&unknown, &["Master/InitCmd \"all\"", "Adp 1099 addresses no SubDevice"]));
}

// covers: 8.2, eni-image
#[test]
fn a_broadcast_that_cannot_be_sent_to_each_subdevice_is_noted_with_its_line() {
    let compared = |data: &str| format!("<Validate><Data>{data}</Data><Timeout>10</Timeout></Validate>");
    let zero = with_bus(&bus(7, 3968, &compared("0000")));
    assert_eq!(commented(&drive(&zero), "all").len(), 2, "0 is 0 in each");
    for (commands, reason) in [
        (bus(7, 3968, &compared("0100")), "it compares the OR of the registers of all SubDevices"),
        (bus(7, 3968, ""), "a read whose answer is not compared"),
        (bus(9, 3968, ""), "reads and writes at once"),
        (bus(8, 257, ""), "RingCAT controls ports and forwarding"),
        (bus(8, 512, ""), "does not use the event requests"),
        (bus(7, 1056, &compared("0000")), "RingCAT sets it itself"),
    ] {
        let configuration = with_bus(&commands);
        assert!(has_notice(&configuration, &["Master/InitCmd \"all\"", reason, "line "]), "{commands}");
        assert!(configuration.declaration.subdevices.iter().all(|it| commented(it, "all").is_empty()));
    }
}

// covers: 8.2, eni-image
#[test]
fn commands_to_the_whole_bus_have_a_limit_and_many_on_ways_to_init_take_no_time() {
    let large = bus(8, 3968, "").replace("<Data>3412</Data>", "<DataLength>1400</DataLength>");
    let slave = |station: u32| format!("<Slave><Info><Name>S</Name><PhysAddr>{station}</PhysAddr></Info></Slave>");
    let slaves: String = (1..=3_000).map(slave).collect();
    let file = |commands: &str| {
        format!(
            "<EtherCATConfig><Config><Master><InitCmds>{commands}</InitCmds></Master>{slaves}</Config></EtherCATConfig>"
        )
    };
    assert!(crate::refusal(&file(&large.repeat(20))).contains("commands to the whole bus"));
    assert_eq!(configured(&file(&large)).declaration.subdevices.len(), 3_000);
    let own = "<InitCmd><Transition>OI</Transition><Cmd>5</Cmd><Adp>1004</Adp><Ado>3968</Ado><Data>01</Data></InitCmd>";
    let many = changed(&[(DRIVE, &format!("{}{DRIVE}", own.repeat(60_000)))]);
    assert_eq!(drive(&many).startup.iter().filter(|it| it.transition == Transition::Oi).count(), 60_001);
}

/// The seed of the fuzz target: an ENI with each kind of command and of group, which is followed.
// covers: 8.2, eni-image
#[test]
fn the_file_with_every_kind_of_command_is_followed() {
    let configuration = configured(include_str!("../files/commands.xml"));
    let declared = &configuration.declaration.subdevices;
    let actions: Vec<&StartupAction> = declared.iter().flat_map(|it| &it.startup).map(|it| &it.action).collect();
    let has = |is: fn(&StartupAction) -> bool| actions.iter().any(|action| is(action));
    assert!(has(|it| matches!(it, StartupAction::Sdo(_))) && has(|it| matches!(it, StartupAction::Upload(_))));
    assert!(has(|it| matches!(it, StartupAction::Idn(_))) && has(|it| matches!(it, StartupAction::IdnRead(_))));
    assert!(has(|it| matches!(it, StartupAction::FileWrite(_))) && has(|it| matches!(it, StartupAction::FileRead(_))));
    assert!(has(|it| matches!(it, StartupAction::Mail(MailMessage::Aoe(_)))));
    assert!(has(|it| matches!(it, StartupAction::Mail(MailMessage::Voe(_)))));
    let at = |transition: &Transition| declared[0].startup.iter().any(|it| it.transition == *transition);
    assert!(Transition::ALL.iter().all(at));
    assert_eq!(declared.iter().filter(|it| it.address.data_word().is_some()).count(), 2);
    assert_eq!(configuration.groups.len(), 3);
}
