//! The command that grants the running program raw frames, interfaces, locked memory and real-time priority.
//!
//! Output: one line for a shell with the path of the running file. Capabilities belong to a file, and a program that
//! was built locally may not be on the PATH.

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
}
