//! Real files, if `../shared/data/eni` exists beside the repository: each results in a configuration or in an error
//! with advice. If the files are missing, the tests print this and pass.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use ringcat_config::eni::{self, FileKind, Problem};
use ringcat_config::{Configuration, follow};
use ringcat_engine::config::{ConfigAddress, ReferenceClock, SyncManagerRole, SyncSignals};
use ringcat_engine::declared::SubDeviceId;
use ringcat_engine::info::Direction;

/// The files of a directory of the shared data, sorted by name.
fn files(directory: &str) -> Vec<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(directory);
    let Ok(entries) = fs::read_dir(&path) else {
        println!("skipped: {} is not there", path.display());
        return Vec::new();
    };
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}

fn configuration(path: &Path) -> Result<Configuration, String> {
    let model = eni::read(&fs::read(path).unwrap()).map_err(|error| error.to_string())?;
    follow(&model).map_err(|error| error.to_string())
}

/// The error of a real file.
fn refusal(path: &Path) -> Problem {
    eni::read(&fs::read(path).unwrap()).expect_err("it is no ENI").problem
}

// covers: eni-read
#[test]
fn every_real_file_results_in_a_configuration_or_its_kind() {
    for path in files("eni") {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let found = configuration(&path);
        if name.starts_with("beremiz") {
            assert_eq!(refusal(&path), Problem::WrongFile { kind: FileKind::BeremizProject });
            continue;
        }
        let configuration = found.unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(configuration.declaration.subdevices.len(), configuration.subdevices.len());
        assert!(configuration.notices.iter().all(|notice| !notice.subject.contains("not known")), "{name}");
    }
}

/// Drives of an EC-Engineer file: in the order of the file, with one LRW for all.
// covers: eni-read
#[test]
fn drives_of_ec_engineer_have_sync_managers_clocks_and_one_lrw() {
    let counts = [("rocos_eni.xml", 1), ("rocos_bcr_eni.xml", 3), ("rocos_eni4.xml", 4), ("rocos_eni7.xml", 7)];
    for path in files("eni") {
        let Some((name, count)) = counts.iter().find(|(name, _)| path.ends_with(name)) else { continue };
        let found = configuration(&path).unwrap_or_else(|error| panic!("{name}: {error}"));
        let declaration = &found.declaration;
        assert_eq!(declaration.subdevices.len(), *count, "{name}");
        for (index, config) in declaration.subdevices.iter().enumerate() {
            assert_eq!(config.address, ConfigAddress::Position(index as u16));
            assert_eq!((config.expected.vendor_id, config.expected.product_code), (Some(154), Some(198_948)));
            let declared = config.declared.as_ref().expect("the file has commands");
            let bytes: Vec<_> = declared.iter().map(|sm| (sm.index, sm.role, sm.register.length)).collect();
            assert_eq!(bytes[0], (0, SyncManagerRole::MailboxOut, 140), "{name}");
            assert_eq!((bytes[2].1, bytes[3].1), (SyncManagerRole::Outputs, SyncManagerRole::Inputs));
            assert_eq!(config.sync, Some(SyncSignals::sync0(1_000_000, 0)), "{name}");
            assert!(config.declared_bootstrap.is_some());
            assert!(config.startup.len() >= 19, "{name}: the PDO assignment is written as the file says");
        }
        let clocks = declaration.clocks.as_ref().expect("the file uses clocks");
        assert_eq!((clocks.reference, clocks.bus_shift), (ReferenceClock::Declared(SubDeviceId(0)), true));
        let [lrw] = &declaration.explicit_lrw[..] else { panic!("{name}: {:?}", declaration.explicit_lrw) };
        assert_eq!(lrw.subdevices.len(), *count, "{name}");
        assert_eq!(found.cycle, Some(Duration::from_millis(1)));
        // Every variable of a drive belongs to a SubDevice.
        let drives = found.image.variables.iter().filter(|variable| variable.name.starts_with("Slave_"));
        assert!(drives.clone().count() >= 10 * count);
        assert!(drives.clone().all(|variable| variable.subdevice.is_some()), "{name}");
    }
}

/// Terminals of a TwinCAT file: the image consists of whole datagrams.
// covers: eni-read
#[test]
fn terminals_of_twincat_have_the_positions_of_their_variables() {
    for path in files("eni").iter().filter(|path| path.to_string_lossy().contains("twincat")) {
        let found = configuration(path).unwrap();
        let areas: Vec<_> = found.image.areas.iter().map(|a| (a.subdevice, a.direction, a.image_bit, a.bits)).collect();
        let expected =
            [(2, Direction::Outputs, 312, 32), (1, Direction::Outputs, 344, 8), (3, Direction::Inputs, 448, 16)];
        assert_eq!(areas, expected);
        let stop = found.image.variables.iter().find(|variable| variable.name.ends_with("E-Stop Ok")).unwrap();
        assert_eq!((stop.subdevice, stop.image_bit), (Some(3), 448));
        let analog = &found.declaration.subdevices[2];
        assert_eq!((analog.expected.revision, analog.expected.revision_mask), (Some(0x0015_0000), 0xFFFF), "low word");
        assert!(analog.startup.is_empty(), "the look-up of the word and its comparison are those of the engine");
        assert!(found.declaration.explicit_lrw.is_empty());
    }
}

// covers: eni-read
#[test]
fn device_descriptions_and_eeprom_images_are_refused_with_their_kind() {
    // Large files take long in an unoptimised build and show nothing more.
    let small = |path: &PathBuf| fs::metadata(path).is_ok_and(|file| file.len() < 60_000);
    for path in files("esi").iter().filter(|path| small(path)) {
        assert_eq!(refusal(path), Problem::WrongFile { kind: FileKind::DeviceDescription }, "{}", path.display());
    }
    for path in files("sii").iter().filter(|path| path.extension().is_some_and(|ending| ending == "bin")) {
        let problem = refusal(path);
        assert_eq!(problem, Problem::WrongFile { kind: FileKind::NotXml }, "{}", path.display());
    }
}
