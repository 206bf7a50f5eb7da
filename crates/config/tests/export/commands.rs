//! Commands of a SubDevice in written files, as those of TwinCAT and EC-Engineer (protocol 8.3).

use ringcat_config::ExportOptions;
use ringcat_config::eni::{Eni, SubDevice, Target, Transition};

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
        assert!(group.members >= 1 && !group.identify.is_empty());
    }
    let mut plugged = network(CELL);
    let into = plugged.subdevice[1].plugged_into.clone();
    plugged.subdevice[2].plugged_into = into;
    let export = plugged.to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    assert!(model(&export.text).subdevices[2].previous_ports.is_empty());
    assert!(export.left_out.iter().any(|it| it.what == "plugged_into"), "{:?}", export.left_out);
    let drive = &eni.subdevices[1];
    let port = &drive.previous_ports[0];
    assert!(port.selected && port.station == Some(1001));
    let data = drive.process_data.as_ref().expect("process data");
    assert_eq!((data.send.len(), data.receive.len(), data.send[0].length), (1, 1, 56));
    let mailbox = drive.mailbox.as_ref().expect("a mailbox");
    assert!(mailbox.eoe.iter().all(|it| it.mac.is_none() && it.ip.is_none() && !it.data.is_empty()));
}
