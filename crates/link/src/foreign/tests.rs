use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use super::*;

/// A host whose files are in a directory, which is removed in the end.
struct Host {
    root: PathBuf,
    variables: BTreeMap<&'static str, &'static str>,
}

impl Host {
    fn new(files: &[(&str, &[u8])]) -> Host {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let root = std::env::temp_dir().join(format!("ringcat-foreign-{}-{number}", std::process::id()));
        fs::create_dir_all(&root).expect("the temporary directory is writable");
        for (path, bytes) in files {
            let place = root.join(path);
            fs::create_dir_all(place.parent().expect("it is below the root")).expect("it is writable");
            fs::write(place, bytes).expect("it is writable");
        }
        Host { root, variables: BTreeMap::new() }
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        // It is below the directory for temporary files.
        let _ = fs::remove_dir_all(&self.root);
    }
}

impl HostFiles for Host {
    fn root(&self) -> &Path {
        &self.root
    }

    fn variable(&self, name: &str) -> Option<String> {
        self.variables.get(name).map(|value| (*value).to_owned())
    }
}

const OURS: &str = "/usr/lib/libethercat.so.1";
const OTHER: &str = "/opt/other/lib/libethercat.so.1";

// covers: bench, daemon
#[test]
fn the_library_that_the_loader_takes_first_is_checked() {
    let cache = loader_cache::tests::cache(&[(loader_cache::NAME, OTHER), (loader_cache::NAME, OURS)]);
    let files: [(&str, &[u8]); 3] =
        [("etc/ld.so.cache", &cache), (&OTHER[1..], b"other"), (&OURS[1..], b"/run/ringcat/control")];
    let mut host = Host::new(&files);
    assert_eq!(library(&host), Ok(Used::ForeignBefore(OTHER.to_owned(), OURS.to_owned())));
    host.variables.insert("LD_LIBRARY_PATH", "/usr/lib:/opt/other/lib");
    assert_eq!(library(&host), Ok(Used::Ours(OURS.to_owned())));
    assert_eq!(library(&Host::new(&[])), Ok(Used::Nothing));
}

// covers: bench, daemon
#[test]
fn modules_programs_and_headers_of_another_maindevice_are_found() {
    let files: [(&str, &[u8]); 3] = [
        ("proc/modules", b"ec_sys 1 0\nec_master 1 1 ec_generic\n"),
        ("usr/bin/ethercat", b"other"),
        ("usr/include/ecrt.h", b"other"),
    ];
    let mut host = Host::new(&files);
    assert_eq!(modules(&host), Ok(Modules::Foreign(vec!["ec_master".to_owned()])));
    assert_eq!(program(&host), Ok(None));
    host.variables.insert("PATH", "relative:/nowhere:/usr/bin/");
    assert_eq!(program(&host), Ok(Some(Used::Foreign("/usr/bin/ethercat".to_owned()))));
    assert_eq!(header(&host), Ok(Used::Foreign("/usr/include/ecrt.h".to_owned())));
    // Without /proc nothing is known.
    assert!(modules(&Host::new(&[])).is_err());
    let monolithic = Host::new(&[("proc/sys/kernel/osrelease", b"6.12.9\n")]);
    assert_eq!(modules(&monolithic), Ok(Modules::NoneAtAll));
    assert!(header(&Host::new(&[("usr/include/ecrt.h/file", b"")])).is_err(), "no file is a result too");
}
