//! A bar on the standard error while a command waits for something that takes seconds.
//!
//! Only a terminal gets one, and it is erased when the command ends by itself. Its progress is requested over a second
//! connection.

use std::io::{self, IsTerminal, Write};
use std::os::fd::AsFd;
use std::path::Path;
use std::time::Duration;

use ringcat_control::Client;
use ringcat_control::message::{Answer, Query};
use ringcat_control::tool::{ToolAnswer, ToolQuery, TransferLine, TransferWork};
use ringcat_link::terminal;

use crate::append::append;

/// Interval of progress requests. A shorter transfer has no bar.
pub const INTERVAL: Duration = Duration::from_millis(300);
/// Columns of the bar itself.
const WIDTH: u64 = 30;
/// Columns of a terminal that does not report its size.
const USUAL_COLUMNS: usize = 80;

/// A transfer of a SubDevice.
#[derive(Clone, Copy, Debug)]
pub struct Transfer {
    /// Number of the master.
    pub master: u32,
    /// Position of the SubDevice.
    pub position: u16,
    /// What it does.
    pub work: TransferWork,
}

/// Whether the standard error shows bars.
pub fn is_shown() -> bool {
    io::stderr().is_terminal()
}

/// The bar of a transfer.
pub struct Bar<'a> {
    name: &'static str,
    transfer: Transfer,
    /// Socket of the daemon, until the second connection was tried.
    socket: Option<&'a Path>,
    second: &'a mut Option<Client>,
    is_drawn: bool,
}

impl<'a> Bar<'a> {
    /// The bar of a command; `second` is the connection for progress requests. If there is none yet, the first request
    /// connects it to `socket`, if given.
    pub fn new(
        name: &'static str,
        transfer: Transfer,
        socket: Option<&'a Path>,
        second: &'a mut Option<Client>,
    ) -> Bar<'a> {
        Bar { name, transfer, socket, second, is_drawn: false }
    }

    /// Shows the progress of the transfer.
    pub fn draw(&mut self, output: &mut dyn Write) {
        let Some(line) = self.look() else { return };
        let columns = terminal::size(io::stderr().as_fd()).map_or(USUAL_COLUMNS, |(columns, _)| columns.into());
        // Without the last column: a terminal would begin a line behind it.
        let text: String = text(self.name, &line).chars().take(columns.saturating_sub(1)).collect();
        // Errors are ignored: the standard error may be closed.
        let _ = write!(output, "\r{text}\x1b[K").and_then(|()| output.flush());
        self.is_drawn = true;
    }

    /// Removes it.
    pub fn remove(&mut self, output: &mut dyn Write) {
        if std::mem::take(&mut self.is_drawn) {
            let _ = output.write_all(b"\r\x1b[K").and_then(|()| output.flush());
        }
    }

    /// Progress of the transfer; `None` while it has not begun.
    fn look(&mut self) -> Option<TransferLine> {
        let Transfer { master, position, work } = self.transfer;
        // The daemon may accept no more clients: there is no bar.
        if let (None, Some(socket)) = (&self.second, self.socket.take()) {
            *self.second = Client::connect(socket, "ethercat").ok();
        }
        let query = Query::Tool(ToolQuery::Transfers { position });
        match self.second.as_mut()?.ask(master, query, Vec::new()) {
            Ok((Answer::Tool(ToolAnswer::Transfers(lines)), _)) => lines.into_iter().find(|line| line.work == work),
            // The answer to the command contains the reason. Another request could wait as long as this one.
            _ => {
                *self.second = None;
                None
            }
        }
    }
}

fn text(name: &str, line: &TransferLine) -> String {
    let TransferLine { done, total, .. } = *line;
    let Some(total) = total.filter(|total| *total > 0) else { return format!("{name}  {done} bytes") };
    let done = done.min(total);
    let filled = (u128::from(done) * u128::from(WIDTH) / u128::from(total)) as usize;
    let percent = u128::from(done) * 100 / u128::from(total);
    let mut text = format!("{name}  [");
    text.extend((0..WIDTH as usize).map(|at| if at < filled { '#' } else { '-' }));
    append!(text, "] {percent:>3} %  {done}/{total} bytes");
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: daemon
    #[test]
    fn a_bar_shows_a_share_if_the_total_is_known() {
        let line = |done, total| TransferLine { work: TransferWork::SiiWrite, done, total };
        let wanted = "sii_write  [###############---------------]  50 %  1024/2048 bytes";
        assert_eq!(text("sii_write", &line(1024, Some(2048))), wanted);
        assert!(text("a", &line(0, Some(7))).contains("[------------------------------]   0 %  0/7"));
        assert!(text("a", &line(u64::MAX, Some(u64::MAX))).contains("[##############################] 100 %"));
        assert_eq!(text("foe_read", &line(12, None)), "foe_read  12 bytes");
        assert_eq!(text("foe_read", &line(0, Some(0))), "foe_read  0 bytes");
        let longest = text("foe_write", &line(16 << 20, Some(16 << 20)));
        assert!(longest.len() < 80, "{longest}");
    }
}
