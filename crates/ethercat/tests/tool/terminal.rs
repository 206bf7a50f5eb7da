//! Bars and the live table in a terminal, which `script` of util-linux makes.

use std::io::{Read, Write};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use ringcat::automatic;
use ringcat::sim::application::dictionary::{Access, Object};
use ringcat::sim::cable::{CableId, DeviceIndex};

use ringcat::sim::fault::Fault;
use ringcat_link::terminal::Keys;

use crate::bench::{Bench, Driver, LONG, PROGRAM, directory};
use crate::golden_bus::{WITH_SOE, segment};
use crate::several::ring;
use crate::standalone::has_daemon;

const CYCLE: Duration = Duration::from_millis(1);
/// Removes a bar: the beginning of the line, and nothing behind it.
const REMOVED: &str = "\r\u{1b}[K";
const OPEN: &str = "  ring        OPEN: the next break isolates slaves";
/// Bytes of a file and of an object that take longer than a second.
const FILE: usize = 100_000;
const OBJECT: usize = 40_000;
/// Data type octet string.
const OCTETS: u8 = 10;

/// A shell in a terminal of 24 rows and 80 columns.
struct Terminal {
    script: Child,
    input: Option<ChildStdin>,
    shown: Arc<Mutex<String>>,
    reader: JoinHandle<()>,
}

impl Terminal {
    /// Runs a line of the shell, in which `$E` is the tool.
    fn start(bench: &Bench, line: &str) -> Terminal {
        let line = format!("stty rows 24 cols 80; tty > tty; {line}");
        let mut script = Command::new("script");
        script.args(["-qefc", &line, "/dev/null"]).current_dir(&bench.directory);
        script.env("RINGCAT_SOCKET", &bench.socket).env("E", PROGRAM).env("SHELL", "/bin/sh");
        script.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut script = script.spawn().expect("util-linux is there");
        let (input, mut output) = (script.stdin.take(), script.stdout.take().expect("it is piped"));
        let shown = Arc::new(Mutex::new(String::new()));
        let kept = shown.clone();
        let reader = std::thread::spawn(move || {
            let mut part = [0; 4096];
            while let Ok(count @ 1..) = output.read(&mut part) {
                kept.lock().expect("no panic").push_str(&String::from_utf8_lossy(&part[..count]));
            }
        });
        Terminal { script, input, shown, reader }
    }

    fn shown(&self) -> String {
        self.shown.lock().expect("no panic").clone()
    }

    /// Waits for a text behind the first `from` bytes; the number of bytes that are there then.
    fn wait_for(&self, text: &str, from: usize) -> usize {
        let begin = Instant::now();
        loop {
            let shown = self.shown();
            if shown.get(from..).is_some_and(|shown| shown.contains(text)) {
                return shown.len();
            }
            assert!(begin.elapsed() < LONG, "no {text:?} in {:?}", shown.get(from..));
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// Waits for texts one behind the other, behind the first `from` bytes; where the last one ends.
    fn wait_for_all(&self, texts: &[&str], from: usize) -> usize {
        texts.iter().fold(from, |from, text| {
            self.wait_for(text, from);
            from + self.shown()[from..].find(text).expect("it has come") + text.len()
        })
    }

    fn press(&mut self, keys: &[u8]) {
        let input = self.input.as_mut().expect("it is open");
        input.write_all(keys).and_then(|()| input.flush()).expect("it is read");
    }

    /// What it has shown, and its exit code.
    fn end(mut self) -> (String, Option<i32>) {
        let code = self.script.wait().expect("it is a child").code();
        drop(self.input.take());
        self.reader.join().expect("no panic");
        let shown = self.shown.lock().expect("no panic").clone();
        (shown, code)
    }
}

/// The output of a line of the shell that ends by itself.
fn in_terminal(bench: &Bench, line: &str) -> String {
    let (shown, code) = Terminal::start(bench, line).end();
    assert_eq!(code, Some(0), "{line}: {shown:?}");
    shown
}

/// A bar of this command was drawn, it has grown, and nothing of it is left.
fn assert_bar(shown: &str, name: &str, has_share: bool) {
    let begin = if has_share { format!("\r{name}  [") } else { format!("\r{name}  ") };
    assert!(shown.contains(&begin) && shown.ends_with(REMOVED), "{name}: {shown:?}");
    let bars: Vec<&str> = shown.split('\r').filter(|bar| bar.starts_with(name)).collect();
    assert!(bars.iter().all(|bar| bar.trim_end_matches("\u{1b}[K").len() < 80), "{bars:?}");
    assert!(bars.first() != bars.last(), "{name} has not grown: {bars:?}");
}

// covers: daemon
#[test]
fn a_long_transfer_shows_a_bar_in_a_terminal_and_nowhere_else() {
    let directory = directory();
    let mut on = segment(&directory, WITH_SOE);
    let input = &mut on.devices[1];
    input.services.foe.files.push(("large.bin".to_owned(), vec![7; FILE]));
    input.objects.push(Object::variable(0x2010, "Large", OCTETS, Access::ReadWrite, &vec![9; OBJECT]));
    input.mailbox.as_mut().expect("it has one").response_time = Duration::from_millis(5);
    let bench = Bench::start_in(directory, vec![on]);
    let slow = |commands: u32| {
        let fault = Fault::SlowSii { device: DeviceIndex(1), busy: Duration::from_millis(5), times: commands };
        bench.inside(0, move |segment| segment.network_mut().apply(fault));
    };
    slow(400);
    assert_bar(&in_terminal(&bench, "$E sii_read -p1 > sii"), "sii_read", true);
    // The read before is kept; a write reads each word of the EEPROM.
    slow(1200);
    assert_bar(&in_terminal(&bench, "$E sii_write -p1 sii"), "sii_write", true);
    std::fs::write(bench.directory.join("fw.bin"), vec![7; FILE]).expect("it can be written");
    assert_bar(&in_terminal(&bench, "$E foe_write -p1 fw.bin"), "foe_write", true);
    assert_bar(&in_terminal(&bench, "$E foe_read -p1 large.bin -o large"), "foe_read", false);
    assert_eq!(std::fs::metadata(bench.directory.join("large")).expect("it is there").len(), FILE as u64);
    assert_bar(&in_terminal(&bench, "$E upload -p1 0x2010 0 > value"), "upload", true);
    assert_bar(&in_terminal(&bench, "$E download -p1 -t octet_string 0x2010 0 - < value"), "download", true);
    // Not in a pipe, not with --json, not with --quiet.
    assert_eq!(bench.good(&["foe_read", "-p1", "large.bin"]).len(), FILE);
    let (sii, file) = (bench.directory.join("sii"), bench.directory.join("fw.bin"));
    for (command, file) in [("sii_write", sii), ("foe_write", file)] {
        slow(1200);
        assert_eq!(bench.good(&[command, "-p1", file.to_str().expect("it is text")]), "");
    }
    for line in ["$E foe_read -p1 large.bin --json > json", "$E foe_read -p1 -q large.bin > file"] {
        assert_eq!(in_terminal(&bench, line), "", "{line}");
    }
}

// covers: daemon
#[test]
fn a_short_transfer_shows_no_bar() {
    let directory = directory();
    let on = segment(&directory, WITH_SOE);
    let bench = Bench::start_in(directory, vec![on]);
    assert_eq!(in_terminal(&bench, "$E sii_read -p1 > sii; $E upload -p1 0x2000 0 > value"), "");
}

// covers: daemon
#[test]
fn a_live_table_follows_the_bus_and_the_size_of_the_terminal() {
    let bench = Bench::start(vec![ring(6, true), ring(2, false)]);
    let mut terminal = Terminal::start(&bench, "stty -a > before; $E watch; echo $? > code; stty -a > after");
    let at = terminal
        .wait_for("\u{1b}[?1049h\u{1b}[?25l\u{1b}[HMaster0  idle\u{1b}[K\r\r\n  ring        closed\u{1b}[K\r\r\n", 0);
    terminal.wait_for("Master1  idle", 0);
    assert!(std::fs::read_to_string(bench.directory.join("before")).expect("it is there").contains("columns 80"));
    bench.inside(0, |segment| segment.network_mut().apply(Fault::Cut(CableId(2))));
    let at =
        terminal.wait_for(&format!("{OPEN}\u{1b}[K\r\r\n  links       MAIN 2 slaves, REDUNDANT 4 slaves\u{1b}[K"), at);
    bench.inside(0, |segment| segment.network_mut().apply(Fault::Heal(CableId(2))));
    let at = terminal.wait_for("  ring        closed\u{1b}[K\r\r\n  links       MAIN 6 slaves, ", at);
    bench.inside(1, |segment| segment.network_mut().apply(Fault::PowerOff(DeviceIndex(1))));
    terminal.wait_for("  ring        one link\u{1b}[K\r\r\n  links       MAIN 1 slaves", at);
    // A smaller terminal has fewer and shorter lines.
    let tty = std::fs::read_to_string(bench.directory.join("tty")).expect("it is there");
    let resized = Command::new("stty").args(["-F", tty.trim(), "rows", "4", "cols", "20"]).status();
    assert!(resized.expect("coreutils are there").success());
    let at = terminal.wait_for("\r\n... ", terminal.shown().len());
    let page = terminal.shown();
    let page = page[..at].rsplit("\u{1b}[H").next().expect("a page").to_owned();
    assert!(page.starts_with("Master0  idle\u{1b}[K\r\r\n  ring        close\u{1b}[K\r\r\n"), "{page:?}");
    terminal.press(b"xq");
    let (shown, code) = terminal.end();
    assert!(code == Some(0) && shown.ends_with("\u{1b}[J\u{1b}[?25h\u{1b}[?1049l"), "{shown:?}");
    let file = |name: &str| std::fs::read_to_string(bench.directory.join(name)).expect("it is there");
    assert_eq!(file("code"), "0\n");
    let settings = |text: String| text.lines().skip(1).map(str::to_owned).collect::<Vec<_>>();
    assert_eq!(settings(file("before")), settings(file("after")), "the terminal is as before");
}

// covers: daemon
#[test]
fn a_live_table_ends_with_keys_the_end_of_the_input_and_a_signal() {
    let bench = Bench::start(vec![ring(2, false)]);
    for keys in [&b"\x03"[..], b"\x04", b"Q", b"\x1c"] {
        let mut terminal = Terminal::start(&bench, "$E watch");
        terminal.wait_for("Master0  idle", 0);
        terminal.press(keys);
        assert_eq!(terminal.end().1, Some(0), "{keys:?}");
    }
    let terminal = Terminal::start(&bench, "$E watch < /dev/null");
    let (printed, code) = terminal.end();
    assert!(code == Some(0) && printed.starts_with("Master0  idle") && !printed.contains("1049"), "{printed}");
    let terminal = Terminal::start(&bench, "sh -c 'echo $$ > pid; exec $E watch'; stty -a > after");
    terminal.wait_for("Master0  idle", 0);
    let pid = std::fs::read_to_string(bench.directory.join("pid")).expect("it is there");
    assert!(Command::new("kill").args(["-TERM", pid.trim()]).status().expect("it runs").success());
    let (shown, _) = terminal.end();
    assert!(shown.ends_with("\u{1b}[?1049l"), "{shown:?}");
    let after = std::fs::read_to_string(bench.directory.join("after")).expect("it is there");
    assert!(after.contains(" icanon") && after.contains(" echo ") && after.contains("isig"), "{after}");
}

/// Variable of the process that panics.
const PANICS: &str = "RINGCAT_TEST_PANIC";

// covers: daemon
#[test]
fn a_panic_gives_the_terminal_back_before_its_message() {
    if std::env::var_os(PANICS).is_some() {
        ethercat::screen::restore_at_panic();
        // It is not given back in the usual way.
        std::mem::forget(Keys::start());
        ethercat::screen::put(ethercat::screen::BEGIN);
        panic!("on purpose");
    }
    let bench = Bench::start(vec![ring(2, false)]);
    let own = std::env::current_exe().expect("a test has a file");
    let name = "terminal::a_panic_gives_the_terminal_back_before_its_message";
    let shown = in_terminal(
        &bench,
        &format!("{PANICS}=1 {} --exact {name} --nocapture --test-threads 1; stty -a > after", own.display()),
    );
    let left = shown.rsplit("\u{1b}[?1049h\u{1b}[?25l").next().expect("a part");
    assert!(left.starts_with("\u{1b}[?25h\u{1b}[?1049l") && left.contains("on purpose"), "{shown:?}");
    assert!(is_usual(&std::fs::read_to_string(bench.directory.join("after")).expect("it is there")));
}

/// Whether `stty -a` shows a terminal that edits lines.
fn is_usual(settings: &str) -> bool {
    ["icanon", "echo", "isig"].iter().all(|wanted| settings.split_whitespace().any(|word| word == *wanted))
}

/// The table leaves the alternate screen.
const LEFT: &str = "\u{1b}[?25h\u{1b}[?1049l";
/// The table begins there.
const DRAWN: &str = "\u{1b}[?1049h\u{1b}[?25l\u{1b}[HMaster0  idle";

/// What is in a file of the shell.
fn file(bench: &Bench, name: &str) -> String {
    std::fs::read_to_string(bench.directory.join(name)).unwrap_or_default()
}

/// Sends a signal to the process whose number the shell has written.
fn kill(bench: &Bench, signal: &str) {
    let sent = Command::new("kill").args([signal, file(bench, "pid").trim()]).status();
    assert!(sent.expect("it is there").success());
}

/// `stty` on the terminal of the shell, from outside.
fn stty(bench: &Bench, arguments: &[&str]) -> String {
    let done = Command::new("stty").args(["-F", file(bench, "tty").trim()]).args(arguments).output();
    String::from_utf8_lossy(&done.expect("coreutils are there").stdout).into_owned()
}

// covers: daemon
#[test]
fn a_live_table_that_is_stopped_gives_the_terminal_back_and_is_drawn_again() {
    let bench = Bench::start(vec![ring(2, false)]);
    let sim = bench.directory.join("sim.toml");
    std::fs::write(&sim, "[[device]]\ntype = \"digital-input-8\"\n").expect("it can be written");
    // With the daemon that runs, and with one of its own.
    let commands = ["$E watch".to_owned(), format!("$E watch --sim {}", sim.display())];
    for command in &commands[..if has_daemon() { 2 } else { 1 }] {
        for name in ["pid", "stopped", "again", "after"] {
            let _ = std::fs::remove_file(bench.directory.join(name));
        }
        let shell = format!("set -m; sh -c 'echo $$ > pid; exec {command}'; stty -a > stopped; fg > /dev/null");
        // By a signal, and by the key.
        let last = "stty -a > again; fg > /dev/null; stty -a > after";
        let mut terminal = Terminal::start(&bench, &format!("{shell}; {last}"));
        let at = terminal.wait_for_all(&[DRAWN], 0);
        kill(&bench, "-TSTP");
        let at = terminal.wait_for_all(&[LEFT, DRAWN], at);
        assert!(is_usual(&file(&bench, "stopped")), "{command}: {}", file(&bench, "stopped"));
        terminal.press(b"\x1a");
        terminal.wait_for_all(&[LEFT, DRAWN], at);
        assert!(is_usual(&file(&bench, "again")), "{command}: {}", file(&bench, "again"));
        kill(&bench, "-QUIT");
        let (shown, _) = terminal.end();
        assert!(shown.ends_with(LEFT), "{command}: {shown:?}");
        assert!(is_usual(&file(&bench, "after")), "{command}: {}", file(&bench, "after"));
    }
}

// covers: daemon
#[test]
fn a_live_table_takes_the_terminal_again_after_sigstop() {
    // It cannot be received. Without job control: the shell would see that the table is stopped.
    let bench = Bench::start(vec![ring(2, false)]);
    let terminal = Terminal::start(&bench, "sh -c 'echo $$ > pid; exec $E watch'; stty -a > after");
    let at = terminal.wait_for_all(&[DRAWN], 0);
    kill(&bench, "-STOP");
    let stat = format!("/proc/{}/stat", file(&bench, "pid").trim());
    bench.wait_until("it stops", || std::fs::read_to_string(&stat).is_ok_and(|stat| stat.contains(") T ")));
    stty(&bench, &["sane"]);
    assert!(is_usual(&stty(&bench, &["-a"])));
    kill(&bench, "-CONT");
    bench.wait_until("the terminal is taken again", || stty(&bench, &["-a"]).contains("-icanon"));
    terminal.wait_for_all(&[DRAWN], at);
    kill(&bench, "-TERM");
    let (shown, _) = terminal.end();
    assert!(shown.ends_with(LEFT), "{shown:?}");
    assert!(is_usual(&file(&bench, "after")), "{}", file(&bench, "after"));
}

// covers: daemon
#[test]
fn a_table_in_a_pipe_is_printed_once_idle_and_beside_an_application() {
    let bench = Bench::start_beside_a_waiting_master(vec![ring(3, true)]);
    let idle = bench.good(&["watch"]);
    assert!(
        idle.starts_with("Master0  idle\n  ring        closed\n  links       MAIN 3 slaves, REDUNDANT 0 slaves\n"),
        "{idle}"
    );
    assert!(idle.contains("\n\nMaster1  not shown: master 1 is not driven: "), "{idle}");
    assert!(idle.matches("  PREOP  +  ").count() == 3 && !idle.contains('\u{1b}'), "{idle}");
    assert!(!idle.contains("Domain") && !idle.contains("cycles"), "{idle}");
    let _driver = Driver::start(&bench, |found| automatic(found, CYCLE));
    let shown = || bench.good(&["watch", "-m0", "--once"]);
    bench.wait_until("OP", || shown().matches("  OP  +  ").count() == 3);
    bench.wait_until("its domain", || shown().contains("  Domain0     working counter "));
    let active = shown();
    println!("{active}");
    let title = format!("Master0  operation, \"application\" (process {})\n", std::process::id());
    assert!(active.starts_with(&title), "{active}");
    assert!(active.contains(" done, ") && active.contains("  frames      "), "{active}");
    assert!(active.lines().all(|line| line.len() <= 80), "{active}");
    let terminal = Terminal::start(&bench, "$E watch --once");
    assert!(terminal.end().0.starts_with(title.trim_end()));
    let mut terminal = Terminal::start(&bench, "$E watch -m0");
    // The mean after a second request, on a busy machine at least a cycle of 1 ms.
    let begin = terminal.wait_for("  cycles      1.0", 0);
    terminal.wait_for(" ms, ", begin.saturating_sub(200));
    terminal.press(b"q");
    assert_eq!(terminal.end().1, Some(0));
    assert!(bench.bad(&["watch", "--json"]).starts_with("'watch' only prints a table: it has no --json!\n"));
}
