//! Output of a running program, line by line, with the time of each line.

use std::io::{BufRead, BufReader, Read};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Time limit to read the output of an ended program.
const END_LIMIT: Duration = Duration::from_secs(5);

/// Lines of an output that a thread reads, so that the pipe is never full.
pub struct Said(Arc<Mutex<Vec<(Instant, String)>>>);

impl Said {
    /// Reads until the output ends.
    pub fn by(output: impl Read + Send + 'static) -> Said {
        let said = Said(Arc::default());
        let lines = said.0.clone();
        std::thread::spawn(move || {
            for line in BufReader::new(output).lines().map_while(Result::ok) {
                lines.lock().unwrap_or_else(PoisonError::into_inner).push((Instant::now(), line));
            }
        });
        said
    }

    /// Lines that came between two moments.
    pub fn between(&self, begin: Instant, end: Instant) -> Vec<(Instant, String)> {
        let lines = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        lines.iter().filter(|(at, _)| (begin..end).contains(at)).cloned().collect()
    }

    /// The output so far.
    pub fn so_far(&self) -> String {
        let lines = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        lines.iter().map(|(_, line)| format!("{line}\n")).collect()
    }

    /// The whole output, which has to end soon.
    pub fn whole(&self) -> String {
        let until = Instant::now() + END_LIMIT;
        // The reading thread shares the lines until the output ends.
        while Arc::strong_count(&self.0) > 1 && Instant::now() < until {
            std::thread::sleep(Duration::from_millis(5));
        }
        self.so_far()
    }
}
