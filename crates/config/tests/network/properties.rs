//! What a file states as the EEPROM describes it, compared with the EEPROM: SyncManagers, mailboxes, protocols, ports.

use std::time::Duration;

use ringcat_config::network::{NetworkFile, ScanOptions};
use ringcat_config::{DifferenceKind, FoundNetwork};
use ringcat_engine::Topology;
use ringcat_engine::info::SubDeviceInfo;
use ringcat_wire::sii::{CoeDetails, Identity, MailboxLayout, MailboxProtocols, SiiSyncManager, SyncManagerKind};

use DifferenceKind::{Mailbox, Ports, Protocols, SyncManager};

const fn layout(start: u16) -> MailboxLayout {
    MailboxLayout { receive_offset: start, receive_size: 128, send_offset: start + 0x80, send_size: 128 }
}

const fn sync_manager(kind: SyncManagerKind, start: u16, control: u8, length: u16) -> SiiSyncManager {
    SiiSyncManager { start, length, control, status: 0, enable: SiiSyncManager::ENABLE, kind }
}

/// A drive with CoE and FoE, outputs and inputs of a byte, and E-bus ports.
fn drive() -> SubDeviceInfo {
    let mut info = SubDeviceInfo::default();
    info.identity = Identity { vendor_id: 7, product_code: 8, revision: 1, serial: 0 };
    info.name = "Drive".to_owned();
    info.mailbox = Some(layout(0x1000));
    info.bootstrap = Some(layout(0x2000));
    info.protocols = MailboxProtocols(MailboxProtocols::COE | MailboxProtocols::FOE);
    info.coe = CoeDetails(CoeDetails::SDO | CoeDetails::PDO_ASSIGN);
    (info.controller.fmmu_count, info.controller.sync_manager_count) = (8, 8);
    info.physical_ports = 0x0033;
    info.sync_managers = vec![
        sync_manager(SyncManagerKind::MailboxOut, 0x1000, 0x26, 128),
        sync_manager(SyncManagerKind::MailboxIn, 0x1080, 0x22, 128),
        sync_manager(SyncManagerKind::Outputs, 0x1100, 0x64, 1),
        sync_manager(SyncManagerKind::Inputs, 0x1180, 0x20, 1),
    ];
    info
}

/// The differences of a drive to the file of [`drive`].
fn differences(change: impl FnOnce(&mut SubDeviceInfo)) -> Vec<(DifferenceKind, String)> {
    let options = ScanOptions::new("machine", Duration::from_millis(1));
    let file = NetworkFile::from_scan(&[drive()], &Topology::default(), &options);
    let mut found = drive();
    change(&mut found);
    let topology = Topology::default();
    let found = [found];
    let network = FoundNetwork::new(&found, &topology);
    let all = file.configuration().differences(network, &file.stated());
    assert!(all.iter().all(|it| !it.prevents_op), "a run takes them from the EEPROM: {all:#?}");
    let text = |text: &str| text.trim_start_matches("position 0 \"Drive\": ").to_owned();
    all.iter().map(|it| (it.kind, text(&it.text))).collect()
}

fn one(kind: DifferenceKind, text: &str) -> Vec<(DifferenceKind, String)> {
    vec![(kind, text.to_owned())]
}

// covers: network-file
#[test]
fn addresses_and_control_bytes_of_sync_managers_are_compared() {
    assert_eq!(differences(|_| ()), []);
    let text = "SM 2: expected address 0x1100, got 0x1200";
    assert_eq!(differences(|info| info.sync_managers[2].start = 0x1200), one(SyncManager, text));
    let text = "SM 3: expected control byte 0x20, got 0x00";
    assert_eq!(differences(|info| info.sync_managers[3].control = 0), one(SyncManager, text));
    // Those of mailboxes are in the mailbox: its addresses are those of the fixed area.
    assert_eq!(differences(|info| info.sync_managers[0].start = 0x1400), []);
}

// covers: network-file
#[test]
fn mailboxes_in_boot_and_protocols_are_compared() {
    let text = "in BOOT, expected mailboxes 0x2000 (128 bytes) and 0x2080 (128 bytes), got none";
    assert_eq!(differences(|info| info.bootstrap = None), one(Mailbox, text));
    let with = |bits: u16| differences(|info| info.protocols = MailboxProtocols(bits));
    let text = "it lacks the protocols FoE of the file";
    assert_eq!(with(MailboxProtocols::COE), one(Protocols, text));
    let text = "it has the protocols EoE, VoE, which the file does not have";
    assert_eq!(with(0x0C | MailboxProtocols::EOE | MailboxProtocols::VOE), one(Protocols, text));
    let text = "expected the protocols FoE, got SoE";
    assert_eq!(with(MailboxProtocols::COE | MailboxProtocols::SOE), one(Protocols, text));
    let coe = |bits: u8| differences(|info| info.coe = CoeDetails(bits));
    assert_eq!(coe(0), [], "without details the EEPROM states nothing of them");
    let text = "its CoE lacks a PDO assignment that can be written; it has complete access, in the file it has not";
    assert_eq!(coe(CoeDetails::SDO | CoeDetails::COMPLETE_ACCESS), one(Protocols, text));
    let text = "its CoE has PDO mappings that can be written, in the file it has not";
    let more = CoeDetails::PDO_ASSIGN | CoeDetails::PDO_CONFIGURATION | CoeDetails::SDO_INFORMATION;
    assert_eq!(coe(more), one(Protocols, text));
}

// covers: network-file
#[test]
fn ports_are_compared_by_place_and_kind() {
    let text = "expected ports \"KK\", got \"K Y\"";
    assert_eq!(differences(|info| info.physical_ports = 0x0103), one(Ports, text));
    // Neither the EEPROM nor the controller states anything.
    assert_eq!(differences(|info| info.physical_ports = 0), []);
}
