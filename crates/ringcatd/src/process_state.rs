//! What the kernel reports about the process of an owner before its end is detected elsewhere.
//!
//! The end of a stream and a pidfd wait until the memory of a process is torn down, and until its core is written. The
//! flags of the process show at once that a signal ends it (`PF_SIGNALED`, `PF_DUMPCORE` of `linux/sched.h`, field 9 of
//! `/proc/PID/stat`). A heartbeat could not distinguish a process that ends from one that waits for a processor.

use std::fs::File;
use std::io::{self, Read, Seek};

/// Flags of a process that a signal ends, or that writes its core.
const IS_ENDED: u32 = 0x0000_0400 | 0x0000_0200;
/// More than the fields that are read: a name has at most 64 bytes.
const LONGEST: usize = 512;

/// State of a process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProcessState {
    /// It runs, or waits for something.
    Runs,
    /// A signal or a debugger has stopped it.
    Stopped,
    /// A signal ends it: it executes none of its own code any more.
    Ends,
}

/// Reads the state of a process again and again.
#[derive(Debug)]
pub struct ProcessFile(File);

impl ProcessFile {
    /// Opens the state of this process.
    ///
    /// # Errors
    /// There is no such process, or this user may not see it.
    pub fn open(pid: u32) -> io::Result<ProcessFile> {
        Ok(ProcessFile(File::open(format!("/proc/{pid}/stat"))?))
    }

    /// Its state now; [`ProcessState::Ends`] when it is gone, `None` if the kernel reports another state.
    pub fn look(&mut self) -> Option<ProcessState> {
        let mut bytes = [0; LONGEST];
        let read = self.0.rewind().and_then(|()| self.0.read(&mut bytes));
        match read {
            Ok(length) => state(&bytes[..length]),
            // The file stays open beyond the process, and has nothing to read then.
            Err(_) => Some(ProcessState::Ends),
        }
    }
}

/// The state in the text of `/proc/PID/stat`. The name of the program may have any characters.
fn state(text: &[u8]) -> Option<ProcessState> {
    let behind = text.iter().rposition(|byte| *byte == b')')? + 1;
    let fields = std::str::from_utf8(text.get(behind..)?).ok()?;
    let mut fields = fields.split_ascii_whitespace();
    let letter = fields.next()?;
    let flags: u32 = fields.nth(5)?.parse().ok()?;
    Some(match letter {
        _ if flags & IS_ENDED != 0 => ProcessState::Ends,
        "T" | "t" => ProcessState::Stopped,
        _ => ProcessState::Runs,
    })
}

#[cfg(test)]
mod tests {
    use std::process::{Child, Command};
    use std::time::{Duration, Instant};

    use super::*;

    fn sleeper() -> (Child, ProcessFile) {
        let child = Command::new("sleep").arg("60").spawn().expect("sleep is there");
        let file = ProcessFile::open(child.id()).expect("it runs");
        (child, file)
    }

    fn wait_for(file: &mut ProcessFile, expected: ProcessState) {
        let begin = Instant::now();
        while file.look() != Some(expected) {
            assert!(begin.elapsed() < Duration::from_secs(10), "{:?}", file.look());
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    fn signal(child: &Child, name: &str) {
        let sent = Command::new("kill").args([name, &child.id().to_string()]).status();
        assert!(sent.is_ok_and(|status| status.success()));
    }

    // covers: daemon
    #[test]
    fn a_process_is_seen_running_stopped_and_ending() {
        let (mut child, mut file) = sleeper();
        wait_for(&mut file, ProcessState::Runs);
        signal(&child, "-STOP");
        wait_for(&mut file, ProcessState::Stopped);
        signal(&child, "-CONT");
        wait_for(&mut file, ProcessState::Runs);
        signal(&child, "-KILL");
        wait_for(&mut file, ProcessState::Ends);
        child.wait().expect("it has ended");
        wait_for(&mut file, ProcessState::Ends);
    }

    // covers: daemon
    #[test]
    fn a_program_with_any_name_is_read_and_other_text_is_no_state() {
        let text = |name: &str, letter: &str, flags: u32| format!("7 ({name}) {letter} 1 7 7 0 -1 {flags} 103 0\n");
        for name in ["app", "a) R 1 (b", "\u{e9}) "] {
            assert_eq!(state(text(name, "S", 0x0040_0000).as_bytes()), Some(ProcessState::Runs));
            assert_eq!(state(text(name, "t", 0).as_bytes()), Some(ProcessState::Stopped));
            assert_eq!(state(text(name, "D", 0x0040_0400).as_bytes()), Some(ProcessState::Ends));
        }
        let whole = text("app", "S", 0);
        for length in 0..whole.len() {
            state(&whole.as_bytes()[..length]);
        }
        assert_eq!(state(b"7 (app) S 1 7 7 0 -1 x"), None);
        assert_eq!(state(&[0xFF; 40]), None);
    }
}
