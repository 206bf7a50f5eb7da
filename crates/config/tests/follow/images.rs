//! The process image: positions of process data, copies, variables, tasks.

use std::time::Duration;

use ringcat_config::{ImageArea, ImageCopy};
use ringcat_engine::declared::SubDeviceId;
use ringcat_engine::info::Direction;
use ringcat_wire::address::LogicalAddress;

use crate::{SMALL, changed, configured, has_notice};

const fn area(subdevice: usize, direction: Direction, sync_manager: u8, image_bit: u32, bits: u32) -> ImageArea {
    ImageArea { subdevice, direction, sync_manager: Some(sync_manager), bit_offset: 0, image_bit, bits }
}

const AREAS: [ImageArea; 4] = [
    area(1, Direction::Outputs, 0, 16, 4),
    area(2, Direction::Outputs, 0, 20, 4),
    area(3, Direction::Outputs, 2, 32, 48),
    area(3, Direction::Inputs, 3, 0, 48),
];

// covers: 8.1, eni-image
#[test]
fn packed_bits_have_their_positions_in_the_image() {
    let image = configured(SMALL).image;
    assert_eq!((image.inputs_len, image.outputs_len), (8, 10));
    assert_eq!(image.areas, AREAS);
}

// covers: eni-image
#[test]
fn offsets_may_count_from_the_header_of_a_datagram_as_twincat_writes_them() {
    // As if the image contained each datagram with its header: ten bytes later.
    let moved = changed(&[
        ("<BitStart>16</BitStart>", "<BitStart>96</BitStart>"),
        ("<BitStart>20</BitStart>", "<BitStart>100</BitStart>"),
        ("<BitStart>32</BitStart>", "<BitStart>112</BitStart>"),
        ("<BitStart>0</BitStart>", "<BitStart>80</BitStart>"),
        ("<ByteSize>8</ByteSize>", "<ByteSize>20</ByteSize>"),
        ("<ByteSize>10</ByteSize>", "<ByteSize>20</ByteSize>"),
    ]);
    let bits: Vec<_> = moved.image.areas.iter().map(|area| area.image_bit).collect();
    assert_eq!(bits, [96, 100, 112, 80]);
    assert!(!has_notice(&moved, &["the offsets of the cyclic commands differ"]));
}

// covers: eni-image
#[test]
fn send_and_recv_take_precedence_over_different_offsets() {
    let elsewhere = changed(&[("<InputOffs>2</InputOffs><OutputOffs>2</OutputOffs>", "<OutputOffs>7</OutputOffs>")]);
    assert_eq!(elsewhere.image.areas, AREAS);
    assert!(has_notice(&elsewhere, &["ProcessData/Send", "the offsets of the cyclic commands differ"]));
}

// covers: eni-image
#[test]
fn process_data_in_several_ranges_fills_them_in_order() {
    let offsets = ("<InputOffs>0</InputOffs><OutputOffs>4</OutputOffs>", "");
    let ranges = "<Send><BitStart>64</BitStart><BitLength>8</BitLength></Send>\
                  <Send><BitStart>24</BitStart><BitLength>40</BitLength></Send>";
    let configuration = changed(&[offsets, ("<Send><BitStart>32</BitStart><BitLength>48</BitLength></Send>", ranges)]);
    let drive: Vec<_> = configuration.image.areas.iter().filter(|area| area.subdevice == 3).copied().collect();
    let second = ImageArea { bit_offset: 8, ..area(3, Direction::Outputs, 2, 24, 40) };
    assert_eq!(drive, [second, area(3, Direction::Outputs, 2, 64, 8), AREAS[3]]);
}

// covers: 8.2, eni-image
#[test]
fn copies_are_split_at_the_borders_of_process_data() {
    let copies = configured(SMALL).image.copies;
    let first = ImageCopy { source_area: 3, source_bit: 8, target_area: 0, target_bit: 2, bits: 2 };
    let second = ImageCopy { source_area: 3, source_bit: 10, target_area: 1, target_bit: 0, bits: 2 };
    assert_eq!(copies, [first, second]);
    let beyond = changed(&[("<DstBitOffs>18</DstBitOffs>", "<DstBitOffs>4</DstBitOffs>")]);
    assert!(beyond.image.copies.is_empty());
    assert!(has_notice(&beyond, &["CopyInfo", "process data of no SubDevice"]));
}

// covers: eni-image
#[test]
fn variables_name_their_subdevice() {
    let variables = configured(SMALL).image.variables;
    let owners: Vec<_> = variables.iter().map(|v| (v.name.as_str(), v.subdevice, v.image_bit, v.bits)).collect();
    let expected = [
        ("Drive.In.Status word", Some(3), 0, 16),
        ("Drive.In.Position", Some(3), 16, 32),
        ("Inputs.DevState", None, 48, 16),
        ("Left.Channels.Outputs", Some(1), 16, 4),
        ("Right.Channels.Outputs", Some(2), 20, 4),
        ("Drive.Out.Control word", Some(3), 32, 16),
    ];
    assert_eq!(owners, expected);
}

// covers: CR-16, eni-image
#[test]
fn an_lrw_is_declared_with_the_subdevices_that_it_addresses() {
    let declaration = configured(SMALL).declaration;
    let [lrw] = &declaration.explicit_lrw[..] else { panic!("{:?}", declaration.explicit_lrw) };
    assert!(lrw.name.starts_with("frame 1, command 4 \"drive\" (line "), "{}", lrw.name);
    assert_eq!((lrw.logical, lrw.length, &lrw.subdevices[..]), (LogicalAddress(0x1000_0000), 6, &[SubDeviceId(3)][..]));
}

#[test]
fn a_working_counter_that_differs_from_the_fmmus_is_noted() {
    let wrong = changed(&[("<DataLength>6</DataLength><Cnt>3</Cnt>", "<DataLength>6</DataLength><Cnt>4</Cnt>")]);
    assert!(has_notice(&wrong, &["command 4 \"drive\"", "Cnt is 4", "give 3"]));
}

// covers: eni-image
#[test]
fn tasks_become_domains_each_with_its_cycle_and_members() {
    let one = configured(SMALL);
    assert_eq!(one.cycle, Some(Duration::from_millis(2)));
    let members: Vec<Vec<usize>> =
        one.declaration.domains.iter().map(|d| d.members.iter().map(|m| m.subdevice.0).collect()).collect();
    assert_eq!(members, [vec![1_usize, 2, 3]]);
    let border = "</Frame></Cyclic><Cyclic><CycleTime>500</CycleTime><Frame>";
    let drive = "<Cmd><State>SAFEOP</State><State>OP</State><Comment>drive</Comment>";
    let two = changed(&[(drive, &format!("{border}{drive}"))]);
    let domains = &two.declaration.domains;
    let members: Vec<(Duration, Vec<usize>)> =
        domains.iter().map(|d| (d.period, d.members.iter().map(|m| m.subdevice.0).collect())).collect();
    assert_eq!(members, [(Duration::from_millis(2), vec![1_usize, 2]), (Duration::from_micros(500), vec![3])]);
    assert_eq!(two.cycle, Some(Duration::from_micros(500)));
    assert!(two.declaration.explicit_lrw[0].name.starts_with("task 2, frame 1, command 1"));
}

// covers: eni-image
#[test]
fn sync_managers_of_different_tasks_are_members_of_both() {
    let border = "</Frame></Cyclic><Cyclic><CycleTime>500</CycleTime><Frame>";
    let lrw = "<Comment>drive</Comment><Cmd>12</Cmd><Addr>268435456</Addr><DataLength>6</DataLength><Cnt>3</Cnt>\
               <InputOffs>0</InputOffs><OutputOffs>4</OutputOffs>";
    let lwr = "<Cmd>11</Cmd><Addr>268435456</Addr><DataLength>6</DataLength><OutputOffs>4</OutputOffs></Cmd>";
    let lrd = "<Cmd><Cmd>10</Cmd><Addr>268435456</Addr><DataLength>6</DataLength><InputOffs>0</InputOffs>";
    let configuration = changed(&[(lrw, &format!("{lwr}{border}{lrd}"))]);
    let domains = &configuration.declaration.domains;
    let drive =
        |domain: usize| domains[domain].members.iter().find(|m| m.subdevice.0 == 3).unwrap().sync_managers.clone();
    assert_eq!((drive(0), drive(1)), (Some(vec![2]), Some(vec![3])));
    assert!(configuration.declaration.explicit_lrw.is_empty());
}

// covers: eni-image
#[test]
fn process_data_without_a_command_is_not_exchanged_and_noted() {
    let nothing = changed(&[("<Addr>16777216</Addr>", "<Addr>33554432</Addr>")]);
    assert!(has_notice(&nothing, &["SyncManager 0", "no cyclic command covers"]));
    assert!(has_notice(&nothing, &["command 3 \"terminals\"", "matches no FMMU"]));
    assert_eq!(nothing.declaration.domains[0].members.len(), 1);
    assert_eq!(nothing.image.areas, AREAS[2..], "the image does not contain it either");
    let variable = nothing.image.variables.iter().find(|variable| variable.name.starts_with("Left")).unwrap();
    assert_eq!(variable.subdevice, None);
}

/// Protocol 8.2: a command is active in the states that it lists.
// covers: eni-image
#[test]
fn process_data_exchanged_in_other_states_is_noted() {
    let states = "<State>SAFEOP</State><State>OP</State><Comment>drive</Comment>";
    let op = changed(&[(states, "<State>4</State><Comment>drive</Comment>")]);
    assert!(has_notice(&op, &["command 4 \"drive\"", "State is OP: RingCAT exchanges process data in SAFEOP and OP"]));
    let any = changed(&[(states, "<Comment>drive</Comment>")]);
    let more = changed(&[(states, &format!("<State>PREOP</State>{states}"))]);
    for usual in [any, more] {
        assert!(!has_notice(&usual, &["State is"]));
    }
}
