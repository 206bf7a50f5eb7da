//! The script of `examples/standby`: it makes namespaces of its own, and removes them.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use crate::bench::{Bench, finish, program};
use crate::running::Running;
use crate::said;

const LIMIT: Duration = Duration::from_secs(20);

fn script() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/standby/play")
}

fn play() -> Child {
    let mut command = Command::new(script());
    command.arg(program("ringcat")).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command.spawn().expect("it is a program")
}

/// What `ip` prints.
fn ip(arguments: &[&str]) -> String {
    let output = Command::new("ip").args(arguments).output().expect("ip starts");
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// No namespace of a run is left, and so no process in one of them.
fn nothing_is_left(process: u32) {
    let namespaces = ip(&["netns", "list"]);
    assert!(!namespaces.contains(&format!("ringcat-{process}-")), "{namespaces}");
}

/// The last line, which is the verdict.
fn verdict(text: &str) -> &str {
    text.lines().last().unwrap_or_default()
}

// covers: standby, MR-01, MR-07, MR-21, MR-26, REQ005, REQ008, REQ012, REQ026
#[test]
fn the_script_of_two_controllers_holds_in_each_step_and_leaves_nothing() {
    // The namespaces of the bench are not used: holding it keeps other tests from running meanwhile, and it is `None`
    // without root.
    let Some(_alone) = Bench::new(0) else { return };
    let child = play();
    let process = child.id();
    let output: Output = finish(child);
    let (text, errors) = said(&output);
    assert!(output.status.success() && verdict(&text).starts_with("result: ok: "), "{text}{errors}");
    assert!(errors.is_empty(), "{errors}");
    for step in ["8.4.1: 1 to 4", "8.4.1: 10, 11", "9.2", "is killed", "8.4.2: 18, 19", "8.4.2: 21, 22"] {
        assert!(text.contains(step), "{step}: {text}");
    }
    nothing_is_left(process);
    println!("{}", verdict(&text));
}

// covers: standby
#[test]
fn the_script_of_two_controllers_leaves_nothing_when_it_is_interrupted() {
    let Some(_alone) = Bench::new(0) else { return };
    let child = play();
    let process = child.id();
    let running = Running::of(child);
    let until = Instant::now() + LIMIT;
    while !running.said().so_far().contains("controller 2 forwards") {
        assert!(Instant::now() < until, "{}{}", running.said().so_far(), running.errors().so_far());
        std::thread::sleep(Duration::from_millis(20));
    }
    assert!(ip(&["netns", "list"]).contains(&format!("ringcat-{process}-c2")));
    running.signal("-TERM");
    let (text, errors) = running.finish(LIMIT);
    assert!(verdict(&text).starts_with("result: FAILED: step "), "{text}{errors}");
    assert!(verdict(&text).ends_with("ended by a signal"), "{text}{errors}");
    nothing_is_left(process);
}
