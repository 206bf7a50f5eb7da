//! Device description from a real SII image.

use core::time::Duration;

use ringcat_wire::register::PortKind;
use ringcat_wire::sii::{
    General, MailboxLayout, PdoDirection, PhysicalPort, Sii, SiiSyncManager, Strings, SyncManagerKind,
};

use super::DescriptionError;
use crate::controller::ControllerConfig;
use crate::description::{
    DcDescription, DeviceDescription, MailboxDescription, PdoDescription, PdoEntryDescription, SyncManagerDescription,
    data_type,
};

/// Time from a request to its answer for devices whose real one is not known.
const RESPONSE_TIME: Duration = Duration::from_micros(200);
/// First objects of the PDOs that stand for those an image does not show.
const SUBSTITUTE_OUTPUTS: u16 = 0x7000;
const SUBSTITUTE_INPUTS: u16 = 0x6000;

impl DeviceDescription {
    /// Description of the device whose EEPROM content this is. The image is kept as it is.
    pub fn from_sii(image: Vec<u8>, name: &str) -> Result<DeviceDescription, DescriptionError> {
        let sii = Sii::parse(&image).map_err(DescriptionError::Sii)?;
        let header = *sii.header();
        let general = sii.general();
        let strings = sii.strings();
        let text = |number: Option<u8>| number.map(|number| string(&strings, number)).unwrap_or_default();
        let [pdi_type, esc_configuration] = header.pdi_control.to_le_bytes();
        let mut description = DeviceDescription {
            order_code: text(general.map(|general| general.order)),
            group: text(general.map(|general| general.group)),
            alias: header.alias,
            ports: ports(general),
            fmmus: sii.fmmu_usages().collect(),
            sync_managers: sii.sync_managers().map(sync_manager).collect(),
            pdos: pdos(&sii),
            mailbox: mailbox(&sii),
            dc: clock(&sii),
            pdi_type,
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
        let expected = usize::from(ControllerConfig::default().sync_manager_count);
        if description.sync_managers.len() > expected {
            return Err(DescriptionError::SyncManagers { got: description.sync_managers.len(), expected });
        }
        fill_mailbox_managers(&mut description);
        substitute_pdos(&mut description);
        description.sii_image = Some(image);
        Ok(description)
    }
}

fn string(strings: &Strings<'_>, number: u8) -> String {
    strings.string(number).map(|bytes| String::from_utf8_lossy(bytes).into_owned()).unwrap_or_default()
}

/// Ports as the general category says; two MII ports where it says nothing.
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

fn sync_manager(entry: SiiSyncManager) -> SyncManagerDescription {
    SyncManagerDescription {
        start: entry.start,
        length: entry.length,
        control: entry.control,
        enable: entry.enable,
        kind: entry.kind,
    }
}

fn pdos(sii: &Sii<'_>) -> Vec<PdoDescription> {
    let strings = sii.strings();
    let mut found = Vec::new();
    for direction in [PdoDirection::Rx, PdoDirection::Tx] {
        for pdo in sii.pdos(direction) {
            let entries = pdo.entries().map(|entry| PdoEntryDescription {
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
                sync_manager: pdo.sync_manager,
                flags: pdo.flags,
                entries: entries.collect(),
            });
        }
    }
    found
}

fn mailbox(sii: &Sii<'_>) -> Option<MailboxDescription> {
    let header = sii.header();
    let managers: Vec<SiiSyncManager> = sii.sync_managers().collect();
    let of = |kind| managers.iter().find(|entry| entry.kind == kind);
    let mut standard = header.standard_mailbox;
    if standard.receive_size == 0 || standard.send_size == 0 {
        let (out, back) = (of(SyncManagerKind::MailboxOut)?, of(SyncManagerKind::MailboxIn)?);
        standard = MailboxLayout {
            receive_offset: out.start,
            receive_size: out.length,
            send_offset: back.start,
            send_size: back.length,
        };
    }
    Some(MailboxDescription {
        standard,
        bootstrap: header.bootstrap_mailbox,
        protocols: header.protocols,
        coe_details: sii.general().map(|general| general.coe).unwrap_or_default(),
        response_time: RESPONSE_TIME,
    })
}

fn clock(sii: &Sii<'_>) -> Option<DcDescription> {
    let modes: Vec<_> = sii.dc_modes().collect();
    (!modes.is_empty()).then_some(DcDescription { wide: true, modes, minimum_cycle_ns: 0 })
}

/// An image with a mailbox but without entries for its SyncManagers: 0 and 1 are meant (facts 3.11).
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

/// A SyncManager with a default length but without PDOs: the device has them in its dictionary only. Bytes stand for
/// what the image does not show, so that the length and the dictionary agree.
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
        if any || entry.length == 0 || entry.length > u16::from(u8::MAX) || !description.has_coe() {
            continue;
        }
        let entries = (1..=u8::MAX).take(usize::from(entry.length)).map(|sub_index| PdoEntryDescription {
            index: base,
            sub_index,
            name: String::new(),
            data_type: data_type::U8,
            bit_length: 8,
        });
        description.pdos.push(PdoDescription {
            direction,
            index: mapping,
            name: String::new(),
            sync_manager: Some(number),
            flags: 0,
            entries: entries.collect(),
        });
    }
}
