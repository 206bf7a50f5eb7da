//! ESI files and any bytes (protocol 12): every file is a description or an error, and every device of a description
//! has an image in each tool's habits or a reason; an image gives a description again.

use ringcat_config::esi::sii::{SiiOptions, SiiProfile, build, compare, skeleton};
use ringcat_config::esi::{self, NoReferences};
use ringcat_wire::sii::Sii;

/// An own file with all elements.
pub const WHOLE: &str = include_str!("../../../config/tests/files/acme.xml");
/// A small one.
pub const SMALL: &str = include_str!("../../../config/tests/files/drive.xml");

/// Reads a file and builds the images of its devices.
pub fn target(bytes: &[u8]) {
    let _ = is_read(bytes);
}

/// The same; returns whether the file was read.
pub fn is_read(bytes: &[u8]) -> bool {
    let esi = match esi::read_with("any.xml", bytes, &NoReferences) {
        Ok(esi) => esi,
        Err(error) => {
            assert!(error.to_string().starts_with("any.xml:"), "{error}");
            return false;
        }
    };
    for device in esi.devices.iter().take(8) {
        for profile in SiiProfile::ALL {
            let Ok(image) = build(&esi, device, &SiiOptions::of(profile, 1033)) else { continue };
            assert!(image.used <= image.bytes.len());
            assert!(compare(&image.bytes, &image.bytes).differences.is_empty());
            let whole = device.eeprom.as_ref().is_some_and(|eeprom| eeprom.data.is_some());
            // An image that the description contains may be anything.
            assert!(whole || Sii::parse(&image.bytes).is_ok());
            if let Ok(text) = skeleton(&image.bytes) {
                let again = esi::read("again.xml", text.as_bytes());
                assert!(whole || again.is_ok(), "{again:?}");
            }
        }
    }
    true
}
