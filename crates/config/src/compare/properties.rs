//! What the SII of a SubDevice describes besides its PDOs, compared with what a file states: address and control byte
//! of SyncManagers with process data, mailboxes in BOOT, mailbox protocols, ports (protocol 4.2, 4.3).

use std::collections::BTreeMap;

use ringcat_engine::config::{SubDeviceConfig, SyncManagerRole};
use ringcat_engine::info::SubDeviceInfo;
use ringcat_wire::register::{PortKind, SyncManagerControl, SyncManagerDirection, SyncManagerMode};
use ringcat_wire::sii::{CoeDetails, MailboxLayout, MailboxProtocols, PhysicalPort};

use super::difference::{DifferenceKind, StatedProperties, StatedSyncManager};

/// Protocols in the order of their names.
const PROTOCOLS: [(u16, &str); 6] = [
    (MailboxProtocols::AOE, "AoE"),
    (MailboxProtocols::COE, "CoE"),
    (MailboxProtocols::EOE, "EoE"),
    (MailboxProtocols::FOE, "FoE"),
    (MailboxProtocols::SOE, "SoE"),
    (MailboxProtocols::VOE, "VoE"),
];
/// Features of CoE that a file states.
const FEATURES: [(u8, &str); 3] = [
    (CoeDetails::COMPLETE_ACCESS, "complete access"),
    (CoeDetails::PDO_ASSIGN, "a PDO assignment that can be written"),
    (CoeDetails::PDO_CONFIGURATION, "PDO mappings that can be written"),
];
/// Mode and direction in the control byte of a SyncManager.
const MODE: u8 = 0x0F;

/// A difference: kind, whether it prevents OP, text.
type Property = (DifferenceKind, bool, String);

/// The differences.
pub(super) fn differences(
    declared: &SubDeviceConfig,
    stated: Option<&StatedProperties>,
    info: &SubDeviceInfo,
) -> Vec<Property> {
    let mut differences = sync_managers(declared, stated, info);
    let Some(stated) = stated else { return differences };
    let boot = info.bootstrap.as_ref().map(buffers);
    if let Some(expected) = stated.boot_mailbox.filter(|expected| boot != Some(*expected)) {
        let text = format!("in BOOT, expected mailboxes {}, got {}", words(Some(expected)), words(boot));
        differences.push((DifferenceKind::Mailbox, false, text));
    }
    if info.mailbox.is_some() {
        let texts = [of_protocols(stated, info), of_features(stated, info)];
        differences.extend(texts.into_iter().flatten().map(|text| (DifferenceKind::Protocols, false, text)));
    }
    differences.extend(of_ports(stated, info).map(|text| (DifferenceKind::Ports, false, text)));
    differences
}

/// Start and length of the mailbox that is written, and of the one that is read.
pub(super) const fn buffers(of: &MailboxLayout) -> [(u16, u16); 2] {
    [(of.receive_offset, of.receive_size), (of.send_offset, of.send_size)]
}

pub(super) fn words(mailbox: Option<[(u16, u16); 2]>) -> String {
    let Some([(out, out_length), (back, back_length)]) = mailbox else { return "none".to_owned() };
    format!("{out:#06x} ({out_length} bytes) and {back:#06x} ({back_length} bytes)")
}

/// Settings that are written, those of an ENI, prevent OP if the SubDevice checks them: it refuses SAFEOP. A controller
/// without a processor (device emulation) takes any.
fn sync_managers(declared: &SubDeviceConfig, stated: Option<&StatedProperties>, info: &SubDeviceInfo) -> Vec<Property> {
    let mut differences = Vec::new();
    // Without the category the addresses are not those of the SII.
    if info.sync_managers.is_empty() {
        return differences;
    }
    let is_checked = declared.declared.is_some() && !info.device_emulation;
    for (number, of) in expected(declared, stated) {
        let mut add = |prevents_op: bool, text: String| {
            differences.push((DifferenceKind::SyncManager, prevents_op, format!("SM {number}: {text}")));
        };
        let Some(own) = info.sync_managers.get(usize::from(number)) else {
            // In a network file the process data cannot be set up: that difference names it.
            if declared.declared.is_some() {
                let count = info.sync_managers.len();
                add(false, format!("it is not among the {count} that the SubDevice describes"));
            }
            continue;
        };
        if let Some(start) = of.start.filter(|start| *start != own.start) {
            add(is_checked, format!("expected address {start:#06x}, got {:#06x}", own.start));
        }
        if let Some(control) = of.control.filter(|control| *control != own.control) {
            let prevents_op = is_checked && !is_compatible(control, own.control);
            add(prevents_op, format!("expected control byte {control:#04x}, got {:#04x}", own.control));
        }
    }
    differences.extend(mailbox_controls(declared, info));
    differences
}

/// Mode and direction of the mailboxes of an ENI, and whether they are enabled; otherwise the SubDevice refuses PREOP.
fn mailbox_controls(declared: &SubDeviceConfig, info: &SubDeviceInfo) -> Vec<Property> {
    let mut differences = Vec::new();
    for it in declared.declared.iter().flatten() {
        let direction = match it.role {
            SyncManagerRole::MailboxOut => SyncManagerDirection::Write,
            SyncManagerRole::MailboxIn => SyncManagerDirection::Read,
            _ => continue,
        };
        let (number, control) = (it.index, it.register.control);
        if !it.register.activate.enable && it.register.length > 0 && info.mailbox.is_some() {
            let text = format!("SM {number}: a mailbox that the file does not enable");
            differences.push((DifferenceKind::SyncManager, true, text));
        }
        let Some(own) = info.sync_managers.get(usize::from(number)) else { continue };
        if (control.bits() ^ own.control) & MODE != 0 {
            let prevents_op = control.mode != SyncManagerMode::Mailbox || control.direction != direction;
            let text = format!("SM {number}: expected control byte {:#04x}, got {:#04x}", control.bits(), own.control);
            differences.push((DifferenceKind::SyncManager, prevents_op, text));
        }
    }
    differences
}

/// Whether a SubDevice with process data of this mode and direction takes another control byte: three buffers in place
/// of one, but no other direction.
fn is_compatible(written: u8, own: u8) -> bool {
    let [written, own] = [written, own].map(SyncManagerControl::from_bits);
    written.direction == own.direction && (written.mode == own.mode || written.mode == SyncManagerMode::Buffered)
}

/// SyncManagers with process data by number: those that are written, else those that the file states.
fn expected(declared: &SubDeviceConfig, stated: Option<&StatedProperties>) -> BTreeMap<u8, StatedSyncManager> {
    let stated = stated.into_iter().flat_map(|stated| &stated.sync_managers);
    let mut expected: BTreeMap<u8, StatedSyncManager> = stated.map(|of| (of.number, *of)).collect();
    for it in declared.declared.iter().flatten().filter(|it| it.area().is_some_and(|area| area.length > 0)) {
        let (start, control) = (Some(it.register.start), Some(it.register.control.bits()));
        expected.insert(it.index, StatedSyncManager { number: it.index, start, control });
    }
    expected
}

fn of_protocols(stated: &StatedProperties, info: &SubDeviceInfo) -> Option<String> {
    let (expected, got) = (stated.protocols?.0, info.protocols.0);
    let list = |bits: u16| names(PROTOCOLS.iter().filter(|(bit, _)| bits & bit != 0).map(|(_, name)| *name));
    let (missing, more) = (list(expected & !got), list(got & !expected));
    match (missing, more) {
        (None, None) => None,
        (Some(missing), None) => Some(format!("it lacks the protocols {missing} of the file")),
        (None, Some(more)) => Some(format!("it has the protocols {more}, which the file does not have")),
        (Some(missing), Some(more)) => Some(format!("expected the protocols {missing}, got {more}")),
    }
}

fn of_features(stated: &StatedProperties, info: &SubDeviceInfo) -> Option<String> {
    let is_coe = stated.protocols?.coe() && info.protocols.coe();
    // An SII without CoE details contains no information about them.
    if !is_coe || info.coe.0 == 0 {
        return None;
    }
    let (expected, got) = (stated.coe?.0, info.coe.0);
    let list = |bits: u8| names(FEATURES.iter().filter(|(bit, _)| bits & bit != 0).map(|(_, name)| *name));
    match (list(expected & !got), list(got & !expected)) {
        (None, None) => None,
        (Some(missing), None) => Some(format!("its CoE lacks {missing}")),
        (None, Some(more)) => Some(format!("its CoE has {more}, in the file it has not")),
        (Some(missing), Some(more)) => Some(format!("its CoE lacks {missing}; it has {more}, in the file it has not")),
    }
}

fn names<'a>(of: impl Iterator<Item = &'a str>) -> Option<String> {
    Some(of.collect::<Vec<_>>().join(", ")).filter(|text| !text.is_empty())
}

fn of_ports(stated: &StatedProperties, info: &SubDeviceInfo) -> Option<String> {
    let got = ports(info);
    if stated.ports.trim().is_empty() || got.is_empty() {
        return None;
    }
    let expected = stated.ports.trim_end();
    (expected != got).then(|| format!("expected ports \"{expected}\", got \"{got}\""))
}

/// The letters of the ports: from the SII, otherwise from the controller.
pub(crate) fn ports(info: &SubDeviceInfo) -> String {
    let code = |port: usize| (info.physical_ports >> (4 * port) & 0xF) as u8;
    let letter = |port: usize| match PhysicalPort::from_code(code(port)) {
        PhysicalPort::Mii => 'Y',
        PhysicalPort::Ebus => 'K',
        PhysicalPort::FastHotConnect => 'H',
        _ if info.physical_ports != 0 => ' ',
        _ => match info.controller.ports[port] {
            PortKind::Mii => 'Y',
            PortKind::Ebus => 'K',
            PortKind::NotImplemented | PortKind::NotConfigured => ' ',
        },
    };
    let letters: String = (0..4).map(letter).collect();
    letters.trim_end().to_owned()
}
