//! The socket of the daemon, and how many clients it has.

use std::fs::{File, TryLockError};
use std::io;
use std::os::unix::fs::{FileTypeExt, MetadataExt, PermissionsExt, chown};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;

use ringcat_control::{Connection, Content, Refusal, Right};
use ringcat_link::private_file;
use ringcat_link::process::{Peer, watch_peer};

use crate::log::say;
use crate::rights::Rights;
use crate::session::{self, ClientProcess, Masters};

/// Clients at a time.
pub const MOST_CLIENTS: usize = 64;
/// The answer to a client without any right.
const NO_RIGHT: &str = "this user may not ask; --mode and --group of ringcatd say which users may";
/// Clients at a time that may only read: the others always find room.
pub const MOST_READERS: usize = 48;

/// The socket. It is removed when this is dropped.
#[derive(Debug)]
pub struct Listening {
    path: PathBuf,
    /// Device and number of the socket's file.
    inode: (u64, u64),
    is_over: Arc<AtomicBool>,
    _lock: SocketLock,
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

/// A socket with its group and mode, which no client can find yet.
#[derive(Debug)]
pub struct Prepared {
    listener: UnixListener,
    hidden: PathBuf,
    path: PathBuf,
    lock: SocketLock,
    rights: Rights,
}

impl Prepared {
    /// Prepares a socket for this path; to set its group may need a capability.
    ///
    /// # Errors
    /// Another daemon listens there, or the path cannot be used.
    pub fn new(path: &Path, rights: Rights) -> Result<Prepared, String> {
        let failed = |error: io::Error| format!("{}: {error}", path.display());
        if let Some(directory) = path.parent().filter(|it| !it.as_os_str().is_empty()) {
            std::fs::create_dir_all(directory).map_err(failed)?;
        }
        let lock = SocketLock::take(path)?;
        check_free(path)?;
        let mut hidden = path.as_os_str().to_owned();
        hidden.push(format!(".{}", std::process::id()));
        let hidden = PathBuf::from(hidden);
        let listener = bind(&hidden, rights).map_err(failed)?;
        Ok(Prepared { listener, hidden, path: path.to_owned(), lock, rights })
    }

    /// Serves each client in a thread. A socket that a killed daemon has left is replaced.
    ///
    /// # Errors
    /// The path cannot be used, or a thread cannot be started.
    pub fn serve(self, masters: Arc<Masters>) -> Result<Listening, String> {
        let Prepared { listener, hidden, path, lock, rights } = self;
        let failed = |error: io::Error| format!("{}: {error}", path.display());
        let inode = inode(&hidden).map_err(failed)?;
        std::fs::rename(hidden, &path).map_err(failed)?;
        let is_over = Arc::new(AtomicBool::new(false));
        let ends = is_over.clone();
        let body = move || accept(&listener, rights, &masters, &ends);
        thread::Builder::new().name("clients".into()).spawn(body).map_err(failed)?;
        Ok(Listening { path, inode, is_over, _lock: lock })
    }
}

/// Device and number of the file at a path.
fn inode(path: &Path) -> io::Result<(u64, u64)> {
    std::fs::symlink_metadata(path).map(|it| (it.dev(), it.ino()))
}

/// Checks that nothing is at this path, or a socket of a daemon that has ended.
fn check_free(path: &Path) -> Result<(), String> {
    let failed = |error: &dyn std::fmt::Display| Err(format!("{}: {error}", path.display()));
    match std::fs::symlink_metadata(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        Err(error) => return failed(&error),
        Ok(found) if !found.file_type().is_socket() => {
            return failed(&"expected a socket of an earlier daemon or nothing, found another file");
        }
        Ok(_) => {}
    }
    match UnixStream::connect(path) {
        Ok(_) => failed(&"another daemon listens there"),
        Err(error) if matches!(error.kind(), io::ErrorKind::ConnectionRefused | io::ErrorKind::NotFound) => Ok(()),
        Err(error) => failed(&format!("expected a socket that nothing listens at: {error}")),
    }
}

/// The lock of a socket, from before the first frame of its daemon until its end: two daemons never share one.
#[derive(Debug)]
struct SocketLock {
    path: PathBuf,
    file: File,
}

impl SocketLock {
    fn take(socket: &Path) -> Result<SocketLock, String> {
        let mut path = socket.as_os_str().to_owned();
        path.push(".lock");
        let path = PathBuf::from(path);
        let failed = |error: io::Error| format!("{}: {error}", path.display());
        loop {
            let file = private_file::open(&path).map_err(failed)?;
            match file.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => {
                    return Err(format!("{}: another daemon listens there", socket.display()));
                }
                Err(TryLockError::Error(error)) => return Err(failed(error)),
            }
            let own = file.metadata().map(|it| (it.dev(), it.ino())).map_err(failed)?;
            // A daemon that has just ended has removed the file that was opened here.
            if inode(&path).is_ok_and(|there| there == own) {
                return Ok(SocketLock { path, file });
            }
        }
    }
}

impl Drop for SocketLock {
    fn drop(&mut self) {
        // Removed before the lock ends.
        let _ = std::fs::remove_file(&self.path);
        let _ = self.file.unlock();
    }
}

impl Drop for Listening {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Release);
        // Another file may be at its place.
        if inode(&self.path).is_ok_and(|there| there == self.inode) {
            // The thread that accepts clients detects the end by another one.
            let _ = UnixStream::connect(&self.path);
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

/// A socket with its group and mode before anything can connect to it.
fn bind(hidden: &Path, rights: Rights) -> io::Result<UnixListener> {
    let _ = std::fs::remove_file(hidden);
    let listener = UnixListener::bind(hidden)?;
    std::fs::set_permissions(hidden, std::fs::Permissions::from_mode(rights.file_mode()))?;
    if let Some(group) = rights.group {
        chown(hidden, None, Some(group))?;
    }
    Ok(listener)
}

fn accept(listener: &UnixListener, rights: Rights, masters: &Arc<Masters>, is_over: &AtomicBool) {
    let counts = Arc::new(Counts::default());
    while !is_over.load(Ordering::Acquire) {
        let stream = match listener.accept() {
            Ok((stream, _)) => stream,
            Err(_) => {
                // Without descriptors no client can be served; some end.
                thread::sleep(std::time::Duration::from_millis(10));
                continue;
            }
        };
        let Ok(peer) = Peer::of(&stream) else { continue };
        let Some(right) = rights.of(&peer) else {
            refuse(stream, Refusal::Failed(NO_RIGHT.to_owned()));
            continue;
        };
        let end = watch_peer(&stream, &peer);
        let place = match Place::take(&counts, right) {
            Ok(place) => place,
            Err(refusal) => {
                refuse(stream, refusal);
                continue;
            }
        };
        let masters = masters.clone();
        let serve = move || {
            session::serve(stream, ClientProcess { peer, right, end }, &masters);
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

#[cfg(test)]
mod tests {
    use super::*;

    fn directory(name: &str) -> PathBuf {
        let path = std::env::temp_dir().join(format!("ringcatd-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).expect("it can be made");
        path
    }

    // covers: daemon
    #[test]
    fn only_a_socket_that_nothing_listens_at_is_replaced() {
        let directory = directory("replaced");
        let socket = directory.join("socket");
        std::fs::write(&socket, "precious").expect("it can be written");
        let refused = Prepared::new(&socket, Rights::default()).expect_err("it is a file");
        assert!(refused.contains("found another file"), "{refused}");
        assert_eq!(std::fs::read(&socket).expect("it is there"), b"precious");
        std::fs::remove_file(&socket).expect("it is there");
        let other = UnixListener::bind(&socket).expect("it is free");
        let refused = Prepared::new(&socket, Rights::default()).expect_err("a program listens");
        assert!(refused.contains("another daemon listens there"), "{refused}");
        drop(other);
        let masters = Arc::new(Masters { all: Vec::new(), stop_limit: std::time::Duration::ZERO });
        let prepared = Prepared::new(&socket, Rights::default()).expect("nothing listens");
        let listening = prepared.serve(masters).expect("it can be replaced");
        UnixStream::connect(&socket).expect("it listens");
        drop(listening);
        assert!(!socket.exists());
        std::fs::remove_dir_all(directory).expect("it is there");
    }

    // covers: daemon
    #[test]
    fn of_two_daemons_at_once_one_has_the_socket_before_it_drives_anything() {
        let directory = directory("two");
        let socket = directory.join("socket");
        let first = Prepared::new(&socket, Rights::default()).expect("it is free");
        let refused = Prepared::new(&socket, Rights::default()).expect_err("the first has it");
        assert!(refused.contains("another daemon listens there"), "{refused}");
        let masters = Arc::new(Masters { all: Vec::new(), stop_limit: std::time::Duration::ZERO });
        let first = first.serve(masters).expect("it is free");
        // Another program puts its own socket there: it is not removed.
        std::fs::remove_file(&socket).expect("it is there");
        let _other = UnixListener::bind(&socket).expect("it is free");
        drop(first);
        assert!(socket.exists());
        std::fs::remove_dir_all(directory).expect("it is there");
    }
}
