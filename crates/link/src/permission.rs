//! The command that grants the running program raw frames, interfaces, locked memory and real-time priority; whether it
//! may write to a file.
//!
//! Output: one line for a shell with the path of the running file. Capabilities belong to a file, and a program that
//! was built locally may not be on the PATH.

use std::ffi::CString;
use std::io;
use std::os::unix::ffi::OsStrExt;
use std::path::Path;

/// The capabilities that the program needs, see `docs/links.md`.
const CAPABILITIES: &str = "cap_net_raw,cap_net_admin,cap_ipc_lock,cap_sys_nice=ep";

/// The command line for the running program.
pub fn setcap_command() -> String {
    match std::env::current_exe() {
        Ok(program) => for_program(&program),
        Err(_) => format!("sudo setcap {CAPABILITIES} $(which ringcat)"),
    }
}

fn for_program(program: &Path) -> String {
    let path = program.display().to_string();
    let plain = path.bytes().all(|b| b.is_ascii_alphanumeric() || b"/._+-".contains(&b));
    let word = if plain { path } else { format!("'{}'", path.replace('\'', "'\\''")) };
    format!("sudo setcap {CAPABILITIES} {word}")
}

/// Whether this process may write to a file or device, without opening it.
///
/// # Errors
/// It is not there, or cannot be reached.
pub fn may_write(path: &Path) -> io::Result<bool> {
    let path = CString::new(path.as_os_str().as_bytes()).map_err(|_| io::Error::from(io::ErrorKind::NotFound))?;
    // SAFETY: the pointer refers to a live null-terminated string.
    if unsafe { libc::faccessat(libc::AT_FDCWD, path.as_ptr(), libc::W_OK, libc::AT_EACCESS) } == 0 {
        return Ok(true);
    }
    let error = io::Error::last_os_error();
    match error.raw_os_error() {
        Some(libc::EACCES | libc::EPERM | libc::EROFS) => Ok(false),
        _ => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_names_the_file_that_runs() {
        let program = std::env::current_exe().expect("a test has a file");
        let line = setcap_command();
        assert!(line.starts_with("sudo setcap cap_net_raw,cap_net_admin,cap_ipc_lock,cap_sys_nice=ep "), "{line}");
        assert!(line.trim_end_matches('\'').ends_with(&program.display().to_string()), "{line}");
    }

    #[test]
    fn a_path_that_a_shell_would_split_is_quoted() {
        let line = |path: &str| for_program(Path::new(path)).split_once("=ep ").map(|(_, word)| word.to_owned());
        assert_eq!(line("/opt/ringcat-1.0/bin/ringcat").as_deref(), Some("/opt/ringcat-1.0/bin/ringcat"));
        assert_eq!(line("/home/a b/ringcat").as_deref(), Some("'/home/a b/ringcat'"));
        assert_eq!(line("/home/it's/ringcat").as_deref(), Some("'/home/it'\\''s/ringcat'"));
    }

    // covers: bench
    #[test]
    fn whether_a_file_may_be_written_is_known_without_opening_it() {
        assert_eq!(may_write(Path::new("/dev/null")).ok(), Some(true));
        // Root may write to more.
        let opened = std::fs::File::options().write(true).open("/proc/version");
        assert_eq!(may_write(Path::new("/proc/version")).ok(), Some(opened.is_ok()));
        for missing in ["/no/such", "with\0end"] {
            assert_eq!(may_write(Path::new(missing)).map_err(|e| e.kind()), Err(io::ErrorKind::NotFound), "{missing}");
        }
    }
}
