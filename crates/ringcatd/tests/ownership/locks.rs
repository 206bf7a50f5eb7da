//! The files that show which daemon and which application has a master: other users can do nothing with them.

use std::os::unix::fs::{MetadataExt, PermissionsExt, symlink};
use std::os::unix::process::CommandExt;
use std::process::Command;

use crate::bench::{directory, turn};
use crate::program::fails;
use crate::running::{Running, Start, UNPRIVILEGED, wait_for};

/// Lock files of a daemon with master 0, by what follows the name of its socket.
const LOCKS: [&str; 2] = ["lock", "0.lock"];

// covers: daemon
#[test]
fn another_user_can_lock_none_of_the_files_that_a_daemon_waits_for() {
    if ringcat_link::process::effective_user() != 0 {
        println!("skipped: only root starts a process of another user");
        return;
    }
    let (directory, turn) = (directory(), turn());
    std::fs::set_permissions(&directory, std::fs::Permissions::from_mode(0o755)).expect("it is writable");
    let mut running = Running::at(&Start { counts: &[2], ..Start::default() }, directory, turn);
    wait_for(&mut running.client(), 0, 2);
    running.kill();
    for lock in LOCKS {
        let file = running.socket.with_extension(lock);
        assert_eq!(std::fs::metadata(&file).expect("a killed daemon leaves it").mode() & 0o7777, 0o600);
        let mut flock = Command::new("flock");
        flock.args(["--exclusive", "--nonblock"]).arg(&file).arg("true").current_dir("/");
        let refused = flock.uid(UNPRIVILEGED).gid(UNPRIVILEGED).output().expect("flock is there");
        let text = String::from_utf8_lossy(&refused.stderr);
        assert!(!refused.status.success() && text.contains("Permission denied"), "{text}");
    }
    running.start_again();
    wait_for(&mut running.client(), 0, 2);
}

// covers: daemon
#[test]
fn a_daemon_writes_and_makes_nothing_behind_a_link_with_the_name_of_its_lock() {
    let (directory, _turn) = (directory(), turn());
    let (socket, target_file) = (directory.join("socket"), directory.join("target_file"));
    let (file, text) = (directory.join("segment.toml"), "[segment]\n[[device]]\ntype = \"servo\"\n");
    std::fs::write(&file, text).expect("it can be written");
    std::fs::write(&target_file, "precious").expect("it can be written");
    for lock in LOCKS {
        for target in [target_file.clone(), directory.join("nothing")] {
            let link = socket.with_extension(lock);
            symlink(&target, &link).expect("it can be made");
            let master = format!("0=sim:{}", file.display());
            let said = fails(&["--master", &master, "--socket", socket.to_str().expect("it is text")]);
            assert!(said.contains("found a symbolic link"), "{said}");
            std::fs::remove_file(&link).expect("it is there");
        }
    }
    assert_eq!(std::fs::read(&target_file).expect("it is there"), b"precious");
    assert!(!directory.join("nothing").exists() && !socket.exists());
    std::fs::remove_dir_all(directory).expect("it is there");
}
