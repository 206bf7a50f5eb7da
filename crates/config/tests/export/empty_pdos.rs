//! PDOs without entries, and SyncManagers to which no PDO is assigned.

use ringcat_config::{ExportOptions, ImageArea};
use ringcat_engine::config::{PdoMapping, StartupAction, SyncManagerRole};
use ringcat_engine::info::Direction;

use crate::{CELL, again, configured, network};

/// `CELL` with other PDOs in the SyncManager for the inputs of the drive.
fn cell(pdos: &str) -> String {
    let (head, rest) = CELL.split_once("[[subdevice.sync_manager.pdo]]\nindex = 0x1a00").expect("the inputs");
    let (_, tail) = rest.split_once("[subdevice.sync]").expect("the signals");
    format!("{head}{pdos}[subdevice.sync]{tail}")
}

/// As the EL6690 and terminals for gateways have them: the application defines the entries.
// covers: eni-run
#[test]
fn a_pdo_without_entries_is_in_the_eni_and_stays_assigned() {
    let file = network(&cell("[[subdevice.sync_manager.pdo]]\nindex = 0x1a10\nname = \"Inputs\"\nentries = []\n\n"));
    let export = file.to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    let drive = &configured(&export.text).declaration.subdevices[1];
    let declared = drive.declared.as_ref().expect("SyncManagers");
    let inputs = declared.iter().find(|it| it.index == 3).expect("SyncManager 3 is in the file");
    assert_eq!((inputs.role, inputs.register.start), (SyncManagerRole::Inputs, 0x1300));
    assert_eq!(inputs.area().map(|area| area.length), Some(0), "it is disabled");
    assert_eq!(inputs.pdos, [PdoMapping::of(0x1A10, [])]);
    let of_drive = |area: &&ImageArea| area.subdevice == 1 && area.direction == Direction::Inputs;
    assert_eq!(export.configuration.image.areas.iter().filter(of_drive).count(), 0);
    assert_eq!(export.left_out.iter().filter(|it| it.what == "sync_manager" && it.subdevice == Some(1)).count(), 0);
    let second = again(&export.text, &ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(second.text, export.text);
}

/// As the EK1960 has them: start 0, control byte 0.
// covers: eni-run
#[test]
fn a_sync_manager_of_zeros_without_pdos_is_not_read_as_cleared() {
    for keys in ["", "op_only = true\n", "watchdog = false\n"] {
        let zeros = format!("start = 0x0000\ncontrol = 0x00\n{keys}");
        let text = cell("").replacen("start = 0x1300\ncontrol = 0x20\n", &zeros, 1);
        let export = network(&text).to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
        let drive = &configured(&export.text).declaration.subdevices[1];
        let inputs = drive.declared.iter().flatten().find(|it| it.index == 3).expect("SyncManager 3 is in the file");
        assert_eq!((inputs.role, inputs.register.activate.enable), (SyncManagerRole::Inputs, false));
    }
}

/// The engine clears the assignment of such a SyncManager, so the ENI has to do the same.
// covers: eni-run, ES-182
#[test]
fn an_assignment_without_pdos_is_cleared_by_the_eni() {
    let export = network(&cell("")).to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    let drive = &configured(&export.text).declaration.subdevices[1];
    let written = drive.startup.iter().filter_map(|command| match &command.action {
        StartupAction::Sdo(it) if it.index == 0x1C13 => Some((it.sub_index, it.data.clone())),
        _ => None,
    });
    assert_eq!(written.collect::<Vec<_>>(), [(0, vec![0]), (0, vec![0])], "cleared, no PDO, a count of 0");
    let inputs = drive.declared.iter().flatten().find(|it| it.index == 3).expect("SyncManager 3 is in the file");
    assert_eq!((inputs.area().map(|area| area.length), &inputs.pdos[..]), (Some(0), &[][..]));
}
