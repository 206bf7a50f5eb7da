//! The program `ringcatd` itself, with its segment in a process of its own.

use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, Output};
use std::time::{Duration, Instant};

use ringcat::Options;
use ringcat::daemon::{Answer, Client, OwnedBus, Query};

use crate::bench::{LONG, ask, directory, turn};
use crate::owner_process::{OwnerProcess, Work};
use crate::running::{PROGRAM, Running, Start, UNPRIVILEGED, signal, wait_for};

// covers: daemon
#[test]
fn the_program_drives_several_masters_each_with_a_segment_in_its_own_process() {
    let mut running = Running::start(&[3, 5]);
    let mut client = running.client();
    wait_for(&mut client, 0, 3);
    wait_for(&mut client, 1, 5);
    assert_eq!(running.segments().len(), 2);
    let Answer::Masters(masters) = ask(&mut client, Query::Masters) else { panic!("they are masters") };
    assert!(masters.iter().all(|master| master.owner.is_none() && master.fault.is_none()), "{masters:?}");
    let owner = OwnerProcess::start(&running.socket, Work::Cycle);
    wait_for(&mut client, 1, 5);
    assert_eq!(owner.end(), "ended: Ok(()), Held");
    wait_for(&mut client, 0, 3);
    running.signal("-TERM");
    assert!(running.child.wait().expect("it ends").success());
    assert!(!running.socket.exists(), "the socket is removed");
    running.wait_for_segments(0);
}

// covers: daemon
#[test]
fn the_program_reports_another_maindevice_that_is_installed_and_goes_on() {
    let (turn, directory) = (turn(), directory());
    for name in ["ethercat", "ecrt.h", "libethercat.so.1"] {
        std::fs::write(directory.join(name), "other").expect("it can be written");
    }
    let names = ["PATH", "CPATH", "LD_LIBRARY_PATH"];
    let variables = names.map(|name| (name, directory.clone().into_os_string()));
    let start = Start { counts: &[1], variables: &variables, ..Start::default() };
    let running = Running::at(&start, directory.clone(), turn);
    wait_for(&mut running.client(), 0, 1);
    for name in ["ethercat", "ecrt.h", "libethercat.so.1"] {
        let wanted = format!("{} is not RingCAT's", directory.join(name).display());
        running.wait_for_lines(|lines| lines.iter().any(|line| line.contains(&wanted)));
    }
}

// covers: daemon
#[test]
fn an_application_goes_on_when_the_daemon_is_killed_and_the_segment_ends_with_it() {
    let mut running = Running::start(&[4]);
    wait_for(&mut running.client(), 0, 4);
    let mut owner = OwnerProcess::start(&running.socket, Work::Cycle);
    running.kill();
    std::thread::sleep(Duration::from_millis(300));
    assert!(owner.child.try_wait().expect("it is a child").is_none(), "it goes on");
    assert_eq!(running.segments().len(), 1);
    let said = owner.end();
    assert_eq!(said, "ended: Err(\"ringcatd has ended, or does not answer\"), DaemonEnded");
    running.wait_for_segments(0);
}

// covers: daemon
#[test]
fn a_new_daemon_waits_for_the_application_of_a_killed_one_and_names_it() {
    for is_killed in [false, true] {
        let mut running = Running::start(&[4]);
        wait_for(&mut running.client(), 0, 4);
        let mut owner = OwnerProcess::start(&running.socket, Work::Cycle);
        running.kill();
        running.start_again();
        let mut client = running.client();
        let state = |client: &mut Client| match ask(client, Query::Masters) {
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
        assert_eq!(OwnerProcess::start(&running.socket, Work::Cycle).end(), "ended: Ok(()), Held");
    }
}

// covers: daemon
#[test]
fn the_daemon_of_one_command_ends_with_its_input_and_so_does_its_segment() {
    let mut running =
        Running::with_input(&Start { counts: &[3], options: &["--while-input-is-open"], ..Start::default() });
    wait_for(&mut running.client(), 0, 3);
    assert_eq!(running.segments().len(), 1);
    drop(running.child.stdin.take());
    assert!(running.child.wait().expect("it ends").success());
    running.wait_for_segments(0);
}

// covers: daemon
#[test]
fn a_segment_ends_with_a_daemon_that_has_never_driven_it_and_by_a_signal() {
    let mut running = Running::start(&[4]);
    wait_for(&mut running.client(), 0, 4);
    let owner = OwnerProcess::start(&running.socket, Work::Cycle);
    running.kill();
    let first = running.segments();
    running.start_again();
    // It waits for the application, and has connected no links to its own segment.
    drop(running.client());
    running.wait_for_segments(2);
    running.kill();
    running.wait_for_segments(1);
    assert_eq!(running.segments(), first);
    owner.end();
    running.wait_for_segments(0);
    running.start_again();
    wait_for(&mut running.client(), 0, 4);
    signal(running.segments()[0], "-TERM");
    running.wait_for_segments(0);
}

// covers: daemon
#[test]
fn a_stopped_daemon_costs_no_application_its_bus_and_a_release_ends_in_time() {
    let running = Running::start(&[4]);
    wait_for(&mut running.client(), 0, 4);
    let owner = OwnerProcess::start(&running.socket, Work::Cycle);
    // Longer than all limits of messages.
    running.signal("-STOP");
    std::thread::sleep(Duration::from_secs(7));
    running.signal("-CONT");
    let Answer::Masters(masters) = ask(&mut running.client(), Query::Masters) else { panic!("they are masters") };
    assert_eq!(masters[0].owner.as_ref().map(|owner| owner.pid), Some(owner.child.id()));
    running.signal("-STOP");
    let begin = Instant::now();
    let said = owner.end();
    let took = begin.elapsed();
    assert!(said.starts_with("ended: Err(") && took < Duration::from_secs(10), "{said}, {took:?}");
    running.signal("-CONT");
    wait_for(&mut running.client(), 0, 4);
}

// covers: daemon
#[test]
fn the_daemon_drives_again_when_threads_can_be_started_again() {
    if ringcat_link::process::effective_user() != 0 {
        println!("skipped: only root limits the threads of a process of another user");
        return;
    }
    let running = Running::with(&Start { counts: &[4], user: Some(UNPRIVILEGED), ..Start::default() });
    wait_for(&mut running.client(), 0, 4);
    let mut owner = OwnerProcess::start(&running.socket, Work::Cycle);
    let pid = running.child.id().to_string();
    let threads = |limit: &str| {
        let limit = format!("--nproc={limit}");
        // By the same user, which needs no capability.
        let limited =
            Command::new("prlimit").args(["--pid", &pid, &limit]).uid(UNPRIVILEGED).gid(UNPRIVILEGED).status();
        assert!(limited.is_ok_and(|status| status.success()));
    };
    // A client needs a thread, too.
    let mut client = running.client();
    threads("1:");
    owner.child.kill().expect("it runs");
    owner.child.wait().expect("it has ended");
    let begin = Instant::now();
    let fault = loop {
        let Answer::Masters(masters) = ask(&mut client, Query::Masters) else { panic!("they are masters") };
        match &masters[0].fault {
            Some(fault) => break fault.clone(),
            None => assert!(begin.elapsed() < LONG, "{masters:?}"),
        }
    };
    println!("without threads: {fault}");
    threads("1000:");
    let is_driven = |client: &mut Client| client.ask(0, Query::State, Vec::new()).is_ok();
    while !is_driven(&mut client) {
        assert!(begin.elapsed() < LONG);
        std::thread::sleep(Duration::from_millis(10));
    }
    wait_for(&mut client, 0, 4);
}

/// Its standard error, when it ends with status 2.
pub fn fails(arguments: &[&str]) -> String {
    let Output { status, stderr, .. } = Command::new(PROGRAM).args(arguments).output().expect("it starts");
    assert_eq!(status.code(), Some(2));
    String::from_utf8_lossy(&stderr).into_owned()
}

/// CAP_NET_ADMIN.
const ADMIN: u64 = 1 << 12;

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
            let permitted = u64::from_str_radix(&permitted, 16).expect("a number");
            // The daemon makes network interfaces where it may.
            let needed = if process == running.child.id() { ADMIN } else { 0 };
            assert_eq!(permitted & !needed, 0, "{text}");
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
