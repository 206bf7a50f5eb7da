//! Keys of a device's table for its mailbox and the mailbox protocols.

use core::net::Ipv4Addr;
use std::path::Path;

use super::file::read_at_most;
use super::format::{DeviceEntry, Place, duration};
use crate::description::{DeviceDescription, EoeDescription, EoeEnd, FoeDescription};

/// Sizes of a mailbox: minimum for an SDO, maximum data of a datagram.
const MAILBOX_BYTES: core::ops::RangeInclusive<u16> = 24..=1486;
/// Maximum size of a file on delivery.
const MAX_FILE_BYTES: u64 = 4 << 20;

/// Reads the keys.
pub(super) fn services(
    entry: &DeviceEntry,
    description: &mut DeviceDescription,
    base_dir: &Path,
) -> Result<(), (String, Place)> {
    if let Some(answer) = &entry.answer_us {
        let time = duration(answer, "answer_us", 1e-6).map_err(|error| (error.message, Some(answer.span())))?;
        let mailbox = description.mailbox.as_mut();
        let without = || ("answer_us: expected a device with a mailbox".to_owned(), Some(answer.span()));
        mailbox.ok_or_else(without)?.response_time = time;
    }
    if let Some(bytes) = &entry.mailbox_bytes {
        let error = |message: String| (format!("mailbox_bytes: {message}"), Some(bytes.span()));
        if !MAILBOX_BYTES.contains(bytes.get_ref()) {
            return Err(error(format!("expected 24 to 1486, got {}", bytes.get_ref())));
        }
        if !description.set_mailbox_bytes(*bytes.get_ref()) {
            return Err(error("expected a device of the catalogue with a mailbox".into()));
        }
    }
    files(entry, &mut description.services.foe, base_dir)?;
    ethernet(entry, &mut description.services.eoe)
}

/// Files on delivery, and settings for writing files.
fn files(entry: &DeviceEntry, foe: &mut FoeDescription, base_dir: &Path) -> Result<(), (String, Place)> {
    for file in &entry.files {
        let path = base_dir.join(file.get_ref());
        let error = |message: String| (format!("files: {}: {message}", path.display()), Some(file.span()));
        let name = path.file_name().and_then(|name| name.to_str()).ok_or_else(|| error("expected a file".into()))?;
        let data = read_at_most(&path, MAX_FILE_BYTES).map_err(error)?;
        foe.files.push((name.to_owned(), data));
    }
    foe.password = entry.password.unwrap_or(foe.password);
    if let Some(erase) = &entry.erase_ms {
        foe.erase_time = duration(erase, "erase_ms", 1e-3).map_err(|error| (error.message, Some(erase.span())))?;
    }
    Ok(())
}

/// The receiver of EoE frames, and its addresses.
fn ethernet(entry: &DeviceEntry, eoe: &mut EoeDescription) -> Result<(), (String, Place)> {
    if let Some(end) = &entry.ethernet {
        eoe.end = match end.get_ref().as_str() {
            "stack" => EoeEnd::Stack,
            "loop" => EoeEnd::Loop,
            "nothing" => EoeEnd::Nothing,
            other => {
                let message = format!("ethernet: expected stack, loop or nothing, got \"{other}\"");
                return Err((message, Some(end.span())));
            }
        };
    }
    if let Some(ip) = &entry.ip {
        let (address, mask) = network(ip.get_ref()).ok_or_else(|| {
            let message =
                format!("ip: expected an address with its prefix as in 10.0.0.2/24, got \"{}\"", ip.get_ref());
            (message, Some(ip.span()))
        })?;
        (eoe.address, eoe.mask) = (Some(address), Some(mask));
    }
    if let Some(gateway) = &entry.gateway {
        let address = gateway.get_ref().parse().ok().filter(|address| is_usable(*address)).ok_or_else(|| {
            let message = format!("gateway: expected an address as in 10.0.0.1, got \"{}\"", gateway.get_ref());
            (message, Some(gateway.span()))
        })?;
        eoe.gateway = Some(address);
    }
    Ok(())
}

/// Address and mask; `None` if a device cannot have the address.
fn network(text: &str) -> Option<(Ipv4Addr, Ipv4Addr)> {
    let (address, prefix) = text.split_once('/')?;
    let address: Ipv4Addr = address.parse().ok()?;
    let prefix: u32 = prefix.parse().ok().filter(|prefix| *prefix <= 32)?;
    let mask = u32::MAX.checked_shl(32 - prefix).unwrap_or(0);
    is_usable(address).then_some((address, mask.into()))
}

/// Whether a device can have an address.
const fn is_usable(address: Ipv4Addr) -> bool {
    !address.is_multicast() && !address.is_broadcast() && !address.is_unspecified()
}
