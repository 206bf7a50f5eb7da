//! Where orders come in: lines of the standard input, and connections to a Unix socket.
//!
//! Each door has a thread that reads lines and waits for the answer; the simulator itself looks for orders between two
//! events and never waits for them.

use std::io::{self, BufRead, BufReader, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;

/// A line, and where its answer goes.
#[derive(Debug)]
pub struct Order {
    /// The line.
    pub line: String,
    /// Takes the answer. Whoever asked may have gone.
    pub answer: Sender<String>,
}

/// All doors, and the orders that came in.
#[derive(Debug)]
pub struct Doors {
    orders: Receiver<Order>,
    socket: Option<PathBuf>,
}

impl Doors {
    /// Listens to the standard input and, where a path is given, to a Unix socket there. Only the user whose process
    /// this is may connect.
    ///
    /// # Errors
    /// A path that cannot be listened at.
    pub fn open(socket: Option<&Path>) -> io::Result<Doors> {
        let (sender, orders) = channel();
        if let Some(path) = socket {
            let listener = listen(path)?;
            let sender = sender.clone();
            thread::Builder::new().name("control socket".into()).spawn(move || accept(&listener, &sender))?;
        }
        thread::Builder::new().name("standard input".into()).spawn(move || {
            // An end of the input, or an error, ends this door and nothing else.
            let _ = serve(io::stdin().lock(), &mut io::stdout(), &sender);
        })?;
        Ok(Doors { orders, socket: socket.map(Path::to_owned) })
    }

    /// The oldest order that was not taken yet.
    pub fn next(&self) -> Option<Order> {
        self.orders.try_recv().ok()
    }
}

impl Drop for Doors {
    fn drop(&mut self) {
        if let Some(path) = &self.socket {
            // It may be gone already.
            let _ = std::fs::remove_file(path);
        }
    }
}

/// A socket at this path; one that a killed simulator has left behind is replaced, one that is in use is not.
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
    for connection in listener.incoming().flatten() {
        let sender = sender.clone();
        let served = thread::Builder::new().name("control connection".into()).spawn(move || {
            let Ok(mut output) = connection.try_clone() else { return };
            // Whoever asked has hung up: nobody is left to be told.
            let _ = serve(BufReader::new(connection), &mut output, &sender);
        });
        if let Err(error) = served {
            eprintln!("ringcat sim: a control connection is not served: {error}");
        }
    }
}

fn serve(input: impl BufRead, output: &mut impl Write, sender: &Sender<Order>) -> io::Result<()> {
    for line in input.lines() {
        let (answer, answered) = channel();
        if sender.send(Order { line: line?, answer }).is_err() {
            return Ok(());
        }
        let Ok(text) = answered.recv() else { return Ok(()) };
        output.write_all(text.as_bytes())?;
        output.flush()?;
    }
    Ok(())
}
