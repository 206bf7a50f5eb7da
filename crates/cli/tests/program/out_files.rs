//! Where commands write the file that they make.

use std::fs::{self, File};
use std::os::unix::fs::symlink;
use std::process::Command;

use crate::files::{ACME, Place, ringcat};

// covers: esi-use
#[test]
fn a_device_or_an_output_is_written_and_a_link_is_not_replaced() {
    let place = Place::new("out");
    let image = place.path("ad08.bin");
    let built = ringcat(&["sii", "build", &format!("{ACME}/acme.xml"), "--type", "AD08", "--out", &image]);
    assert_eq!(built.code, Some(0), "{}", built.all());
    let skeleton = |out: &str| ringcat(&["sii", "skeleton", &image, "--out", out]);
    assert_eq!(skeleton("/dev/null").code, Some(0));
    let shown = skeleton("/dev/stdout");
    assert!(shown.code == Some(0) && shown.out.contains("ProductCode"), "{}", shown.all());
    // The earlier content of a redirected output stays.
    fs::write(place.path("log"), "before\n").expect("it is writable");
    let log = File::options().append(true).open(place.path("log")).expect("it is writable");
    let mut command = Command::new(env!("CARGO_BIN_EXE_ringcat"));
    command.args(["sii", "skeleton", &image, "--out", "/dev/stdout"]).stdout(log);
    assert!(command.status().expect("it starts").success());
    let log = place.read("log");
    assert!(log.starts_with("before\n") && log.contains("ProductCode"), "{log}");
    // Also where it leads nowhere.
    symlink("none", place.path("link.xml")).expect("it is writable");
    let refused = skeleton(&place.path("link.xml"));
    assert!(refused.code == Some(2) && refused.verdict().contains("or add --overwrite"), "{}", refused.all());
}
