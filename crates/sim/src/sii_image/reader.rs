//! Device description from a real SII image.

use core::time::Duration;

use ringcat_wire::register::PortKind;
use ringcat_wire::sii::{
    General, MailboxLayout, PdoDirection, PhysicalPort, Sii, SiiHeader, SiiSyncManager, Strings, SyncManagerKind,
};

use super::DescriptionError;
use crate::controller::MAX_UNITS;
use crate::description::{
    DcDescription, DeviceDescription, MailboxDescription, PdoDescription, PdoEntryDescription, SyncManagerDescription,
    data_type,
};

/// Response time of devices whose real value is not known.
const RESPONSE_TIME: Duration = Duration::from_micros(200);
/// A mailbox must hold the header of a message (protocol 6.1).
const SMALLEST_MAILBOX: u16 = 6;
/// Bytes of a substitute entry if an entry per byte would exceed the limit of an object.
const CHUNK: u16 = 31;
/// First objects of the PDOs that substitute PDOs missing in an image.
const SUBSTITUTE_OUTPUTS: u16 = 0x7000;
const SUBSTITUTE_INPUTS: u16 = 0x6000;

impl DeviceDescription {
    /// Description of the device with this EEPROM content. The image is kept unchanged.
    pub fn from_sii(image: Vec<u8>, name: &str) -> Result<DeviceDescription, DescriptionError> {
        let sii = Sii::parse(&image).map_err(DescriptionError::Sii)?;
        let header = *sii.header();
        let general = sii.general();
        let strings = sii.strings();
        let text = |number: Option<u8>| number.map(|number| string(&strings, number)).unwrap_or_default();
        let [pdi_type, esc_configuration] = header.pdi_control.to_le_bytes();
        let sync_managers = sync_managers(&sii);
        let mut description = DeviceDescription {
            order_code: text(general.map(|general| general.order)),
            group: text(general.map(|general| general.group)),
            alias: header.alias,
            ports: ports(general),
            fmmus: sii.fmmu_usages().collect(),
            pdos: pdos(&sii, &sync_managers),
            mailbox: mailbox(&sii, &sync_managers),
            sync_managers,
            dc: clock(&sii),
            pdi_type,
            esc_configuration: esc_configuration & !1,
            pdi_configuration: pdi_configuration(&header),
            emulation: esc_configuration & 0x01 != 0,
            ebus_current_ma: general.map_or(0, |general| general.ebus_current_ma),
            identification: general
                .filter(|general| general.flags.identification_al_status_code())
                .map(|_| header.alias),
            id_switch_address: general
                .filter(|general| general.flags.identification_memory())
                .map(|general| general.id_switch_address),
            sii_size_bytes: image.len(),
            ..DeviceDescription::plain(name, header.identity)
        };
        let expected = usize::from(MAX_UNITS);
        if description.sync_managers.len() > expected {
            return Err(DescriptionError::SyncManagers { got: description.sync_managers.len(), expected });
        }
        fill_mailbox_managers(&mut description);
        substitute_pdos(&mut description);
        description.sii_image = Some(image);
        Ok(description)
    }
}

fn pdi_configuration(header: &SiiHeader) -> [u8; 4] {
    let ([a, b], [c, d]) = (header.pdi_configuration.to_le_bytes(), header.extended_pdi_configuration.to_le_bytes());
    [a, b, c, d]
}

fn string(strings: &Strings<'_>, number: u8) -> String {
    strings.string(number).map(|bytes| String::from_utf8_lossy(bytes).into_owned()).unwrap_or_default()
}

/// Ports of the general category; two MII ports if it contains none.
fn ports(general: Option<General>) -> [PortKind; 4] {
    let declared = general.map(|general| general.ports()).unwrap_or([PhysicalPort::Unused; 4]);
    let ports = declared.map(|port| match port {
        PhysicalPort::Unused | PhysicalPort::Other(_) => PortKind::NotImplemented,
        PhysicalPort::Mii | PhysicalPort::FastHotConnect => PortKind::Mii,
        PhysicalPort::Ebus => PortKind::Ebus,
    });
    if ports == [PortKind::NotImplemented; 4] {
        return [PortKind::Mii, PortKind::Mii, PortKind::NotImplemented, PortKind::NotImplemented];
    }
    ports
}

/// The SyncManagers up to the first one that is erased.
fn sync_managers(sii: &Sii<'_>) -> Vec<SyncManagerDescription> {
    let described = sii.sync_managers().take_while(|entry| !entry.is_erased());
    let entries = described.enumerate().map(|(number, entry)| SyncManagerDescription {
        start: entry.start,
        length: entry.length,
        control: entry.control,
        enable: entry.enable,
        kind: kind(sii, number, &entry),
    });
    entries.collect()
}

/// Type of a SyncManager. If the image contains no type, its PDOs determine it, then the control byte of an enabled
/// SyncManager.
fn kind(sii: &Sii<'_>, number: usize, entry: &SiiSyncManager) -> SyncManagerKind {
    let has = |direction| sii.pdos(direction).any(|pdo| pdo.sync_manager.map(usize::from) == Some(number));
    match entry.kind {
        SyncManagerKind::MailboxOut
        | SyncManagerKind::MailboxIn
        | SyncManagerKind::Outputs
        | SyncManagerKind::Inputs => entry.kind,
        SyncManagerKind::Unused | SyncManagerKind::Other(_) if has(PdoDirection::Rx) => SyncManagerKind::Outputs,
        SyncManagerKind::Unused | SyncManagerKind::Other(_) if has(PdoDirection::Tx) => SyncManagerKind::Inputs,
        SyncManagerKind::Unused | SyncManagerKind::Other(_) if entry.is_enabled() && entry.length > 0 => {
            entry.kind_of_control()
        }
        SyncManagerKind::Unused | SyncManagerKind::Other(_) => SyncManagerKind::Unused,
    }
}

/// A PDO assigned to a SyncManager of another type is not assigned.
fn pdos(sii: &Sii<'_>, sync_managers: &[SyncManagerDescription]) -> Vec<PdoDescription> {
    let strings = sii.strings();
    let mut found = Vec::new();
    for direction in [PdoDirection::Rx, PdoDirection::Tx] {
        let wanted = match direction {
            PdoDirection::Rx => SyncManagerKind::Outputs,
            PdoDirection::Tx => SyncManagerKind::Inputs,
        };
        let fits = |number: &u8| sync_managers.get(usize::from(*number)).is_some_and(|entry| entry.kind == wanted);
        for pdo in sii.pdos(direction) {
            let entries = pdo.entries().filter(|entry| !entry.is_erased()).map(|entry| PdoEntryDescription {
                index: entry.index,
                sub_index: entry.sub_index,
                name: string(&strings, entry.name),
                data_type: entry.data_type,
                bit_length: entry.bit_length,
            });
            found.push(PdoDescription {
                direction,
                index: pdo.index,
                name: string(&strings, pdo.name),
                sync_manager: pdo.sync_manager.filter(fits),
                flags: pdo.flags,
                entries: entries.collect(),
            });
        }
    }
    found
}

/// The layout of the fixed area, if it is possible; otherwise the layout of the mailbox SyncManagers.
fn mailbox(sii: &Sii<'_>, sync_managers: &[SyncManagerDescription]) -> Option<MailboxDescription> {
    let header = sii.header();
    let standard = Some(header.standard_mailbox).filter(is_possible);
    let has_protocols = header.protocols.0 != 0;
    let standard =
        standard.or_else(|| of_sync_managers(sync_managers).filter(|layout| has_protocols && is_possible(layout)))?;
    let number = |kind| sync_managers.iter().position(|entry| entry.kind == kind);
    let numbers = number(SyncManagerKind::MailboxOut).zip(number(SyncManagerKind::MailboxIn));
    let (out, inward) = numbers.unwrap_or((0, 1));
    // A device without SyncManagers for the mailbox uses the first two, unless they exchange process data.
    let exchanges = |number: usize| {
        sync_managers
            .get(number)
            .is_some_and(|it| matches!(it.kind, SyncManagerKind::Outputs | SyncManagerKind::Inputs))
    };
    if exchanges(out) || exchanges(inward) {
        return None;
    }
    Some(MailboxDescription {
        standard,
        bootstrap: Some(header.bootstrap_mailbox).filter(is_possible).unwrap_or_default(),
        protocols: header.protocols,
        coe_details: sii.general().map(|general| general.coe).unwrap_or_default(),
        response_time: RESPONSE_TIME,
    })
}

fn of_sync_managers(sync_managers: &[SyncManagerDescription]) -> Option<MailboxLayout> {
    let of = |kind| sync_managers.iter().find(|entry| entry.kind == kind);
    let (out, back) = (of(SyncManagerKind::MailboxOut)?, of(SyncManagerKind::MailboxIn)?);
    Some(MailboxLayout {
        receive_offset: out.start,
        receive_size: out.length,
        send_offset: back.start,
        send_size: back.length,
    })
}

/// Whether both mailboxes can hold a header and do not overlap in the process RAM. 0xFFFF is a field that was never
/// written.
fn is_possible(layout: &MailboxLayout) -> bool {
    let span = |start: u16, size: u16| u32::from(start)..u32::from(start) + u32::from(size);
    let out = span(layout.receive_offset, layout.receive_size);
    let back = span(layout.send_offset, layout.send_size);
    let fits = |span: &core::ops::Range<u32>, size: u16| {
        size != u16::MAX && size >= SMALLEST_MAILBOX && span.start >= 0x1000 && span.end <= 0x1_0000
    };
    fits(&out, layout.receive_size) && fits(&back, layout.send_size) && (out.end <= back.start || back.end <= out.start)
}

fn clock(sii: &Sii<'_>) -> Option<DcDescription> {
    let modes: Vec<_> = sii.dc_modes().collect();
    (!modes.is_empty()).then_some(DcDescription { wide: true, modes, minimum_cycle_ns: 0 })
}

/// An image with a mailbox but without entries for its SyncManagers: uses 0 and 1 (protocol 3.11).
fn fill_mailbox_managers(description: &mut DeviceDescription) {
    let Some(mailbox) = description.mailbox else {
        return;
    };
    if !description.sync_managers.is_empty() {
        return;
    }
    let layout = mailbox.standard;
    let entry = |start, length, control, kind| SyncManagerDescription { start, length, control, enable: 1, kind };
    description.sync_managers = vec![
        entry(layout.receive_offset, layout.receive_size, 0x26, SyncManagerKind::MailboxOut),
        entry(layout.send_offset, layout.send_size, 0x22, SyncManagerKind::MailboxIn),
    ];
}

/// A SyncManager with a default length but without PDOs: the device has PDOs only in its dictionary. Byte entries
/// substitute the missing PDOs, so that the length and the dictionary agree.
fn substitute_pdos(description: &mut DeviceDescription) {
    let managers = description.sync_managers.clone();
    for (number, entry) in (0u8..).zip(managers) {
        let (direction, mapping, base) = match entry.kind {
            SyncManagerKind::Outputs => (PdoDirection::Rx, 0x1600, SUBSTITUTE_OUTPUTS),
            SyncManagerKind::Inputs => (PdoDirection::Tx, 0x1A00, SUBSTITUTE_INPUTS),
            SyncManagerKind::Unused
            | SyncManagerKind::MailboxOut
            | SyncManagerKind::MailboxIn
            | SyncManagerKind::Other(_) => continue,
        };
        let any = description.pdos.iter().any(|pdo| pdo.direction == direction);
        let in_use = entry.enable & SiiSyncManager::ENABLE != 0 && entry.enable & SiiSyncManager::VIRTUAL == 0;
        if any || entry.length == 0 || !in_use || !description.has_coe() {
            continue;
        }
        let entries = substitutes(entry.length, base);
        description.pdos.push(PdoDescription {
            direction,
            index: mapping,
            name: String::new(),
            sync_manager: Some(number),
            flags: 0,
            entries,
        });
    }
}

/// Entries of this number of bytes in total: one per byte, or as few as possible.
fn substitutes(length: u16, index: u16) -> Vec<PdoEntryDescription> {
    let width = if length < u16::from(u8::MAX) { 1 } else { CHUNK };
    let starts = (0..length).step_by(usize::from(width));
    let entries = (1..=u8::MAX).zip(starts).map(|(sub_index, start)| {
        let bytes = width.min(length - start);
        PdoEntryDescription {
            index,
            sub_index,
            name: String::new(),
            data_type: if bytes == 1 { data_type::U8 } else { data_type::OCTET_STRING },
            bit_length: u8::try_from(8 * bytes).unwrap_or(u8::MAX),
        }
    });
    entries.collect()
}
