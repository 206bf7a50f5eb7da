//! The ring that the outputs of the original tool show: a coupler, an analogue input with a mailbox, a digital output,
//! and a SubDevice whose SII has no information and that refuses PREOP.

use std::path::Path;

use ringcat::sim::application::dictionary::{Access, Entry, Object};
use ringcat::sim::application::soe::idn::IdnObject;
use ringcat::sim::segment::Segment;
use ringcat::wire::mailbox::soe::Idn;
use ringcat::wire::sii::{
    CoeDetails, DcMode, FmmuUsage, General, Identity, MailboxLayout, MailboxProtocols, PdoDescription, PdoDirection,
    PdoEntry, SiiHeader, SiiSyncManager, SiiWriter, SyncManagerKind,
};

/// Mailbox protocols of the analogue input.
pub const COE_FOE: u16 = MailboxProtocols::COE | MailboxProtocols::FOE;
/// The same with SoE, for an application that declares an IDN.
pub const WITH_SOE: u16 = COE_FOE | MailboxProtocols::SOE;

const UINT8: u8 = 5;
const UINT16: u8 = 6;
const UINT32: u8 = 7;
const STRING: u8 = 9;

/// An SII with a header, strings and what `more` writes.
fn image(header: SiiHeader, more: impl FnOnce(&mut SiiWriter<'_>)) -> Vec<u8> {
    let mut bytes = vec![0xFF; 2048];
    let mut writer = SiiWriter::new(&mut bytes, &header).expect("it fits");
    more(&mut writer);
    writer.finish().expect("it fits");
    bytes
}

fn header(alias: u16, [vendor_id, product_code, revision, serial]: [u32; 4]) -> SiiHeader {
    let identity = Identity { vendor_id, product_code, revision, serial };
    SiiHeader { pdi_control: 0x0C05, pdi_configuration: 0x4403, alias, identity, ..SiiHeader::default() }
}

fn coupler() -> Vec<u8> {
    image(header(0, [2, 0x044C_2C52, 0x0012_0000, 0]), |sii| {
        sii.strings(&["EK1100", "SystemBk", "EK1100 EtherCAT Coupler (2A E-Bus)"]).expect("it fits");
        // MII at port 0 and 2, EBUS at port 1.
        let ports = 0x0131;
        let general = General { group: 2, order: 1, name: 3, ebus_current_ma: -2000, physical_ports: ports, ..none() };
        sii.general(&general).expect("it fits");
    })
}

fn none() -> General {
    General::default()
}

fn entry(index: u16, sub_index: u8, name: u8, data_type: u8, bit_length: u8) -> PdoEntry {
    PdoEntry { index, sub_index, name, data_type, bit_length, ..PdoEntry::default() }
}

fn sync_manager(start: u16, length: u16, control: u8, enable: u8, kind: SyncManagerKind) -> SiiSyncManager {
    SiiSyncManager { start, length, control, status: 0, enable, kind }
}

fn analogue_input(protocols: u16) -> Vec<u8> {
    let layout = |receive_offset, size, send_offset| MailboxLayout {
        receive_offset,
        receive_size: size,
        send_offset,
        send_size: size,
    };
    let header = SiiHeader {
        bootstrap_mailbox: layout(0x1000, 244, 0x10F4),
        standard_mailbox: layout(0x1800, 246, 0x18F6),
        protocols: MailboxProtocols(protocols),
        ..header(1000, [2, 0x0C1E_3052, 0x0010_0000, 0x11])
    };
    image(header, |sii| {
        let strings = ["EL3102", "AnaIn", "EL3102 2Ch. Ana. Input +/-10V", "Channel 1", "Status", "Value", "Channel 2"];
        sii.strings(&strings).expect("it fits");
        let details = CoeDetails(CoeDetails::SDO | CoeDetails::SDO_INFORMATION | CoeDetails::PDO_ASSIGN);
        let general = General { coe: details, foe: 1, ebus_current_ma: 130, physical_ports: 0x33, ..none() };
        sii.general(&General { group: 2, order: 1, name: 3, ..general }).expect("it fits");
        sii.fmmus(&[FmmuUsage::Outputs, FmmuUsage::Inputs, FmmuUsage::MailboxStatus]).expect("it fits");
        let sync_managers = [
            sync_manager(0x1800, 246, 0x26, 1, SyncManagerKind::MailboxOut),
            sync_manager(0x18F6, 246, 0x22, 1, SyncManagerKind::MailboxIn),
            sync_manager(0x1000, 0, 0x24, 0, SyncManagerKind::Outputs),
            sync_manager(0x1100, 6, 0x20, 1, SyncManagerKind::Inputs),
        ];
        sii.sync_managers(&sync_managers).expect("it fits");
        let channel = |index| [entry(index, 1, 5, UINT8, 8), entry(index, 2, 6, UINT16, 16)];
        let (first, second) = (channel(0x3101), channel(0x3102));
        let pdo = |index, name, entries| PdoDescription {
            index,
            sync_manager: Some(3),
            synchronisation: 0,
            name,
            flags: 0,
            entries,
        };
        sii.pdos(PdoDirection::Tx, &[pdo(0x1A00, 4, &first), pdo(0x1A01, 7, &second)]).expect("it fits");
        sii.dc_modes(&[DcMode { sync0_cycle_ns: 1_000_000, assign_activate: 0x0300, ..DcMode::default() }])
            .expect("it fits");
    })
}

/// With all its PDOs, or with the first one alone.
fn digital_output(is_whole: bool) -> Vec<u8> {
    image(header(0, [2, 0x07D8_3052, 0x0010_0000, 0]), |sii| {
        let strings = ["EL2008 8Ch. Dig. Output 24V, 0.5A", "Channel 1", "Output", "Channel 2"];
        sii.strings(&strings).expect("it fits");
        sii.general(&General { name: 1, physical_ports: 0x33, ..none() }).expect("it fits");
        sii.fmmus(&[FmmuUsage::Outputs]).expect("it fits");
        sii.sync_managers(&[sync_manager(0x0F00, 1, 0x44, 1, SyncManagerKind::Outputs)]).expect("it fits");
        let one = |index| [entry(index, 1, 3, 1, 1)];
        let (first, second, gap) = (one(0x7000), one(0x7010), [entry(0, 0, 0, 0, 6)]);
        let pdo = |index, name, entries| PdoDescription {
            index,
            sync_manager: Some(0),
            synchronisation: 0,
            name,
            flags: 0,
            entries,
        };
        let pdos = [pdo(0x1600, 2, &first[..]), pdo(0x1601, 4, &second), pdo(0x1602, 0, &gap)];
        let pdos = if is_whole { &pdos[..] } else { &pdos[..1] };
        sii.pdos(PdoDirection::Rx, pdos).expect("it fits");
    })
}

/// The segment file, with the SIIs in a directory. With SoE the digital output has one PDO, as the application of the
/// original had declared it: ours declares PDOs of SubDevices without a dictionary as they are.
pub fn segment(directory: &Path, protocols: u16) -> Segment {
    on(directory, protocols, false, "")
}

/// The same SubDevices in a ring, and a fifth one with EoE.
pub fn ring(directory: &Path, protocols: u16) -> Segment {
    on(directory, protocols, true, "[[device]]\ntype = \"ethernet-terminal\"\n")
}

fn on(directory: &Path, protocols: u16, is_ring: bool, more: &str) -> Segment {
    let files = [
        ("coupler.bin", coupler(), 64),
        ("input.bin", analogue_input(protocols), 32),
        ("output.bin", digital_output(protocols == COE_FOE), 0),
        ("silent.bin", image(header(0, [0x29C, 0x02C3_0001, 0, 0]), |_| ()), 0),
    ];
    let mut text = format!("[segment]\nring = {is_ring}\n");
    for (name, bytes, clock_bits) in files {
        std::fs::write(directory.join(name), bytes).expect("it can be written");
        text += &format!("[[device]]\nsii = \"{name}\"\nclock_bits = {clock_bits}\n");
    }
    text += more;
    let mut segment = Segment::from_toml(&text, directory).expect("it is right");
    let input = &mut segment.devices[1];
    input.objects.extend(objects());
    input.services.foe.files.push(("fw.bin".to_owned(), b"hello".to_vec()));
    let idn = |number, value| IdnObject::number(Idn(number), "Value", 2, value);
    for drive in &mut input.services.soe.drives {
        drive.extend([idn(0x8096, 0), IdnObject::number(Idn(0x8064), "Long", 4, 0x0403_0201)]);
    }
    segment
}

fn objects() -> Vec<Object> {
    vec![
        Object::variable(0x2000, "Number", UINT32, Access::ReadWrite, &0x8000_0005_u32.to_le_bytes()),
        Object::variable(0x2001, "Float", 8, Access::ReadWrite, &2_u32.to_le_bytes()),
        Object::variable(0x2002, "Text", STRING, Access::ReadOnly, b"EL3102"),
        Object::variable(0x2003, "Byte", UINT8, Access::ReadWrite, &[0]),
        Object::variable(0x2004, "Constant", UINT16, Access::ReadOnly, &[1, 0]),
        Object::record(0x8000, "Settings", vec![Entry::new(6, UINT16, Access::ReadWrite, &[0, 0])]),
    ]
}
