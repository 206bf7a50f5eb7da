//! A C program with the library of this build.

use std::ffi::OsStr;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use crate::bench::Bench;

/// It declares all SubDevices, prints "op" when its cycles are complete, and ends with its input.
const SOURCE: &str = "../ffi/tests/c/lossless.c";
const PERIOD_US: &str = "4000";

/// A C program that owns the bus. It is killed at the latest when this is dropped.
pub struct CProgram(Child);

impl CProgram {
    /// Compiles and starts it in the near namespace, and waits until it is in OP; `None` without a C compiler.
    pub fn start(bench: &Bench) -> Option<CProgram> {
        if Command::new("cc").arg("--version").output().is_err() {
            println!("skipped: there is no C compiler");
            return None;
        }
        let program = compiled(&bench.place);
        let mut command = Command::new("ip");
        command.args(["netns", "exec", &bench.near]).arg(program).args([PERIOD_US, "once"]);
        command.env("RINGCAT_SOCKET", bench.socket()).stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = CProgram(command.spawn().expect("it starts"));
        let mut line = String::new();
        let stdout = child.0.stdout.as_mut().expect("it is piped");
        BufReader::new(stdout).read_line(&mut line).expect("it is text");
        assert_eq!(line, "op\n", "{:#?}", bench.lines());
        Some(child)
    }

    /// Ends it in order: it closes its master.
    pub fn end(mut self) {
        drop(self.0.stdin.take());
        drop(self.0.stdout.take());
        self.0.wait().expect("it ends");
    }
}

impl Drop for CProgram {
    fn drop(&mut self) {
        // It may have ended.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn run(command: &mut Command) {
    let status = command.stdout(Stdio::null()).status();
    assert!(status.is_ok_and(|status| status.success()), "{command:?}");
}

/// The program, with the library beside it.
fn compiled(place: &Path) -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let (prefix, program) = (place.join("prefix"), place.join("c-program"));
    run(Command::new(here.join("../ffi/install")).arg("--archive").arg(archive()).arg("--prefix").arg(&prefix));
    let lib = prefix.join("lib");
    let mut cc = Command::new("cc");
    cc.arg("-std=gnu11").arg("-I").arg(prefix.join("include")).arg(here.join(SOURCE)).arg("-o").arg(&program);
    cc.arg("-L").arg(&lib).arg(format!("-Wl,-rpath,{}", lib.display())).args(["-lethercat", "-lpthread"]);
    run(&mut cc);
    program
}

/// The newest archive of the library beside this test program: the build of the workspace makes it.
fn archive() -> PathBuf {
    let program = std::env::current_exe().expect("it is known");
    let directory = program.parent().expect("it has one");
    let files = std::fs::read_dir(directory).expect("it is there").flatten().map(|entry| entry.path());
    let is_archive = |path: &PathBuf| {
        let name = path.file_name().and_then(OsStr::to_str).unwrap_or_default();
        name.starts_with("libringcat_ffi") && name.ends_with(".a")
    };
    let age = |path: &PathBuf| std::fs::metadata(path).and_then(|data| data.modified()).expect("it has a time");
    files.filter(is_archive).max_by_key(age).expect("the library is built")
}
