mod declared;

use std::path::Path;
use std::string::ToString;
use std::vec;
use std::vec::Vec;
use std::{fs, println};

use ringcat_wire::address::{Position, StationAddress};
use ringcat_wire::register::Information;
use ringcat_wire::sii::{CoeDetails, GeneralFlags, MailboxLayout, MailboxProtocols, Sii, SiiHeader, SiiSyncManager};

use super::*;
use crate::config::{FileRead, PdoEntry, PdoMapping, StartupAction, StartupCommand, Transition, Watchdog};
use crate::info::{InfoWarning, PdoEntryInfo, PdoInfo, PdoSource, Readout, SiiProblem};

/// An ET1100: 8 FMMUs, 8 SyncManagers, 8 KiB, four MII ports, DC.
const INFORMATION: [u8; Information::LEN] = [0x11, 0x01, 0x02, 0x00, 8, 8, 8, 0xFF, 0x0C, 0x00];

fn sm(start: u16, length: u16, control: u8, enable: u8, kind: SyncManagerKind) -> SiiSyncManager {
    SiiSyncManager { start, length, control, status: 0, enable, kind }
}

fn pdo(index: u16, direction: Direction, sync_manager: Option<u8>, entries: &[(u16, u8, u8)]) -> PdoInfo {
    let entry =
        |&(index, sub_index, bit_length): &_| PdoEntryInfo { index, sub_index, bit_length, ..Default::default() };
    PdoInfo { index, direction, sync_manager, name: "".into(), flags: 0, entries: entries.iter().map(entry).collect() }
}

/// A device with mailbox, two output PDOs in SM 2, one input PDO in SM 3, and one that is not assigned.
fn device() -> SubDeviceInfo {
    SubDeviceInfo {
        position: Position(4),
        station: StationAddress(0x1005),
        controller: Information::decode(&INFORMATION).into(),
        mailbox: Some(MailboxLayout {
            receive_offset: 0x1000,
            receive_size: 0x80,
            send_offset: 0x1080,
            send_size: 0x80,
        }),
        protocols: MailboxProtocols(MailboxProtocols::COE),
        coe: CoeDetails(CoeDetails::SDO | CoeDetails::PDO_ASSIGN | CoeDetails::PDO_CONFIGURATION),
        sync_managers: vec![
            sm(0x1000, 0x80, 0x36, 1, SyncManagerKind::MailboxOut),
            sm(0x1080, 0x80, 0x32, 1, SyncManagerKind::MailboxIn),
            sm(0x1100, 3, 0x64, 1, SyncManagerKind::Outputs),
            sm(0x1180, 4, 0x20, 1, SyncManagerKind::Inputs),
        ],
        pdos: vec![
            pdo(0x1600, Direction::Outputs, Some(2), &[(0x7000, 1, 1), (0x7000, 2, 1), (0, 0, 6)]),
            pdo(0x1601, Direction::Outputs, Some(2), &[(0x7010, 1, 12)]),
            pdo(0x1A00, Direction::Inputs, Some(3), &[(0x6000, 1, 16), (0x6000, 2, 16)]),
            pdo(0x1A01, Direction::Inputs, None, &[(0x6010, 1, 8)]),
        ],
        ..SubDeviceInfo::default()
    }
}

/// A terminal without a mailbox: digital outputs at 0x0F00, no PDO names.
fn terminal() -> SubDeviceInfo {
    SubDeviceInfo {
        controller: Information::decode(&INFORMATION).into(),
        sync_managers: vec![sm(0x0F00, 0, 0x44, 9, SyncManagerKind::Outputs)],
        pdos: (0..4).map(|n| pdo(0x1600 + n, Direction::Outputs, Some(0), &[(0x3001, 1 + n as u8, 1)])).collect(),
        ..SubDeviceInfo::default()
    }
}

fn any() -> SubDeviceConfig {
    SubDeviceConfig::default()
}

fn problem(config: &SubDeviceConfig, info: &SubDeviceInfo) -> PlanProblem {
    plan(config, info).unwrap_err().problem
}

fn sdos(plan: &SubDevicePlan) -> Vec<(u16, u8, Vec<u8>)> {
    let all = plan.pdos.iter().flat_map(|planned| &planned.sdos);
    all.map(|sdo| (sdo.index, sdo.sub_index, sdo.data.clone())).collect()
}

// covers: plan
#[test]
fn the_sii_alone_gives_mailbox_areas_and_unused_sync_managers() {
    let plan = plan(&any(), &device()).unwrap();
    let mailbox: Vec<_> = plan.mailbox.iter().map(|sm| (sm.index, sm.register.encode())).collect();
    let out = [0x00, 0x10, 0x80, 0x00, 0x36, 0, 1, 0];
    let inward = [0x80, 0x10, 0x80, 0x00, 0x32, 0, 1, 0];
    assert_eq!(mailbox, [(0, out), (1, inward)]);
    let [outputs, inputs] = &plan.process_data[..] else { panic!("{:?}", plan.process_data) };
    assert_eq!((outputs.sync_manager, outputs.direction, outputs.length), (2, Direction::Outputs, 3));
    assert_eq!(outputs.register.encode(), [0x00, 0x11, 0x03, 0x00, 0x64, 0, 1, 0]);
    assert_eq!((inputs.sync_manager, inputs.direction, inputs.length), (3, Direction::Inputs, 4));
    assert_eq!(inputs.register.encode(), [0x80, 0x11, 0x04, 0x00, 0x20, 0, 1, 0]);
    assert_eq!(plan.unused, [4, 5, 6, 7]);
    assert_eq!((sdos(&plan), plan.warnings, plan.watchdog), (vec![], vec![], vec![]));
    assert!(plan.lrw_supported && plan.bootstrap.is_empty());
    assert_eq!(plan.station, StationAddress(0x1005));
}

#[test]
fn entries_are_adjacent_across_pdos() {
    let plan = plan(&any(), &device()).unwrap();
    let places: Vec<_> = plan.process_data[0]
        .pdos
        .iter()
        .flat_map(|pdo| pdo.entries.iter().map(|entry| (pdo.index, entry.index, entry.bit_offset, entry.bit_length)))
        .collect();
    let expected = [(0x1600, 0x7000, 0, 1), (0x1600, 0x7000, 1, 1), (0x1600, 0, 2, 6), (0x1601, 0x7010, 8, 12)];
    assert_eq!(places, expected);
}

#[test]
fn a_mailbox_without_sync_manager_category_gets_the_usual_control_bytes() {
    let info = SubDeviceInfo { sync_managers: vec![], pdos: vec![], ..device() };
    let plan = plan(&any(), &info).unwrap();
    let controls: Vec<_> = plan.mailbox.iter().map(|sm| sm.register.control.bits()).collect();
    assert_eq!(controls, [0x26, 0x22]);
    assert_eq!(plan.process_data, []);
}

#[test]
fn the_bootstrap_mailbox_has_its_own_addresses() {
    let layout = MailboxLayout { receive_offset: 0x1000, receive_size: 0x100, send_offset: 0x1200, send_size: 0x100 };
    let plan = plan(&any(), &SubDeviceInfo { bootstrap: Some(layout), ..device() }).unwrap();
    assert_eq!(plan.bootstrap[1].register.encode(), [0x00, 0x12, 0x00, 0x01, 0x32, 0, 1, 0]);
    assert_eq!(plan.mailbox[1].register.start, 0x1080);
}

#[test]
fn a_terminal_without_mailbox_has_process_data_in_sm_0() {
    let plan = plan(&any(), &terminal()).unwrap();
    let [area] = &plan.process_data[..] else { panic!("{:?}", plan.process_data) };
    assert_eq!((area.sync_manager, area.physical, area.length, area.op_only), (0, 0x0F00, 1, true));
    assert_eq!(area.register.encode(), [0x00, 0x0F, 0x01, 0x00, 0x44, 0, 1, 0]);
    assert_eq!(area.pdos.len(), 4);
    assert!(plan.mailbox.is_empty());
}

#[test]
fn a_sync_manager_without_pdos_has_the_length_of_the_sii() {
    let info = SubDeviceInfo { pdos: vec![], ..device() };
    let plan = plan(&any(), &info).unwrap();
    assert_eq!(plan.process_data.iter().map(|area| area.length).collect::<Vec<_>>(), [3, 4]);
    assert!(plan.process_data.iter().all(|area| area.pdos.is_empty()));
}

#[test]
fn a_sync_manager_without_enable_bit_and_pdos_stays_disabled() {
    let mut info = SubDeviceInfo { pdos: vec![], ..device() };
    info.sync_managers[2].enable = 0;
    let plan = plan(&any(), &info).unwrap();
    assert_eq!(plan.process_data[0].register.encode(), [0x00, 0x11, 0x00, 0x00, 0x64, 0, 0, 0]);
    assert_eq!(plan.mapped_areas().map(|(fmmu, area)| (fmmu, area.sync_manager)).collect::<Vec<_>>(), [(0, 3)]);
}

#[test]
fn a_virtual_sync_manager_is_no_area() {
    let mut info = device();
    info.sync_managers[3].enable = SiiSyncManager::ENABLE | SiiSyncManager::VIRTUAL;
    let plan = plan(&any(), &info).unwrap();
    assert_eq!(plan.process_data.iter().map(|area| area.sync_manager).collect::<Vec<_>>(), [2]);
}

#[test]
fn the_direction_of_the_pdos_overrides_the_control_byte() {
    let mut info = device();
    info.sync_managers[2].control = 0x20;
    assert_eq!(plan(&any(), &info).unwrap().process_data[0].register.control.bits(), 0x24);
}

#[test]
fn an_fmmu_maps_an_area_byte_by_byte() {
    let plan = plan(&any(), &device()).unwrap();
    let outputs = fmmu(&plan.process_data[0], LogicalAddress(0x0001_0020)).encode();
    assert_eq!(outputs, [0x20, 0, 1, 0, 3, 0, 0, 7, 0x00, 0x11, 0, 2, 1, 0, 0, 0]);
    let inputs = fmmu(&plan.process_data[1], LogicalAddress(0x0001_0023)).encode();
    assert_eq!(inputs, [0x23, 0, 1, 0, 4, 0, 0, 7, 0x80, 0x11, 0, 1, 1, 0, 0, 0]);
}

#[test]
fn a_changed_assignment_is_cleared_written_and_counted() {
    let config = any().assign(3, Direction::Inputs, vec![PdoMapping::from_sii(0x1A01), PdoMapping::from_sii(0x1A00)]);
    let plan = plan(&config, &device()).unwrap();
    let expected =
        [(0x1C13, 0, vec![0]), (0x1C13, 1, vec![0x01, 0x1A]), (0x1C13, 2, vec![0x00, 0x1A]), (0x1C13, 0, vec![2])];
    assert_eq!(sdos(&plan), expected);
    assert_eq!(plan.process_data[1].length, 5);
    assert_eq!(plan.process_data[1].pdos[1].entries[0].bit_offset, 8);
    // SM 2 was not declared: as in the SII.
    assert_eq!(plan.process_data[0].length, 3);
}

// covers: plan
#[test]
fn a_changed_mapping_is_written_while_the_pdo_is_not_assigned() {
    let mapping = PdoMapping::of(0x1A00, [PdoEntry::new(0x6000, 1, 16), PdoEntry::new(0, 0, 8)]);
    let plan = plan(&any().assign(3, Direction::Inputs, vec![mapping]), &device()).unwrap();
    let expected = [
        (0x1C13, 0, vec![0]),
        (0x1A00, 0, vec![0]),
        (0x1A00, 1, vec![0x10, 0x01, 0x00, 0x60]),
        (0x1A00, 2, vec![0x08, 0x00, 0x00, 0x00]),
        (0x1A00, 0, vec![2]),
        (0x1C13, 1, vec![0x00, 0x1A]),
        (0x1C13, 0, vec![1]),
    ];
    assert_eq!(sdos(&plan), expected);
    assert_eq!(plan.process_data[1].length, 3);
}

#[test]
fn a_declaration_equal_to_the_sii_writes_nothing() {
    let entries = [PdoEntry::new(0x6000, 1, 16), PdoEntry::new(0x6000, 2, 16)];
    let config = any().assign(3, Direction::Inputs, vec![PdoMapping::of(0x1A00, entries)]);
    assert_eq!(sdos(&plan(&config, &device()).unwrap()), []);
}

#[test]
fn an_assignment_without_pdos_disables_the_sync_manager() {
    let plan = plan(&any().assign(3, Direction::Inputs, vec![]), &device()).unwrap();
    assert_eq!(sdos(&plan), [(0x1C13, 0, vec![0]), (0x1C13, 0, vec![0])]);
    let area = &plan.process_data[1];
    assert_eq!((area.length, area.register.activate.enable), (0, false));
    assert!(!fmmu(area, LogicalAddress(0)).active);
}

// covers: plan, ES-47
#[test]
fn the_mapping_of_a_fixed_pdo_is_never_written() {
    let mapping = |fixed| PdoMapping::of(0x1A02, [PdoEntry::new(0x6020, 1, 8)]).with_fixed(fixed);
    let of = |fixed| plan(&any().assign(3, Direction::Inputs, vec![mapping(fixed)]), &device()).unwrap();
    let objects = |plan: &SubDevicePlan| sdos(plan).iter().map(|sdo| sdo.0).collect::<Vec<_>>();
    let (free, fixed) = (of(false), of(true));
    assert_eq!(objects(&free), [0x1C13, 0x1A02, 0x1A02, 0x1A02, 0x1C13, 0x1C13]);
    assert_eq!((objects(&fixed), free.warnings), (vec![0x1C13; 3], vec![]));
    assert_eq!(fixed.warnings, [PlanWarning::FixedMapping { pdo: 0x1A02 }], "it is not what the SII describes");
}

#[test]
fn a_change_that_the_sii_does_not_permit_is_a_warning_and_not_written() {
    let info = SubDeviceInfo { coe: CoeDetails(CoeDetails::SDO), ..device() };
    let mapping = PdoMapping::of(0x1A02, [PdoEntry::new(0x6020, 1, 8)]);
    let plan = plan(&any().assign(3, Direction::Inputs, vec![mapping]), &info).unwrap();
    let expected = [PlanWarning::FixedAssignment { sync_manager: 3 }, PlanWarning::FixedMapping { pdo: 0x1A02 }];
    assert_eq!(plan.warnings, expected);
    assert_eq!((sdos(&plan), plan.process_data[1].length), (vec![], 1));
}

// covers: plan
#[test]
fn other_process_data_without_coe_is_a_warning_and_configured_as_declared() {
    let entries = |bits| vec![PdoMapping::of(0x1600, [PdoEntry::new(0x3001, 1, bits)])];
    for (bits, bytes) in [(4, 1), (16, 2)] {
        let plan = plan(&any().assign(0, Direction::Outputs, entries(bits)), &terminal()).unwrap();
        assert_eq!((sdos(&plan), plan.process_data[0].length), (vec![], bytes));
        assert_eq!(plan.warnings, [PlanWarning::NoCoe { sync_manager: 0 }]);
    }
    let as_described = (0..4).map(|n| PdoMapping::of(0x1600 + n, [PdoEntry::new(0x3001, 1 + n as u8, 1)])).collect();
    let plan = plan(&any().assign(0, Direction::Outputs, as_described), &terminal()).unwrap();
    assert_eq!((sdos(&plan), plan.warnings), (vec![], vec![]));
}

/// A former owner may have written others: all that is not known is written.
// covers: plan
#[test]
fn downloads_bring_any_dictionary_to_what_is_planned() {
    let plan = plan(&any(), &device()).unwrap();
    let [outputs, _] = &plan.pdos[..] else { panic!("{:?}", plan.pdos) };
    assert_eq!(outputs.wanted.pdos.iter().map(|pdo| pdo.index).collect::<Vec<_>>(), [0x1600, 0x1601]);
    let written = |held: &HeldPdos| outputs.downloads(held).iter().map(|sdo| (sdo.index, sdo.sub_index)).collect();
    let all: Vec<(u16, u8)> = written(&HeldPdos::default());
    let mappings = [(0x1600, 0), (0x1600, 1), (0x1600, 2), (0x1600, 3), (0x1600, 0), (0x1601, 0), (0x1601, 1)];
    let assignment = [(0x1601, 0), (0x1C12, 1), (0x1C12, 2), (0x1C12, 0)];
    assert_eq!(all, [&[(0x1C12, 0)][..], &mappings, &assignment].concat());
    let held = HeldPdos { assigned: Some(vec![0x1600, 0x1601]), mapped: outputs.wanted.pdos.clone() };
    assert_eq!(outputs.downloads(&held), []);
    let reordered = HeldPdos { assigned: Some(vec![0x1601, 0x1600]), ..held };
    assert_eq!(written(&reordered), [(0x1C12, 0), (0x1C12, 1), (0x1C12, 2), (0x1C12, 0)]);
}

// covers: plan
#[test]
fn watchdogs_are_declared_per_sync_manager_and_for_the_controller() {
    let config = any()
        .watchdog(Some(0x09C2), Some(500))
        .sync_manager(2, Direction::Outputs, Watchdog::Off)
        .sync_manager(3, Direction::Inputs, Watchdog::On);
    let plan = plan(&config, &device()).unwrap();
    let expected = [(RegisterAddress(0x0400), vec![0xC2, 0x09]), (RegisterAddress(0x0420), vec![0xF4, 0x01])];
    assert_eq!(plan.watchdog, expected);
    let controls: Vec<_> = plan.process_data.iter().map(|area| area.register.control.bits()).collect();
    assert_eq!(controls, [0x24, 0x60]);
}

#[test]
fn controller_or_sii_exclude_lrw() {
    let mut info = device();
    info.flags = GeneralFlags(GeneralFlags::NOT_LRW);
    assert!(!plan(&any(), &info).unwrap().lrw_supported);
    info = device();
    info.controller.features.lrw_unsupported = true;
    assert!(!plan(&any(), &info).unwrap().lrw_supported);
}

// covers: plan
#[test]
fn an_error_names_subdevice_sync_manager_expected_and_got() {
    let config = any().assign(9, Direction::Inputs, vec![]);
    assert_eq!(
        plan(&config, &device()).unwrap_err().to_string(),
        "SubDevice 4 (0x1005): SM 9 is declared, the controller has 8 SyncManagers"
    );
}

#[test]
fn sync_managers_must_exist_and_be_free() {
    let unknown = any().assign(5, Direction::Inputs, vec![PdoMapping::from_sii(0x1A00)]);
    let expected = PlanProblem::UnknownSyncManager { sync_manager: 5, described: 4 };
    assert_eq!(problem(&unknown, &device()), expected);
    let mailbox = any().sync_manager(1, Direction::Inputs, Watchdog::Default);
    assert_eq!(problem(&mailbox, &device()), PlanProblem::MailboxSyncManager { sync_manager: 1 });
}

#[test]
fn pdos_must_be_known_of_the_right_direction_and_assigned_once() {
    let assign = |pdo| any().assign(3, Direction::Inputs, vec![PdoMapping::from_sii(pdo)]);
    let (expected, got) = (Direction::Inputs, Direction::Outputs);
    assert_eq!(problem(&assign(0x1A77), &device()), PlanProblem::UnknownPdo { sync_manager: 3, pdo: 0x1A77 });
    let direction = PlanProblem::PdoDirection { sync_manager: 3, pdo: 0x1600, expected, got };
    assert_eq!(problem(&assign(0x1600), &device()), direction);
    let twice = vec![PdoMapping::from_sii(0x1A00), PdoMapping::from_sii(0x1A00)];
    let expected = PlanProblem::PdoTwice { pdo: 0x1A00, first: 3, second: 3 };
    assert_eq!(problem(&any().assign(3, Direction::Inputs, twice), &device()), expected);
    let contradiction =
        any().sync_manager(3, Direction::Outputs, Watchdog::Default).assign(3, Direction::Inputs, vec![]);
    let expected = PlanProblem::Directions { sync_manager: 3, expected: got, got: Direction::Inputs };
    assert_eq!(problem(&contradiction, &device()), expected);
}

#[test]
fn too_many_or_too_long_is_an_error() {
    let entries = vec![PdoEntry::new(0x6000, 1, 255); 255];
    let config = any().assign(3, Direction::Inputs, vec![PdoMapping::of(0x1A00, entries)]);
    let expected = PlanProblem::TooMany { object: 0x1A00, expected: 254, got: 255 };
    assert_eq!(problem(&config, &device()), expected);
    let pdos = (0..20).map(|n| PdoMapping::of(0x1A10 + n, vec![PdoEntry::new(0x6000, 1, 255); 254])).collect();
    let config = any().assign(3, Direction::Inputs, pdos);
    let expected = PlanProblem::TooLong { sync_manager: 3, bits: 20 * 254 * 255 };
    assert_eq!(problem(&config, &device()), expected);
}

#[test]
fn three_buffers_must_not_overlap_the_next_area() {
    let mut info = device();
    // Three times 3 bytes from 0x1100 end at 0x1109.
    info.sync_managers[3].start = 0x1109;
    assert!(plan(&any(), &info).is_ok());
    info.sync_managers[3].start = 0x1108;
    let expected =
        PlanProblem::Overlap { first: 2, first_bytes: 0x1100..0x1109, second: 3, second_bytes: 0x1108..0x1114 };
    assert_eq!(problem(&any(), &info), expected);
}

#[test]
fn an_area_must_lie_in_the_memory() {
    let mut info = device();
    info.controller.ram_kib = 1;
    info.sync_managers[3].start = 0x13F8;
    let expected = PlanProblem::OutsideMemory { sync_manager: 3, start: 0x13F8, bytes: 12, memory_end: 0x1400 };
    assert_eq!(problem(&any(), &info), expected);
}

#[test]
fn each_area_needs_an_fmmu() {
    let mut info = device();
    info.controller.fmmu_count = 1;
    assert_eq!(problem(&any(), &info), PlanProblem::TooFewFmmus { expected: 2, got: 1 });
}

#[test]
fn an_sdo_needs_coe() {
    let config = any().sdo(0x8000, 1, [1]);
    assert!(plan(&config, &device()).is_ok());
    assert_eq!(problem(&config, &terminal()), PlanProblem::NoCoe { index: 0x8000, sub_index: 1 });
}

#[test]
fn a_message_of_a_start_up_command_fits_the_mailbox_of_its_state() {
    let layout = MailboxLayout { receive_offset: 0x1000, receive_size: 0x40, send_offset: 0x1200, send_size: 0x40 };
    let protocols = MailboxProtocols(MailboxProtocols::FOE | MailboxProtocols::AOE);
    let info = SubDeviceInfo { bootstrap: Some(layout), protocols, ..device() };
    // The headers of mailbox and FoE have 6 bytes each, the mailboxes 128 and in BOOT 64.
    let file = |transition, length: usize| {
        let read = StartupAction::FileRead(FileRead::new("n".repeat(length)));
        SubDeviceConfig { startup: vec![StartupCommand::new(transition, read)], ..any() }
    };
    for (transition, mailbox) in [(Transition::Ip, 128), (Transition::Ib, 64)] {
        let most = usize::from(mailbox) - 12;
        assert!(plan(&file(transition, most), &info).is_ok(), "{transition:?}");
        let expected = PlanProblem::MailTooLong { bytes: usize::from(mailbox) + 1, mailbox };
        assert_eq!(problem(&file(transition, most + 1), &info), expected);
    }
    let text = PlanProblem::MailTooLong { bytes: 129, mailbox: 128 }.to_string();
    assert_eq!(text, "a start-up command has a message of 129 bytes, the mailbox has 128");
}

#[test]
fn a_dictionary_without_pdos_overrides_the_default_length() {
    let mut info = device();
    info.pdos.retain(|pdo| pdo.sync_manager != Some(2));
    assert_eq!(plan(&any(), &info).unwrap().process_data[0].length, 3);
    info.pdo_source = PdoSource::Dictionary;
    assert_eq!(plan(&any(), &info).unwrap().process_data[0].length, 0);
}

#[test]
fn the_type_of_a_sync_manager_overrides_its_pdos() {
    let mut info = device();
    info.pdos.retain(|pdo| pdo.sync_manager != Some(3));
    info.pdos[0].sync_manager = Some(3);
    let plan = plan(&any(), &info).unwrap();
    assert_eq!((plan.process_data[1].direction, plan.process_data[1].pdos.len()), (Direction::Inputs, 0));
}

// covers: odd-sii
#[test]
fn an_error_names_declaration_or_sii_as_the_part_to_correct() {
    let fault = |config: &SubDeviceConfig, info: &SubDeviceInfo| plan(config, info).unwrap_err().fault;
    let wrong = any().assign(9, Direction::Inputs, vec![]);
    assert_eq!(fault(&wrong, &device()), PlanFault::Declaration);
    let mut unfit = device();
    unfit.sync_managers[2].start = 0x2FFF;
    assert_eq!(fault(&any(), &unfit), PlanFault::Sii);
    assert_eq!(
        plan(&any(), &unfit).unwrap_err().to_string(),
        "SubDevice 4 (0x1005): its SII cannot be used: SM 2: 9 bytes (all buffers) at 0x2fff exceed the memory, \
         which ends at 0x3000"
    );
    let problem = SiiProblem::Checksum { expected: 1, got: 2 };
    let mut damaged = SubDeviceInfo { sync_managers: vec![], ..device() };
    damaged.warnings.push(InfoWarning { category: None, offset: Some(14), problem });
    let declared = any().assign(3, Direction::Inputs, vec![PdoMapping::from_sii(0x1A00)]);
    assert_eq!(fault(&declared, &damaged), PlanFault::Sii);
}

#[test]
fn a_blank_eeprom_is_an_error_unless_sync_managers_are_declared() {
    let mut blank = SubDeviceInfo { sync_managers: vec![], pdos: vec![], mailbox: None, ..device() };
    blank.warnings.push(InfoWarning { category: None, offset: None, problem: SiiProblem::Blank });
    assert_eq!(problem(&any(), &blank), PlanProblem::NoSii);
    let declared = SubDeviceConfig { declared: Some(vec![]), ..any() };
    assert!(plan(&declared, &blank).is_ok());
}

/// Every real image that parses gives a plan on a large controller.
// covers: plan
#[test]
fn real_images_can_be_planned() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/sii");
    let Ok(entries) = fs::read_dir(&folder) else {
        println!("skipped: {} is not there", folder.display());
        return;
    };
    let mut information = Information::decode(&INFORMATION);
    (information.fmmu_count, information.sync_manager_count, information.ram_kib) = (16, 16, 60);
    for path in entries.map(|entry| entry.unwrap().path()).filter(|path| path.extension().is_some_and(|e| e == "bin")) {
        let image = fs::read(&path).unwrap();
        let Ok(sii) = Sii::parse(&image) else { continue };
        let header: &SiiHeader = sii.header();
        let info = SubDeviceInfo::from_parts(Readout { information, ..Readout::default() }, header, sii.categories());
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        match plan(&any(), &info) {
            Ok(plan) => {
                let areas = plan.process_data.iter().map(|area| (area.sync_manager, area.direction, area.length));
                println!("{name}: {:?}", areas.collect::<Vec<_>>());
            }
            Err(error) => panic!("{name}: {error}"),
        }
    }
}
