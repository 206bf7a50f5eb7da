//! Commands of a SubDevice in written files, as those of TwinCAT and EC-Engineer (protocol 8.3).

use ringcat_config::ExportOptions;
use ringcat_config::eni::{Eni, Port, Requires, SubDevice, Target, Transition};
use ringcat_wire::address::LogicalAddress;
use ringcat_wire::command::Command;
use ringcat_wire::register::{Fmmu, SyncManager, SyncManagerActivate, SyncManagerControl};

use crate::{CELL, model, network};

fn exported() -> Eni {
    let export = network(CELL).to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    model(&export.text)
}

/// Register, data, and what is compared: data, mask, milliseconds.
type Line = (u16, Vec<u8>, Option<(Vec<u8>, Option<Vec<u8>>, u32)>);

/// The commands of a transition in their order.
fn at(subdevice: &SubDevice, transition: Transition) -> Vec<Line> {
    let commands = subdevice.init_commands.iter().filter(|command| command.transitions.contains(&transition));
    let line = |command: &ringcat_config::eni::EcatCommand| {
        let Target::Register { ado, .. } = command.datagram.target else { panic!("{command:?}") };
        let validate = command.validate.as_ref().map(|it| (it.data.clone(), it.mask.clone(), it.timeout_ms));
        (ado.0, command.datagram.data.clone(), validate)
    };
    commands.map(line).collect()
}

/// The request of a state and its check.
fn state(request: u8, code: u8, mask: u8, timeout_ms: u32) -> [Line; 2] {
    [(0x0120, vec![request, 0], None), (0x0130, vec![0, 0], Some((vec![code, 0], Some(vec![mask, 0]), timeout_ms)))]
}

fn contains(lines: &[Line], wanted: &[Line]) -> bool {
    lines.windows(wanted.len()).any(|window| window == wanted)
}

// covers: ES-60, eni-run
#[test]
fn latch_units_without_a_signal_are_activated_by_a_command_that_is_read_back() {
    let latch = CELL.replace("{ address = 0x0200, data = \"04 00\",", "{ address = 0x0980, data = \"30 01\",");
    assert_ne!(latch, CELL);
    let network = network(&latch);
    // The export is read back and compared.
    let eni = model(&network.to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}")).text);
    let lines = eni.subdevices.iter().flat_map(|it| &it.init_commands);
    let found = lines.filter(|it| it.datagram.data == [0x30, 0x01]).count();
    assert_eq!(found, 1);
}

// covers: ES-117, ES-118, ES-120, eni-run
#[test]
fn each_state_change_is_requested_and_waited_for() {
    let eni = exported();
    let drive = &eni.subdevices[1];
    let config = &network(CELL).configuration().declaration.subdevices[1];
    let limit = |from, to| u32::try_from(config.limit(from, to).as_millis()).expect("it fits");
    use ringcat_wire::al::AlState::{Boot, Init, Op, PreOp, SafeOp};
    let first = at(drive, Transition::Ip);
    assert_eq!(first[..2], state(0x11, 1, 0x0F, 3000), "an error of a SubDevice with a mailbox is acknowledged");
    assert_eq!(at(&eni.subdevices[0], Transition::Ip)[..2], state(0x01, 1, 0x0F, 3000), "there is no mailbox");
    for (transition, code, mask, limit) in [
        (Transition::Ip, 2, 0x1F, limit(Init, PreOp)),
        (Transition::Ps, 4, 0x1F, limit(PreOp, SafeOp)),
        (Transition::So, 8, 0x1F, limit(SafeOp, Op)),
        (Transition::Os, 4, 0x0F, limit(Op, SafeOp)),
        (Transition::Sp, 2, 0x0F, limit(SafeOp, PreOp)),
        (Transition::Op, 2, 0x0F, limit(Op, PreOp)),
        (Transition::Pi, 1, 0x0F, limit(PreOp, Init)),
        (Transition::Si, 1, 0x0F, limit(SafeOp, Init)),
        (Transition::Oi, 1, 0x0F, limit(Op, Init)),
        (Transition::Ib, 3, 0x1F, limit(Init, Boot)),
        (Transition::Bi, 1, 0x0F, limit(Boot, Init)),
    ] {
        let lines = at(drive, transition);
        assert!(contains(&lines, &state(code, code, mask, limit)), "{transition:?}: {lines:x?}");
    }
}

// covers: ES-116, eni-run
#[test]
fn the_application_has_the_eeprom_while_it_starts_and_keeps_it_where_declared() {
    let of = |text: &str, subdevice: usize, transition: Transition| -> Vec<(u16, u8)> {
        let export = network(text).to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
        let own = model(&export.text);
        // Read again and written again it is the same.
        let again = crate::again(&export.text, &ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
        let lines = |eni: &Eni| -> Vec<(u16, u8)> {
            let lines = at(&eni.subdevices[subdevice], transition).into_iter();
            let those = lines.filter(|line| matches!(line.0, 0x0500 | 0x0120));
            those.map(|line| (line.0, line.1[0])).collect()
        };
        assert_eq!(lines(&model(&again.text)), lines(&own));
        lines(&own)
    };
    let with = CELL.replace("eeprom_to_pdi = true\n", "");
    let (drive, coupler) = (1, 0);
    assert_eq!(of(CELL, drive, Transition::Ip), [(0x0120, 0x11), (0x0500, 0), (0x0500, 1), (0x0120, 2)]);
    let taken_back = [(0x0120, 0x11), (0x0500, 0), (0x0500, 1), (0x0120, 2), (0x0500, 0)];
    assert_eq!(of(&with, drive, Transition::Ip), taken_back);
    assert_eq!(of(&with, drive, Transition::Ib), [(0x0120, 0x11), (0x0500, 0), (0x0500, 1), (0x0120, 3)]);
    assert_eq!(of(&with, drive, Transition::Bi), [(0x0120, 1), (0x0500, 0)]);
    assert_eq!(of(&with, coupler, Transition::Ip), [(0x0120, 1), (0x0500, 0), (0x0120, 2)], "it has no mailbox");
}

// covers: ES-118, ES-119, ES-122, ES-135, eni-run
#[test]
fn registers_of_clocks_sync_managers_and_fmmus_have_the_bytes_of_other_tools() {
    let eni = exported();
    let drive = &eni.subdevices[1];
    let (ip, ps) = (at(drive, Transition::Ip), at(drive, Transition::Ps));
    let of = |lines: &[Line], register: u16| -> Vec<Vec<u8>> {
        lines.iter().filter(|line| line.0 == register).map(|line| line.1.clone()).collect()
    };
    // SYNC stops before PREOP; its start time is that of the MainDevice that reads the file.
    assert_eq!(of(&ip, 0x0980), [[0, 0]]);
    let clock: Vec<u16> =
        ps.iter().map(|line| line.0).filter(|register| (0x0980..=0x09AF).contains(register)).collect();
    assert_eq!(clock, [0x09A0, 0x0990, 0x0980]);
    assert_eq!(of(&ps, 0x0990), [[0; 8]]);
    let sync = network(CELL).configuration().declaration.subdevices[1].sync.expect("SYNC signals");
    let dc = drive.clock.as_ref().expect("a clock");
    assert_eq!((dc.reference, dc.cycle_0_ns, dc.shift_ns), (true, sync.sync0_cycle_ns, sync.sync0_shift_ns));
    let config = &network(CELL).configuration().declaration.subdevices[1];
    let word = |value: Option<u16>| -> Vec<Vec<u8>> { value.map(|it| it.to_le_bytes().to_vec()).into_iter().collect() };
    assert_eq!(of(&ip, 0x0400), word(config.watchdog_divider));
    assert_eq!(of(&ip, 0x0420), word(config.watchdog_intervals));
    // Mailboxes first, process data after them; start, length, control, status, activate, PDI control.
    assert_eq!(of(&ip, 0x0800).last(), Some(&vec![0x00, 0x10, 0x80, 0x00, 0x26, 0, 1, 0]));
    assert_eq!(of(&ps, 0x0810), [[0x00, 0x12, 0x07, 0x00, 0x64, 0, 1, 0]]);
    // Logical address, length, bits 0 to 7, physical address and bit, writes, enabled.
    let fmmu = &of(&ps, 0x0600)[0];
    assert_eq!((fmmu.len(), fmmu[4..].to_vec()), (16, vec![7, 0, 0, 7, 0x00, 0x12, 0, 2, 1, 0, 0, 0]));
}

// covers: ES-126, ES-133, ES-136, ES-138, eni-run
#[test]
fn addresses_cables_groups_and_places_of_a_written_file_are_those_of_the_network() {
    let eni = exported();
    let stations: Vec<_> = eni.subdevices.iter().map(|it| it.station).collect();
    assert_eq!(stations, (1001..).take(stations.len()).map(Some).collect::<Vec<_>>());
    assert!(eni.subdevices[0].previous_ports.is_empty(), "the first one is plugged into nothing");
    let heads: Vec<usize> = (0..eni.subdevices.len()).filter(|it| eni.subdevices[*it].hot_connect.is_some()).collect();
    assert_eq!(heads, [2, 4]);
    for head in heads {
        let group = eni.subdevices[head].hot_connect.as_ref().expect("a group");
        assert!(eni.subdevices[head].previous_ports.is_empty(), "a head has no place");
        assert!(!group.identify.is_empty());
    }
    let members = eni.subdevices.iter().filter_map(|it| Some(it.hot_connect.as_ref()?.members));
    assert_eq!(members.collect::<Vec<_>>(), [2, 1], "the head included");
    let mut plugged = network(CELL);
    let into = plugged.subdevice[1].plugged_into.clone();
    plugged.subdevice[2].plugged_into = into;
    let export = plugged.to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    assert!(model(&export.text).subdevices[2].previous_ports.is_empty());
    assert!(export.left_out.iter().any(|it| it.what == "plugged_into"), "{:?}", export.left_out);
    let drive = &eni.subdevices[1];
    let port = &drive.previous_ports[0];
    assert!(port.selected && port.station == Some(1001));
    let declared = network(CELL).subdevice[1].plugged_into.as_ref().expect("it is plugged into the coupler").port;
    let number = [Port::A, Port::B, Port::C, Port::D].iter().position(|it| *it == port.port);
    assert_eq!(number, Some(declared.into()), "the letter of the port");
    let data = drive.process_data.as_ref().expect("process data");
    assert_eq!((data.send.len(), data.receive.len(), data.send[0].length), (1, 1, 56));
    let mailbox = drive.mailbox.as_ref().expect("a mailbox");
    assert!(mailbox.eoe.iter().all(|it| it.mac.is_none() && it.ip.is_none() && !it.data.is_empty()));
}

// covers: ES-115, eni-run
#[test]
fn an_exported_eni_begins_with_the_commands_for_the_whole_bus() {
    let expected: [(u16, usize, &[u8]); 9] = [
        (0x0010, 2, &[]),
        (0x0300, 8, &[]),
        (0x0600, 256, &[]),
        (0x0800, 256, &[]),
        (0x0910, 32, &[]),
        (0x0981, 1, &[]),
        (0x0930, 2, &[0x00, 0x10]),
        (0x0934, 2, &[0x00, 0x0C]),
        (0x0103, 1, &[]),
    ];
    let commands = exported().main_device.init_commands;
    assert_eq!(commands.len(), expected.len());
    for (command, (register, length, data)) in commands.iter().zip(expected) {
        let Target::Register { adp, ado } = command.datagram.target else { panic!("{command:?}") };
        let mut bytes = data.to_vec();
        bytes.resize(length, 0);
        assert_eq!((command.datagram.command, adp, ado.0), (Command::Bwr, 0, register));
        assert_eq!((&command.datagram.data, command.datagram.count), (&bytes, None), "{register:#06x}");
        assert_eq!((command.retries, command.requires), (3, Some(Requires::Cycle)), "{register:#06x}");
        assert!(command.before_subdevices && command.transitions == [Transition::Ip], "{register:#06x}");
    }
}

// covers: ES-175
#[test]
fn fmmus_and_sync_managers_have_the_bytes_of_files_of_tools() {
    let outputs = |logical, length, physical_start| {
        let logical_start = LogicalAddress(logical);
        let fmmu = Fmmu { logical_start, length, logical_stop_bit: 7, physical_start, ..Fmmu::default() };
        Fmmu { write: true, active: true, ..fmmu }.encode()
    };
    let hex = |bytes: &[u8]| bytes.iter().map(|byte| format!("{byte:02X}")).collect::<String>();
    assert_eq!(hex(&outputs(0x0100_0000, 4, 0x1100)), "00000001040000070011000201000000");
    assert_eq!(hex(&outputs(0x0100_0004, 1, 0x0F00)), "0400000101000007000F000201000000");
    for (bit, expected) in [(0, "00000009010000000D08000101000000"), (3, "00000009010003030D08000101000000")] {
        let logical = LogicalAddress(0x0900_0000);
        let state = Fmmu {
            logical_start: logical,
            length: 1,
            logical_start_bit: bit,
            logical_stop_bit: bit,
            physical_start: 0x080D,
            read: true,
            active: true,
            ..Fmmu::default()
        };
        assert_eq!(hex(&state.encode()), expected, "bit {bit}");
    }
    for (start, length, control, is_active, expected) in
        [(0x0F00, 1, 0x44, true, "000F010044000100"), (0x1180, 0, 0, false, "8011000000000000")]
    {
        let manager = SyncManager {
            start,
            length,
            control: SyncManagerControl::from_bits(control),
            activate: SyncManagerActivate::from_bits(is_active.into()),
            ..SyncManager::default()
        };
        assert_eq!(hex(&manager.encode()), expected);
    }
}

// covers: ES-178, eni-run
#[test]
fn exported_auto_increment_addresses_count_down_and_identities_are_read_by_word() {
    let eni = exported();
    let places: Vec<u16> = eni.subdevices.iter().take(4).filter_map(|it| it.auto_increment).collect();
    assert_eq!(places, [0, 65535, 65534, 65533]);
    // SubDevices without an identity in the network file have no identity to compare.
    let expected = network(CELL).configuration().declaration.subdevices;
    let expected = expected.iter().filter(|it| it.expected.vendor_id.is_some() && it.expected.product_code.is_some());
    let (expected, mut compared) = (expected.count(), 0);
    for subdevice in &eni.subdevices {
        let words: Vec<Vec<u8>> = at(subdevice, Transition::Ip)
            .into_iter()
            .filter(|(register, data, _)| {
                *register == 0x0502 && data.get(2).is_some_and(|word| (8..=0xE).contains(word))
            })
            .map(|(_, data, _)| data)
            .collect();
        for data in &words {
            assert_eq!((data[..2].to_vec(), data[3..].to_vec()), (vec![0, 1], vec![0; 3]), "{data:02x?}");
        }
        let order: Vec<u8> = words.iter().map(|data| data[2]).collect();
        compared += usize::from(order.starts_with(&[8, 0xA]));
        assert!(order.is_sorted(), "{order:x?}");
    }
    assert!(compared > 0 && compared == expected, "{compared} of {expected}");
}
