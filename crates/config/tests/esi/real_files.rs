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

// covers: esi-read, ES-02, ES-05, ES-10, ES-160
#[test]
fn every_real_file_is_read() {
    let mut devices = 0;
    for path in files("esi") {
        let esi = model(&path);
        println!("{}: {} devices, {} modules", esi.file, esi.devices.len(), esi.modules.len());
        for notice in &esi.notices {
            println!("    {notice}");
        }
        assert!(!esi.devices.is_empty(), "{}", esi.file);
        devices += esi.devices.len();
    }
    assert!(devices == 0 || devices == 463, "{devices}");
}
