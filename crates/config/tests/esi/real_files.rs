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

/// Notices of second definitions and of names of nothing.
const NOTED: [&str; 5] = ["is there already", "the one of line", "names no group", "is not described", "SubIdx"];

// covers: esi-read, ES-02, ES-05, ES-10, ES-160
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
