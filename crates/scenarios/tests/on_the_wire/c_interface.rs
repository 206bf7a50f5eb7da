//! A program in C on a ring of interfaces whose cables are cut while it runs: with links that the library opens itself,
//! and without privileges on those of a daemon.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use crate::bench::{Bench, await_op, program, target_directory};
use crate::running::Running;
use crate::states;

/// Number of SubDevices with digital outputs; `examples/c/ring.c` uses all that it finds.
const LIGHTS: usize = 6;
/// Longest delay of a change on a busy machine.
const LONG: Duration = Duration::from_secs(30);
/// A user without privileges.
const USER: &str = "65534";

fn segment() -> String {
    format!("[segment]\nring = true\n[[device]]\ntype = \"digital-output-8\"\ncount = {LIGHTS}\n")
}

/// Files that are removed at the end.
struct Place(PathBuf);

impl Place {
    /// A directory for all users, with the library and the example.
    fn with_the_example(name: &str) -> Place {
        let place = std::env::temp_dir().join(format!("ringcat-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&place).expect("it can be made");
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let mut install = Command::new(root.join("crates/ffi/install"));
        run(install.arg("--archive").arg(archive()).arg("--prefix").arg(&place));
        for file in ["ring.c", "Makefile"] {
            std::fs::copy(root.join("examples/c").join(file), place.join(file)).expect("it is there");
        }
        run(Command::new("make").arg("-C").arg(&place).arg("ring").arg(format!("PREFIX={}", place.display())));
        run(Command::new("chmod").args(["-R", "a+rwX"]).arg(&place));
        Place(place)
    }

    fn file(&self, name: &str) -> String {
        self.0.join(name).display().to_string()
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn run(command: &mut Command) {
    let output = command.output().expect("it starts");
    assert!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&output.stderr));
}

/// The newest archive of the C interface that was built.
fn archive() -> PathBuf {
    // The programs are built together with it.
    program("ringcat");
    let files = std::fs::read_dir(target_directory().join("deps")).expect("it is there").flatten();
    let archives = files.map(|file| file.path()).filter(|path| {
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        name.starts_with("libringcat_ffi") && name.ends_with(".a")
    });
    let age = |path: &PathBuf| std::fs::metadata(path).and_then(|data| data.modified()).expect("a time");
    archives.max_by_key(age).expect("it was built")
}

/// Waits until the program has printed a line with this end since a moment.
fn wait_for(light: &Running, since: Instant, end: &str) {
    let is_there = || light.said().between(since, Instant::now()).iter().any(|(_, line)| line.ends_with(end));
    while !is_there() {
        let said = || format!("{}\n{}", light.said().so_far(), light.errors().so_far());
        assert!(since.elapsed() < LONG, "\"{end}\" does not come: {}", said());
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Cuts and repairs an inner cable and both cables of interfaces; nothing leaves OP.
fn cut_cables(bench: &Bench, light: &Running) {
    let inner = |order: &str| drop(bench.order(order));
    let host = |interface: &str, state: &str| bench.set_link(interface, state);
    type Change<'a> = (&'a dyn Fn(), &'a str);
    let changes: [Change<'_>; 6] = [
        (&|| inner("cut 1-2"), "Redundant link: up, 4 SubDevice(s)."),
        (&|| inner("heal 1-2"), "The ring is closed."),
        (&|| host("main1", "down"), "Redundant link: down, 0 SubDevice(s)."),
        (&|| host("main1", "up"), "The ring is closed."),
        (&|| host("main0", "down"), "Redundant link: up, 6 SubDevice(s)."),
        (&|| host("main0", "up"), "The ring is closed."),
    ];
    for (change, line) in changes {
        let begin = Instant::now();
        change();
        wait_for(light, begin, line);
        std::thread::sleep(Duration::from_millis(100));
        assert_eq!(states(bench, "OP"), LIGHTS, "{line}: {}", bench.order("status"));
    }
}

/// Ends it in order; prints what it has reported.
fn end(light: Running) {
    let (said, errors) = light.interrupt();
    println!("{said}");
    assert!(said.trim_end().ends_with(", 0 with a SubDevice out of OP."), "{said}\n{errors}");
}

/// Scheduling of each thread of a process: 0 is the ordinary one, 1 SCHED_FIFO; the first thread is the program's own.
fn policies(process: u32) -> Vec<u32> {
    let tasks = std::fs::read_dir(format!("/proc/{process}/task")).expect("it runs").flatten();
    let mut tasks: Vec<u32> = tasks.filter_map(|task| task.file_name().to_str()?.parse().ok()).collect();
    tasks.sort_unstable();
    let policy = |task: &u32| {
        let stat = std::fs::read_to_string(format!("/proc/{process}/task/{task}/stat")).expect("it runs");
        // Field 41; the name of field 2 may have blanks.
        stat.rsplit(')').next().and_then(|rest| rest.split_whitespace().nth(38)?.parse().ok()).expect("a policy")
    };
    tasks.iter().map(policy).collect()
}

// covers: c-interface, ring-cut, ring-interfaces
#[test]
fn a_program_in_c_that_opens_two_interfaces_stays_in_op_in_a_cut_ring() {
    let Some(mut bench) = Bench::new(2) else { return };
    let place = Place::with_the_example("c-links");
    bench.simulate(&segment(), true);
    let command = ["-f", "40", "env", "RINGCAT_MAIN=main0", "RINGCAT_REDUNDANT=main1", &place.file("ring")];
    let begin = Instant::now();
    let child = bench.start(Path::new("chrt"), &command);
    let process = child.id();
    let light = Running::of(child);
    wait_for(&light, begin, "6 SubDevice(s) in OP.");
    wait_for(&light, begin, "The ring is closed.");
    // The program has real-time scheduling, the threads that the library has started do not.
    let [own, others @ ..] = &policies(process)[..] else { panic!("it runs") };
    assert_eq!(*own, 1);
    assert!(!others.is_empty() && others.iter().all(|policy| *policy == 0), "{others:?}");
    cut_cables(&bench, &light);
    end(light);
}

// covers: c-interface, daemon, ring-cut
#[test]
fn a_program_in_c_without_privileges_drives_the_ring_of_a_daemon_until_killed() {
    let Some(mut bench) = Bench::new(2) else { return };
    let place = Place::with_the_example("c-daemon");
    bench.simulate(&segment(), true);
    let socket = place.file("socket");
    let daemon = ["--master", "0=main0,main1", "--group", USER, "--socket", &socket];
    let daemon = Running::of(bench.start(&program("ringcatd"), &daemon));
    let in_preop = || states(&bench, "PREOP") == LIGHTS;
    let wait_for_preop = || {
        let begin = Instant::now();
        while !in_preop() {
            assert!(begin.elapsed() < LONG, "{}\n{}", bench.order("status"), daemon.errors().so_far());
            std::thread::sleep(Duration::from_millis(20));
        }
    };
    wait_for_preop();
    let variable = format!("RINGCAT_SOCKET={socket}");
    let ids = ["--reuid", USER, "--regid", USER, "--clear-groups", "--bounding-set", "-all"];
    let start = || {
        let example = place.file("ring");
        let command = [&ids[..], &["env", &variable, &example]].concat();
        Running::of(bench.start(Path::new("setpriv"), &command))
    };
    let begin = Instant::now();
    let light = start();
    wait_for(&light, begin, "The ring is closed.");
    await_op(&bench, LIGHTS);
    cut_cables(&bench, &light);
    light.signal("-KILL");
    wait_for_preop();
    let begin = Instant::now();
    let light = start();
    wait_for(&light, begin, "The ring is closed.");
    await_op(&bench, LIGHTS);
    end(light);
    wait_for_preop();
    daemon.signal("-TERM");
    daemon.finish(LONG);
}
