//! The program `ringcatd` itself, with its segment in a process of its own.

use std::os::unix::fs::PermissionsExt;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::MutexGuard;
use std::time::{Duration, Instant};

use ringcat::Options;
use ringcat::daemon::{Answer, Ask, Client, OwnedBus};
use ringcat_control::message::Snapshot;

use crate::bench::{LONG, ask, directory, ring, turn};
use crate::owner_process::{OwnerProcess, Work};

const PROGRAM: &str = env!("CARGO_BIN_EXE_ringcatd");

/// The running program. It is killed when this is dropped.
struct Running {
    child: Child,
    masters: usize,
    socket: PathBuf,
    directory: PathBuf,
    _turn: MutexGuard<'static, ()>,
}

impl Running {
    /// With masters on simulated rings of so many SubDevices.
    fn start(counts: &[usize]) -> Running {
        Running::start_as(counts, None)
    }

    /// The same as another user.
    fn start_as(counts: &[usize], user: Option<u32>) -> Running {
        let turn = turn();
        let directory = directory();
        let socket = directory.join("socket");
        for (master, count) in counts.iter().enumerate() {
            let file = directory.join(format!("{master}.toml"));
            std::fs::write(&file, ring(*count)).expect("it can be written");
        }
        let child = Running::spawn(&directory, &socket, counts.len(), user);
        Running { child, masters: counts.len(), socket, directory, _turn: turn }
    }

    fn spawn(directory: &Path, socket: &Path, masters: usize, user: Option<u32>) -> Child {
        let mut command = Command::new(PROGRAM);
        if let Some(user) = user {
            let copy = directory.join("ringcatd");
            std::fs::copy(PROGRAM, &copy).expect("it can be read");
            std::fs::set_permissions(directory, std::fs::Permissions::from_mode(0o777)).expect("it is there");
            command = Command::new(copy);
            command.uid(user).gid(user).current_dir("/");
        }
        for master in 0..masters {
            let file = directory.join(format!("{master}.toml"));
            command.arg("--master").arg(format!("{master}=sim:{}", file.display()));
        }
        command.arg("--socket").arg(socket).stderr(Stdio::null()).spawn().expect("it starts")
    }

    /// Starts the program again with the same options.
    fn start_again(&mut self) {
        self.child = Running::spawn(&self.directory, &self.socket, self.masters, None);
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

// covers: daemon
#[test]
fn a_new_daemon_waits_for_the_application_of_a_killed_one_and_names_it() {
    for is_killed in [false, true] {
        let mut running = Running::start(&[4]);
        wait_for(&mut running.client(), 0, 4);
        let mut owner = OwnerProcess::start(&running.socket, Work::Cycle);
        running.child.kill().expect("it runs");
        running.child.wait().expect("it has ended");
        running.start_again();
        let mut client = running.client();
        let state = |client: &mut Client| match ask(client, Ask::Masters) {
            Answer::Masters(masters) => masters[0].clone(),
            other => panic!("{other:?}"),
        };
        let waits = format!("waits for the end of \"application\" (process {})", owner.child.id());
        let begin = Instant::now();
        while begin.elapsed() < Duration::from_millis(1500) {
            let now = state(&mut client);
            assert!(now.owner.is_none() && now.fault.as_ref().is_some_and(|it| it.starts_with(&waits)), "{now:?}");
            std::thread::sleep(Duration::from_millis(50));
        }
        let taken = OwnedBus::take(&running.socket, 0, "second", &Options::default(), || ());
        let refused = taken.expect_err("the first still drives it").to_string();
        assert!(refused.contains(&waits), "{refused}");
        assert!(owner.child.try_wait().expect("it is a child").is_none(), "it goes on");
        if is_killed {
            owner.child.kill().expect("it runs");
        } else {
            owner.end();
        }
        while state(&mut client).fault.is_some() {
            assert!(begin.elapsed() < LONG);
            std::thread::sleep(Duration::from_millis(5));
        }
        wait_for(&mut client, 0, 4);
        assert_eq!(OwnerProcess::start(&running.socket, Work::Cycle).end(), "ended: Ok(()), lost false");
    }
}

// covers: daemon
#[test]
fn a_stopped_daemon_costs_no_application_its_bus_and_a_release_ends_in_time() {
    let running = Running::start(&[4]);
    wait_for(&mut running.client(), 0, 4);
    let owner = OwnerProcess::start(&running.socket, Work::Cycle);
    let signal = |name: &str| {
        let sent = Command::new("kill").args([name, &running.child.id().to_string()]).status();
        assert!(sent.is_ok_and(|status| status.success()));
    };
    // Longer than all limits of messages.
    signal("-STOP");
    std::thread::sleep(Duration::from_secs(7));
    signal("-CONT");
    let Answer::Masters(masters) = ask(&mut running.client(), Ask::Masters) else { panic!("they are masters") };
    assert_eq!(masters[0].owner.as_ref().map(|owner| owner.pid), Some(owner.child.id()));
    signal("-STOP");
    let begin = Instant::now();
    let said = owner.end();
    let took = begin.elapsed();
    assert!(said.starts_with("ended: Err(") && took < Duration::from_secs(10), "{said}, {took:?}");
    signal("-CONT");
    wait_for(&mut running.client(), 0, 4);
}

// covers: daemon
#[test]
fn the_daemon_drives_again_when_threads_can_be_started_again() {
    if ringcat_link::process::effective_user() != 0 {
        println!("skipped: only root limits the threads of a process of another user");
        return;
    }
    let running = Running::start_as(&[4], Some(65_534));
    wait_for(&mut running.client(), 0, 4);
    let mut owner = OwnerProcess::start(&running.socket, Work::Cycle);
    let pid = running.child.id().to_string();
    let threads = |limit: &str| {
        let limit = format!("--nproc={limit}");
        // By the same user, which needs no capability.
        let limited = Command::new("prlimit").args(["--pid", &pid, &limit]).uid(65_534).gid(65_534).status();
        assert!(limited.is_ok_and(|status| status.success()));
    };
    // A client needs a thread, too.
    let mut client = running.client();
    threads("1:");
    owner.child.kill().expect("it runs");
    owner.child.wait().expect("it has ended");
    let begin = Instant::now();
    let fault = loop {
        let Answer::Masters(masters) = ask(&mut client, Ask::Masters) else { panic!("they are masters") };
        match &masters[0].fault {
            Some(fault) => break fault.clone(),
            None => assert!(begin.elapsed() < LONG, "{masters:?}"),
        }
    };
    println!("without threads: {fault}");
    threads("1000:");
    let is_driven = |client: &mut Client| client.ask(0, Ask::State, Vec::new()).is_ok();
    while !is_driven(&mut client) {
        assert!(begin.elapsed() < LONG);
        std::thread::sleep(Duration::from_millis(10));
    }
    wait_for(&mut client, 0, 4);
}

fn fails(arguments: &[&str]) -> String {
    let Output { status, stderr, .. } = Command::new(PROGRAM).args(arguments).output().expect("it starts");
    assert_eq!(status.code(), Some(2));
    String::from_utf8_lossy(&stderr).into_owned()
}

// covers: daemon
#[test]
fn the_program_and_its_segment_give_up_all_capabilities_that_they_do_not_need() {
    let running = Running::start(&[2]);
    wait_for(&mut running.client(), 0, 2);
    let mut checked = 0;
    for process in running.segments().into_iter().chain([running.child.id()]) {
        for thread in std::fs::read_dir(format!("/proc/{process}/task")).expect("it runs").flatten() {
            let text = std::fs::read_to_string(thread.path().join("status")).unwrap_or_default();
            let value = |key: &str| text.lines().find_map(|line| line.strip_prefix(key)).map(|it| it.trim().to_owned());
            let Some(permitted) = value("CapPrm:") else { continue };
            assert_eq!(permitted.trim_matches('0'), "", "{text}");
            assert_eq!(value("NoNewPrivs:").as_deref(), Some("1"));
            checked += 1;
        }
    }
    assert!(checked >= 4, "{checked} threads");
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
