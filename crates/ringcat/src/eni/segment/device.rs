//! One SubDevice of a file as a simulated device.

use std::collections::BTreeSet;
use std::time::Duration;

use ringcat_config::eni::{BitRange, Eni, Mailbox, MailboxBuffer, PdoEntry, SubDevice, Target};
use ringcat_engine::config::{
    ConfigAddress, DeclaredArea, DeclaredSyncManager, PdoAssignment, PdoEntry as ConfigEntry, PdoMapping,
    StartupAction, SubDeviceConfig, SyncManagerRole,
};
use ringcat_engine::info::Direction;
use ringcat_sim::application::{Behaviour, InputSource};
use ringcat_sim::description::{
    DcDescription, DeviceDescription, FoeDescription, MailboxDescription, PdoDescription, PdoEntryDescription,
    SyncManagerDescription,
};
use ringcat_wire::register::{PortKind, SyncManager, SyncManagerControl};
use ringcat_wire::sii::{
    CoeDetails, DcMode, FmmuUsage, Identity, MailboxLayout, MailboxProtocols, PdoDirection, SiiSyncManager,
    SyncManagerKind,
};

use super::objects;

/// Mailbox of a device with mailbox commands but without a mailbox in the file.
const MAILBOX: MailboxLayout =
    MailboxLayout { receive_offset: 0x1000, receive_size: 128, send_offset: 0x1080, send_size: 128 };
/// Time from a request to its answer.
const ANSWER: Duration = Duration::from_micros(200);
/// Start of the process data of a device if the file does not give it.
const PROCESS_DATA_START: u16 = 0x1800;
/// Index of PDOs that the file does not describe, by SyncManager.
const UNNAMED: [u16; 2] = [0x17F0, 0x1BF0];
/// Maximum number of bits of an entry without a name: a multiple of 8 that fits into a byte.
const GAP: u32 = 248;
/// Bits of an unknown PDO.
const UNKNOWN_PDO: u8 = 16;
/// Bytes of the SII, enough for long lists of PDOs.
const SII_BYTES: usize = 2048;

pub(super) fn describe(subdevice: &SubDevice, config: &SubDeviceConfig) -> DeviceDescription {
    let number = |of_file: Option<u32>, expected: Option<u32>| expected.or(of_file).unwrap_or(0);
    let expected = &config.expected;
    let identity = Identity {
        vendor_id: number(subdevice.vendor_id, expected.vendor_id),
        product_code: number(subdevice.product_code, expected.product_code),
        revision: number(subdevice.revision, expected.revision.or(expected.minimum_revision)),
        serial: number(subdevice.serial, expected.serial),
    };
    let mut device = DeviceDescription::plain(&subdevice.name, identity);
    device.group = "ENI".into();
    match config.address {
        ConfigAddress::Alias { alias, offset: 0 } => device.alias = alias,
        ConfigAddress::Identification { value, offset: 0 } => device.identification = Some(value),
        ConfigAddress::DataWord { register, value, offset: 0 } => device.data_word = Some((register.0, value)),
        _ => {}
    }
    device.identification = expected.identification.or(device.identification);
    device.ports = ports(&subdevice.physics);
    device.mailbox = mailbox(subdevice, config);
    let declared = config.declared.clone().unwrap_or_else(|| guessed(subdevice, config, device.mailbox.as_ref()));
    // Outputs that are switched on at SO belong to terminals without a state machine of their own.
    device.emulation = declared.iter().any(|sm| sm.op_only);
    loaded_registers(subdevice, &mut device);
    device.sync_managers = sync_managers(&declared);
    device.pdos = pdos(subdevice, &declared);
    let areas = declared.iter().filter(|sm| sm.role.direction().is_some()).map(|sm| match sm.role {
        SyncManagerRole::Inputs => FmmuUsage::Inputs,
        _ => FmmuUsage::Outputs,
    });
    device.fmmus = areas.chain(device.mailbox.map(|_| FmmuUsage::MailboxStatus)).collect();
    device.fmmus.resize(device.fmmus.len().max(4), FmmuUsage::Unused);
    device.objects = objects::objects(subdevice, &device.pdos, &device.sync_managers);
    device.services.soe.drives = objects::drives(subdevice);
    files(config, &mut device.services.foe);
    device.dc = (subdevice.clock.is_some() || config.sync.is_some()).then(|| clock(config));
    device.behaviour = Behaviour::Terminal(InputSource::Outputs);
    device.sii_size_bytes = SII_BYTES;
    device
}

/// Files that its commands read exist, and have their name as contents; the password of a command is that of the
/// device.
fn files(config: &SubDeviceConfig, foe: &mut FoeDescription) {
    for command in &config.startup {
        match &command.action {
            StartupAction::FileRead(read) => {
                foe.password = read.password;
                foe.files.push((read.name.clone(), read.name.clone().into_bytes()));
            }
            StartupAction::FileWrite(write) => foe.password = write.password,
            _ => {}
        }
    }
}

/// Registers that a controller loads from its EEPROM get the values that the file expects. All other registers keep
/// those of the simulated controller.
fn loaded_registers(subdevice: &SubDevice, device: &mut DeviceDescription) {
    let checks =
        subdevice.init_commands.iter().filter_map(|command| match (&command.validate, command.datagram.target) {
            (Some(validate), Target::Register { ado, .. }) => Some((ado.0, validate)),
            _ => None,
        });
    for (first, validate) in checks {
        for (offset, byte) in (0_u16..).zip(&validate.data) {
            let mask = validate.mask.as_ref().and_then(|mask| mask.get(usize::from(offset))).copied().unwrap_or(0xFF);
            let loaded = match first.checked_add(offset) {
                Some(0x0140) => &mut device.pdi_type,
                Some(0x0141) => {
                    if mask & 1 != 0 {
                        device.emulation = byte & 1 != 0;
                    }
                    &mut device.esc_configuration
                }
                Some(at @ 0x0150..=0x0153) => &mut device.pdi_configuration[usize::from(at - 0x0150)],
                Some(_) | None => continue,
            };
            *loaded = *loaded & !mask | byte & mask;
        }
    }
}

/// Appends the station address to names that several devices have.
pub(super) fn make_names_unique(eni: &Eni, devices: &mut [DeviceDescription]) {
    let mut names = BTreeSet::new();
    for (number, device) in devices.iter_mut().enumerate() {
        if names.insert(device.name.clone()) && !device.name.is_empty() {
            continue;
        }
        let station = eni.subdevices.get(number).and_then(|subdevice| subdevice.station);
        device.name = match station {
            Some(station) => format!("{} {station}", device.name).trim().to_owned(),
            None => format!("{} #{number}", device.name).trim().to_owned(),
        };
        names.insert(device.name.clone());
    }
}

/// A letter per port (protocol 8.1): K is EBUS, blank is none, others are Ethernet in some form.
fn ports(physics: &str) -> [PortKind; 4] {
    let mut ports = [PortKind::NotImplemented; 4];
    for (port, letter) in ports.iter_mut().zip(physics.chars()) {
        *port = match letter {
            'K' | 'k' => PortKind::Ebus,
            ' ' => PortKind::NotImplemented,
            _ => PortKind::Mii,
        };
    }
    ports
}

fn mailbox(subdevice: &SubDevice, config: &SubDeviceConfig) -> Option<MailboxDescription> {
    let given = subdevice.mailbox.as_ref();
    let declared = |role| config.declared.iter().flatten().find(|sm| sm.role == role).map(|sm| sm.register);
    let pair = (declared(SyncManagerRole::MailboxOut), declared(SyncManagerRole::MailboxIn));
    let standard = match (pair, given) {
        ((Some(out), Some(inward)), _) => layout(out.start, out.length, inward.start, inward.length),
        (_, Some(Mailbox { send: Some(send), receive: Some(receive), .. })) => of_buffers(send, receive),
        (_, Some(mailbox)) if has_commands(mailbox) => MAILBOX,
        _ => return None,
    };
    let bootstrap = given.and_then(|mailbox| mailbox.bootstrap.as_ref());
    let protocols = protocols(given);
    let coe = CoeDetails::SDO
        | CoeDetails::SDO_INFORMATION
        | CoeDetails::PDO_ASSIGN
        | CoeDetails::PDO_CONFIGURATION
        | CoeDetails::COMPLETE_ACCESS;
    Some(MailboxDescription {
        standard,
        bootstrap: bootstrap.map_or(MailboxLayout::default(), |(send, receive)| of_buffers(send, receive)),
        protocols,
        coe_details: CoeDetails(if protocols.coe() { coe } else { 0 }),
        response_time: ANSWER,
    })
}

/// Whether commands go through the mailbox.
fn has_commands(of: &Mailbox) -> bool {
    !of.coe.is_empty() || !of.soe.is_empty() || !of.eoe.is_empty() || !of.others.is_empty()
}

fn of_buffers(send: &MailboxBuffer, receive: &MailboxBuffer) -> MailboxLayout {
    layout(send.start, send.length, receive.start, receive.length)
}

const fn layout(receive_offset: u16, receive_size: u16, send_offset: u16, send_size: u16) -> MailboxLayout {
    MailboxLayout { receive_offset, receive_size, send_offset, send_size }
}

/// The protocols that the file names, and those of its commands.
fn protocols(mailbox: Option<&Mailbox>) -> MailboxProtocols {
    let Some(mailbox) = mailbox else { return MailboxProtocols(0) };
    let bit = |name: &str| match name.trim().to_ascii_lowercase().as_str() {
        "aoe" => MailboxProtocols::AOE,
        "eoe" => MailboxProtocols::EOE,
        "coe" => MailboxProtocols::COE,
        "foe" => MailboxProtocols::FOE,
        "soe" => MailboxProtocols::SOE,
        "voe" => MailboxProtocols::VOE,
        _ => 0,
    };
    let named = mailbox.protocols.iter().map(|name| bit(name)).fold(0, |all, one| all | one);
    let used = [
        (!mailbox.coe.is_empty(), MailboxProtocols::COE),
        (!mailbox.soe.is_empty(), MailboxProtocols::SOE),
        (!mailbox.eoe.is_empty(), MailboxProtocols::EOE),
        (mailbox.others.iter().any(|command| command.protocol == "AoE"), MailboxProtocols::AOE),
        (mailbox.others.iter().any(|command| command.protocol == "VoE"), MailboxProtocols::VOE),
        (mailbox.others.iter().any(|command| command.protocol == "FoE"), MailboxProtocols::FOE),
    ];
    MailboxProtocols(used.into_iter().filter(|(used, _)| *used).fold(named, |all, (_, one)| all | one))
}

/// SyncManagers of a device without commands for them in the file: mailboxes, then the SyncManagers to which the file
/// assigns PDOs, or outputs and inputs with the lengths of the image.
fn guessed(
    subdevice: &SubDevice,
    config: &SubDeviceConfig,
    mailbox: Option<&MailboxDescription>,
) -> Vec<DeclaredSyncManager> {
    let mut declared: Vec<DeclaredSyncManager> = Vec::new();
    let mut add = |role, start, length, control| {
        let mut register =
            SyncManager { start, length, control: SyncManagerControl::from_bits(control), ..SyncManager::default() };
        register.activate.enable = true;
        let index = declared.len() as u8;
        declared.push(DeclaredSyncManager::new(index, role, register));
    };
    if let Some(mailbox) = mailbox {
        let MailboxLayout { receive_offset, receive_size, send_offset, send_size } = mailbox.standard;
        add(SyncManagerRole::MailboxOut, receive_offset, receive_size, 0x26);
        add(SyncManagerRole::MailboxIn, send_offset, send_size, 0x22);
    }
    let Some(data) = &subdevice.process_data else {
        declared.extend(assigned(config));
        return declared;
    };
    let bytes = |ranges: &[BitRange]| {
        let bits: u32 = ranges.iter().map(|range| range.length).fold(0, u32::saturating_add);
        u16::try_from(bits.div_ceil(8)).unwrap_or(u16::MAX / 8)
    };
    let (outputs, inputs) = (bytes(&data.send), bytes(&data.receive));
    if outputs > 0 {
        add(SyncManagerRole::Outputs, PROCESS_DATA_START, outputs, 0x64);
    }
    if inputs > 0 {
        // Three buffers, and the next one begins with a word.
        let start = PROCESS_DATA_START.saturating_add(outputs.saturating_mul(3).saturating_add(7) & !7);
        add(SyncManagerRole::Inputs, start, inputs, 0x20);
    }
    declared
}

/// SyncManagers to which commands of the file assign PDOs, one behind the other. The length of a PDO that is only
/// assigned is unknown: it gets two bytes.
fn assigned(config: &SubDeviceConfig) -> Vec<DeclaredSyncManager> {
    let mut start = PROCESS_DATA_START;
    let sync_manager = |assignment: &PdoAssignment| {
        let pdos: Vec<PdoMapping> = assignment
            .pdos
            .iter()
            .map(|pdo| match &pdo.entries {
                Some(_) => pdo.clone(),
                None => PdoMapping::of(pdo.index, [ConfigEntry::new(0, 0, UNKNOWN_PDO)]),
            })
            .collect();
        let bits: u32 =
            pdos.iter().flat_map(|pdo| pdo.entries.iter().flatten()).map(|it| u32::from(it.bit_length)).sum();
        let length = u16::try_from(bits.div_ceil(8)).unwrap_or(u16::MAX / 8);
        let (role, control) = match assignment.direction {
            Direction::Outputs => (SyncManagerRole::Outputs, 0x64),
            Direction::Inputs => (SyncManagerRole::Inputs, 0x20),
        };
        let control = SyncManagerControl::from_bits(control);
        let mut register = SyncManager { start, length, control, ..SyncManager::default() };
        register.activate.enable = length > 0;
        // Three buffers, and the next one begins with a word.
        start = start.saturating_add(length.saturating_mul(3).saturating_add(7) & !7);
        DeclaredSyncManager::new(assignment.sync_manager, role, register).with_pdos(pdos)
    };
    config.pdos.iter().flatten().map(sync_manager).collect()
}

fn sync_managers(declared: &[DeclaredSyncManager]) -> Vec<SyncManagerDescription> {
    let count = declared.iter().map(|sm| usize::from(sm.index) + 1).max().unwrap_or(0);
    let unused = SyncManagerDescription { start: 0, length: 0, control: 0, enable: 0, kind: SyncManagerKind::Unused };
    let mut described = vec![unused; count];
    for sm in declared {
        described[usize::from(sm.index)] = SyncManagerDescription {
            start: sm.register.start,
            length: sm.register.length,
            control: sm.register.control.bits(),
            enable: u8::from(sm.register.activate.enable) | if sm.op_only { SiiSyncManager::OP_ONLY } else { 0 },
            kind: match sm.role {
                SyncManagerRole::MailboxOut => SyncManagerKind::MailboxOut,
                SyncManagerRole::MailboxIn => SyncManagerKind::MailboxIn,
                SyncManagerRole::Outputs => SyncManagerKind::Outputs,
                SyncManagerRole::Inputs => SyncManagerKind::Inputs,
            },
        };
    }
    described
}

/// PDOs that the file declares in SyncManagers, then PDOs that it only describes. A PDO without names fills the rest of
/// a SyncManager.
fn pdos(subdevice: &SubDevice, declared: &[DeclaredSyncManager]) -> Vec<PdoDescription> {
    let of_file = subdevice.process_data.iter().flat_map(|data| &data.pdos);
    let names = |index: u16| of_file.clone().find(|pdo| pdo.index == index);
    let mut pdos: Vec<PdoDescription> = Vec::new();
    for sm in declared {
        let Some(DeclaredArea { sync_manager, direction, length, .. }) = sm.area() else { continue };
        let inputs = direction == Direction::Inputs;
        let direction = if inputs { PdoDirection::Tx } else { PdoDirection::Rx };
        let mapped: Vec<PdoDescription> = sm
            .pdos
            .iter()
            .filter(|pdo| !pdos.iter().any(|known| known.index == pdo.index))
            .map(|pdo| PdoDescription {
                direction,
                index: pdo.index,
                name: names(pdo.index).map_or(String::new(), |found| found.name.clone()),
                sync_manager: Some(sync_manager),
                flags: 0,
                entries: (0..)
                    .zip(pdo.entries.iter().flatten())
                    .map(|(place, entry)| {
                        let found = names(pdo.index)
                            .and_then(|found: &ringcat_config::eni::Pdo| found.entries.get::<usize>(place));
                        PdoEntryDescription {
                            index: entry.index,
                            sub_index: entry.sub_index,
                            name: found.map_or(String::new(), |found| found.name.clone()),
                            data_type: objects::data_type(entry.bit_length.into()),
                            bit_length: entry.bit_length,
                        }
                    })
                    .collect(),
            })
            .collect();
        let mapped = if mapped.is_empty() { assigned_only(subdevice, sync_manager, direction, &pdos) } else { mapped };
        pdos.extend(filled(mapped, sync_manager, direction, length));
    }
    for pdo in of_file {
        if pdos.iter().any(|known| known.index == pdo.index) {
            continue;
        }
        pdos.push(PdoDescription {
            direction: if pdo.outputs { PdoDirection::Rx } else { PdoDirection::Tx },
            index: pdo.index,
            name: pdo.name.clone(),
            sync_manager: None,
            flags: 0,
            entries: pdo.entries.iter().map(entry).collect(),
        });
    }
    pdos
}

/// PDOs that commands assign, with the entries that the file describes, if it does.
fn assigned_only(
    subdevice: &SubDevice,
    sync_manager: u8,
    direction: PdoDirection,
    known: &[PdoDescription],
) -> Vec<PdoDescription> {
    let of_file = subdevice.process_data.iter().flat_map(|data| &data.pdos);
    let is_new = |index: &u16| !known.iter().any(|pdo| pdo.index == *index);
    let describe = |index: u16| {
        let described = of_file.clone().find(|pdo| pdo.index == index);
        PdoDescription {
            direction,
            index,
            name: described.map_or(String::new(), |pdo| pdo.name.clone()),
            sync_manager: Some(sync_manager),
            flags: 0,
            entries: described.iter().flat_map(|pdo| &pdo.entries).map(entry).collect(),
        }
    };
    objects::assigned(subdevice, sync_manager).into_iter().filter(is_new).map(describe).collect()
}

/// An entry as the file describes it.
fn entry(entry: &PdoEntry) -> PdoEntryDescription {
    PdoEntryDescription {
        index: entry.index,
        sub_index: entry.sub_index,
        name: entry.name.clone(),
        data_type: objects::data_type(entry.bit_length),
        bit_length: u8::try_from(entry.bit_length).unwrap_or(u8::MAX),
    }
}

/// PDOs with the length of their SyncManager. A PDO that the file assigns without a mapping, or an additional PDO, gets
/// the missing bits. PDOs that are too long are replaced by one PDO without names.
fn filled(
    mut mapped: Vec<PdoDescription>,
    sync_manager: u8,
    direction: PdoDirection,
    length: u16,
) -> Vec<PdoDescription> {
    let bits: u32 = mapped.iter().map(PdoDescription::bit_length).sum();
    let Some(missing) = (8 * u32::from(length)).checked_sub(bits) else {
        return vec![without_names(sync_manager, direction, length)];
    };
    // Bits up to the next byte belong to no PDO.
    if missing < 8 {
        return mapped;
    }
    match mapped.iter_mut().find(|pdo| pdo.entries.is_empty()) {
        Some(unknown) => unknown.entries = gaps(missing),
        None => mapped.push(PdoDescription { entries: gaps(missing), ..without_names(sync_manager, direction, 0) }),
    }
    mapped
}

/// Entries without names, with this number of bits in total.
fn gaps(bits: u32) -> Vec<PdoEntryDescription> {
    let starts = (0..bits).step_by(GAP as usize);
    let entry = |start: u32| PdoEntryDescription {
        index: 0,
        sub_index: 0,
        name: String::new(),
        data_type: 0,
        bit_length: (bits - start).min(GAP) as u8,
    };
    starts.map(entry).collect()
}

fn without_names(sync_manager: u8, direction: PdoDirection, length: u16) -> PdoDescription {
    let entries = gaps(8 * u32::from(length));
    let base = UNNAMED[usize::from(direction == PdoDirection::Tx)];
    let index = base + u16::from(sync_manager);
    PdoDescription { direction, index, name: String::new(), sync_manager: Some(sync_manager), flags: 0, entries }
}

/// The clock of the device, with the SYNC signals of the file.
fn clock(config: &SubDeviceConfig) -> DcDescription {
    let mode = config.sync.map(|signals| DcMode {
        sync0_cycle_ns: signals.sync0_cycle_ns,
        sync0_shift_ns: 0,
        sync1_shift_ns: 0,
        sync1_cycle_factor: 0,
        assign_activate: signals.assign_activate,
        sync0_cycle_factor: 0,
        name: 0,
        description: 0,
        reserved: [0; 4],
    });
    DcDescription { wide: true, modes: mode.into_iter().collect(), minimum_cycle_ns: 0 }
}
