//! Lines on the standard output and the standard error output, whose readers may have left (`program | head`).
//!
//! `println!` and `eprintln!` panic there. Hidden characters of the text are shown as in [`visible`].

use std::io::{self, ErrorKind, Write};

use crate::visible::visible;

/// Prints a line on the standard output. A reader that has left is no error.
///
/// # Errors
/// The output cannot be written, for example because a disk is full.
pub fn line(text: &str) -> io::Result<()> {
    without_a_reader(put(&mut io::stdout().lock(), text))
}

/// Prints a line on the standard error output. Errors are ignored: there is no place left to report them.
pub fn error_line(text: &str) {
    let _ = put(&mut io::stderr().lock(), text);
}

fn put(out: &mut impl Write, text: &str) -> io::Result<()> {
    out.write_all(format!("{}\n", visible(text)).as_bytes())
}

fn without_a_reader(written: io::Result<()>) -> io::Result<()> {
    match written {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        written => written,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: daemon
    #[test]
    fn a_reader_that_has_left_is_no_error_and_a_full_disk_is_one() {
        let (reader, mut writer) = io::pipe().expect("a pipe");
        drop(reader);
        assert!(put(&mut writer, "a").is_err_and(|error| error.kind() == ErrorKind::BrokenPipe));
        assert!(without_a_reader(put(&mut writer, "a")).is_ok());
        let mut full = std::fs::OpenOptions::new().write(true).open("/dev/full").expect("Linux has it");
        assert!(without_a_reader(put(&mut full, "a")).is_err_and(|error| error.kind() == ErrorKind::StorageFull));
    }

    // covers: daemon
    #[test]
    fn a_line_has_no_hidden_characters() {
        let mut out = Vec::new();
        put(&mut out, "a\u{1b}b").expect("memory");
        assert_eq!(out, b"a\\u{1b}b\n");
    }
}
