//! An image from a description: the fixed area, the categories in their order, the end (protocol ES-80 to ES-85,
//! ES-100).

use std::collections::BTreeMap;

use ringcat_wire::sii::{Identity, MailboxLayout, MailboxProtocols, SiiHeader};

use super::categories::Builder;
use super::profile::{SiiOptions, SiiProfile};
use crate::esi::error::EsiError;
use crate::esi::model::{Device, Eeprom, Esi, Mailbox, SyncManagerRole};
use crate::xml::shown;

/// Bytes of `ConfigData`: the words before the checksum.
const CONFIG_BYTES: usize = 14;
/// Bytes of the EEPROM of a description that does not say.
const USUAL_BYTES: usize = 2048;
/// The unit of the size word.
const BYTES_PER_KBIT: usize = 128;
/// The category of strings; others follow.
const STRINGS: u16 = 10;

/// An image and what differs from the description.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SiiImage {
    /// The image.
    pub bytes: Vec<u8>,
    /// Bytes up to the end marker.
    pub used: usize,
    /// What is not in the image as the description says it.
    pub notices: Vec<String>,
}

/// The category of a device that TwinCAT writes before the standard ones.
const DEVICE_SPECIFIC: u16 = 3;

/// The image of a device.
///
/// # Errors
/// [`EsiError`]: a description without `Eeprom`, PDOs that the format cannot hold, an image larger than `ByteSize`.
pub fn build(esi: &Esi, device: &Device, options: &SiiOptions) -> Result<SiiImage, EsiError> {
    let rule = |line, reason: String| EsiError::rule(&esi.file, line, device.kind.trim(), reason);
    let fallback = Eeprom::default();
    let eeprom = match &device.eeprom {
        Some(eeprom) => eeprom,
        None if device.is_invisible => {
            return Err(rule(device.line, "it has no controller (Invisible), so it has no EEPROM".to_owned()));
        }
        None => &fallback,
    };
    if let Some(data) = &eeprom.data {
        let line = eeprom.line;
        return whole(data, options)
            .ok_or_else(|| rule(line, format!("Eeprom/Data has {} bytes, expected at least 128", data.len())));
    }
    check(esi, device)?;
    let mut notices = Vec::new();
    let mut builder = Builder::new(device, esi.group_of(device), options);
    let mut categories = builder.all();
    own_categories(eeprom, &mut categories, &mut notices);
    let strings = &builder.strings;
    notices.extend(strings.changed.iter().map(|text| format!("text {} is shortened or not Latin-1", shown(text))));
    if strings.left_out > 0 {
        let reason = format!("{} texts beyond 255 have no place in an SII", strings.left_out);
        return Err(rule(device.line, reason));
    }
    let size = eeprom.byte_size.map_or(USUAL_BYTES, |size| size as usize);
    let mut bytes = header(device, eeprom, size, options, &mut notices).encode().to_vec();
    categories.insert(0, (STRINGS, strings.bytes()));
    if options.profile == SiiProfile::TwinCat {
        // A category of the device precedes the standard ones (protocol ES-82); the others keep their order.
        categories.sort_by_key(|(code, _)| *code != DEVICE_SPECIFIC);
    }
    for (code, data) in categories.into_iter().filter(|(_, data)| !data.is_empty()) {
        let words = u16::try_from(data.len().div_ceil(2))
            .map_err(|_| rule(device.line, format!("category {code} has {} bytes", data.len())))?;
        bytes.extend_from_slice(&code.to_le_bytes());
        bytes.extend_from_slice(&words.to_le_bytes());
        bytes.extend_from_slice(&data);
        if data.len() % 2 != 0 {
            bytes.push(options.profile.pad());
        }
    }
    bytes.extend_from_slice(&[0xFF, 0xFF]);
    let used = bytes.len();
    if used > size {
        let reason = format!(
            "the image needs {used} bytes, ByteSize is {size}{}",
            if options.without_pdos { "" } else { " (--without-pdos leaves the PDOs out)" }
        );
        return Err(rule(eeprom.line, reason));
    }
    if options.profile != SiiProfile::Siitool {
        bytes.resize(size, 0xFF);
    }
    Ok(SiiImage { bytes, used, notices })
}

/// PDOs that the format cannot hold.
fn check(esi: &Esi, device: &Device) -> Result<(), EsiError> {
    for pdo in device.tx_pdos.iter().chain(&device.rx_pdos) {
        let index = pdo.index.index;
        let rule = |reason: String| Err(EsiError::rule(&esi.file, pdo.line, device.kind.trim(), reason));
        if pdo.entries.len() > 255 {
            return rule(format!("PDO {index:#06x} has {} entries, an SII holds 255", pdo.entries.len()));
        }
        if let Some(entry) = pdo.entries.iter().find(|entry| entry.bit_length > 255) {
            return rule(format!("PDO {index:#06x} has an entry of {} bits, an SII holds 255", entry.bit_length));
        }
    }
    Ok(())
}

/// The image that the description contains, with the alias and the serial number of the options.
fn whole(data: &[u8], options: &SiiOptions) -> Option<SiiImage> {
    let mut bytes = data.to_vec();
    let fixed = bytes.first_chunk_mut::<{ SiiHeader::LEN }>()?;
    let mut header = SiiHeader::decode(fixed);
    if options.alias.is_some() || options.serial.is_some() {
        header.alias = options.alias.unwrap_or(header.alias);
        header.identity.serial = options.serial.unwrap_or(header.identity.serial);
        *fixed = header.with_checksum().encode();
    }
    Some(SiiImage { used: bytes.len(), bytes, notices: Vec::new() })
}

/// Categories given by the description. They replace generated categories if their length is right (protocol ES-100).
fn own_categories(eeprom: &Eeprom, categories: &mut Vec<(u16, Vec<u8>)>, notices: &mut Vec<String>) {
    let mut places = BTreeMap::new();
    for (place, (number, _)) in categories.iter().enumerate().filter(|(_, (_, made))| !made.is_empty()) {
        places.entry(*number).or_insert(place);
    }
    for own in &eeprom.categories {
        let data = own.content.bytes();
        let Some(made) = places.get(&own.number).and_then(|place| categories.get_mut(*place)) else {
            if !data.is_empty() {
                places.insert(own.number, categories.len());
            }
            categories.push((own.number, data));
            continue;
        };
        let fits = match own.number {
            30 => data.len() == 32,
            41 => data.len().is_multiple_of(8) && !data.is_empty(),
            _ => !data.is_empty(),
        };
        if fits {
            made.1 = data;
        } else {
            let (line, number, length) = (own.line, own.number, data.len());
            notices.push(format!("line {line}: Category {number} of {length} bytes: not used, not a valid length"));
        }
    }
}

fn header(device: &Device, eeprom: &Eeprom, size: usize, options: &SiiOptions, notices: &mut Vec<String>) -> SiiHeader {
    let mut fixed = [0_u8; SiiHeader::LEN];
    let config = &eeprom.config_data;
    if config.len() > CONFIG_BYTES {
        notices.push(format!("ConfigData has {} bytes: the first {CONFIG_BYTES} count", config.len()));
    }
    let kept = config.len().min(CONFIG_BYTES);
    fixed[..kept].copy_from_slice(&config[..kept]);
    let mut header = SiiHeader::decode(&fixed);
    header.alias = options.alias.unwrap_or(header.alias);
    header.identity = identity(device, options);
    if let Some(bytes) = eeprom.bootstrap.as_ref().and_then(|bytes| bytes.first_chunk()) {
        header.bootstrap_mailbox = MailboxLayout::decode(bytes);
    }
    if let Some(mailbox) = &device.mailbox {
        header.standard_mailbox = layout(device);
        header.protocols = protocols(mailbox);
    }
    let kbit = (size / BYTES_PER_KBIT).saturating_sub(1);
    header.size_kbit_minus_1 = u16::try_from(kbit).unwrap_or(u16::MAX);
    header.version = 1;
    header.with_checksum()
}

fn identity(device: &Device, options: &SiiOptions) -> Identity {
    Identity {
        vendor_id: device.vendor_id,
        product_code: device.product_code,
        revision: device.revision,
        serial: options.serial.or(device.serial).unwrap_or(0),
    }
}

/// Addresses of the first mailbox SyncManagers.
fn layout(device: &Device) -> MailboxLayout {
    let of = |role| {
        let sm = device.sync_managers.iter().find(|sm| sm.role == role);
        sm.map_or((0, 0), |sm| (sm.start.unwrap_or(0), sm.default_size.unwrap_or(0)))
    };
    let (receive_offset, receive_size) = of(SyncManagerRole::MailboxOut);
    let (send_offset, send_size) = of(SyncManagerRole::MailboxIn);
    MailboxLayout { receive_offset, receive_size, send_offset, send_size }
}

fn protocols(mailbox: &Mailbox) -> MailboxProtocols {
    let bits = [
        (mailbox.aoe.is_some(), MailboxProtocols::AOE),
        (mailbox.eoe.is_some(), MailboxProtocols::EOE),
        (mailbox.coe.is_some(), MailboxProtocols::COE),
        (mailbox.foe, MailboxProtocols::FOE),
        (mailbox.soe.is_some(), MailboxProtocols::SOE),
        (mailbox.voe, MailboxProtocols::VOE),
    ];
    MailboxProtocols(bits.into_iter().filter(|(is_set, _)| *is_set).fold(0, |all, (_, bit)| all | bit))
}
