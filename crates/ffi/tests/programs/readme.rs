//! The commands of the README, as they are typed, by a user without privileges.
//!
//! What is built and installed there is what the tests have: `cargo` and `crates/ffi/install` are scripts that put it
//! into place.

use std::fs;
use std::io::{BufRead, BufReader};
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use crate::library::{copy_program, installed, root};

/// A user without privileges.
const USER: &str = "65534";
/// The heading above the commands.
const HEADING: &str = "## A daemon that owns the bus, and programs for `ecrt.h`";
const LONG: Duration = Duration::from_secs(60);

/// The commands below a heading of the README.
fn commands() -> String {
    let text = fs::read_to_string(root().join("README.md")).expect("it is there");
    let (_, rest) = text.split_once(HEADING).expect("the heading");
    rest.split("```").nth(1).expect("the commands").trim_start().to_owned()
}

fn script(path: &Path, text: &str) {
    fs::create_dir_all(path.parent().expect("a directory")).expect("it can be made");
    let written = path.with_extension("text");
    fs::write(&written, format!("#!/bin/sh\n{text}\n")).expect("it can be written");
    assert!(copy_program(&written, path));
    fs::set_permissions(path, fs::Permissions::from_mode(0o755)).expect("it is writable");
}

/// A directory with what the commands expect in the repository; `None` if the programs are not built.
fn place(prefix: &Path) -> Option<PathBuf> {
    let place = std::env::temp_dir().join(format!("ringcat-readme-{}", std::process::id()));
    let own = std::env::current_exe().expect("it is known");
    let built = own.ancestors().nth(2).expect("a directory of programs");
    fs::create_dir_all(place.join("target/release")).expect("it can be made");
    for name in ["ringcatd", "ringcat"] {
        if !copy_program(&built.join(name), &place.join("target/release").join(name)) {
            println!("skipped: {name} is not built (cargo test --workspace builds it)");
            fs::remove_dir_all(&place).expect("it is there");
            return None;
        }
    }
    script(&place.join("bin/cargo"), "exit 0");
    let (lib, include) = (prefix.join("lib"), prefix.join("include"));
    // The real one compiles for a while: the daemon of the line before listens by then. This one waits for it.
    let listens = "i=0; until test -S /tmp/ringcat-$(id -u)/control || test $i = 600; do sleep 0.1; i=$((i+1)); done";
    let install = format!("mkdir -p \"$2\" && cp -r {} {} \"$2\"\n{listens}", lib.display(), include.display());
    script(&place.join("crates/ffi/install"), &install);
    let examples = place.join("examples/c");
    fs::create_dir_all(&examples).expect("it can be made");
    for entry in fs::read_dir(root().join("examples/c")).expect("it is there").flatten() {
        let is_source = entry.file_type().is_ok_and(|it| it.is_file()) && entry.path().extension().is_some();
        if is_source || entry.file_name() == "Makefile" {
            fs::copy(entry.path(), examples.join(entry.file_name())).expect("it can be copied");
        }
    }
    for directory in [&place, &examples] {
        fs::set_permissions(directory, fs::Permissions::from_mode(0o777)).expect("it is writable");
    }
    Some(place)
}

/// Ends the processes of this program.
fn end(program: &Path, signal: &str) -> usize {
    let program = fs::metadata(program).expect("it is there");
    let all = fs::read_dir("/proc").expect("it is there").flatten();
    let is_it = |path: &PathBuf| {
        fs::metadata(path.join("exe")).is_ok_and(|it| (it.dev(), it.ino()) == (program.dev(), program.ino()))
    };
    let found: Vec<PathBuf> = all.map(|entry| entry.path()).filter(is_it).collect();
    for process in &found {
        let pid = process.file_name().expect("a number");
        // It may have ended meanwhile.
        let _ = Command::new("kill").arg(signal).arg(pid).status();
    }
    found.len()
}

// covers: daemon, c-interface
#[test]
fn the_commands_of_the_readme_work_without_a_right_as_they_are_typed() {
    let Some(prefix) = installed() else { return };
    let Some(place) = place(prefix) else { return };
    let is_root = fs::metadata("/proc/self").expect("it is there").uid() == 0;
    let mut shell = Command::new(if is_root { "setpriv" } else { "bash" });
    if is_root {
        shell.args(["--reuid", USER, "--regid", USER, "--clear-groups", "bash"]);
    }
    let path = format!("{}:/usr/local/bin:/usr/bin:/bin", place.join("bin").display());
    shell.args(["-c", &commands()]).current_dir(&place).env_clear().env("PATH", path);
    let mut shell = shell.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it runs");
    let (lines, said) = channel();
    let streams: [Box<dyn std::io::Read + Send>; 2] =
        [Box::new(shell.stdout.take().expect("it is piped")), Box::new(shell.stderr.take().expect("it is piped"))];
    for stream in streams {
        let lines = lines.clone();
        std::thread::spawn(move || {
            for line in BufReader::new(stream).lines().map_while(Result::ok) {
                // The test may have seen enough.
                let _ = lines.send(line);
            }
        });
    }
    // The readers alone have it: the lines end with the programs.
    drop(lines);
    let mut all = Vec::new();
    let (daemon, first) = (place.join("target/release/ringcatd"), place.join("examples/c/first_application"));
    while all.last().is_none_or(|line| line != "AnaIn: operational.") {
        let Ok(line) = said.recv_timeout(LONG) else {
            end(&daemon, "-KILL");
            panic!("{all:#?}");
        };
        all.push(line);
    }
    // As Ctrl-C does, first for the program, then for the daemon.
    assert_eq!(end(&first, "-INT"), 1);
    let status = shell.wait().expect("it ends");
    assert!(end(&daemon, "-TERM") >= 1, "it goes on");
    // The daemon has the streams, too: they end with it.
    let is_over = loop {
        match said.recv_timeout(LONG) {
            Ok(line) => all.push(line),
            Err(error) => break error == RecvTimeoutError::Disconnected,
        }
    };
    if !is_over {
        end(&daemon, "-KILL");
    }
    assert!(is_over, "the daemon does not end: {all:#?}");
    assert!(status.success(), "{status}\n{all:#?}");
    // What `ringcat run` says at its end: on a busy machine frames may have come late.
    let result = all.iter().find(|line| line.starts_with("result: ")).expect("ringcat run has ended");
    assert!(!result.contains("ringcatd") && !result.contains("not in OP"), "{all:#?}");
    let socket = "ringcatd: listens at /tmp/ringcat-65534/control";
    assert!(!is_root || all.iter().any(|line| line == socket), "{all:#?}");
    fs::remove_dir_all(&place).expect("it is there");
}
