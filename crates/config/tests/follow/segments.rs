//! The segment: positions, groups, clocks, files without commands.

use ringcat_config::eni::Port;
use ringcat_engine::config::{ConfigAddress, PdoAssignment, PdoEntry, PdoMapping, ReferenceClock};
use ringcat_engine::declared::{GroupId, SubDeviceId};
use ringcat_engine::info::Direction;
use ringcat_wire::address::{RegisterAddress, StationAddress};

use crate::{SMALL, changed, configured, has_notice, refusal, refused, with};

fn addresses(configuration: &ringcat_config::Configuration) -> Vec<ConfigAddress> {
    configuration.declaration.subdevices.iter().map(|config| config.address).collect()
}

// covers: 8.1, eni-image
#[test]
fn positions_follow_auto_inc_addr_and_not_the_order_of_the_file() {
    let swapped = changed(&[
        ("<AutoIncAddr>65535</AutoIncAddr>", "<AutoIncAddr>1</AutoIncAddr>"),
        ("<AutoIncAddr>65534</AutoIncAddr>", "<AutoIncAddr>65535</AutoIncAddr>"),
        ("<AutoIncAddr>1</AutoIncAddr>", "<AutoIncAddr>65534</AutoIncAddr>"),
    ]);
    assert_eq!(addresses(&swapped), [0, 2, 1, 3].map(ConfigAddress::Position));
    let facts: Vec<_> = swapped.subdevices.iter().map(|facts| (facts.station, facts.plugged_into)).collect();
    let expected = [
        (Some(1001), None),
        (Some(1002), Some((0, Port::B))),
        (Some(1003), Some((1, Port::B))),
        (Some(1004), Some((0, Port::C))),
    ];
    assert_eq!(facts, expected);
    assert_eq!(swapped.at_station(StationAddress(1003)), Some(SubDeviceId(2)));
    assert_eq!(swapped.subdevices[3].net_id, Some([5, 6, 7, 8, 3, 1]));
}

#[test]
fn without_auto_inc_addr_the_order_of_the_file_is_used_and_noted() {
    let zeros = changed(&[
        ("<AutoIncAddr>65535</AutoIncAddr>", ""),
        ("<AutoIncAddr>65534</AutoIncAddr>", ""),
        ("<AutoIncAddr>65533</AutoIncAddr>", ""),
    ]);
    assert_eq!(addresses(&zeros), [0, 1, 2, 3].map(ConfigAddress::Position));
    assert!(has_notice(&zeros, &["AutoIncAddr", "order of the file"]));
}

const GROUP: &str = "<HotConnect><GroupName>Gripper</GroupName><GroupMemberCnt>2</GroupMemberCnt>\
    <IdentifyCmd><Cmd>1</Cmd><Adp>0</Adp><Ado>18</Ado><DataLength>2</DataLength>\
    <Validate><Data>3412</Data></Validate></IdentifyCmd></HotConnect>";
/// `PreviousPort` of the second SubDevice, which becomes the head of a group.
const HEAD: &str = "<PreviousPort Selected=\"1\"><Port>B</Port><PhysAddr>1001</PhysAddr></PreviousPort>";

// covers: 8.2, eni-image
#[test]
fn a_hot_connect_group_is_found_by_alias_and_its_members_follow_it() {
    let configuration = changed(&[(HEAD, GROUP)]);
    let alias = |offset| ConfigAddress::Alias { alias: 0x1234, offset };
    let expected = [ConfigAddress::Position(0), alias(0), alias(1), ConfigAddress::Position(1)];
    assert_eq!(addresses(&configuration), expected, "those of a group are not counted");
    let groups: Vec<_> = configuration.declaration.subdevices.iter().map(|c| (c.group, c.optional)).collect();
    assert_eq!(groups, [(None, false), (Some(GroupId(0)), true), (Some(GroupId(0)), true), (None, false)]);
    assert_eq!(configuration.groups, ["Gripper"]);
}

// covers: eni-image
#[test]
fn a_group_may_be_identified_by_its_eeprom_or_its_switch() {
    let eeprom = "<IdentifyCmd><Cmd>2</Cmd><Adp>0</Adp><Ado>1282</Ado><Data>000104000000</Data></IdentifyCmd>\
                  <IdentifyCmd><Cmd>1</Cmd><Adp>0</Adp><Ado>1288</Ado><DataLength>2</DataLength>\
                  <Validate><Data>0700</Data></Validate></IdentifyCmd></HotConnect>";
    let head = GROUP.split("<IdentifyCmd>").next().unwrap();
    let configuration = changed(&[(HEAD, &format!("{head}{eeprom}"))]);
    assert_eq!(addresses(&configuration)[1], ConfigAddress::Alias { alias: 7, offset: 0 });
    let switch = changed(&[(HEAD, &GROUP.replace("<Ado>18</Ado>", "<Ado>308</Ado>"))]);
    assert_eq!(addresses(&switch)[2], ConfigAddress::Identification { value: 0x1234, offset: 1 });
    // A data word: digital inputs, process RAM.
    for register in [3864, 4096] {
        let word = GROUP.replace("<Ado>18</Ado>", &format!("<Ado>{register}</Ado>"));
        let at = |offset| ConfigAddress::DataWord { register: RegisterAddress(register), value: 0x1234, offset };
        assert_eq!(addresses(&changed(&[(HEAD, &word)]))[1..3], [at(0), at(1)]);
        let masked = word.replace("<Data>3412</Data>", "<Data>3402</Data><DataMask>ff0f</DataMask>");
        assert!(refused(&[(HEAD, &masked)]).contains("a whole data word"), "a part of a word is none");
    }
}

#[test]
fn a_group_that_cannot_be_found_or_is_not_complete_is_refused() {
    let word = refused(&[(HEAD, &GROUP.replace("<Ado>18</Ado>", "<Ado>3584</Ado>"))]);
    assert!(word.contains("identification of the hot connect group \"Gripper\""), "{word}");
    assert!(word.contains("other kinds of identification"), "{word}");
    let long = refused(&[(HEAD, &GROUP.replace(">2</GroupMemberCnt>", ">9</GroupMemberCnt>"))]);
    assert!(long.contains("expected 9, got 3") && long.contains("line "), "{long}");
    // The last member alone is missing.
    let last = refused(&[(HEAD, &GROUP.replace(">2</GroupMemberCnt>", ">4</GroupMemberCnt>"))]);
    assert!(last.contains("members of the hot connect group: expected 4, got 3"), "{last}");
}

/// The file with one group of one SubDevice, "Gripper", and a second one, whose name and mark are these.
fn two_groups(name: &str, ado: u16, value: &str) -> String {
    let group = GROUP.replace(">2</GroupMemberCnt>", ">1</GroupMemberCnt>");
    let second = group.replace("Gripper", name).replace("<Ado>18</Ado>", &format!("<Ado>{ado}</Ado>"));
    let second = second.replace("<Data>3412</Data>", &format!("<Data>{value}</Data>"));
    let third = "<PreviousPort Selected=\"1\"><Port>B</Port><PhysAddr>1002</PhysAddr></PreviousPort>";
    with(&[(HEAD, &group), (third, &second)])
}

// covers: 8.2, hot-connect, eni-image
#[test]
fn two_groups_with_one_identifier_or_name_are_refused_with_the_line() {
    configured(&two_groups("Tool", 18, "3512"));
    configured(&two_groups("Tool", 308, "3412"));
    for (ado, mark) in [(18, "alias 4660"), (308, "identification 4660"), (4096, "data word 4660 at 0x1000")] {
        let text = two_groups("Tool", ado, "3412").replace("<Ado>18</Ado>", &format!("<Ado>{ado}</Ado>"));
        let error = refusal(&text);
        let expected = format!("expected one that no other group has, got {mark} offset 0, which Slave 2 \"Left\"");
        assert!(error.contains("Slave 3 \"Right\"") && error.contains(&expected), "{error}");
        assert!(error.contains("line 51,"), "{error}");
    }
    let error = refusal(&two_groups("Gripper", 18, "3512"));
    assert!(
        error.contains("GroupName") && error.contains("\"Gripper\", which the group of Slave 2 \"Left\""),
        "{error}"
    );
    assert!(error.contains("line 51,"), "{error}");
    configured(&two_groups("", 18, "3512").replace("<GroupName>Gripper</GroupName>", ""));
}

// covers: 8.2, hot-connect, eni-image
#[test]
fn a_group_with_several_identifiers_is_refused_with_the_line_of_the_second() {
    let command = &GROUP[GROUP.find("<IdentifyCmd>").expect("a command")..GROUP.find("</HotConnect>").expect("an end")];
    let twice = |second: &str| with(&[(HEAD, &GROUP.replace("</HotConnect>", &format!("{second}</HotConnect>")))]);
    configured(&twice(command));
    let word = |ado: u16| command.replace("<Ado>18</Ado>", &format!("\n<Ado>{ado}</Ado>"));
    for (ado, mark) in [(308, "identification 4660"), (3864, "data word 4660 at 0x0f18")] {
        let error = refusal(&twice(&word(ado)));
        let expected =
            format!("expected one alias, identification or data word that is compared, got alias 4660 and {mark}");
        assert!(error.contains(&expected) && error.contains("line "), "{error}");
    }
    // Many of them cost no more than two.
    let many: String = (0..50_000).map(|number| word(0x1000 + number)).collect();
    assert!(refusal(&twice(&many)).contains("got alias 4660 and data word 4660 at 0x1000"));
    let words = GROUP.replace("<Ado>18</Ado>", "<Ado>3864</Ado>");
    let words = words.replace("</HotConnect>", &format!("{}</HotConnect>", word(4096)));
    let error = refused(&[(HEAD, &words)]);
    assert!(error.contains("got data word 4660 at 0x0f18 and data word 4660 at 0x1000"), "{error}");
}

// covers: eni-image
#[test]
fn names_of_several_subdevices_or_variables_are_noted() {
    assert!(!has_notice(&configured(SMALL), &["of several"]));
    let text = SMALL.replace("<Name>Right</Name>", "<Name>Left</Name>");
    assert!(has_notice(
        &configured(&text),
        &["a name of several SubDevices (\"Left\")", "the first one in the file (line"]
    ));
    let names: Vec<String> = configured(SMALL).image.variables.iter().map(|it| it.name.clone()).collect();
    let text = SMALL.replace(&format!("<Name>{}</Name>", names[1]), &format!("<Name>{}</Name>", names[0]));
    assert!(has_notice(&configured(&text), &["a name of several variables", &names[0]]));
}

// covers: 7, eni-image
#[test]
fn the_reference_clock_is_the_subdevice_addressed_by_the_cyclic_time_command() {
    let clocks = configured(SMALL).declaration.clocks.expect("the file uses clocks");
    assert_eq!((clocks.reference, clocks.bus_shift), (ReferenceClock::Declared(SubDeviceId(3)), false));
    let bus_shift = "<Cmd><Cmd>5</Cmd><Adp>1004</Adp><Ado>2320</Ado><DataLength>4</DataLength></Cmd>";
    let first = "<Comment>time</Comment><Cmd>13</Cmd><Adp>0</Adp>";
    let frame = "<Frame>\n        <Cmd><State>PREOP</State>";
    let shifted = changed(&[
        ("<Comment>time</Comment><Cmd>14</Cmd><Adp>1004</Adp>", first),
        (frame, &frame.replace("<Frame>", &format!("<Frame>{bus_shift}"))),
    ]);
    let clocks = shifted.declaration.clocks.unwrap();
    assert_eq!((clocks.reference, clocks.bus_shift), (ReferenceClock::Declared(SubDeviceId(0)), true));
}

// covers: eni-image
#[test]
fn a_file_without_commands_uses_the_sii_and_expects_the_identity_of_info() {
    let text = "<EtherCATConfig><Config><Slave><Info><Name>A</Name><PhysAddr>1001</PhysAddr><VendorId>2</VendorId>\
        <ProductCode>0</ProductCode></Info><ProcessData><Send><BitStart>8</BitStart><BitLength>16</BitLength></Send>\
        <Send><BitStart>32</BitStart><BitLength>8</BitLength></Send></ProcessData></Slave></Config></EtherCATConfig>";
    let configuration = configured(text);
    let config = &configuration.declaration.subdevices[0];
    assert_eq!(config.declared, None);
    assert_eq!((config.expected.vendor_id, config.expected.product_code), (Some(2), None));
    let areas: Vec<_> =
        configuration.image.areas.iter().map(|a| (a.sync_manager, a.bit_offset, a.image_bit, a.bits)).collect();
    assert_eq!(areas, [(None, 0, 8, 16), (None, 16, 32, 8)]);
    assert_eq!(configuration.image.outputs_len, 5, "without an image of the file as long as needed");
    assert_eq!(configuration.declaration.domains.len(), 1);
    assert!(has_notice(&configuration, &["Cyclic/CycleTime", "1ms is taken"]));
}

/// A file with start-up lists only, as users write it (a common problem: a mapping that differs from the SII).
// covers: 6.3, eni-image
#[test]
fn a_file_with_only_coe_commands_defines_the_length_of_process_data() {
    let command = |object: &str, sub_index: u8, complete: u8, data: &str| {
        format!(
            "<InitCmd CompleteAccess=\"{complete}\"><Transition>PS</Transition><Ccs>1</Ccs><Index>{object}</Index>\
             <SubIndex>{sub_index}</SubIndex><Data>{data}</Data></InitCmd>"
        )
    };
    let commands = [
        command("0x1c13", 0, 0, "00"),
        command("0x1c13", 1, 0, "021a"),
        command("0x1c13", 2, 0, "051a"),
        command("0x1c13", 0, 0, "02"),
        command("0x1c12", 0, 1, "0200 0116 0716"),
        command("0x1601", 0, 1, "0200 10004060 20007a60"),
        command("0x1a05", 1, 0, "08006160"),
        command("0x1a05", 0, 0, "01"),
    ];
    let text = format!(
        "<EtherCATConfig><Config><Slave><Info><Name>A</Name></Info><Mailbox><CoE><InitCmds>{}</InitCmds></CoE>\
         </Mailbox>\
         </Slave></Config></EtherCATConfig>",
        commands.concat()
    );
    let config = &configured(&text).declaration.subdevices[0];
    let assigned =
        |sync_manager, direction, pdos: [PdoMapping; 2]| PdoAssignment::new(sync_manager, direction, pdos.to_vec());
    let drive = PdoMapping::of(0x1601, [PdoEntry::new(0x6040, 0, 16), PdoEntry::new(0x607A, 0, 32)]);
    let mode = PdoMapping::of(0x1A05, [PdoEntry::new(0x6061, 0, 8)]);
    let expected = vec![
        assigned(2, Direction::Outputs, [drive, PdoMapping::from_sii(0x1607)]),
        assigned(3, Direction::Inputs, [PdoMapping::from_sii(0x1A02), mode]),
    ];
    assert_eq!(config.pdos.as_ref(), Some(&expected));
    assert_eq!(config.startup.len(), 8, "and they are sent");
    let whole = configured(SMALL);
    assert!(whole.declaration.subdevices.iter().all(|config| config.pdos.is_none()), "others have SyncManagers");
}
