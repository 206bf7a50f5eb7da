//! The journal of the system: a datagram for each line.
//!
//! Its native protocol: fields as `NAME=value` lines. A line has no line break, so no field needs the other form.

use std::io;
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};

use super::priority::Priority;

/// Longest line; the journal would take more.
const LONGEST: usize = 4096;

/// A socket for lines to the journal.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    socket: UnixDatagram,
}

impl Journal {
    /// The journal at this path; `None` where none is.
    pub fn at(path: &Path) -> Option<Journal> {
        if !path.exists() {
            return None;
        }
        let socket = UnixDatagram::unbound().ok()?;
        socket.set_nonblocking(true).ok()?;
        Some(Journal { path: path.to_owned(), socket })
    }

    /// Sends a line. One that the journal does not take at once is lost there: it is on the standard error, too.
    pub fn send(&self, priority: Priority, identifier: &str, text: &str) {
        let datagram = datagram(priority, identifier, text);
        while let Err(error) = self.socket.send_to(&datagram, &self.path) {
            if error.kind() != io::ErrorKind::Interrupted {
                return;
            }
        }
    }
}

fn datagram(priority: Priority, identifier: &str, text: &str) -> Vec<u8> {
    let one_line = |text: &str| -> String { text.chars().map(|it| if it == '\n' { ' ' } else { it }).collect() };
    let mut text = one_line(text);
    text.truncate(text.floor_char_boundary(LONGEST));
    let (number, identifier) = (priority.number(), one_line(identifier));
    format!("PRIORITY={number}\nSYSLOG_IDENTIFIER={identifier}\nMESSAGE={text}\n").into_bytes()
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use super::*;

    // covers: links
    #[test]
    fn a_line_reaches_the_journal_as_fields_and_a_full_journal_holds_nothing_up() {
        let path = std::env::temp_dir().join(format!("ringcat-journal-{}", std::process::id()));
        assert!(Journal::at(&path).is_none(), "there is none");
        let reader = UnixDatagram::bind(&path).expect("it is free");
        let journal = Journal::at(&path).expect("it is there");
        journal.send(Priority::Warning, "ringcatd", "EtherCAT: a line\nPRIORITY=0");
        let mut bytes = [0; 200];
        let length = reader.recv(&mut bytes).expect("it is sent");
        let wanted = "PRIORITY=4\nSYSLOG_IDENTIFIER=ringcatd\nMESSAGE=EtherCAT: a line PRIORITY=0\n";
        assert_eq!(std::str::from_utf8(&bytes[..length]), Ok(wanted));
        let begin = Instant::now();
        (0..10_000).for_each(|_| journal.send(Priority::Info, "ringcatd", "more"));
        assert!(begin.elapsed() < Duration::from_secs(5), "{:?}", begin.elapsed());
        drop(reader);
        std::fs::remove_file(&path).expect("it is there");
        journal.send(Priority::Info, "ringcatd", "the journal is gone");
    }
}
