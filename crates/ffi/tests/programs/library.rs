//! The library as the tests link it, and programs that run with it.

use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Output, Stdio};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

/// A program says what a test waits for within this time, also on a busy machine.
const LONG: Duration = Duration::from_secs(60);

/// The directory of this crate.
pub fn here() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The directory of the repository.
pub fn root() -> PathBuf {
    here().join("../..")
}

/// A directory for what the tests make.
pub fn workshop() -> PathBuf {
    let place = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("ffi");
    std::fs::create_dir_all(&place).expect("a directory for the tests");
    place
}

/// The archive: the newest one beside this test program.
fn archive() -> PathBuf {
    let program = std::env::current_exe().expect("a path of this program");
    let mut found: Vec<PathBuf> = Vec::new();
    for place in program.ancestors().skip(1).take(2) {
        let files = std::fs::read_dir(place).expect("the directory of this program").flatten();
        found.extend(files.map(|file| file.path()).filter(|path| {
            let name = path.file_name().and_then(|name| name.to_str()).unwrap_or("");
            name.starts_with("libringcat_ffi") && name.ends_with(".a")
        }));
    }
    let age = |path: &PathBuf| std::fs::metadata(path).and_then(|data| data.modified()).expect("a time");
    found.into_iter().max_by_key(age).expect("the archive of this crate is built with its tests")
}

/// Runs a command, which has to succeed.
pub fn run(command: &mut Command) -> String {
    let Output { status, stdout, stderr } = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let text = String::from_utf8_lossy(&stdout).into_owned();
    assert!(status.success(), "{command:?}: {status}\n{text}\n{}", String::from_utf8_lossy(&stderr));
    text
}

/// An installation of the archive of these tests.
pub fn installation() -> Command {
    let mut install = Command::new(here().join("install"));
    install.arg("--archive").arg(archive());
    install
}

/// Where `crates/ffi/install` has put everything; `None` without a C compiler.
pub fn installed() -> Option<&'static Path> {
    static PREFIX: OnceLock<Option<PathBuf>> = OnceLock::new();
    let installed = PREFIX.get_or_init(|| {
        if Command::new("cc").arg("--version").output().is_err() {
            println!("skipped: there is no C compiler");
            return None;
        }
        let prefix = workshop().join("prefix");
        run(installation().arg("--prefix").arg(&prefix));
        Some(prefix)
    });
    installed.as_deref()
}

/// Installs everything for a prefix of a running system below a directory, as packages do; `None` without a C compiler.
pub fn installed_below(directory: &Path, prefix: &str) -> Option<()> {
    installed()?;
    run(installation().args(["--prefix", prefix]).arg("--destdir").arg(directory));
    Some(())
}

/// The shared library; `None` without a C compiler.
pub fn library() -> Option<PathBuf> {
    Some(installed()?.join("lib/libethercat.so.1"))
}

/// Compiles a C program with strict warnings; `None` without a C compiler.
pub fn program(source: &Path, arguments: &[&str]) -> Option<PathBuf> {
    Some(program_with(installed()?, source, arguments))
}

/// Compiles a C program against the library that is installed there.
pub fn program_with(prefix: &Path, source: &Path, arguments: &[&str]) -> PathBuf {
    // Tests beside each other compile the same source.
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let (name, number) = (source.file_stem().expect("a file name"), COUNT.fetch_add(1, Ordering::Relaxed));
    let program = workshop().join(format!("{}-{number}", name.display()));
    let mut cc = Command::new("cc");
    cc.args(["-std=gnu11", "-g", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]).args(arguments);
    cc.arg("-I").arg(prefix.join("include")).arg(source).arg("-o").arg(&program);
    let lib = prefix.join("lib");
    cc.arg("-L").arg(&lib).arg(format!("-Wl,-rpath,{}", lib.display())).args(["-lethercat", "-lpthread", "-ldl"]);
    run(&mut cc);
    program
}

/// Runs a program on a simulated segment; its output, and whether it succeeded with its errors.
pub fn on_segment(program: &Path, segment: &Path, arguments: &[&str]) -> (String, Result<(), String>) {
    let (said, reported, status) = outputs(program, segment, arguments);
    (said, if status.success() { Ok(()) } else { Err(format!("{status}\n{reported}")) })
}

/// Runs a program on a simulated segment; what it says and reports, and how it ends.
pub fn outputs(program: &Path, segment: &Path, arguments: &[&str]) -> (String, String, ExitStatus) {
    let mut command = Command::new("timeout");
    command.arg("120").arg(program).args(arguments).env("RINGCAT_SIM", segment);
    let Output { status, stdout, stderr } = command.output().expect("the program runs");
    (String::from_utf8_lossy(&stdout).into_owned(), String::from_utf8_lossy(&stderr).into_owned(), status)
}

/// Runs a program until it has said these lines, and interrupts it as Ctrl-C does; what it has said, what it has
/// reported if that is piped, and how it ends. How many cycles it needs depends on what else runs on this machine.
pub fn interrupted_after(command: &mut Command, wanted: &[&str]) -> (String, String, ExitStatus) {
    let mut child = command.stdout(Stdio::piped()).spawn().expect("it runs");
    let (stdout, stderr) = (child.stdout.take().expect("it is piped"), child.stderr.take());
    let reported = std::thread::spawn(move || {
        let mut bytes = Vec::new();
        stderr.into_iter().for_each(|mut stderr| drop(stderr.read_to_end(&mut bytes)));
        String::from_utf8_lossy(&bytes).into_owned()
    });
    let (sender, lines) = channel();
    // The test may have given up.
    std::thread::spawn(move || {
        BufReader::new(stdout).lines().map_while(Result::ok).try_for_each(|line| sender.send(line)).ok()
    });
    let (begin, mut said): (_, Vec<String>) = (Instant::now(), Vec::new());
    while !wanted.iter().all(|wanted| said.iter().any(|line| line == wanted)) {
        let Ok(line) = lines.recv_timeout(LONG.saturating_sub(begin.elapsed())) else {
            let _ = child.kill();
            panic!("{said:#?} instead of {wanted:?}: {:?}\n{}", child.wait(), reported.join().unwrap_or_default());
        };
        said.push(line);
    }
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(sent.is_ok_and(|status| status.success()));
    let status = child.wait().expect("it ends");
    // Until the end of its output.
    said.extend(lines);
    (said.join("\n"), reported.join().expect("no panic"), status)
}

/// Copies a program. By another process: a descriptor of this one that is open for writing may be in a child that
/// another test starts, and a program that is open for writing cannot be started.
pub fn copy_program(from: &Path, to: &Path) -> bool {
    Command::new("cp").arg("--").arg(from).arg(to).status().is_ok_and(|status| status.success())
}
