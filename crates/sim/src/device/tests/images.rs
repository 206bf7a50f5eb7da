//! Devices from real SII images, if present.

use std::path::PathBuf;

use ringcat_wire::al::{AlState, AlStatus};
use ringcat_wire::sii::{Sii, SiiSyncManager, SyncManagerKind};

use super::bench::Bench;
use crate::description::DeviceDescription;

fn image_files() -> Vec<PathBuf> {
    let folder = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/sii"));
    let Ok(entries) = std::fs::read_dir(&folder) else {
        return Vec::new();
    };
    let mut files: Vec<PathBuf> = entries.filter_map(|entry| entry.ok().map(|entry| entry.path())).collect();
    files.retain(|path| path.extension().is_some_and(|extension| extension == "bin"));
    files.sort();
    files
}

/// Length of a SyncManager according to the SII: the PDOs assigned to it, or its own entry.
fn length_from_sii(sii: &Sii<'_>, number: u8, entry: &SiiSyncManager) -> u16 {
    use ringcat_wire::sii::PdoDirection::{Rx, Tx};
    let assigned = [Rx, Tx].into_iter().flat_map(|direction| sii.pdos(direction));
    let bits: u32 = assigned.filter(|pdo| pdo.sync_manager == Some(number)).map(|pdo| pdo.bit_length()).sum();
    if bits > 0 { bits.div_ceil(8) as u16 } else { entry.length }
}

// covers: sim-files
#[test]
fn each_real_image_results_in_a_device_in_op_or_a_refusal_with_a_reason() {
    let files = image_files();
    if files.is_empty() {
        println!("no real SII images here: skipped");
        return;
    }
    let (mut up, mut refused) = (0, 0);
    for path in &files {
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        let image = std::fs::read(path).unwrap();
        match DeviceDescription::from_sii(image.clone(), &name) {
            Err(error) => {
                println!("{name}: refused: {error}");
                assert!(Sii::parse(&image).is_err(), "{name}");
                refused += 1;
            }
            Ok(description) => {
                let sii = Sii::parse(&image).unwrap();
                for (number, entry) in (0u8..).zip(sii.sync_managers()) {
                    if matches!(entry.kind, SyncManagerKind::Outputs | SyncManagerKind::Inputs) {
                        let expected = length_from_sii(&sii, number, &entry);
                        assert_eq!(description.default_length(number), expected, "{name} SyncManager {number}");
                    }
                }
                let bench = Bench::up_to(description, AlState::Op);
                assert_eq!(bench.device.al_status(), AlStatus::new(AlState::Op), "{name}");
                assert_eq!(bench.device.controller.sii_image(), image, "{name}");
                let (outputs, inputs) = (bench.device.outputs().len(), bench.device.inputs().len());
                println!("{name}: OP, {outputs} bytes out, {inputs} bytes in");
                up += 1;
            }
        }
    }
    println!("{} images: {up} reach OP, {refused} refused", files.len());
    assert!(up > 0);
}
