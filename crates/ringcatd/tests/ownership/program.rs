//! The program `ringcatd` itself, with its segment in a process of its own.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::MutexGuard;
use std::time::{Duration, Instant};

use ringcat::daemon::{Answer, Ask, Client};
use ringcat_control::message::Snapshot;

use crate::bench::{LONG, ask, directory, ring, turn};
use crate::owner_process::{OwnerProcess, Work};

const PROGRAM: &str = env!("CARGO_BIN_EXE_ringcatd");

/// The running program. It is killed when this is dropped.
struct Running {
    child: Child,
    socket: PathBuf,
    directory: PathBuf,
    _turn: MutexGuard<'static, ()>,
}

impl Running {
    /// With masters on simulated rings of so many SubDevices.
    fn start(counts: &[usize]) -> Running {
        let turn = turn();
        let directory = directory();
        let socket = directory.join("socket");
        let mut command = Command::new(PROGRAM);
        for (master, count) in counts.iter().enumerate() {
            let file = directory.join(format!("{master}.toml"));
            std::fs::write(&file, ring(*count)).expect("it can be written");
            command.arg("--master").arg(format!("{master}=sim:{}", file.display()));
        }
        let child = command.arg("--socket").arg(&socket).stderr(Stdio::null()).spawn().expect("it starts");
        Running { child, socket, directory, _turn: turn }
    }

    fn client(&self) -> Client {
        let begin = Instant::now();
        loop {
            match Client::connect(&self.socket, "test") {
                Ok(client) => return client,
                Err(error) => assert!(begin.elapsed() < LONG, "{error}"),
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// Processes of simulated segments of this program.
    fn segments(&self) -> Vec<u32> {
        let wanted = self.directory.as_os_str().as_encoded_bytes();
        let is_segment = |pid: &u32| {
            let line = std::fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
            let has = |wanted: &[u8]| line.windows(wanted.len()).any(|window| window == wanted);
            has(b"--simulate") && has(wanted)
        };
        let all = std::fs::read_dir("/proc").expect("it is there").flatten();
        all.filter_map(|entry| entry.file_name().to_str()?.parse().ok()).filter(is_segment).collect()
    }

    fn wait_for_no_segment(&self) {
        let begin = Instant::now();
        while !self.segments().is_empty() {
            assert!(begin.elapsed() < LONG, "{:?}", self.segments());
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
        let _ = std::fs::remove_dir_all(&self.directory);
    }
}

fn state(client: &mut Client, master: u32) -> Box<Snapshot> {
    match client.ask(master, Ask::State, Vec::new()).expect("it is answered").0 {
        Answer::State(state) => state,
        other => panic!("{other:?}"),
    }
}

/// Waits until all SubDevices are found and in PREOP.
fn wait_for(client: &mut Client, master: u32, count: usize) {
    let begin = Instant::now();
    loop {
        let now = state(client, master);
        let is_in_preop = |position| {
            let status = client.ask(master, Ask::AlStatus { position }, Vec::new());
            matches!(status, Ok((Answer::AlStatus { status: 2, .. }, _)))
        };
        if now.subdevices.len() == count && (0..count as u16).all(is_in_preop) {
            return;
        }
        assert!(begin.elapsed() < LONG, "{now:?}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

// covers: daemon
#[test]
fn the_program_drives_several_masters_each_with_a_segment_in_its_own_process() {
    let mut running = Running::start(&[3, 5]);
    let mut client = running.client();
    wait_for(&mut client, 0, 3);
    wait_for(&mut client, 1, 5);
    assert_eq!(running.segments().len(), 2);
    let Answer::Masters(masters) = ask(&mut client, Ask::Masters) else { panic!("they are masters") };
    assert!(masters.iter().all(|master| master.owner.is_none() && master.fault.is_none()), "{masters:?}");
    let owner = OwnerProcess::start(&running.socket, Work::Cycle);
    wait_for(&mut client, 1, 5);
    assert_eq!(owner.end(), "ended: Ok(()), lost false");
    wait_for(&mut client, 0, 3);
    let ended = Command::new("kill").args(["-TERM", &running.child.id().to_string()]).status();
    assert!(ended.is_ok_and(|status| status.success()));
    assert!(running.child.wait().expect("it ends").success());
    assert!(!running.socket.exists(), "the socket is removed");
    running.wait_for_no_segment();
}

// covers: daemon
#[test]
fn an_application_goes_on_when_the_daemon_is_killed_and_the_segment_ends_with_it() {
    let mut running = Running::start(&[4]);
    wait_for(&mut running.client(), 0, 4);
    let mut owner = OwnerProcess::start(&running.socket, Work::Cycle);
    running.child.kill().expect("it runs");
    running.child.wait().expect("it has ended");
    std::thread::sleep(Duration::from_millis(300));
    assert!(owner.child.try_wait().expect("it is a child").is_none(), "it goes on");
    assert_eq!(running.segments().len(), 1);
    let said = owner.end();
    assert!(said.starts_with("ended: ") && said.ends_with("lost true"), "{said}");
    running.wait_for_no_segment();
}

fn fails(arguments: &[&str]) -> String {
    let Output { status, stderr, .. } = Command::new(PROGRAM).args(arguments).output().expect("it starts");
    assert_eq!(status.code(), Some(2));
    String::from_utf8_lossy(&stderr).into_owned()
}

// covers: daemon
#[test]
fn wrong_options_and_files_end_the_program_with_what_was_expected() {
    let directory = directory();
    let socket = directory.join("socket");
    let socket = socket.to_str().expect("it is text");
    let text = fails(&["--master", "eth1", "--socket", socket]);
    assert!(text.contains("expected NUMBER=INTERFACE[,INTERFACE] or NUMBER=sim:FILE"), "{text}");
    assert!(fails(&["--master", "0=a", "--master", "0=b", "--socket", socket]).contains("master 0 is given twice"));
    let none = fails(&["--master", "0=sim:/nonexistent.toml", "--socket", socket]);
    assert!(none.contains("master 0") && none.contains("/nonexistent.toml"), "{none}");
    let wrong = directory.join("wrong.toml");
    std::fs::write(&wrong, "[segment]\n[[device]]\ntype = \"toaster\"\n").expect("it can be written");
    let text = fails(&["--master", &format!("0=sim:{}", wrong.display()), "--socket", socket]);
    assert!(text.contains("toaster"), "{text}");
    assert!(!Path::new(socket).exists());
    std::fs::remove_dir_all(directory).expect("it is there");
}
