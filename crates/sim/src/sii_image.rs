//! SII image from a device description, and description from a real SII image (protocol 4).
//!
//! Converts between [`DeviceDescription`] and the bytes of an EEPROM. A real image is kept byte for byte; the
//! description derived from it defines the behaviour of the device. If an image lacks information, such as the mapping
//! of a device with PDOs only in its dictionary, substitutes are added so that SyncManagers and dictionary agree.

mod reader;

use core::fmt;

use ringcat_wire::register::PortKind;
use ringcat_wire::sii::{
    CHECKSUM_DISABLED, DcMode, General, GeneralFlags, MailboxProtocols, PdoDescription as SiiPdo, PdoDirection,
    PdoEntry, SiiError, SiiHeader, SiiSyncManager, SiiWriteError, SiiWriter,
};

use crate::description::{DeviceDescription, PdoDescription};

/// Bytes per KBit, the unit of the size word.
const BYTES_PER_KBIT: usize = 128;
/// Largest EEPROM that the size word can describe.
const MAX_IMAGE_BYTES: usize = 0x1_0000 * BYTES_PER_KBIT;
/// Maximum number of characters of a string.
const MAX_STRING: usize = 255;

/// The reason for which an SII image is no device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum DescriptionError {
    /// The image is invalid.
    Sii(SiiError),
    /// More SyncManagers than a controller has.
    SyncManagers {
        /// SyncManagers of the image.
        got: usize,
        /// SyncManagers of the controller.
        expected: usize,
    },
}

impl fmt::Display for DescriptionError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            DescriptionError::Sii(error) => error.fmt(f),
            DescriptionError::SyncManagers { got, expected } => {
                write!(f, "SII declares {got} SyncManagers, expected at most {expected}")
            }
        }
    }
}

impl std::error::Error for DescriptionError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            DescriptionError::Sii(error) => Some(error),
            _ => None,
        }
    }
}

/// The EEPROM content of a device: the real image if there is one, with the alias and the serial number of the
/// description. An image derived from the description grows beyond the declared size if the content needs it; strings
/// beyond 255 and entries beyond the limits of the format are omitted.
pub fn build(description: &DeviceDescription) -> Vec<u8> {
    if let Some(image) = &description.sii_image {
        return with_alias_and_serial(image.clone(), description);
    }
    let mut size = description.sii_size_bytes.next_multiple_of(BYTES_PER_KBIT).clamp(BYTES_PER_KBIT, MAX_IMAGE_BYTES);
    loop {
        let mut image = vec![0; size];
        match write(description, &mut image) {
            Ok(_) => return image,
            Err(SiiWriteError::Full { expected, .. }) if size < MAX_IMAGE_BYTES => {
                size = expected.max(size + 1).next_multiple_of(BYTES_PER_KBIT).min(MAX_IMAGE_BYTES);
            }
            // An item that cannot be written ends the list of categories before it.
            Err(_) => return image,
        }
    }
}

/// Writes alias and serial number into a real image; equal values leave it unchanged.
fn with_alias_and_serial(mut image: Vec<u8>, description: &DeviceDescription) -> Vec<u8> {
    if let Some(bytes) = image.first_chunk_mut::<{ SiiHeader::LEN }>() {
        let mut header = SiiHeader::decode(bytes);
        let serial = description.identity.serial;
        if (header.alias, header.identity.serial) != (description.alias, serial) {
            header.alias = description.alias;
            header.identity.serial = serial;
            let unchecked = header.checksum == CHECKSUM_DISABLED;
            *bytes = if unchecked { header.encode() } else { header.with_checksum().encode() };
        }
    }
    image
}

/// Used bytes of an image, up to the end marker.
pub fn used_bytes(description: &DeviceDescription) -> usize {
    let mut image = vec![0; build(description).len()];
    write(description, &mut image).unwrap_or(image.len())
}

/// Strings of an image with their indices.
#[derive(Default)]
struct StringTable<'a>(Vec<&'a str>);

impl<'a> StringTable<'a> {
    /// The index of a string, 0 for none.
    fn number(&mut self, string: &'a str) -> u8 {
        let end = (0..=string.len().min(MAX_STRING)).rev().find(|end| string.is_char_boundary(*end)).unwrap_or(0);
        let string = &string[..end];
        if string.is_empty() {
            return 0;
        }
        let place = self.0.iter().position(|known| *known == string).unwrap_or_else(|| {
            if self.0.len() < usize::from(u8::MAX) {
                self.0.push(string);
            }
            self.0.len() - 1
        });
        u8::try_from(place + 1).unwrap_or(0)
    }
}

fn write(description: &DeviceDescription, image: &mut [u8]) -> Result<usize, SiiWriteError> {
    let mut strings = StringTable::default();
    let general = general(description, &mut strings);
    let inputs = PdoTable::new(description, PdoDirection::Tx, &mut strings);
    let outputs = PdoTable::new(description, PdoDirection::Rx, &mut strings);
    let mut writer = SiiWriter::new(image, &header(description, image.len()))?;
    writer.strings(&strings.0)?;
    writer.general(&general)?;
    if !description.fmmus.is_empty() {
        writer.fmmus(&description.fmmus)?;
    }
    let managers: Vec<SiiSyncManager> = description
        .sync_managers
        .iter()
        .map(|entry| SiiSyncManager {
            start: entry.start,
            length: entry.length,
            control: entry.control,
            status: 0,
            enable: entry.enable,
            kind: entry.kind,
        })
        .collect();
    if !managers.is_empty() {
        writer.sync_managers(&managers)?;
    }
    for (direction, table) in [(PdoDirection::Tx, inputs), (PdoDirection::Rx, outputs)] {
        if !table.heads.is_empty() {
            writer.pdos(direction, &table.rows())?;
        }
    }
    let modes: &[DcMode] = description.dc.as_ref().map_or(&[], |dc| &dc.modes);
    if !modes.is_empty() {
        writer.dc_modes(modes)?;
    }
    writer.finish()
}

/// The name in the SII.
fn name(description: &DeviceDescription) -> &str {
    description.name_in_sii.as_ref().unwrap_or(&description.name)
}

/// Offsets of reserved words 0x20 to 0x23, counted from word 0x1D.
const CONTENT_HASH: core::ops::Range<usize> = 3..7;

/// A hash that distinguishes the content of devices with a different name: MainDevices cache the categories of devices
/// with an equal fixed area, but these devices differ in their categories. These words also differ in many real images.
/// 64 bits of FNV-1a.
fn content_hash(description: &DeviceDescription) -> [u16; 4] {
    let Some(name) = &description.name_in_sii else { return [0; 4] };
    let hash = name
        .bytes()
        .fold(0xCBF2_9CE4_8422_2325_u64, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01B3));
    [0, 16, 32, 48].map(|shift| (hash >> shift) as u16)
}

fn header(description: &DeviceDescription, size_bytes: usize) -> SiiHeader {
    let kbit = u16::try_from(size_bytes / BYTES_PER_KBIT - 1).unwrap_or(u16::MAX);
    let mailbox = description.mailbox;
    let mut reserved_1d = SiiHeader::default().reserved_1d;
    reserved_1d[CONTENT_HASH].copy_from_slice(&content_hash(description));
    let esc_configuration = description.esc_configuration & !1 | u8::from(description.emulation);
    let [a, b, c, d] = description.pdi_configuration;
    SiiHeader {
        reserved_1d,
        pdi_control: u16::from_le_bytes([description.pdi_type, esc_configuration]),
        pdi_configuration: u16::from_le_bytes([a, b]),
        extended_pdi_configuration: u16::from_le_bytes([c, d]),
        alias: description.alias,
        identity: description.identity,
        bootstrap_mailbox: mailbox.map(|mailbox| mailbox.bootstrap).unwrap_or_default(),
        standard_mailbox: mailbox.map(|mailbox| mailbox.standard).unwrap_or_default(),
        protocols: mailbox.map_or(MailboxProtocols(0), |mailbox| mailbox.protocols),
        size_kbit_minus_1: kbit,
        ..SiiHeader::default()
    }
}

fn general<'a>(description: &'a DeviceDescription, strings: &mut StringTable<'a>) -> General {
    // String 1 is the order code, as in real images: some MainDevices use it as name without reading this category.
    let order = strings.number(&description.order_code);
    let group = strings.number(&description.group);
    let protocols = description.mailbox.map(|mailbox| mailbox.protocols).unwrap_or_default();
    let drives = u8::try_from(description.services.soe.drives.len()).unwrap_or(u8::MAX);
    let mut flags = 0;
    if description.mailbox.is_some() {
        flags |= GeneralFlags::MAILBOX_DATA_LINK_LAYER;
    }
    if description.identification.is_some() {
        flags |= GeneralFlags::IDENTIFICATION_AL_STATUS_CODE;
    }
    if description.id_switch_address.is_some() {
        flags |= GeneralFlags::IDENTIFICATION_MEMORY;
    }
    General {
        group,
        order,
        name: strings.number(name(description)),
        coe: description.mailbox.map(|mailbox| mailbox.coe_details).unwrap_or_default(),
        foe: u8::from(protocols.foe()),
        eoe: u8::from(protocols.eoe()),
        soe_channels: if protocols.soe() { drives } else { 0 },
        flags: GeneralFlags(flags),
        ebus_current_ma: description.ebus_current_ma,
        id_switch_address: description.id_switch_address.unwrap_or(0),
        group_again: group,
        physical_ports: physical_ports(&description.ports),
        ..General::default()
    }
}

/// A nibble per port (protocol 4.3).
fn physical_ports(ports: &[PortKind; 4]) -> u16 {
    ports.iter().rev().fold(0, |bits, port| {
        bits << 4
            | match port {
                PortKind::NotImplemented | PortKind::NotConfigured => 0,
                PortKind::Mii => 1,
                PortKind::Ebus => 3,
            }
    })
}

/// The PDOs of one direction with their entries, for the writer.
struct PdoTable<'a> {
    heads: Vec<(&'a PdoDescription, u8)>,
    entries: Vec<Vec<PdoEntry>>,
}

impl<'a> PdoTable<'a> {
    fn new(description: &'a DeviceDescription, direction: PdoDirection, strings: &mut StringTable<'a>) -> PdoTable<'a> {
        let mut table = PdoTable { heads: Vec::new(), entries: Vec::new() };
        for pdo in description.pdos.iter().filter(|pdo| pdo.direction == direction) {
            table.heads.push((pdo, strings.number(&pdo.name)));
            let entries = pdo.entries.iter().take(usize::from(u8::MAX)).map(|entry| PdoEntry {
                index: entry.index,
                sub_index: entry.sub_index,
                name: strings.number(&entry.name),
                data_type: entry.data_type,
                bit_length: entry.bit_length,
                flags: 0,
            });
            table.entries.push(entries.collect());
        }
        table
    }

    fn rows(&self) -> Vec<SiiPdo<'_>> {
        let rows = self.heads.iter().zip(&self.entries).map(|((pdo, name), entries)| SiiPdo {
            index: pdo.index,
            sync_manager: pdo.sync_manager,
            synchronisation: 0,
            name: *name,
            flags: pdo.flags,
            entries,
        });
        rows.collect()
    }
}

#[cfg(test)]
mod tests;
