//! Lines for the operator on the standard error, and in the journal of the system.
//!
//! A thread writes them: a terminal that is stopped, or a pipe that nothing reads, holds up this thread alone. Lines
//! that wait are bounded in number; what does not fit is counted.

use std::collections::VecDeque;
use std::fmt;
use std::io::Write;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use ringcat_link::operator::{OperatorLines, Priority, lost_lines};

/// Name of the program, before its own lines and in the journal.
const NAME: &str = "ringcatd";
/// Lines that wait to be written.
const MOST_WAITING: usize = 256;
/// Longest wait of the end of the program for its last lines.
const LAST: Duration = Duration::from_secs(1);

static LOG: Log = Log::new();

/// Lines on their way.
struct Log {
    lines: Mutex<Lines>,
    changed: Condvar,
}

struct Lines {
    waiting: VecDeque<(Priority, String)>,
    lost: u64,
    has_thread: bool,
    /// The thread writes a line.
    is_writing: bool,
}

impl Log {
    const fn new() -> Log {
        let lines = Lines { waiting: VecDeque::new(), lost: 0, has_thread: false, is_writing: false };
        Log { lines: Mutex::new(lines), changed: Condvar::new() }
    }

    fn lines(&self) -> MutexGuard<'_, Lines> {
        self.lines.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn push(&self, priority: Priority, line: String) {
        let mut lines = self.lines();
        if lines.waiting.len() < MOST_WAITING {
            lines.waiting.push_back((priority, line));
            self.changed.notify_all();
        } else {
            lines.lost += 1;
        }
    }

    /// Body of the thread.
    fn write(&self, to: &OperatorLines, mut out: impl Write) {
        let mut lines = self.lines();
        loop {
            let lost = std::mem::take(&mut lines.lost);
            let next = match lost {
                0 => lines.waiting.pop_front(),
                _ => Some((Priority::Warning, format!("{NAME}: {}", lost_lines(lost)))),
            };
            let Some((priority, line)) = next else {
                lines.is_writing = false;
                self.changed.notify_all();
                lines = self.changed.wait(lines).unwrap_or_else(PoisonError::into_inner);
                continue;
            };
            lines.is_writing = true;
            drop(lines);
            to.write_and_wait(priority, &line, &mut out);
            lines = self.lines();
        }
    }

    fn flush(&self, limit: Duration) {
        let begin = Instant::now();
        let mut lines = self.lines();
        while lines.has_thread && (lines.is_writing || !lines.waiting.is_empty()) {
            let left = limit.saturating_sub(begin.elapsed());
            if left.is_zero() {
                return;
            }
            lines = self.changed.wait_timeout(lines, left).unwrap_or_else(PoisonError::into_inner).0;
        }
    }
}

/// A line of the daemon itself. It is written soon; the caller does not wait.
pub fn say(line: fmt::Arguments<'_>) {
    print(Priority::Info, format!("{NAME}: {line}"));
}

/// A line as it is. It is written soon; the caller does not wait.
pub fn print(priority: Priority, line: String) {
    let is_first = !std::mem::replace(&mut LOG.lines().has_thread, true);
    if is_first {
        let body = || LOG.write(&OperatorLines::new(NAME, |name| std::env::var(name).ok()), std::io::stderr());
        let thread = thread::Builder::new().name("log".into()).spawn(body);
        // If the thread cannot be started, the next line tries again.
        LOG.lines().has_thread = thread.is_ok();
    }
    LOG.push(priority, line);
}

/// Waits until all lines are written, a second at most: to be called at the end of the program.
pub fn flush() {
    LOG.flush(LAST);
}

#[cfg(test)]
mod tests {
    use std::io::{self, BufRead, BufReader};
    use std::sync::Arc;

    use super::*;

    // covers: daemon
    #[test]
    fn a_reader_that_is_stopped_holds_up_no_line_and_later_sees_how_many_are_lost() {
        let log = Arc::new(Log::new());
        let (reader, writer) = io::pipe().expect("a pipe");
        log.lines().has_thread = true;
        let writing = log.clone();
        let no_journal = OperatorLines::new(NAME, |_| Some(String::new()));
        thread::spawn(move || writing.write(&no_journal, writer));
        let begin = Instant::now();
        // More than a pipe and the queue hold.
        for _ in 0..1000 {
            log.push(Priority::Info, "x".repeat(1000));
        }
        log.flush(Duration::from_millis(50));
        assert!(begin.elapsed() < Duration::from_secs(5), "{:?}", begin.elapsed());
        let (mut written, mut lost) = (0, 0);
        let mut lines = BufReader::new(reader).lines();
        while written + lost < 1000 {
            let line = lines.next().expect("there are more").expect("it is text");
            let text =
                line.strip_prefix("ringcatd: ").and_then(|text| text.split_once(" were lost: nothing took them"));
            match text.and_then(|(count, _)| count.split_once(' ')) {
                Some((number, _)) => lost += number.parse::<u64>().expect("a number"),
                None => written += 1,
            }
        }
        assert!(lost > 0 && written + lost == 1000, "{written} written, {lost} lost");
    }
}
