//! Firmware images that the boot loader of simulated devices accepts.
//!
//! Magic `RCFW`, length of the version (u8), version, program, sum of all preceding bytes (u32, little-endian).

use ringcat_wire::mailbox::foe::FoeErrorCode;

const MAGIC: &[u8; 4] = b"RCFW";

/// An image with this version (at most 255 bytes) and a program.
pub fn image(version: &str, program: &[u8]) -> Vec<u8> {
    let end = (0..=version.len().min(255)).rev().find(|end| version.is_char_boundary(*end)).unwrap_or(0);
    let version = &version.as_bytes()[..end];
    let mut image = MAGIC.to_vec();
    image.push(version.len() as u8);
    image.extend_from_slice(version);
    image.extend_from_slice(program);
    image.extend_from_slice(&sum(&image).to_le_bytes());
    image
}

/// The version of an image, or the reason for which the boot loader refuses it.
pub(super) fn check(image: &[u8]) -> Result<String, (FoeErrorCode, &'static str)> {
    let foreign = (FoeErrorCode::FIRMWARE_DOES_NOT_FIT, "no firmware of this device");
    let (content, checksum) = image.split_last_chunk().ok_or(foreign)?;
    let body = content.strip_prefix(MAGIC).ok_or(foreign)?;
    if sum(content) != u32::from_le_bytes(*checksum) {
        return Err((FoeErrorCode::CHECKSUM_WRONG, "checksum wrong"));
    }
    let (length, rest) = body.split_first().ok_or(foreign)?;
    let version = rest.get(..usize::from(*length)).ok_or(foreign)?;
    Ok(String::from_utf8_lossy(version).into_owned())
}

fn sum(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0, |sum: u32, byte| sum.wrapping_add(u32::from(*byte)))
}
