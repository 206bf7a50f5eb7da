//! Lines for the operator on the standard error.

use std::fmt;
use std::io::Write;

/// Writes a line. Where nothing takes it, it is lost: a daemon goes on without a terminal.
pub fn say(line: fmt::Arguments<'_>) {
    let _ = writeln!(std::io::stderr().lock(), "ringcatd: {line}");
}
