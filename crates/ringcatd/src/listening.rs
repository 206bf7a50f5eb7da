//! The socket of the daemon, and how many clients it has.

use std::io;
use std::os::unix::fs::{PermissionsExt, chown};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use ringcat_control::{Connection, Content, Refusal, Right};
use ringcat_link::process::Peer;

use crate::log::say;
use crate::rights::Rights;
use crate::session::{self, Masters};

/// Clients at a time.
pub const MOST_CLIENTS: usize = 64;
/// Clients at a time that may only read: the others always find room.
pub const MOST_READERS: usize = 48;

/// The socket. It is removed when this is dropped.
#[derive(Debug)]
pub struct Listening {
    path: PathBuf,
}

/// Numbers of clients now.
#[derive(Debug, Default)]
struct Counts {
    all: AtomicUsize,
    readers: AtomicUsize,
}

/// A place of a client, free again when it is dropped.
struct Place {
    counts: Arc<Counts>,
    right: Right,
}

impl Place {
    fn take(counts: &Arc<Counts>, right: Right) -> Result<Place, Refusal> {
        // Counted before it is checked: two clients at once never both take the last place.
        let place = Place { counts: counts.clone(), right };
        let all = counts.all.fetch_add(1, Ordering::AcqRel);
        let readers = counts.readers.fetch_add(usize::from(right == Right::Read), Ordering::AcqRel);
        if all >= MOST_CLIENTS {
            return Err(Refusal::TooManyClients { limit: MOST_CLIENTS });
        }
        if right == Right::Read && readers >= MOST_READERS {
            return Err(Refusal::TooManyClients { limit: MOST_READERS });
        }
        Ok(place)
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.counts.all.fetch_sub(1, Ordering::AcqRel);
        self.counts.readers.fetch_sub(usize::from(self.right == Right::Read), Ordering::AcqRel);
    }
}

impl Listening {
    /// Listens at this path, and serves each client in a thread. A socket that a killed daemon has left is replaced.
    ///
    /// # Errors
    /// Another daemon listens there, or the path cannot be used.
    pub fn start(path: &Path, rights: Rights, masters: Arc<Masters>) -> Result<Listening, String> {
        let failed = |error: io::Error| format!("{}: {error}", path.display());
        if UnixStream::connect(path).is_ok() {
            return Err(format!("{}: another daemon listens there", path.display()));
        }
        if let Some(directory) = path.parent().filter(|it| !it.as_os_str().is_empty()) {
            std::fs::create_dir_all(directory).map_err(failed)?;
        }
        let listener = bind(path, rights).map_err(failed)?;
        let body = move || accept(&listener, rights, &masters);
        thread::Builder::new().name("clients".into()).spawn(body).map_err(failed)?;
        Ok(Listening { path: path.to_owned() })
    }
}

impl Drop for Listening {
    fn drop(&mut self) {
        // It may be gone already.
        let _ = std::fs::remove_file(&self.path);
    }
}

/// A socket with its group and mode before anything can connect to it.
fn bind(path: &Path, rights: Rights) -> io::Result<UnixListener> {
    let mut hidden = path.as_os_str().to_owned();
    hidden.push(format!(".{}", std::process::id()));
    let _ = std::fs::remove_file(&hidden);
    let listener = UnixListener::bind(&hidden)?;
    std::fs::set_permissions(&hidden, std::fs::Permissions::from_mode(rights.mode))?;
    if let Some(group) = rights.group {
        chown(&hidden, None, Some(group))?;
    }
    std::fs::rename(&hidden, path)?;
    Ok(listener)
}

fn accept(listener: &UnixListener, rights: Rights, masters: &Arc<Masters>) {
    let counts = Arc::new(Counts::default());
    loop {
        let stream = match listener.accept() {
            Ok((stream, _)) => stream,
            Err(_) => {
                // Without descriptors no client can be served; some end.
                thread::sleep(std::time::Duration::from_millis(10));
                continue;
            }
        };
        let Ok(peer) = Peer::of(&stream) else { continue };
        let right = rights.of(&peer);
        let place = match Place::take(&counts, right) {
            Ok(place) => place,
            Err(refusal) => {
                refuse(stream, refusal);
                continue;
            }
        };
        let masters = masters.clone();
        let serve = move || {
            session::serve(stream, &peer, right, &masters);
            drop(place);
        };
        if let Err(error) = thread::Builder::new().name("client".into()).spawn(serve) {
            say(format_args!("a client is not served: {error}"));
        }
    }
}

/// Says why, and closes the connection. A fresh socket has room for it.
fn refuse(stream: UnixStream, refusal: Refusal) {
    if let Ok(connection) = Connection::new(stream) {
        let _ = connection.send(&Content::Refused(refusal).into());
    }
}
