//! A page that is drawn again and again at the same place of a terminal.

use std::fs::File;
use std::io::{self, Write};
use std::os::fd::AsFd;

use ringcat_control::visible;
use ringcat_link::terminal;

use crate::append::append;

/// Columns and rows of a terminal that does not report its size.
const USUAL: (u16, u16) = (80, 24);

/// Written before the first page: the alternate screen, without a cursor.
pub const BEGIN: &str = "\x1b[?1049h\x1b[?25l";
/// Written at the end: the screen that was there before, with a cursor.
pub const END: &str = "\x1b[?25h\x1b[?1049l";

/// Columns and rows of the terminal at the standard output.
pub fn size() -> (u16, u16) {
    terminal::size(io::stdout().as_fd()).unwrap_or(USUAL)
}

/// Writes to the terminal at once, past buffers and locks. Errors are ignored: it may be closed.
pub fn put(text: &str) {
    if let Ok(terminal) = io::stdout().as_fd().try_clone_to_owned() {
        let _ = File::from(terminal).write_all(text.as_bytes());
    }
}

/// From now on a panic leaves the alternate screen and gives the terminal its settings back before its message.
pub fn restore_at_panic() {
    let before = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        terminal::restore();
        put(END);
        before(panic);
    }));
}

/// Overwrites the screen with lines, cut at the last column. If they do not fit, the last row has the number of the
/// rest.
pub fn page(lines: &[String], (columns, rows): (u16, u16)) -> String {
    // A terminal may erase the last column together with what is behind it.
    let (columns, rows) = (usize::from(columns).saturating_sub(1), usize::from(rows).max(1));
    let shown = if lines.len() <= rows { lines.len() } else { rows - 1 };
    let mut text = "\x1b[H".to_owned();
    for (row, line) in lines[..shown].iter().enumerate() {
        text += if row == 0 { "" } else { "\r\n" };
        text.extend(visible(line.trim_end_matches('\n')).chars().take(columns));
        text += "\x1b[K";
    }
    if shown < lines.len() {
        let behind = format!("... {} more lines", lines.len() - shown);
        let behind: String = behind.chars().take(columns).collect();
        append!(text, "{}{behind}\x1b[K", if shown == 0 { "" } else { "\r\n" });
    }
    text + "\x1b[J"
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: daemon
    #[test]
    fn a_page_fits_the_terminal_and_says_what_it_leaves_out() {
        let lines = ["a title".to_owned(), "a\u{1b}b".to_owned(), "third".to_owned()];
        let all = "\x1b[Ha title\x1b[K\r\na\\u{1b}b\x1b[K\r\nthird\x1b[K\x1b[J";
        assert_eq!(page(&lines, (80, 3)), all);
        assert_eq!(page(&lines, (4, 2)), "\x1b[Ha t\x1b[K\r\n...\x1b[K\x1b[J");
        assert_eq!(page(&lines, (80, 2)), "\x1b[Ha title\x1b[K\r\n... 2 more lines\x1b[K\x1b[J");
        assert_eq!(page(&lines, (80, 1)), "\x1b[H... 3 more lines\x1b[K\x1b[J");
        assert_eq!(page(&[], (80, 24)), "\x1b[H\x1b[J");
    }
}
