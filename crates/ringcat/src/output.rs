//! Standard output that somebody may close: `ringcat demo | head` goes on to its end without a reader.

use std::fmt::Arguments;
use std::io::{Write, stdout};

/// Writes text and shows it at once. What nobody reads any more is no error.
pub fn write(text: Arguments<'_>) {
    let mut out = stdout().lock();
    // The only error that is likely is that nobody reads any more.
    let _ = out.write_fmt(text).and_then(|()| out.flush());
}

/// Like `println!`, without a panic on a closed pipe.
macro_rules! say {
    () => { $crate::output::write(format_args!("\n")) };
    ($($text:tt)+) => { $crate::output::write(format_args!("{}\n", format_args!($($text)+))) };
}

pub(crate) use say;
