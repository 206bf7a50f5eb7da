//! Two controllers, each `ringcat standby` in a namespace of its own, at one ring: one ends, hangs, loses the bus or
//! hands the role over, and the other one goes on.

use std::fs;
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::bench::{Bench, await_op};
use crate::documented::Page;
use crate::running::Running;
use crate::{RING_OF_10, said, states};

const CYCLE_MS: f64 = 5.0;
/// A busy machine reaches each state within this time.
const LIMIT: Duration = Duration::from_secs(20);
/// Options of both controllers. The machine may be busy: a stall of less than 40 ms is no failure.
const ROLE: [&str; 6] = ["--listen", "300ms", "--timeout", "10", "--guard", "40ms"];
const AUTOMATIC: [&str; 3] = ["--automatic", "--cycle", "5ms"];
const TAKEN_OVER: &str = "taken over: 10 SubDevices go on as they are";
pub const READY: &str = "the other MainDevice: ready";

/// Two controllers at a simulated ring, of 10 unless a test has another one.
pub struct Pair {
    /// The bench.
    pub bench: Bench,
    declared: Vec<String>,
    role: Vec<String>,
}

impl Pair {
    /// On interfaces, if the machine allows it.
    pub fn new() -> Option<Pair> {
        Pair::with_role(&ROLE)
    }

    /// The same with these options of both controllers.
    pub fn with_role(role: &[&str]) -> Option<Pair> {
        Pair::at(&RING_OF_10.segment(), role)
    }

    /// The same at this ring.
    pub fn at(ring: &str, role: &[&str]) -> Option<Pair> {
        let mut bench = Bench::new(2)?;
        bench.add_second_main_device();
        bench.simulate(ring, true);
        let role = role.iter().map(|word| (*word).to_owned()).collect();
        Some(Pair { bench, declared: AUTOMATIC.map(str::to_owned).to_vec(), role })
    }

    fn arguments<'a>(&'a self, links: [&'a str; 2], more: &[&'a str]) -> Vec<&'a str> {
        let declared: Vec<&str> = self.declared.iter().map(String::as_str).collect();
        let role: Vec<&str> = self.role.iter().map(String::as_str).collect();
        let links = ["standby", "--main", links[0], "--redundant", links[1]];
        [&links[..], &declared, &role, more].concat()
    }

    /// Starts the first one.
    pub fn first(&self, more: &[&str]) -> Running {
        self.bench.run_ringcat(&self.arguments(["main0", "active1"], more))
    }

    /// Starts the second one.
    pub fn second(&self, more: &[&str]) -> Running {
        self.bench.run_other_ringcat(&self.arguments(["second0", "main1"], more))
    }

    /// The first one in OP as ACTIVE, the second one as its standby, which it reports as ready.
    fn in_op(&self, more: &[&str]) -> (Running, Running) {
        let first = self.first(more);
        await_op(&self.bench, 10);
        let second = self.second(more);
        await_words(&first, READY);
        (first, second)
    }

    /// Switches both interfaces of a controller, the first one or the second one.
    pub fn switch(&self, host: usize, state: &str) {
        for name in [["main0", "active1"], ["main1", "second0"]][host] {
            let arguments = format!("link set {name} {state}");
            if host == 0 { self.bench.ip_main(&arguments) } else { self.bench.ip_elsewhere(&arguments) }
        }
    }

    /// All SubDevices are in this state.
    pub fn all_are_in(&self, state: &str) {
        assert_eq!(states(&self.bench, state), 10, "{}", self.bench.order("status"));
    }
}

/// Waits until a controller has said this.
pub fn await_words(controller: &Running, words: &str) {
    await_that(words, &[controller], || controller.said().so_far().contains(words));
}

/// Waits until something holds.
pub fn await_that(what: &str, controllers: &[&Running], holds: impl Fn() -> bool) {
    let until = Instant::now() + LIMIT;
    while !holds() {
        if Instant::now() >= until {
            let text = |it: &&Running| format!("{}{}\n", it.said().so_far(), it.errors().so_far());
            panic!("not within {LIMIT:?}: {what}\n{}", controllers.iter().map(text).collect::<String>());
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Ends a controller in order, which says all of this.
pub fn end(controller: Running, words: &[&str]) {
    let (said, errors) = controller.interrupt();
    assert!(words.iter().all(|words| said.contains(words)), "{words:?}: {said}{errors}");
}

/// The silence before the takeover, as the line about it says.
fn silence_ms(said: &str) -> f64 {
    let line = said.lines().find(|line| line.contains("taken over: ")).expect("it took over");
    let (_, silence) = line.split_once("was ").unwrap_or_else(|| panic!("{line}"));
    silence.split(' ').next().and_then(|ms| ms.parse().ok()).unwrap_or_else(|| panic!("{line}"))
}

// covers: standby, MR-01, MR-07, MR-21, REQ012
#[test]
fn a_killed_active_is_taken_over_and_comes_back_and_no_subdevice_leaves_op() {
    let Some(pair) = Pair::new() else { return };
    let (first, second) = pair.in_op(&[]);
    first.signal("-KILL");
    await_words(&second, TAKEN_OVER);
    pair.all_are_in("OP");
    let silence = silence_ms(&second.said().so_far());
    println!("without process data: {silence} ms, {:.0} cycles missing", (silence / CYCLE_MS - 1.0).max(0.0));
    // The killed one is started again, follows, and is handed the role over.
    drop(first);
    let first = pair.first(&[]);
    await_words(&first, "INACTIVE: cycles run");
    await_words(&second, READY);
    end(second, &["result: ok: handed the role over, takeovers: 1"]);
    await_words(&first, "ACTIVE (handed over)");
    pair.all_are_in("OP");
    end(
        first,
        &["stopped: outputs zero, all SubDevices in INIT", "result: ok: stopped the bus as ACTIVE, takeovers: 1"],
    );
    pair.all_are_in("INIT");
    pair.bench.show_simulator_lateness();
}

// covers: standby, MR-21, REQ012
#[test]
fn a_stopped_active_is_off_before_the_other_takes_over_and_ends_when_it_goes_on() {
    let Some(pair) = Pair::new() else { return };
    let (first, second) = pair.in_op(&[]);
    first.signal("-STOP");
    await_words(&second, TAKEN_OVER);
    let on = pair.bench.links_main();
    let is_on = |name: &str| on.lines().any(|line| line.contains(&format!("{name}@")) && line.contains(",UP"));
    assert!(!is_on("main0") && !is_on("active1"), "{on}");
    first.signal("-CONT");
    let (said, errors) = first.finish(LIMIT);
    assert!(said.contains("FAILED") && said.contains("the guard has switched both off"), "{said}{errors}");
    pair.all_are_in("OP");
    end(second, &["result: ok: stopped the bus as ACTIVE, takeovers: 1"]);
    pair.all_are_in("INIT");
    pair.bench.show_simulator_lateness();
}

// covers: standby, MR-07
#[test]
fn an_active_that_loses_all_its_cables_yields_and_follows_when_they_are_back() {
    let Some(pair) = Pair::new() else { return };
    let (first, second) = pair.in_op(&[]);
    pair.bench.ip_main("link set active1 down");
    pair.bench.set_link("main0", "down");
    await_words(&first, "INACTIVE (all links lost)");
    await_words(&second, TAKEN_OVER);
    pair.all_are_in("OP");
    pair.bench.ip_main("link set active1 up");
    pair.bench.set_link("main0", "up");
    await_words(&second, READY);
    pair.all_are_in("OP");
    end(second, &["result: ok: handed the role over, takeovers: 1"]);
    await_words(&first, "ACTIVE (handed over)");
    pair.all_are_in("OP");
    end(first, &["result: ok: stopped the bus as ACTIVE, takeovers: 1"]);
    pair.bench.show_simulator_lateness();
}

// covers: standby, MR-09, MR-10, MR-24, REQ016, REQ048
#[test]
fn of_two_controllers_with_half_the_ring_each_one_yields_when_it_is_repaired() {
    let Some(pair) = Pair::new() else { return };
    let (first, second) = pair.in_op(&[]);
    pair.bench.order("cut 4-5");
    await_words(&first, "ring open:");
    pair.bench.ip_main("link set active1 down");
    await_words(&second, "taken over: ");
    pair.bench.order("heal 4-5");
    let yields = |it: &Running| {
        let said = it.said().so_far();
        said.split_once("collision: another MainDevice sends, too").is_some_and(|(_, rest)| rest.contains("INACTIVE ("))
    };
    await_that("one of them yields", &[&first, &second], || yields(&first) || yields(&second));
    // Which one follows from the addresses of their interfaces.
    let (active, inactive) = if yields(&first) { (second, first) } else { (first, second) };
    await_op(&pair.bench, 10);
    assert!(!yields(&active), "{}", active.said().so_far());
    end(inactive, &["FAILED: collisions with another ACTIVE: "]);
    await_op(&pair.bench, 10);
    // It may not have received a frame of the other one, which yields in the cycle that shows the collision.
    end(active, &["stopped: outputs zero, all SubDevices in INIT"]);
    pair.all_are_in("INIT");
    pair.bench.show_simulator_lateness();
}

// covers: standby, MR-07
#[test]
fn a_permanent_standby_follows_and_never_takes_over() {
    let Some(pair) = Pair::new() else { return };
    let first = pair.first(&[]);
    await_op(&pair.bench, 10);
    let second = pair.second(&["--permanent-standby"]);
    await_words(&second, "INACTIVE: cycles run");
    first.signal("-KILL");
    // The watchdogs of the outputs expire.
    await_that("outputs leave OP", &[&second], || states(&pair.bench, "OP") <= 5);
    std::thread::sleep(Duration::from_secs(1));
    let (said, errors) = second.interrupt();
    assert!(!said.contains("taken over"), "{said}{errors}");
    assert!(said.contains("result: ok: left as INACTIVE, takeovers: 0"), "{said}{errors}");
}

// covers: standby, 9.9
#[test]
fn a_watchdog_that_is_too_short_for_a_takeover_ends_a_controller_that_is_strict() {
    let Some(mut pair) = Pair::new() else { return };
    // The watchdogs of outputs have 100 ms: ten cycles and two more are longer.
    let declared =
        std::mem::replace(&mut pair.declared, ["--automatic", "--cycle", "10ms"].map(str::to_owned).to_vec());
    let (said, errors) = pair.first(&["--strict"]).finish(LIMIT);
    let reason =
        "its watchdog of 100.0 ms is too short: a takeover may last 120.0 ms, and the SubDevice then leaves OP";
    let last = said.lines().last().unwrap_or_default();
    assert!(last.starts_with("result: FAILED: ") && last.contains(reason), "{said}{errors}");
    pair.all_are_in("INIT");
    pair.declared = declared;
    let first = pair.first(&["--strict"]);
    await_op(&pair.bench, 10);
    end(first, &["stopped: outputs zero, all SubDevices in INIT"]);
}

// covers: standby, json, REQ010
#[test]
fn controllers_with_a_network_file_print_json_and_name_a_difference_of_the_files() {
    let Some(mut pair) = Pair::new() else { return };
    let path = |name: &str| {
        let name = format!("ringcat-takeover-{name}-{}.toml", std::process::id());
        std::env::temp_dir().join(name).display().to_string()
    };
    let (same, other) = (path("same"), path("other"));
    for (file, cycle) in [(&same, "5ms"), (&other, "10ms")] {
        let arguments = ["init", "--main", "main0", "--cycle", cycle, "--overwrite", "--out", file];
        let output = pair.bench.ringcat(&arguments);
        assert!(output.status.success(), "{:?}", said(&output));
    }
    pair.declared = vec!["--network".to_owned(), same.clone()];
    let (first, second) = pair.in_op(&["--json"]);
    let (text, errors) = first.interrupt();
    let result = Page::read().check("standby", &text);
    let takeover = |result: &Value, key: &str| result["takeover"][key].clone();
    assert_eq!(takeover(&result, "handed_over"), true, "{text}{errors}");
    assert_eq!(takeover(&result, "role"), "active", "{text}{errors}");
    let is_event = |line: &&str, name: &str| line.contains(&format!("\"event\":\"{name}\""));
    for name in ["RoleChanged", "Partner"] {
        assert!(text.lines().any(|line| is_event(&line, name)), "{name}: {text}");
    }
    await_words(&second, "ACTIVE (handed over)");
    pair.all_are_in("OP");
    // The file of the one that joins differs.
    pair.declared = vec!["--network".to_owned(), other.clone()];
    let first = pair.first(&[]);
    await_words(&second, "ConfigurationDiffers");
    await_words(&first, "the other MainDevice has another configuration");
    end(first, &["FAILED: the other MainDevice differs: "]);
    pair.all_are_in("OP");
    let (text, errors) = second.interrupt();
    let result = Page::read().check("standby", &text);
    let counted = ["takeovers", "collisions"].map(|key| takeover(&result, key));
    assert_eq!(counted, [Value::from(1), Value::from(0)], "{text}{errors}");
    assert_eq!(takeover(&result, "stopped"), true, "{text}{errors}");
    assert!(takeover(&result, "configuration_differences").as_u64() > Some(0), "{text}{errors}");
    for file in [same, other] {
        fs::remove_file(file).expect("it was written");
    }
}
