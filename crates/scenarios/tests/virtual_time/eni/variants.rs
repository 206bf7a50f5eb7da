//! Unusual files: groups that join later, tasks with several cycle times, objects that a drive does not have; and a
//! ring behind a junction, which a file cannot describe.

use std::time::Duration;

use ringcat::eni::EniImage;
use ringcat::simulated::SimulatedSegment;
use ringcat::{DomainId, Event, JunctionConnection, MainDevice, Options, SubDeviceId};
use ringcat_sim::cable::{CableId, CableSpec, DeviceIndex, Endpoint};
use ringcat_sim::frame::Port;
use ringcat_sim::network::Network;
use ringcat_wire::address::StationAddress;
use ringcat_wire::al::AlState;
use ringcat_wire::register::{PortKind, map};

use super::{BUTTONS, DRIVE, EniFile, LAMPS, MACHINE, Plant, activate, activate_on, segment};

/// The machine with some of its text replaced.
fn with(changes: &[(&str, &str)]) -> EniFile {
    let mut text = String::from_utf8(MACHINE.to_vec()).expect("it is text");
    for (from, to) in changes {
        assert_eq!(text.matches(from).count(), 1, "{from}");
        text = text.replace(from, to);
    }
    EniFile::from_bytes(text.as_bytes()).unwrap_or_else(|error| panic!("{error}"))
}

fn set(plant: &mut Plant, name: &str, value: u64) {
    let variable = plant.image.variable(name).cloned().expect("it is there");
    assert!(plant.image.write(&variable, value));
}

fn get(plant: &Plant, name: &str) -> u64 {
    plant.image.read(plant.image.variable(name).expect("it is there"))
}

// covers: 8.2, eni-run
#[test]
fn a_hot_connect_group_of_a_file_has_its_places_from_the_start() {
    let group = "      <HotConnect><GroupName>Drive</GroupName><GroupMemberCnt>1</GroupMemberCnt>
        <IdentifyCmd><Comment>alias</Comment><Cmd>1</Cmd><Adp>0</Adp><Ado>18</Ado><Data>0000</Data>
          <Validate><Data>0700</Data><Timeout>100</Timeout></Validate></IdentifyCmd></HotConnect>
      <DC>";
    let file = with(&[("      <DC>", group)]);
    let mut network = file.simulated(false).expect("a segment");
    network.power_off(DeviceIndex(DRIVE));
    let mut plant = activate_on_any(network, file);
    plant.run(300);
    assert!(plant.application.exchange_mut().status(DomainId(0)).expect("it is declared").wkc > 0);
    set(&mut plant, "Lamps.Channel 2", 1);
    set(&mut plant, "Drive.Target velocity", 0x0102_0304);
    plant.run(4);
    assert_eq!(plant.device(LAMPS).outputs(), [2], "the others work");
    assert_eq!(get(&plant, "Drive.Position"), 0);
    plant.network_mut().power_on(DeviceIndex(DRIVE));
    let until = plant.application.now() + Duration::from_secs(20);
    while get(&plant, "Drive.Position") != 0x0102_0304 {
        assert!(plant.application.now() < until, "{:?}", plant.events);
        plant.cycle();
    }
    assert_eq!(plant.device(DRIVE).outputs(), [4, 3, 2, 1, 0, 0]);
}

/// As [`activate_on`], with any SubDevices.
fn activate_on_any(network: Network, file: EniFile) -> Plant {
    let plant = super::start(network, file, false).expect("the others are there");
    assert!(plant.image.unplaced().is_empty(), "absent SubDevices have places too");
    plant
}

// covers: 8.1, eni-run
#[test]
fn tasks_of_a_file_are_domains_with_their_own_cycle_times() {
    let slow = "    </Cyclic>
    <Cyclic>
      <CycleTime>4000</CycleTime>
      <Frame><Cmd><State>4</State><Comment>drive</Comment><Cmd>12</Cmd><Addr>16777218</Addr><DataLength>6</DataLength>
        <Cnt>3</Cnt><InputOffs>2</InputOffs><OutputOffs>2</OutputOffs></Cmd></Frame>
    </Cyclic>";
    let file = with(&[
        ("    </Cyclic>", slow),
        ("<DataLength>8</DataLength>\n          <Cnt>8</Cnt>", "<DataLength>1</DataLength>\n          <Cnt>5</Cnt>"),
    ]);
    let periods: Vec<Duration> = file.configuration.declaration.domains.iter().map(|domain| domain.period).collect();
    assert_eq!(periods, [1, 4].map(Duration::from_millis));
    let mut plant = activate(file, false, false).expect("it fits");
    plant.settle();
    plant.network_mut().device_mut(DeviceIndex(BUTTONS)).set_inputs(&[0x05]);
    set(&mut plant, "Lamps.Channel 1", 1);
    set(&mut plant, "Drive.Target velocity", 0x0506_0708);
    plant.run(3);
    assert_eq!((plant.device(LAMPS).outputs(), get(&plant, "Buttons.Channel 3")), (&[1][..], 1));
    // The slow task needs two of its cycles for both directions, and may just have missed one.
    plant.run(12);
    assert_eq!(get(&plant, "Drive.Position"), 0x0506_0708);
    let domain = |plant: &Plant, name: &str| plant.image.variable(name).expect("it is there").domain;
    assert_eq!(domain(&plant, "Drive.Position"), Some(DomainId(1)));
    assert_eq!(domain(&plant, "Buttons.Channel 3"), Some(DomainId(0)));
}

// covers: 8.2, eni-run
#[test]
fn a_refused_object_is_reported_with_the_comment_of_the_file() {
    let file = with(&[]);
    let mut segment = segment(&file.eni, &file.configuration, false);
    segment.devices[DRIVE].objects.clear();
    let network = Network::from_description(segment).expect("cables fit");
    let mut plant = activate_on(network, file, false).expect("it fits");
    plant.run(300);
    let reports = |event: &Event| {
        matches!(event, Event::ConfigurationFailed { subdevice: SubDeviceId(DRIVE), reason }
            if reason.starts_with("start-up command 14 (PREOP to SAFEOP) \"velocity mode\": SDO 0x6060:00: aborted"))
    };
    assert!(plant.events.iter().any(reports), "{:?}", plant.events);
    set(&mut plant, "Lamps.Channel 1", 1);
    plant.run(4);
    assert_eq!(plant.device(LAMPS).outputs(), [1], "the others work");
}

/// Coupler, lamps, valves, buttons and back to the coupler, which has the drive on its port 2. The file does not
/// describe this connection.
// covers: JR-05, eni-run
#[test]
fn a_local_ring_is_declared_by_station_addresses_between_load_and_apply() {
    let file = with(&[]);
    let mut segment = segment(&file.eni, &file.configuration, false);
    segment.devices[0].ports = [PortKind::Mii; 4];
    let port = |device: usize, port| Endpoint::Device(DeviceIndex(device), port);
    let CableSpec { delay, .. } = segment.cables[0];
    segment.cables[1].a = port(0, Port::D);
    segment.cables.push(CableSpec { a: port(BUTTONS, Port::B), b: port(0, Port::B), delay });
    let network = Network::from_description(segment).expect("cables fit");
    let mut main_device = MainDevice::request(SimulatedSegment::new(network), &Options::default());
    let found = main_device.scan().expect("a scan").subdevices;
    main_device.load(file.declaration(false)).expect("it is sound");
    let at = |station| file.configuration.at_station(StationAddress(station)).expect("it is in the file");
    let connection = JunctionConnection::new(at(1001), 1, at(1004), 1);
    main_device.add_junction_connection(connection).expect("it fits");
    let application = main_device.apply().map_err(ringcat::Error::from).expect("it fits");
    let image = EniImage::new(&file.configuration, application.directory()).expect("the image fits");
    let mut plant = Plant { file, application, image, found, events: Vec::new() };
    plant.settle();
    for (fault, broken) in [(Network::cut as fn(&mut Network, CableId), true), (Network::heal, false)] {
        plant.events.clear();
        fault(plant.network_mut(), CableId(2));
        plant.run(200);
        let reports = |event: &&Event| matches!(event, Event::JunctionChanged { broken: now, .. } if *now == broken);
        assert_eq!(plant.events.iter().filter(reports).count(), 1, "{:?}", plant.events);
        assert!(plant.is_complete() && plant.application.all_settled());
    }
}

/// As in TwinCAT files for terminals: outputs that act already in SAFEOP would be dangerous.
// covers: 8.2, sync-managers-declared
#[test]
fn outputs_that_a_file_enables_at_so_are_off_in_safeop() {
    let set_sm = "<Data>000f010044000100</Data>";
    let text = String::from_utf8(MACHINE.to_vec()).expect("it is text");
    let lamps = text.find(set_sm).expect("the lamps have one");
    let at = text[..lamps].rfind("<Transition>PS</Transition>").expect("it is set at PS");
    let text = format!("{}{}", &text[..at], text[at..].replacen(">PS<", ">SO<", 1));
    let file = EniFile::from_bytes(text.as_bytes()).expect("it is sound");
    let declared = file.configuration.declaration.subdevices[LAMPS].declared.clone().expect("it has commands");
    assert!(declared[0].op_only && !file.configuration.notices.iter().any(|notice| notice.subject.contains("at SO")));
    let mut plant = activate(file, false, false).expect("it fits");
    plant.settle();
    let is_on = |plant: &Plant| plant.device(LAMPS).controller.register(map::sync_manager(0).offset(6), 1)[0] & 1 == 1;
    assert!(is_on(&plant));
    for (to, on) in [(AlState::SafeOp, false), (AlState::Op, true)] {
        let mut work = plant.application.engine_mut().start_state_request(SubDeviceId(LAMPS), to);
        while work.take().is_none() {
            plant.cycle();
        }
        assert_eq!(is_on(&plant), on, "{to}");
    }
    plant.settle();
}

/// The text without blocks that contain a string.
fn without(text: &str, open: &str, close: &str, containing: &str) -> String {
    let mut kept = String::new();
    let mut rest = text;
    while let Some(start) = rest.find(open) {
        let end = start + rest[start..].find(close).expect("it is closed") + close.len();
        kept.push_str(&rest[..start]);
        if !rest[start..end].contains(containing) {
            kept.push_str(&rest[start..end]);
        }
        rest = &rest[end..];
    }
    kept + rest
}

fn read(text: &str) -> EniFile {
    EniFile::from_bytes(text.as_bytes()).unwrap_or_else(|error| panic!("{error}"))
}

/// Puts commands before those of the drive.
fn with_commands_of_the_drive(commands: &str) -> EniFile {
    let text = String::from_utf8(MACHINE.to_vec()).expect("it is text");
    let drive = text.find("<Name>Drive</Name>").expect("it is there");
    let at = drive + text[drive..].find("</Mailbox>").expect("it has one");
    let at = at + text[at..].find("<InitCmds>").expect("it has some") + "<InitCmds>".len();
    read(&[&text[..at], commands, &text[at..]].concat())
}

// covers: eni-run
#[test]
fn registers_checked_by_a_file_are_set_by_the_simulated_eeprom() {
    let check = |ado: u16, data: &str, mask: &str| {
        format!(
            "<InitCmd><Transition>IP</Transition><Comment>check {ado}</Comment><Cmd>4</Cmd><Adp>1005</Adp>\
             <Ado>{ado}</Ado>\
             <Data>0000</Data><Validate><Data>{data}</Data>{mask}<Timeout>10</Timeout></Validate></InitCmd>"
        )
    };
    let masked = check(0x0150, "0180", "<DataMask>03f0</DataMask>");
    let mut plant = activate(with_commands_of_the_drive(&(check(0x0140, "0c06", "") + &masked)), false, false).unwrap();
    plant.settle();
    // Values of another controller type are not adopted.
    let mut plant = activate(with_commands_of_the_drive(&check(0x0000, "9900", "")), false, false).unwrap();
    plant.run(300);
    let reports = |event: &Event| {
        matches!(event, Event::ConfigurationFailed { subdevice: SubDeviceId(DRIVE), reason }
            if reason.contains("\"check 0\": register 0x0000: expected 99 00 within 10 ms, got 11 00"))
    };
    assert!(plant.events.iter().any(reports), "{:?}", plant.events);
}

// covers: eni-run
#[test]
fn pdos_assigned_by_a_file_fill_their_simulated_sync_manager() {
    let text = String::from_utf8(MACHINE.to_vec()).expect("it is text");
    let text = without(&text, "<TxPdo", "</TxPdo>", "#x6064");
    let text = without(&text, "<InitCmd>", "</InitCmd>", "<Index>6656<");
    let mut plant = activate(read(&text), false, false).expect("it fits");
    plant.settle();
    set(&mut plant, "Drive.Target velocity", 0x0102_0304);
    plant.run(4);
    assert_eq!(get(&plant, "Drive.Position"), 0x0102_0304);
}

/// The SII of the drive has no inputs, or not even a mailbox for a dictionary.
// covers: eni-run
#[test]
fn a_file_with_more_data_than_the_sii_is_followed() {
    for is_cut in [false, true] {
        let file = with(&[]);
        let mut segment = segment(&file.eni, &file.configuration, false);
        let drive = &mut segment.devices[DRIVE];
        let mut silent = drive.clone();
        silent.pdos.clear();
        silent.sync_managers.truncate(if is_cut { 0 } else { 3 });
        drive.sii_image = Some(ringcat_sim::sii_image::build(&silent));
        let network = Network::from_description(segment).expect("cables fit");
        let mut plant = activate_on(network, file, false).expect("the file says what there is");
        plant.settle();
        set(&mut plant, "Drive.Target velocity", 0x0102_0304);
        plant.run(4);
        assert_eq!(get(&plant, "Drive.Position"), 0x0102_0304);
    }
}

// covers: eni-run
#[test]
fn process_data_of_a_file_beyond_eight_kibibytes_has_simulated_memory() {
    let file = with(&[
        ("<Data>0014060064000100</Data>", "<Data>0094060064000100</Data>"),
        ("<Data>02000001060000070014000201000000</Data>", "<Data>02000001060000070094000201000000</Data>"),
    ]);
    let mut plant = activate(file, false, false).expect("it fits");
    plant.settle();
    set(&mut plant, "Drive.Target velocity", 0x0102_0304);
    plant.run(4);
    assert_eq!(get(&plant, "Drive.Position"), 0x0102_0304);
    assert_eq!(plant.found[DRIVE].controller.ram_kib, 34);
}
