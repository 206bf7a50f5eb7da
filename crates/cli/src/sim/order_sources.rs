//! Where orders come in: lines of the standard input, and connections to a Unix socket.
//!
//! Each of these sources has a thread that reads lines and waits for the answer; the simulator takes orders between two
//! events and never waits for them.

use std::io::{self, BufRead, BufReader, Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;

use crate::output;

/// Most bytes of a line: the longest order carries the inputs of a large SubDevice.
const LONGEST_LINE: u64 = 16_384;
/// Most connections at a time.
const MOST_CONNECTIONS: usize = 32;

/// A line, and where its answer goes.
#[derive(Debug)]
pub struct Order {
    /// The line.
    pub line: String,
    /// Takes the answer. The client may be gone.
    pub answer: Sender<String>,
}

/// All sources of orders, and the orders that came in.
#[derive(Debug)]
pub struct OrderSources {
    orders: Receiver<Order>,
    socket: Option<PathBuf>,
}

impl OrderSources {
    /// Listens to the standard input and, where a path is given, to a Unix socket there. Only the user whose process
    /// this is may connect.
    ///
    /// # Errors
    /// A path that cannot be listened at.
    pub fn open(socket: Option<&Path>) -> io::Result<OrderSources> {
        let (sender, orders) = channel();
        if let Some(path) = socket {
            let listener = listen(path)?;
            let sender = sender.clone();
            thread::Builder::new().name("control socket".into()).spawn(move || accept(&listener, &sender))?;
        }
        thread::Builder::new().name("standard input".into()).spawn(move || {
            // An end of the input, or an error, ends this source and nothing else.
            let _ = serve(io::stdin().lock(), &mut io::stdout(), &sender, output::answer);
        })?;
        Ok(OrderSources { orders, socket: socket.map(Path::to_owned) })
    }

    /// The oldest order that is waiting.
    pub fn next(&self) -> Option<Order> {
        self.orders.try_recv().ok()
    }
}

impl Drop for OrderSources {
    fn drop(&mut self) {
        if let Some(path) = &self.socket {
            // It may be gone already.
            let _ = std::fs::remove_file(path);
        }
    }
}

/// A socket at this path. A socket that a killed simulator has left behind is replaced, a socket in use is not.
fn listen(path: &Path) -> io::Result<UnixListener> {
    use std::os::unix::fs::PermissionsExt;
    let listener = match UnixListener::bind(path) {
        Err(error) if error.kind() == io::ErrorKind::AddrInUse && UnixStream::connect(path).is_err() => {
            std::fs::remove_file(path)?;
            UnixListener::bind(path)?
        }
        other => other?,
    };
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o600))?;
    Ok(listener)
}

fn accept(listener: &UnixListener, sender: &Sender<Order>) {
    let open = Arc::new(());
    for mut connection in listener.incoming().flatten() {
        let (sender, held) = (sender.clone(), open.clone());
        if Arc::strong_count(&open) > MOST_CONNECTIONS + 1 {
            // The client may have hung up.
            let _ = connection.write_all(b"error: too many connections\n");
            continue;
        }
        let served = thread::Builder::new().name("control connection".into()).spawn(move || {
            let _held = held;
            let Ok(mut output) = connection.try_clone() else { return };
            // An error means that the client has hung up.
            let _ = serve(BufReader::new(connection), &mut output, &sender, |_, answer| answer.to_owned());
        });
        if let Err(error) = served {
            output::complain(format_args!("ringcat sim: a control connection is not served: {error}"));
        }
    }
}

/// Passes lines on as orders, and writes the answers as `format` makes them of an order and its answer.
fn serve(
    mut input: impl BufRead,
    output: &mut impl Write,
    sender: &Sender<Order>,
    format: impl Fn(&str, &str) -> String,
) -> io::Result<()> {
    loop {
        let mut bytes = Vec::new();
        if (&mut input).take(LONGEST_LINE).read_until(b'\n', &mut bytes)? == 0 {
            return Ok(());
        }
        if bytes.len() as u64 == LONGEST_LINE && bytes.last() != Some(&b'\n') {
            output.write_all(format("", "error: a line is too long; nothing more is read here\n").as_bytes())?;
            return Ok(());
        }
        let line = String::from_utf8_lossy(&bytes).trim_end_matches(['\n', '\r']).to_owned();
        let (answer, answered) = channel();
        if sender.send(Order { line: line.clone(), answer }).is_err() {
            return Ok(());
        }
        let Ok(text) = answered.recv() else { return Ok(()) };
        output.write_all(format(&line, &text).as_bytes())?;
        output.flush()?;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The output of a source where each order is its own answer.
    fn echo(input: &[u8]) -> String {
        let (sender, orders) = channel::<Order>();
        let simulator = thread::spawn(move || {
            for order in orders {
                assert!(order.answer.send(format!("{}\n", order.line)).is_ok());
            }
        });
        let mut output = Vec::new();
        assert!(serve(input, &mut output, &sender, |_, answer| answer.to_owned()).is_ok());
        drop(sender);
        assert!(simulator.join().is_ok());
        String::from_utf8_lossy(&output).into_owned()
    }

    #[test]
    fn each_line_is_an_order_whatever_its_bytes_and_its_end() {
        assert_eq!(echo(b"status\ncut 1-2\r\n\xff\n\nquit"), "status\ncut 1-2\n\u{fffd}\n\nquit\n");
        assert_eq!(echo(b""), "");
    }

    // covers: sim-interfaces
    #[test]
    fn a_line_without_end_is_refused_and_takes_no_memory() {
        let endless = BufReader::new(io::repeat(0));
        let (sender, _orders) = channel();
        let mut output = Vec::new();
        assert!(serve(endless, &mut output, &sender, |_, answer| answer.to_owned()).is_ok());
        assert!(output.starts_with(b"error: a line is too long"));
        let longest = vec![b'x'; LONGEST_LINE as usize - 1];
        assert_eq!(echo(&longest).len(), LONGEST_LINE as usize);
    }
}
