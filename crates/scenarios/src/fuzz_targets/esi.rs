//! ESI files and any bytes (protocol 12): every file is a description or an error, and every device of a description
//! has an image in each tool's habits or a reason; an image gives a description again. Every device is a SubDevice of a
//! network file that is valid, or is refused with a reason.

use std::time::Duration;

use ringcat_config::esi::sii::{SiiOptions, SiiProfile, build, compare, skeleton};
use ringcat_config::esi::{self, Choices, Device, Esi, NoReferences, PdoChoice, select};
use ringcat_config::network::NetworkFile;
use ringcat_config::network::model::SubDevice;
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
        declare(&esi, device);
        for profile in SiiProfile::ALL {
            let Ok(image) = build(&esi, device, &SiiOptions::of(profile, 1033)) else { continue };
            assert!(image.used <= image.bytes.len());
            assert!(compare(&image.bytes, &image.bytes).differences.is_empty());
            let whole = device.eeprom.as_ref().is_some_and(|eeprom| eeprom.data.is_some());
            // An image that the description contains may be anything.
            assert!(whole || Sii::parse(&image.bytes).is_ok());
            if let Ok(made) = skeleton(&image.bytes) {
                let again = esi::read("again.xml", made.text.as_bytes());
                assert!(whole || again.is_ok(), "{again:?}");
            }
        }
    }
    true
}

/// Declares a device by default, and with each of its PDOs besides or left out.
fn declare(esi: &Esi, device: &Device) {
    let mut all = vec![Choices::default()];
    for pdo in device.rx_pdos.iter().chain(&device.tx_pdos).take(4) {
        let (mut with, mut without) = (Choices::default(), Choices::default());
        with.with = vec![PdoChoice::new(pdo.index.index, None)];
        without.without = vec![pdo.index.index];
        all.extend([with, without]);
    }
    for choices in &all {
        let cycle = Duration::from_millis(1);
        let declared = select(esi, device, choices).and_then(|of| SubDevice::from_esi(&of, cycle, choices.language));
        match declared {
            Ok(declared) => {
                let mut file = NetworkFile::empty("any", cycle);
                file.push(declared.subdevice);
                let text = file.to_text();
                let again = NetworkFile::read("any.toml", text.as_bytes());
                assert_eq!(again.unwrap_or_else(|error| panic!("{error}\n{text}")).to_text(), text);
            }
            Err(error) => assert!(error.to_string().contains(':'), "{error}"),
        }
    }
}
