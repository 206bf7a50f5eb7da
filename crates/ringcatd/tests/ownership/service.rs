//! The program as a service: its configuration file, and what the service manager is reported.

use std::ffi::OsString;
use std::io::{Read, Write};
use std::os::unix::net::{UnixDatagram, UnixListener};
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use ringcat_control::Content;
use ringcat_control::wire::{VERSION, encode};

use crate::bench::{LONG, directory, ring, turn};
use crate::program::fails;
use crate::running::{PROGRAM, Running, Start, wait_for};

/// What the service manager would receive.
struct Manager {
    socket: UnixDatagram,
    seen: Vec<String>,
}

impl Manager {
    fn at(path: &Path) -> Manager {
        let socket = UnixDatagram::bind(path).expect("it is free");
        socket.set_read_timeout(Some(Duration::from_millis(50))).expect("a socket");
        Manager { socket, seen: Vec::new() }
    }

    /// Reads until something holds for all lines that have come.
    fn wait_until(&mut self, what: &str, holds: impl Fn(&[String]) -> bool) {
        let begin = Instant::now();
        while !holds(&self.seen) {
            assert!(begin.elapsed() < LONG, "{what}: {:?}", self.seen);
            let mut buffer = [0; 2048];
            if let Ok(length) = self.socket.recv(&mut buffer) {
                let text = String::from_utf8_lossy(&buffer[..length]).into_owned();
                self.seen.extend(text.lines().map(str::to_owned));
            }
        }
    }
}

/// A configuration file with masters on simulated rings of so many SubDevices, and further lines.
fn file(directory: &Path, counts: &[usize], further: &str) -> String {
    let mut text = further.to_owned();
    for (master, count) in counts.iter().enumerate() {
        let segment = directory.join(format!("{master}.toml"));
        std::fs::write(&segment, ring(*count)).expect("it can be written");
        text += &format!("RINGCAT_MASTER{master}_SIM=\"{}\"\n", segment.display());
    }
    let path = directory.join("ethercat.conf");
    std::fs::write(&path, text).expect("it can be written");
    path.to_str().expect("text").to_owned()
}

// covers: daemon
#[test]
fn a_configuration_file_takes_the_place_of_options() {
    let (turn, directory) = (turn(), directory());
    let conf = file(&directory, &[3, 4], "# ours\nDEVICE_MODULES=\"generic\"\nRINGCAT_MASTER1_SAFE_STATE=SAFEOP\n");
    let running = Running::at(&Start { options: &["--conf", &conf], ..Start::default() }, directory, turn);
    let mut client = running.client();
    wait_for(&mut client, 0, 3);
    wait_for(&mut client, 1, 4);
}

// covers: daemon
#[test]
fn the_program_ends_with_all_mistakes_of_its_file_and_changes_nothing() {
    let directory = directory();
    let socket = directory.join("socket");
    let socket = socket.to_str().expect("it is text");
    let conf = file(&directory, &[2], "MASTER0_DEVCE=eth0\nRINGCAT_MODE=0999\n");
    let text = fails(&["--conf", &conf, "--socket", socket]);
    assert!(text.contains(&format!("ringcatd: {conf}:1: MASTER0_DEVCE: expected MASTERx_DEVICE")), "{text}");
    assert!(text.contains(&format!("ringcatd: {conf}:2: RINGCAT_MODE: expected octal digits")), "{text}");
    assert!(!Path::new(socket).exists());
    assert!(fails(&["--conf", "/nonexistent.conf"]).contains("/nonexistent.conf: No such file"));
    assert!(fails(&["--conf", &conf, "--master", "0=eth1"]).contains("cannot be used with"));
    std::fs::remove_dir_all(directory).expect("it is there");
}

// covers: daemon
#[test]
fn a_check_says_what_was_understood_and_its_exit_code_whether_it_is_right() {
    let directory = directory();
    let socket = directory.join("socket");
    let further = format!("MASTER1_DEVICE=no-such\nRINGCAT_SOCKET={}\nUPDOWN_INTERFACES=no-such\n", socket.display());
    let conf = file(&directory, &[2], &further);
    let check = |options: &[&str]| {
        let output = Command::new(PROGRAM).arg("--check").args(options).output().expect("it starts");
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        (output.status.code(), said, String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let (code, said, wrong) = check(&["--conf", &conf]);
    assert_eq!((code, wrong.as_str()), (Some(0), ""), "{said}");
    let lines = [
        "line 1: MASTER1_DEVICE: master 1 on interface no-such",
        "line 3: UPDOWN_INTERFACES: switched on with the daemon, and off with it: no-such",
        "master 1: main interface no-such: waits, ",
    ];
    for line in lines {
        assert!(said.contains(line), "{line}: {said}");
    }
    // Nothing was made, and no process of a segment is left.
    let mut left: Vec<OsString> =
        std::fs::read_dir(&directory).expect("it is there").flatten().map(|it| it.file_name()).collect();
    left.sort();
    assert_eq!(left, ["0.toml", "ethercat.conf"]);
    std::fs::write(&conf, "A=$1\nB=`id`\n").expect("it can be written");
    let (code, _, wrong) = check(&["--conf", &conf]);
    assert_eq!((code, wrong.lines().count()), (Some(2), 2), "{wrong}");
    let (_, said, _) = check(&[]);
    let rule =
        ["/etc/ethercat.conf counts, since systemd runs", "/etc/sysconfig/ethercat counts, since systemd does not"];
    assert!(rule.iter().any(|rule| said.starts_with(rule)), "{said}");
    std::fs::remove_dir_all(directory).expect("it is there");
}

// covers: daemon
#[test]
fn the_service_manager_gets_ready_state_life_and_end() {
    let (turn, directory) = (turn(), directory());
    let conf = file(&directory, &[3], "MASTER1_DEVICE=no-such\n");
    let path = directory.join("notify");
    let mut manager = Manager::at(&path);
    let variables = [("NOTIFY_SOCKET", path.into_os_string()), ("WATCHDOG_USEC", "400000".into())];
    let start = Start { options: &["--conf", &conf], variables: &variables, ..Start::default() };
    let mut running = Running::at(&start, directory, turn);
    let status = |line: &String| line.starts_with("STATUS=master 0: 3 SubDevices; master 1 is not driven: ");
    manager.wait_until("ready", |seen| seen.iter().any(|line| line == "READY=1"));
    // The first state after it: master 0 is scanned, and what master 1 waits for was said.
    let ready = manager.seen.iter().position(|line| line == "READY=1").expect("it was seen");
    assert!(status(&manager.seen[ready + 1]), "{:?}", manager.seen);
    // Written by a thread of its own.
    running.wait_for_lines(|lines| lines.iter().any(|line| line.contains("master 1 is not driven: ")));
    let mut client = running.client();
    wait_for(&mut client, 0, 3);
    let before = manager.seen.len();
    manager.wait_until("it lives", |seen| seen[before..].iter().filter(|line| *line == "WATCHDOG=1").count() >= 5);
    running.signal("-TERM");
    manager.wait_until("it ends", |seen| seen.iter().any(|line| line == "STOPPING=1"));
    assert_eq!(manager.seen.iter().filter(|line| *line == "READY=1").count(), 1);
    assert!(running.child.wait().expect("it ends").success());
}

/// Socket of the process that is a daemon of another version.
const OF_ANOTHER_VERSION: &str = "RINGCAT_TEST_ANOTHER_VERSION";

/// A daemon of another version: the test program again, under the name of the daemon.
fn another_version(directory: &Path) -> Child {
    let program = directory.join("ringcatd");
    let own = std::env::current_exe().expect("a test has a file");
    std::os::unix::fs::symlink(own, &program).expect("it is free");
    let mut daemon = Command::new(program);
    daemon.args(["--exact", "service::ethercatctl_queries_and_stops_a_daemon_of_another_version", "--nocapture"]);
    daemon.env(OF_ANOTHER_VERSION, directory.join("socket")).stdout(Stdio::null()).stderr(Stdio::null());
    let daemon = daemon.spawn().expect("it is a program");
    let begin = Instant::now();
    while !directory.join("socket").exists() {
        assert!(begin.elapsed() < LONG, "it listens");
        std::thread::sleep(Duration::from_millis(5));
    }
    daemon
}

/// What that process does, until it is ended. A test that fails does not end it.
fn be_of_another_version(socket: &Path) -> ! {
    std::thread::spawn(|| {
        std::thread::sleep(LONG * 3);
        std::process::exit(1);
    });
    let listener = UnixListener::bind(socket).expect("it is free");
    let mut message = encode(&Content::Hello { program: "another".to_owned() }.into()).expect("it is short");
    message[4..6].copy_from_slice(&(VERSION - 1).to_le_bytes());
    loop {
        let (mut stream, _) = listener.accept().expect("a client comes");
        // A client that only connects leaves at once.
        let _ = stream.write_all(&message).and_then(|()| stream.read(&mut [0; 256]));
    }
}

// covers: daemon
#[test]
fn ethercatctl_queries_and_stops_a_daemon_of_another_version() {
    if let Some(socket) = std::env::var_os(OF_ANOTHER_VERSION) {
        be_of_another_version(Path::new(&socket));
    }
    let (_turn, directory) = (turn(), directory());
    let further = format!("RINGCAT_SOCKET=\"{}\"\n", directory.join("socket").display());
    let conf = file(&directory, &[3], &further);
    let mut daemon = another_version(&directory);
    let (code, said) = control(&conf, "status");
    let expected = format!("ringcatd runs (process {})\nit has control version {}, ", daemon.id(), VERSION - 1);
    assert!(code == Some(0) && said.starts_with(&expected) && said.contains("ethercatctl restart"), "{said}");
    let (code, said) = control(&conf, "start");
    assert!(code == Some(0) && said.contains("runs already") && said.contains("ethercatctl restart"), "{said}");
    assert!(daemon.try_wait().expect("it is a child").is_none());
    // It ends by the signal, while a thread here waits for it: a process that has ended is there until then.
    let wait = std::thread::spawn(move || daemon.wait().expect("it is a child").signal());
    let (code, said) = control(&conf, "restart");
    assert_eq!((code, wait.join().expect("no panic")), (Some(0), Some(15)), "{said}");
    assert!(control(&conf, "status").1.contains("): idle\n"));
    assert_eq!(control(&conf, "stop").0, Some(0));
    std::fs::remove_dir_all(directory).expect("it is there");
}

// covers: daemon
#[test]
fn ethercatctl_ends_no_process_that_is_no_daemon() {
    let (_turn, directory) = (turn(), directory());
    let socket = directory.join("socket");
    let conf = file(&directory, &[3], &format!("RINGCAT_SOCKET=\"{}\"\n", socket.display()));
    let listener = UnixListener::bind(&socket).expect("it is free");
    std::thread::spawn(move || listener.incoming().for_each(drop));
    for verb in ["status", "stop", "restart", "start"] {
        let (code, said) = control(&conf, verb);
        let expected = format!("process {}, which listens at {}, is ", std::process::id(), socket.display());
        assert!(code == Some(1) && said.contains(&expected) && said.ends_with(" and not ringcatd\n"), "{said}");
    }
    std::fs::remove_dir_all(directory).expect("it is there");
}

// covers: daemon
#[test]
fn a_reader_of_the_output_may_leave() {
    let (_turn, directory) = (turn(), directory());
    let conf = file(&directory, &[3], "");
    for (program, arguments, good) in [
        (PROGRAM, &["--check", "--conf", &conf][..], 0),
        (PROGRAM, &["--check", "--conf", "/nonexistent"], 2),
        (env!("CARGO_BIN_EXE_ethercatctl"), &["check", "--conf", &conf], 0),
        (env!("CARGO_BIN_EXE_ethercatctl"), &["status", "--conf", &conf], 3),
        (env!("CARGO_BIN_EXE_ethercatctl"), &["start", "--conf", "/nonexistent"], 1),
    ] {
        let (reader, writer) = std::io::pipe().expect("a pipe");
        drop(reader);
        let mut command = Command::new(program);
        command.args(arguments).env("RINGCAT_SOCKET", directory.join("socket"));
        command.stderr(writer.try_clone().expect("a descriptor")).stdout(writer);
        assert_eq!(command.status().expect("it starts").code(), Some(good), "{program} {arguments:?}");
    }
    std::fs::remove_dir_all(directory).expect("it is there");
}

// covers: daemon
#[test]
fn the_daemon_under_the_name_ethercatctl_is_that_program() {
    let directory = directory();
    let link = directory.join("ethercatctl");
    std::os::unix::fs::symlink(PROGRAM, &link).expect("it is free");
    let said = |program: &Path| Command::new(program).arg("--help").output().expect("it starts").stdout;
    assert_eq!(said(&link), said(Path::new(env!("CARGO_BIN_EXE_ethercatctl"))));
    assert_ne!(said(&link), said(Path::new(PROGRAM)));
    std::fs::remove_dir_all(directory).expect("it is there");
}

/// The exit code and what was printed on both streams.
fn control(conf: &str, verb: &str) -> (Option<i32>, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_ethercatctl")).args([verb, "--conf", conf]).output();
    let output = output.expect("it starts");
    let said = [output.stdout, output.stderr].concat();
    (output.status.code(), String::from_utf8_lossy(&said).into_owned())
}

// covers: daemon
#[test]
fn ethercatctl_starts_queries_restarts_and_stops_the_daemon() {
    let (_turn, directory) = (turn(), directory());
    let further = format!("RINGCAT_SOCKET=\"{}\"\n", directory.join("socket").display());
    let conf = file(&directory, &[3], &further);
    assert_eq!(control(&conf, "status"), (Some(3), "ringcatd does not run\n".to_owned()));
    assert_eq!(control(&conf, "stop").0, Some(0));
    let (code, said) = control(&conf, "start");
    assert_eq!(code, Some(0), "{said}");
    assert!(said.ends_with("master 0: 3 SubDevices\n"), "{said}");
    let pid = || {
        let (code, said) = control(&conf, "status");
        assert_eq!(code, Some(0), "{said}");
        assert!(said.contains("master 0 (sim:") && said.ends_with("): idle\n"), "{said}");
        said.split(['(', ')']).nth(1).expect("its process").to_owned()
    };
    let first = pid();
    assert!(control(&conf, "start").1.contains("runs already"));
    assert_eq!(pid(), first);
    assert_eq!(control(&conf, "restart").0, Some(0));
    let second = pid();
    assert_ne!(second, first);
    // With a wrong file the daemon that runs goes on.
    let right = std::fs::read(&conf).expect("it is there");
    std::fs::write(&conf, [&right[..], b"RINGCAT_MOOD=1\n"].concat()).expect("it can be written");
    for verb in ["restart", "check"] {
        let (code, said) = control(&conf, verb);
        assert!(code != Some(0) && said.contains(&format!("{conf}:3: RINGCAT_MOOD: ")), "{said}");
    }
    std::fs::write(&conf, right).expect("it can be written");
    assert_eq!(pid(), second);
    assert_eq!(control(&conf, "check").0, Some(0));
    assert_eq!(control(&conf, "stop").0, Some(0));
    assert_eq!(control(&conf, "status").0, Some(3));
    std::fs::remove_dir_all(directory).expect("it is there");
}
