//! libfakeethercat: programs run without any bus, and two of them exchange process data.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use crate::library::{here, installed, program, root, workshop};

/// A place of their own for the programs of a test.
struct Place {
    home: PathBuf,
    prefix: String,
}

impl Place {
    fn new(name: &str) -> Place {
        let home = workshop().join(format!("home-{name}"));
        std::fs::create_dir_all(&home).expect("a directory");
        Place { home, prefix: format!("/RingCatTest/{name}-{}", std::process::id()) }
    }

    /// A command on the fake library, as `LD_LIBRARY_PATH` gives it to a program that was linked with the other one.
    fn command(&self, program: &Path, name: &str) -> Command {
        let lib = installed().expect("it was compiled").join("lib/fakeethercat");
        // A wrapper like `timeout` would be killed instead of the program, which ends by itself after a minute.
        let mut command = Command::new(program);
        command.env("LD_LIBRARY_PATH", lib).env("FAKE_EC_HOMEDIR", &self.home);
        command.env("FAKE_EC_PREFIX", &self.prefix).env("FAKE_EC_NAME", name);
        command
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let name = self.prefix.trim_start_matches('/').replace('/', "_");
        for file in std::fs::read_dir("/dev/shm").into_iter().flatten().flatten() {
            if file.file_name().to_string_lossy().starts_with(&format!("{name}.")) {
                let _ = std::fs::remove_file(file.path());
            }
        }
    }
}

/// A program that runs until this is dropped.
struct Running(Child);

impl Running {
    /// Starts it and waits until it says that it is active.
    fn start(command: &mut Command) -> Running {
        let mut child = command.stdout(Stdio::piped()).spawn().expect("it starts");
        let mut line = String::new();
        BufReader::new(child.stdout.as_mut().expect("a pipe")).read_line(&mut line).expect("a line");
        assert_eq!(line, "active\n");
        Running(child)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Runs a program to its end; what it prints.
fn finish(command: &mut Command) -> String {
    let output = command.output().expect("it runs");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{}\n{text}\n{}", output.status, String::from_utf8_lossy(&output.stderr));
    text
}

fn pair() -> Option<PathBuf> {
    // Found by LD_LIBRARY_PATH, which comes behind an rpath.
    program(&here().join("tests/c/fake_pair.c"), &["-O2", "-Wl,--enable-new-dtags"])
}

// covers: c-interface
#[test]
fn two_programs_exchange_process_data_through_the_fake_library() {
    let Some(pair) = pair() else { return };
    for (slaves, cycles) in [("1", "400"), ("5", "400"), ("64", "100")] {
        let place = Place::new(&format!("pair{slaves}"));
        let machine = Running::start(place.command(&pair, "machine").args(["machine", slaves, "0"]));
        let output = finish(place.command(&pair, "control").args(["control", slaves, cycles]));
        assert!(output.ends_with("all values came back\n"), "{output}");
        // Another life of the control program, then of the machine, which is killed.
        finish(place.command(&pair, "control").args(["control", slaves, "20"]));
        drop(machine);
        let _machine = Running::start(place.command(&pair, "machine").args(["machine", slaves, "0"]));
        finish(place.command(&pair, "control").args(["control", slaves, "20"]));
    }
}

// covers: c-interface
#[test]
fn domains_that_are_numbered_differently_do_not_meet_and_permuted_ones_do() {
    let Some(pair) = pair() else { return };
    let place = Place::new("permuted");
    let permuted = |command: &mut Command, list: &str| {
        command.env("FAKE_EC_DOMAIN_PERMUTATION", list);
    };
    let mut machine = place.command(&pair, "machine");
    permuted(machine.args(["machine", "2", "0"]), "3,0");
    let _machine = Running::start(&mut machine);
    let mut control = place.command(&pair, "control");
    let alone = control.args(["control", "2", "1"]).output().expect("it runs");
    assert!(!alone.status.success(), "nothing answers in domain 0");
    let mut control = place.command(&pair, "control");
    permuted(control.args(["control", "2", "20"]), "3");
    finish(&mut control);
    let mut control = place.command(&pair, "control");
    permuted(control.args(["control", "2", "1"]), "x");
    let refused = control.output().expect("it runs");
    assert!(!refused.status.success());
    assert!(String::from_utf8_lossy(&refused.stderr).contains("expected numbers up to 255"), "{refused:?}");
}

// covers: c-interface
#[test]
fn the_fake_library_writes_the_declared_subdevices_as_json() {
    let Some(pair) = pair() else { return };
    let place = Place::new("json");
    drop(Running::start(place.command(&pair, "plant").args(["machine", "3", "0"])));
    let text = std::fs::read_to_string(place.home.join("plant_slaves.json")).expect("the file");
    let slave = |address: &str| {
        format!(
            "    \"{address}\": {{\n      \"vendor_id\": 2,\n      \"product_id\": 4660,\n      \"sdos\": {{\n        \
             \"0x8000:03\": \"3412\"\n      }}\n    }}"
        )
    };
    let slaves = ["0x00000000", "0x00070001", "0x00000002"].map(slave).join(",\n");
    assert_eq!(text, format!("{{\n  \"slaves\": {{\n{slaves}\n  }}\n}}\n"));
    let left: Vec<_> = std::fs::read_dir(&place.home).expect("the directory").flatten().collect();
    assert_eq!(left.len(), 1, "{left:?}");
}

/// A layout that another program does not share, and a file that is no memory of the library, are refused by name.
// covers: c-interface
#[test]
fn memory_that_does_not_fit_is_refused_and_changes_nothing() {
    let Some(pair) = pair() else { return };
    let place = Place::new("unfit");
    let user = std::fs::metadata("/proc/self").map(|data| std::os::unix::fs::MetadataExt::uid(&data)).expect("proc");
    let name = place.prefix.trim_start_matches('/').replace('/', "_");
    let file = Path::new("/dev/shm").join(format!("{name}.{user}.0"));
    for content in [vec![7; 100], vec![7; 2048 * 1025]] {
        std::fs::write(&file, &content).expect("a file");
        let refused = place.command(&pair, "control").args(["control", "1", "1"]).output().expect("it runs");
        assert_eq!(refused.status.code(), Some(1), "{refused:?}");
        assert!(String::from_utf8_lossy(&refused.stderr).contains("shared memory"), "{refused:?}");
        assert_eq!(std::fs::read(&file).expect("the file"), content);
    }
    // A program that made the memory was killed before its header was written.
    std::fs::write(&file, vec![0; 2048 * 1025]).expect("a file");
    drop(Running::start(place.command(&pair, "control").args(["control", "1", "1"])));
    let data = std::fs::metadata(&file).expect("the file");
    let blocks = std::os::unix::fs::MetadataExt::blocks(&data);
    assert_eq!(blocks * 512, data.len().next_multiple_of(4096), "all of it is there, so that no store can fail");
}

// covers: c-interface
#[test]
fn the_first_application_reaches_op_at_once_on_the_fake_library() {
    let source = root().join("examples/c/first_application.c");
    let Some(first) = program(&source, &["-Wl,--enable-new-dtags"]) else { return };
    let place = Place::new("first");
    let output = finish(place.command(&first, "first").arg("20"));
    for wanted in ["Domain1: WC 3.", "Domain1: State 2.", "4 slave(s).", "AL states: 0x08.", "AnaIn: operational."] {
        assert!(output.lines().any(|line| line == wanted), "{wanted}\n{output}");
    }
}

// covers: c-interface
#[test]
fn no_call_of_the_fake_library_is_a_cancellation_point() {
    let arguments = ["-pthread", "-Wl,--enable-new-dtags"];
    let Some(cancelled) = program(&here().join("tests/c/cancelled.c"), &arguments) else { return };
    let place = Place::new("cancelled");
    assert_eq!(finish(place.command(&cancelled, "cancelled").arg("fake")), "no call was cancelled\n");
}

/// Under memcheck where it is installed: it would find memory that was freed.
// covers: c-interface
#[test]
fn late_calls_to_a_released_master_are_refused_by_the_fake_library() {
    let Some(released) = program(&here().join("tests/c/fake_released.c"), &["-Wl,--enable-new-dtags"]) else { return };
    let place = Place::new("released");
    let has_memcheck = Command::new("valgrind").arg("--version").output().is_ok();
    if has_memcheck {
        let mut command = place.command(Path::new("valgrind"), "released");
        finish(command.args(["--quiet", "--error-exitcode=9", "--leak-check=full"]).arg(&released));
    } else {
        println!("skipped: memcheck, for there is no valgrind");
        finish(&mut place.command(&released, "released"));
    }
}

// covers: c-interface
#[test]
fn the_fake_library_is_clean_under_memcheck() {
    let Some(pair) = pair() else { return };
    if Command::new("valgrind").arg("--version").output().is_err() {
        println!("skipped: there is no valgrind");
        return;
    }
    let place = Place::new("memcheck");
    let _machine = Running::start(place.command(&pair, "machine").args(["machine", "5", "0"]));
    let mut command = place.command(Path::new("valgrind"), "control");
    command.args(["--quiet", "--error-exitcode=9", "--leak-check=full"]).arg(&pair).args(["control", "5", "10"]);
    finish(&mut command);
}
