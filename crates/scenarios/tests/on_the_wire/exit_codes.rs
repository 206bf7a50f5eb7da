//! Failures on interfaces, and the last line of the program. None exits with 0. Situations that need no interface are
//! in `crates/cli/tests/program/exit_codes.rs`.

use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::time::Duration;

use crate::bench::{Bench, Client, await_op, finish};
use crate::messages::MIRROR;
use crate::{Plant, said, states};

/// A coupler, two outputs and two inputs.
const PLANT: Plant = Plant { outputs: 2, inputs: 2, servos: 0, coupler: true };
const SUBDEVICES: usize = 5;
/// Two clocks.
const WITH_DRIVES: Plant = Plant { outputs: 1, inputs: 0, servos: 2, coupler: true };
/// Duration of a run with a fault in OP.
const LASTS: &str = "1500ms";
const PAUSE: Duration = Duration::from_millis(300);

/// Event during a command.
enum Happens {
    Nothing,
    /// A command to the simulator when all SubDevices are in OP.
    Order(&'static str),
    /// A signal when all SubDevices are in OP.
    Signal(&'static str),
    /// Interfaces of the simulator are switched off when all SubDevices are in OP.
    Down(&'static [&'static str]),
}

use Happens::{Down, Nothing, Order, Signal};

/// Failed checks.
#[derive(Default)]
struct Findings {
    looked: usize,
    wrong: Vec<String>,
}

impl Findings {
    /// The exit status and the last line of a command.
    fn evaluate(&mut self, line: &str, child: Child, status: i32, expected: &str) {
        let output = finish(child);
        let (text, errors) = said(&output);
        let last = |text: &str| text.trim_end().lines().last().unwrap_or_default().to_owned();
        let lasts = [last(&errors), last(&text)];
        let result = lasts.iter().find(|line| line.starts_with("result: ")).cloned().unwrap_or_default();
        println!("{:<60} {:?}  {result}", line, output.status.code());
        self.looked += 1;
        let held = result.starts_with("result: ok");
        let fits = result.strip_prefix("result: ").is_some_and(|result| is_like(result, expected));
        if output.status.code() != Some(status) || !fits || held != (status == 0) {
            let code = output.status.code();
            self.wrong.push(format!(
                "`{line}` -> {code:?}, expected {status}\n  {result}\n  expected {expected}\n{text}{errors}"
            ));
        }
    }

    fn assert_none(self) {
        assert!(self.wrong.is_empty(), "{} of {}:\n{}", self.wrong.len(), self.looked, self.wrong.join("\n"));
    }
}

/// Whether a line has these parts, separated by `...`, in this order.
fn is_like(line: &str, parts: &str) -> bool {
    let mut rest = line;
    for (number, part) in parts.split("...").enumerate() {
        match rest.find(part) {
            Some(at) if number > 0 || at == 0 => rest = &rest[at + part.len()..],
            _ => return false,
        }
    }
    true
}

fn words(line: &str) -> Vec<&str> {
    line.split(' ').collect()
}

/// Starts a command, waits for OP if an event is given, and triggers the event.
fn start(bench: &Bench, line: &str, happens: &Happens) -> Child {
    let child = bench.start_ringcat(&words(line));
    if !matches!(happens, Nothing) {
        await_op(bench, SUBDEVICES);
        std::thread::sleep(PAUSE);
    }
    match happens {
        Nothing => {}
        Order(order) => {
            bench.order(order);
        }
        Signal(signal) => {
            let process = child.id().to_string();
            assert!(Command::new("kill").args([&format!("-{signal}"), &process]).status().is_ok_and(|it| it.success()));
        }
        Down(interfaces) => interfaces.iter().for_each(|interface| bench.set_link(interface, "down")),
    }
    child
}

/// Undoes the event.
fn restore(bench: &Bench, happened: &Happens) {
    if let Down(interfaces) = happened {
        interfaces.iter().for_each(|interface| bench.set_link(interface, "up"));
    }
    bench.order("heal all");
    for device in 0..SUBDEVICES {
        bench.order(&format!("power on {device}"));
        bench.order(&format!("wake {device}"));
    }
    std::thread::sleep(PAUSE);
}

/// A file system with little space.
struct SmallDisk(PathBuf);

impl SmallDisk {
    fn new() -> SmallDisk {
        let path = std::env::temp_dir().join(format!("ringcat-small-disk-{}", std::process::id()));
        std::fs::create_dir_all(&path).expect("the temporary directory is writable");
        let mount = Command::new("mount").args(["-t", "tmpfs", "-o", "size=16k", "tmpfs"]).arg(&path).status();
        assert!(mount.is_ok_and(|status| status.success()), "root may mount");
        SmallDisk(path)
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        // It contains nothing else.
        let _ = Command::new("umount").arg(&self.0).status();
        let _ = std::fs::remove_dir(&self.0);
    }
}

/// Checks each situation on the simulated segment, and restores it.
fn evaluate_all(bench: &Bench, situations: &[(String, Happens, &str)], findings: &mut Findings) {
    for (line, happens, expected) in situations {
        findings.evaluate(line, start(bench, line, happens), 1, expected);
        restore(bench, happens);
        // SubDevices behind a cut cable cannot be stopped, except through the other side of a ring.
        let is_out_of_reach =
            matches!(happens, Order(order) if order.starts_with("cut")) && !line.contains("--redundant");
        let was_stopped = !matches!(happens, Nothing) && !expected.contains("stop:") && !is_out_of_reach;
        assert!(!was_stopped || states(bench, "OP") == 0, "`{line}`: {}", bench.order("status"));
    }
}

// covers: signals, verdict
#[test]
fn failures_in_a_ring_are_in_the_last_line_and_the_exit_status() {
    let Some(mut bench) = Bench::new(2) else { return };
    bench.simulate(&PLANT.segment(), true);
    let disk = SmallDisk::new();
    let ring = "--main main0 --redundant main1";
    let run = format!("run {ring} --for {LASTS}");
    let (long, cycles) = (format!("run {ring} --for 60s"), format!("bench cycles {ring} --count 10000000"));
    let situations = [
        (run.clone(), Order("power off 2"), "FAILED: ...cycles incomplete...SubDevice 2 "),
        (run.clone(), Order("power off 0"), "FAILED: ...SubDevice 0 "),
        (run.clone(), Order("cut 2-3"), "FAILED: ...the ring is open"),
        (run.clone(), Order("cut main"), "FAILED: ...the ring is open"),
        (run.clone(), Order("drop redundant 5"), "FAILED: ..."),
        (run.clone(), Down(&["sim0", "sim1"]), "FAILED: ...did not come back...stop: no frame comes back"),
        (long.clone(), Signal("INT"), "FAILED: ...ended by SIGINT before --for 1min had passed"),
        (long.clone(), Signal("TERM"), "FAILED: ...ended by SIGTERM before --for 1min had passed"),
        (long.clone(), Signal("HUP"), "FAILED: ...ended by SIGHUP before --for 1min had passed"),
        (cycles.clone(), Signal("INT"), "FAILED: ...ended by SIGINT after ... of 10000000 cycles"),
        (format!("{cycles} --one-thread"), Signal("HUP"), "FAILED: ...ended by SIGHUP after "),
        (format!("bench rate {ring}"), Signal("INT"), "FAILED: ended by SIGINT before all rates were tried"),
        (format!("{run} --capture {}/x.pcapng", disk.0.display()), Nothing, "FAILED: ...No space left on device"),
        (
            format!("run {ring} --for 300ms --within 5s --cycle 10us"),
            Nothing,
            "FAILED: ...the cycle time was not kept: ",
        ),
    ];
    let mut findings = Findings::default();
    evaluate_all(&bench, &situations, &mut findings);
    // Without an event. A stall of this machine may still cost a frame, which is then reported.
    let output = bench.ringcat(&words(&format!("run {ring} --for 300ms")));
    let (text, errors) = said(&output);
    let held = text.trim_end().lines().last().is_some_and(|line| line.starts_with("result: ok"));
    assert_eq!(output.status.code(), Some(i32::from(!held)), "{text}{errors}");
    findings.assert_none();
}

// covers: verdict
#[test]
fn failures_on_one_interface_are_in_the_last_line_and_the_exit_status() {
    let Some(mut bench) = Bench::new(1) else { return };
    bench.simulate(&PLANT.segment(), false);
    let run = format!("run --main main0 --for {LASTS}");
    let situations = [
        (run.clone(), Order("drop main 5"), "FAILED: ...did not come back"),
        (run.clone(), Order("cut main"), "FAILED: ...did not come back...stop: no frame comes back"),
        (run.clone(), Order("cut 2-3"), "FAILED: ...cycles incomplete...SubDevice 3 "),
    ];
    let mut findings = Findings::default();
    evaluate_all(&bench, &situations, &mut findings);
    let mut nothing = |bench: &Bench, line: &str, status, expected: &str| {
        findings.evaluate(line, bench.start_ringcat(&words(line)), status, expected);
    };
    let machine = concat!(env!("CARGO_MANIFEST_DIR"), "/../ringcat/examples/machine.eni.xml");
    nothing(&bench, &format!("run --main main0 --eni {machine}"), 2, "FAILED: the network is not the one of the file");
    nothing(&bench, "scan --main main0 --sync all:auto", 2, "FAILED: unexpected argument '--sync' found");
    bench.order("hang 3");
    nothing(&bench, "run --main main0 --for 1s --within 4s", 1, "FAILED: ... of 5 SubDevices not in OP within 4s");
    bench.simulate(&WITH_DRIVES.segment(), false);
    nothing(
        &bench,
        "run --main main0 --sync 2:300us",
        2,
        "FAILED: --sync: SubDevice 2 ...SYNC0 every 300 us does not go",
    );
    nothing(&bench, "run --main main0 --sync 1:1ms", 2, "FAILED: --sync 1: SubDevice 1 ...has no distributed clock");
    findings.assert_none();
}

// covers: other-main-device
#[test]
fn only_capture_starts_beside_a_main_device_which_stays_in_op() {
    let Some(mut bench) = Bench::new(2) else { return };
    bench.simulate(&PLANT.segment(), true);
    let mut findings = Findings::default();
    let owner = bench.run_ringcat(&words("run --main main0 --redundant main1"));
    await_op(&bench, SUBDEVICES);
    for line in [
        "scan --main main0",
        "scan --main main1 --json",
        "run --main main0 --for 1s",
        "ring --main main0 --redundant main1",
        "clocks --main main0",
        "bench cycles --main main0",
        "bench rate --main main1",
        "bench round-trip --main main0",
        "bench echo --main main0",
    ] {
        let line = if line.starts_with("bench round-trip") { "bench round-trip --main main0 --count 10" } else { line };
        findings.evaluate(
            line,
            bench.start_ringcat(&words(line)),
            2,
            "FAILED: process ... (ringcat) uses EtherCAT on main",
        );
        assert_eq!(states(&bench, "OP"), SUBDEVICES, "`{line}`: {}", bench.order("status"));
    }
    let file = std::env::temp_dir().join(format!("ringcat-beside-{}.pcapng", std::process::id()));
    let line = format!("capture --main main0 --out {} --for 300ms", file.display());
    let program = crate::bench::program("ringcat");
    findings.evaluate(&line, bench.start(&program, &words(&line)), 0, "ok: ");
    std::fs::remove_file(&file).expect("it was written");
    // A second simulator would return each frame a second time.
    let segment = concat!(env!("CARGO_MANIFEST_DIR"), "/../sim/segments/demo.toml");
    let line = format!("sim --main sim0 --segment {segment}");
    findings.evaluate(
        &line,
        bench.start_at_sim(&program, &words(&line)),
        2,
        "FAILED: process ... uses EtherCAT on sim0",
    );
    assert_eq!(states(&bench, "OP"), SUBDEVICES);
    let (output, errors) = owner.interrupt();
    assert!(!output.contains("no longer answers") && !output.contains("SAFEOP"), "{output}{errors}");
    findings.assert_none();
}

// covers: other-main-device
#[test]
fn a_main_device_in_another_namespace_is_found_by_its_frames() {
    let Some(mut bench) = Bench::new(2) else { return };
    bench.give_away_main1();
    bench.set_link("sim1", "down");
    bench.simulate(&PLANT.segment(), true);
    let owner = bench.run_ringcat(&words("run --main main0"));
    await_op(&bench, SUBDEVICES);
    bench.set_link("sim1", "up");
    std::thread::sleep(PAUSE);
    let mut findings = Findings::default();
    for line in ["scan --main main1", "run --main main1 --for 1s", "ring --main main1"] {
        let expected = "FAILED: another MainDevice controls this segment: its frames, from ... arrive on main1";
        findings.evaluate(line, bench.start_other_ringcat(&words(line)), 2, expected);
    }
    drop(owner);
    findings.assert_none();
}

// covers: verdict
#[test]
fn an_empty_cable_and_an_open_ring_are_in_the_last_line() {
    let Some(mut bench) = Bench::new(2) else { return };
    let mut findings = Findings::default();
    let mut nothing = |bench: &Bench, line: &str, status, expected: &str| {
        findings.evaluate(line, bench.start_ringcat(&words(line)), status, expected);
    };
    for command in ["run", "ring", "bench rate"] {
        nothing(&bench, &format!("{command} --main main0"), 2, "FAILED: ...no frame returns");
    }
    let mirror = Client::new(bench.start_at_sim(Path::new("python3"), &["-c", MIRROR]));
    assert_eq!(mirror.line, "ready");
    nothing(&bench, "scan --main main0", 2, "FAILED: scan: frames return, but no SubDevice processes them");
    drop(mirror);
    bench.simulate(&PLANT.segment(), true);
    bench.order("cut 1-2");
    nothing(&bench, "ring --main main0 --redundant main1", 1, "FAILED: the ring is open, 5 SubDevices");
    nothing(&bench, "ring --main main0 --redundant main1 --json", 1, "FAILED: the ring is open, 5 SubDevices");
    findings.assert_none();
}

/// A network of a coupler alone.
const COUPLER_ALONE: &str = "<EtherCATConfig Version=\"1.3\"><Config><Master><Info><Name>M</Name></Info></Master>\
    <Slave><Info>\
    <Name>Coupler</Name><PhysAddr>1001</PhysAddr><AutoIncAddr>0</AutoIncAddr><Physics>YKY</Physics>\
    <VendorId>3143</VendorId>\
    <ProductCode>72089601</ProductCode></Info></Slave></Config></EtherCATConfig>";

// covers: verdict
#[test]
fn a_bus_with_more_subdevices_than_the_eni_runs_and_exits_with_1() {
    let Some(mut bench) = Bench::new(1) else { return };
    bench.simulate(&PLANT.segment(), false);
    let file = std::env::temp_dir().join(format!("ringcat-coupler-{}.xml", std::process::id()));
    std::fs::write(&file, COUPLER_ALONE).expect("the temporary directory is writable");
    let line = format!("run --main main0 --for 300ms --within 5s --eni {}", file.display());
    let mut findings = Findings::default();
    findings.evaluate(
        &line,
        bench.start_ringcat(&words(&line)),
        1,
        "FAILED: ...the file lacks 4 SubDevices of the bus",
    );
    std::fs::remove_file(&file).expect("it was written");
    findings.assert_none();
}

// covers: signals
#[test]
fn on_one_processor_no_thread_spins_and_limits_and_signals_work() {
    let Some(mut bench) = Bench::new(1) else { return };
    bench.simulate(&PLANT.segment(), false);
    let program = crate::bench::program("ringcat").display().to_string();
    let on_one = |line: &str| {
        let program = [&["-c", "0", &program][..], &words(line)].concat();
        bench.start(Path::new("taskset"), &program)
    };
    let run = "run --main main0 --receive busy --priority 40";
    for signal in [None, Some("-TERM"), Some("-INT"), Some("-HUP")] {
        let child = on_one(&if signal.is_some() { run.to_owned() } else { format!("{run} --for 500ms") });
        if let Some(signal) = signal {
            await_op(&bench, SUBDEVICES);
            std::thread::sleep(PAUSE);
            let process = child.id().to_string();
            assert!(Command::new("kill").args([signal, &process]).status().is_ok_and(|status| status.success()));
        }
        let (output, errors) = said(&finish(child));
        assert!(errors.contains("this process may use one processor only, so no thread spins"), "{errors}");
        assert!(output.contains("stopped: outputs zero, all SubDevices in INIT"), "{signal:?}: {output}{errors}");
        assert!(output.trim_end().lines().last().is_some_and(|line| line.starts_with("result: ")), "{output}");
        assert_eq!(states(&bench, "INIT"), SUBDEVICES, "{signal:?}");
    }
}
