//! SyncManagers that a configuration file declares.

use super::*;
use crate::config::{DeclaredSyncManager, SyncManagerRole};

fn manager(index: u8, role: SyncManagerRole, start: u16, length: u16, control: u8) -> DeclaredSyncManager {
    DeclaredSyncManager {
        index,
        role,
        register: sync_manager(start, length, control),
        op_only: false,
        pdos: Vec::new(),
    }
}

fn of_file() -> Vec<DeclaredSyncManager> {
    vec![
        manager(3, SyncManagerRole::Inputs, 0x1480, 6, 0x20),
        manager(1, SyncManagerRole::MailboxIn, 0x1100, 0x100, 0x22),
        manager(0, SyncManagerRole::MailboxOut, 0x1000, 0x100, 0x26),
        manager(2, SyncManagerRole::Outputs, 0x1400, 4, 0x64),
    ]
}

fn with(change: impl FnOnce(&mut Vec<DeclaredSyncManager>)) -> SubDeviceConfig {
    let mut declared = of_file();
    change(&mut declared);
    SubDeviceConfig { declared: Some(declared), ..any() }
}

#[test]
fn declared_sync_managers_replace_the_sii_without_assignments() {
    // The declared assignment is ignored.
    let config = with(|_| ()).assign(2, Direction::Outputs, vec![PdoMapping::from_sii(0x1601)]);
    let plan = plan(&config, &device()).unwrap();
    let mailbox: Vec<_> = plan.mailbox.iter().map(|sm| (sm.index, sm.register.encode())).collect();
    assert_eq!(mailbox, [(0, [0, 0x10, 0, 1, 0x26, 0, 1, 0]), (1, [0, 0x11, 0, 1, 0x22, 0, 1, 0])]);
    let areas: Vec<_> = plan.process_data.iter().map(|a| (a.sync_manager, a.direction, a.physical, a.length)).collect();
    assert_eq!(areas, [(2, Direction::Outputs, 0x1400, 4), (3, Direction::Inputs, 0x1480, 6)]);
    assert_eq!(plan.pdos, []);
    let mailbox = |sync_manager, declared, sii| PlanWarning::OtherMailbox { sync_manager, declared, sii };
    let address = |sync_manager, declared, sii| PlanWarning::OtherAddress { sync_manager, declared, sii };
    let expected = [
        mailbox(0, (0x1000, 0x100), (0x1000, 0x80)),
        mailbox(1, (0x1100, 0x100), (0x1080, 0x80)),
        address(2, 0x1400, 0x1100),
        address(3, 0x1480, 0x1180),
    ];
    assert_eq!(plan.warnings, expected);
    let text = "SM 1: the file has a mailbox of 256 bytes at 0x1100, the SII one of 128 bytes at 0x1080: that of the \
                file is used";
    assert_eq!(expected[1].to_string(), text);
    assert_eq!(plan.unused, [4, 5, 6, 7]);
    let layout = plan.mailbox_layout().unwrap();
    assert_eq!((layout.receive_offset, layout.send_offset, layout.send_size), (0x1000, 0x1100, 0x100));
}

// covers: sync-managers-declared
#[test]
fn a_file_with_the_addresses_of_the_sii_gives_no_warning() {
    let same = with(|declared| {
        for (sm, (start, length)) in declared.iter_mut().zip([(0x1180, 6), (0x1080, 0x80), (0x1000, 0x80), (0x1100, 4)])
        {
            (sm.register.start, sm.register.length) = (start, length);
        }
    });
    assert_eq!(plan(&same, &device()).unwrap().warnings, []);
}

// covers: sync-managers-declared
#[test]
fn declared_bootstrap_mailboxes_replace_those_of_the_sii() {
    let pair = [
        manager(0, SyncManagerRole::MailboxOut, 0x1000, 0x80, 0x26),
        manager(1, SyncManagerRole::MailboxIn, 0x1200, 0x80, 0x22),
    ];
    let plan = plan(&SubDeviceConfig { declared_bootstrap: Some(pair), ..any() }, &device()).unwrap();
    assert_eq!(plan.bootstrap_layout().unwrap().send_offset, 0x1200);
    assert_eq!(plan.mailbox_layout(), device().mailbox);
}

#[test]
fn entries_of_a_declared_sync_manager_have_the_places_of_the_file() {
    let entries = [PdoEntry::new(0x7000, 1, 12), PdoEntry::new(0, 0, 4), PdoEntry::new(0x7000, 2, 16)];
    let planned = plan(&with(|declared| declared[3].pdos = vec![PdoMapping::of(0x1600, entries)]), &device()).unwrap();
    let places: Vec<_> = planned.process_data[0].pdos[0].entries.iter().map(|e| (e.index, e.bit_offset)).collect();
    assert_eq!(places, [(0x7000, 0), (0, 12), (0x7000, 16)]);
    let off = with(|declared| {
        declared[3].pdos = vec![PdoMapping::of(0x1600, entries)];
        declared[3].register.activate.enable = false;
    });
    let planned = plan(&off, &device()).unwrap();
    assert_eq!((planned.process_data[0].length, planned.mapped_areas().count()), (0, 1));
    assert_eq!(planned.process_data[0].register.length, 4, "written as declared");
}

// covers: sync-managers-declared
#[test]
fn contradictory_declared_sync_managers_are_refused() {
    let problem = |change: fn(&mut Vec<DeclaredSyncManager>)| problem(&with(change), &device());
    let twice = PlanProblem::DeclaredTwice { sync_manager: 2 };
    assert_eq!(problem(|declared| declared[0].index = 2), twice);
    let half = PlanProblem::DeclaredMailboxes { out: 1, inward: 0 };
    assert_eq!(problem(|declared| drop(declared.remove(1))), half);
    let none = PlanProblem::NoSuchSyncManager { sync_manager: 8, available: 8 };
    assert_eq!(problem(|declared| declared[0].index = 8), none);
    let (expected, got) = (Direction::Outputs, Direction::Inputs);
    let control = PlanProblem::DeclaredControl { sync_manager: 2, expected, got };
    assert_eq!(problem(|declared| declared[3].register = sync_manager(0x1400, 4, 0x20)), control);
    let short = PlanProblem::DeclaredTooShort { sync_manager: 2, expected: 33, got: 32 };
    let entries = [PdoEntry::new(0x7000, 1, 32), PdoEntry::new(0x7000, 2, 1)];
    let with_entries = with(|declared| declared[3].pdos = vec![PdoMapping::of(0x1600, entries)]);
    assert_eq!(super::problem(&with_entries, &device()), short);
    let unknown = PlanProblem::UnknownPdo { sync_manager: 2, pdo: 0x1777 };
    assert_eq!(problem(|declared| declared[3].pdos = vec![PdoMapping::from_sii(0x1777)]), unknown);
}

// covers: sync-managers-declared
#[test]
fn declared_mailboxes_override_the_protocols_of_the_sii() {
    let silent = SubDeviceInfo { protocols: MailboxProtocols(0), ..device() };
    assert_eq!(problem(&any().sdo(0x8000, 1, [0]), &silent), PlanProblem::NoCoe { index: 0x8000, sub_index: 1 });
    assert!(plan(&with(|_| ()).sdo(0x8000, 1, [0]), &silent).is_ok());
    let none = SubDeviceInfo { mailbox: None, ..device() };
    let without = with(without_mailboxes).sdo(0x8000, 1, [0]);
    assert_eq!(problem(&without, &none), PlanProblem::NoCoe { index: 0x8000, sub_index: 1 });
}

fn without_mailboxes(declared: &mut Vec<DeclaredSyncManager>) {
    declared.retain(|sm| sm.role.direction().is_some());
}

/// A SubDevice with mailboxes refuses PREOP without them.
// covers: sync-managers-declared
#[test]
fn mailboxes_that_a_file_does_not_have_are_those_of_the_sii() {
    let expected = plan(&any(), &device()).unwrap().mailbox;
    assert_eq!(expected.len(), 2);
    let empty = with(Vec::clear);
    for config in [with(without_mailboxes), with(without_mailboxes).sdo(0x8000, 1, [0]), empty] {
        let planned = plan(&config, &device()).unwrap();
        assert_eq!((&planned.mailbox, planned.warnings.first()), (&expected, Some(&PlanWarning::MailboxOfSii)));
        assert!(planned.unused.iter().all(|index| *index > 1), "{:?}", planned.unused);
    }
    let silent = SubDeviceInfo { protocols: MailboxProtocols(0), ..device() };
    let commands = with(without_mailboxes).sdo(0x8000, 1, [0]);
    assert_eq!(problem(&commands, &silent), PlanProblem::NoCoe { index: 0x8000, sub_index: 1 }, "the SII says which");
    // The file uses their SyncManagers, or their memory.
    let number = |declared: &mut Vec<DeclaredSyncManager>| {
        without_mailboxes(declared);
        declared[0].index = 1;
    };
    let memory = |declared: &mut Vec<DeclaredSyncManager>| {
        without_mailboxes(declared);
        declared[0].register = sync_manager(0x1000, 6, 0x20);
    };
    for config in [with(number), with(memory)] {
        let planned = plan(&config, &device()).unwrap();
        assert_eq!(planned.mailbox, []);
        assert!(!planned.warnings.contains(&PlanWarning::MailboxOfSii), "{:?}", planned.warnings);
    }
    let none = plan(&with(without_mailboxes), &SubDeviceInfo { mailbox: None, ..device() }).unwrap();
    assert!(!none.warnings.contains(&PlanWarning::MailboxOfSii), "{:?}", none.warnings);
}
