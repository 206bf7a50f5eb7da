//! Standard output that somebody may close: `ringcat demo | head` goes on to its end without a reader.
//!
//! A full disk is another matter: what was printed is not there, so the command has failed.

use std::fmt::Arguments;
use std::io::{self, ErrorKind, Write, stdout};
use std::sync::OnceLock;

/// The first error that is no closed pipe.
static FAILURE: OnceLock<io::Error> = OnceLock::new();

/// Writes text and shows it at once. A closed pipe is no error.
pub fn write(text: Arguments<'_>) {
    let mut out = stdout().lock();
    if let Err(error) = out.write_fmt(text).and_then(|()| out.flush())
        && error.kind() != ErrorKind::BrokenPipe
    {
        // Further ones are of the same kind.
        let _ = FAILURE.set(error);
    }
}

/// Why something that was to be printed was not.
pub fn failure() -> Option<&'static io::Error> {
    FAILURE.get()
}

/// `1 copy`, `2 copies`.
pub fn counted(count: usize, one: &str, more: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { more })
}

/// Like `println!`, without a panic on a closed pipe.
macro_rules! say {
    () => { $crate::output::write(format_args!("\n")) };
    ($($text:tt)+) => { $crate::output::write(format_args!("{}\n", format_args!($($text)+))) };
}

pub(crate) use say;
