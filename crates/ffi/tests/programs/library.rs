//! The library as the tests link it, and programs that run with it.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

/// The directory of this crate.
pub fn here() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The directory of the repository.
pub fn root() -> PathBuf {
    here().join("../..")
}

/// A directory for what the tests make.
fn workshop() -> PathBuf {
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

/// The shared library; `None` without a C compiler.
pub fn library() -> Option<&'static Path> {
    static LIBRARY: OnceLock<Option<PathBuf>> = OnceLock::new();
    let linked = LIBRARY.get_or_init(|| {
        if Command::new("cc").arg("--version").output().is_err() {
            println!("skipped: there is no C compiler");
            return None;
        }
        let library = workshop().join("libethercat.so.1");
        let mut cc = Command::new("cc");
        cc.args(["-shared", "-Wl,--whole-archive"]).arg(archive()).arg("-Wl,--no-whole-archive");
        cc.arg(format!("-Wl,--version-script={}", here().join("libethercat.map").display()));
        cc.args(["-Wl,-soname,libethercat.so.1", "-Wl,-z,nodelete", "-Wl,-z,defs", "-Wl,--gc-sections"]);
        cc.arg("-o").arg(&library).args(["-lpthread", "-ldl", "-lm", "-lgcc_s", "-lc"]);
        run(&mut cc);
        Some(library)
    });
    linked.as_deref()
}

/// Compiles a C program with strict warnings; `None` without a C compiler.
pub fn program(source: &Path, arguments: &[&str]) -> Option<PathBuf> {
    let library = library()?;
    let name = source.file_stem().expect("a file name");
    let program = workshop().join(name);
    let mut cc = Command::new("cc");
    cc.args(["-std=gnu11", "-g", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]).args(arguments);
    cc.arg("-I").arg(here().join("include")).arg(source).arg("-o").arg(&program);
    cc.arg(library).arg(format!("-Wl,-rpath,{}", workshop().display())).arg("-lpthread");
    run(&mut cc);
    Some(program)
}

/// Runs a program on a simulated segment; its output, and whether it succeeded with its errors.
pub fn on_segment(program: &Path, segment: &Path, arguments: &[&str]) -> (String, Result<(), String>) {
    let mut command = Command::new("timeout");
    command.arg("120").arg(program).args(arguments).env("RINGCAT_SIM", segment);
    let Output { status, stdout, stderr } = command.output().expect("the program runs");
    let errors = format!("{status}\n{}", String::from_utf8_lossy(&stderr));
    (String::from_utf8_lossy(&stdout).into_owned(), if status.success() { Ok(()) } else { Err(errors) })
}
