//! Real files, if `../shared/data/esi` exists beside the repository. If they are missing, the tests print this and
//! pass.

use std::fs;
use std::path::{Path, PathBuf};

use ringcat_config::esi::{self, Esi};

/// The files of a directory of the shared data, sorted by name.
pub fn files(directory: &str) -> Vec<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(directory);
    let Ok(entries) = fs::read_dir(&path) else {
        println!("skipped: {} is not there", path.display());
        return Vec::new();
    };
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}

/// The name of a file without its folder.
pub fn name(path: &Path) -> String {
    path.file_name().unwrap().to_string_lossy().into_owned()
}

/// The model of a real file.
pub fn model(path: &Path) -> Esi {
    esi::read(&name(path), &fs::read(path).unwrap()).unwrap_or_else(|error| panic!("{error}"))
}

/// Notices of duplicate definitions, and of undefined groups and types.
const NOTED: [&str; 5] =
    ["is defined in line", "is defined several times", "no such group", "is not defined", "SubIdx"];

/// The limits of the reader leave room for larger files.
// covers: ES-02, ES-04
#[test]
fn the_largest_real_file_is_far_below_the_limits() {
    let all: Vec<(PathBuf, Vec<u8>)> =
        files("esi").into_iter().map(|path| (path.clone(), fs::read(path).unwrap())).collect();
    let Some((path, bytes)) = all.iter().max_by_key(|(_, bytes)| bytes.len()) else { return };
    assert_eq!((bytes.len(), model(path).devices.len()), (4_171_103, 155));
    let (mut entries, mut with_cdata) = (0, 0);
    for (path, bytes) in &all {
        let has = |part: &str| bytes.windows(part.len()).any(|window| window.eq_ignore_ascii_case(part.as_bytes()));
        assert!(!has("<!DOCTYPE"), "{}", path.display());
        with_cdata += usize::from(has("<![CDATA["));
        let esi = model(path);
        let pdos = esi.devices.iter().flat_map(|device| device.rx_pdos.iter().chain(&device.tx_pdos));
        entries = entries.max(pdos.map(|pdo| pdo.entries.len()).max().unwrap_or(0));
    }
    assert!(with_cdata > 0 && entries == 32, "{with_cdata} {entries}");
}

// covers: esi-read, ES-05, ES-10, ES-160
#[test]
fn every_real_file_is_read() {
    let (mut devices, mut noted) = (0, [0; NOTED.len()]);
    for path in files("esi") {
        let esi = model(&path);
        println!("{}: {} devices, {} modules", esi.file, esi.devices.len(), esi.modules.len());
        for notice in &esi.notices {
            println!("    {notice}");
        }
        assert!(!esi.devices.is_empty(), "{}", esi.file);
        let about = |text: &str| esi.notices.iter().filter(|it| it.text.contains(text)).map(|it| it.times).sum();
        let counts: [usize; 5] = NOTED.map(about);
        (0..NOTED.len()).for_each(|at| noted[at] += counts[at]);
        devices += esi.devices.len();
    }
    assert!(devices == 0 || devices == 463, "{devices}");
    // A PDO that one device has twice.
    assert!(devices == 0 || noted == [1, 0, 0, 0, 0], "{NOTED:?}: {noted:?}");
}
