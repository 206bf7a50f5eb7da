//! Where a daemon listens, and where its clients look for it.
//!
//! A daemon of root listens at [`DEFAULT_SOCKET`]. One of another user listens in a directory that only this user can
//! write: the one for its running programs (`XDG_RUNTIME_DIR`, or `/run/user/UID`), or `/tmp/ringcat-UID` where there
//! is none. Clients look at the places of their own user first, then at that of root. A directory of another user, or
//! one that others can write, is not used: another user could listen there.

use std::ffi::OsString;
use std::fs::DirBuilder;
use std::io;
use std::os::unix::fs::{DirBuilderExt, FileTypeExt, MetadataExt};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};

use ringcat_link::process::effective_user;

/// Where a daemon of root listens unless an option says otherwise.
pub const DEFAULT_SOCKET: &str = "/run/ringcat/control";
/// Names the socket for clients.
pub const VARIABLE: &str = "RINGCAT_SOCKET";
/// Names the directory for running programs of a user.
const RUNTIME_VARIABLE: &str = "XDG_RUNTIME_DIR";
/// The socket in a directory for running programs.
const IN_RUNTIME: &str = "ringcat/control";
/// Its directory there.
const IN_RUNTIME_DIRECTORY: &str = "ringcat";
/// The socket in a directory of its own.
const NAME: &str = "control";
/// Where the system makes directories for running programs.
const RUNTIME: &str = "/run/user";
/// Where a directory is made if there is none.
const TEMPORARY: &str = "/tmp";
/// Bits of a mode with which others can write.
const OTHERS_WRITE: u32 = 0o022;

/// Variables of the environment.
pub trait Variables: Fn(&str) -> Option<OsString> {}

impl<T: Fn(&str) -> Option<OsString>> Variables for T {}

/// The places of a user, the preferred one first.
#[derive(Debug)]
struct Places {
    user: u32,
    runtime: Vec<PathBuf>,
    own: PathBuf,
}

impl Places {
    fn new(user: u32, variable: impl Variables, runtime: &Path, temporary: &Path) -> Places {
        let named = variable(RUNTIME_VARIABLE).map(PathBuf::from).filter(|path| path.is_absolute());
        let runtime = named.into_iter().chain([runtime.join(user.to_string())]);
        let runtime = runtime.filter(|path| is_private(path, user)).collect();
        Places { user, runtime, own: temporary.join(format!("ringcat-{user}")) }
    }

    fn of_this_user(variable: impl Variables) -> Places {
        Places::new(effective_user(), variable, Path::new(RUNTIME), Path::new(TEMPORARY))
    }

    /// Where daemons of this user may listen.
    fn sockets(&self) -> Vec<PathBuf> {
        let own = Some(&self.own).filter(|path| is_private(path, self.user)).map(|path| path.join(NAME));
        self.runtime.iter().map(|path| path.join(IN_RUNTIME)).chain(own).collect()
    }

    /// Where a daemon of this user listens. The directory is made.
    fn listening(&self) -> Result<PathBuf, String> {
        let directory = self.runtime.first().map_or_else(|| self.own.clone(), |path| path.join(IN_RUNTIME_DIRECTORY));
        match DirBuilder::new().mode(0o700).create(&directory) {
            Ok(()) => {}
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(format!("{}: {error}", directory.display())),
        }
        if is_private(&directory, self.user) {
            return Ok(directory.join(NAME));
        }
        let user = self.user;
        Err(format!("{}: expected a directory of user {user} that no other user can write", directory.display()))
    }
}

/// Whether a directory belongs to this user, and no other one can write it.
fn is_private(path: &Path, user: u32) -> bool {
    let found = std::fs::symlink_metadata(path);
    found.is_ok_and(|it| it.is_dir() && it.uid() == user && it.mode() & OTHERS_WRITE == 0)
}

/// The socket of a daemon that this user starts without an option for it. Its directory is made.
///
/// # Errors
/// There is another file, or a directory of another user, in its place, for the operator.
pub fn to_listen_at(variable: impl Variables) -> Result<PathBuf, String> {
    if effective_user() == 0 { Ok(DEFAULT_SOCKET.into()) } else { Places::of_this_user(variable).listening() }
}

/// The socket that clients of this process connect to: the one that [`VARIABLE`] names, or the first of the usual
/// places where a daemon listens. Where none does it is that of root.
pub fn to_connect_to(variable: impl Variables) -> PathBuf {
    if let Some(named) = variable(VARIABLE).filter(|path| !path.is_empty()) {
        return named.into();
    }
    let users = if effective_user() == 0 { Vec::new() } else { Places::of_this_user(variable).sockets() };
    found(users, Path::new(DEFAULT_SOCKET))
}

fn found(mut of_user: Vec<PathBuf>, of_root: &Path) -> PathBuf {
    let is_socket = |path: &Path| std::fs::symlink_metadata(path).is_ok_and(|it| it.file_type().is_socket());
    of_user.retain(|path| is_socket(path));
    match &of_user[..] {
        // What is wrong with it is found when it is connected to.
        [only] if !is_socket(of_root) => only.clone(),
        all => {
            all.iter().find(|path| UnixStream::connect(path).is_ok()).map_or_else(|| of_root.to_owned(), PathBuf::clone)
        }
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::{PermissionsExt, symlink};
    use std::os::unix::net::UnixListener;

    use super::*;

    fn directory(name: &str) -> PathBuf {
        let path = std::env::temp_dir().join(format!("ringcat-control-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).expect("it can be made");
        path
    }

    fn nothing(_: &str) -> Option<OsString> {
        None
    }

    // covers: daemon
    #[test]
    fn a_user_listens_in_a_directory_of_its_own_and_clients_find_it_there() {
        let (directory, user) = (directory("listen"), effective_user());
        let (run, temporary) = (directory.join("run"), directory.join("tmp"));
        std::fs::create_dir(&temporary).expect("it can be made");
        let places = |variable: &dyn Fn(&str) -> Option<OsString>| Places::new(user, variable, &run, &temporary);
        let own = temporary.join(format!("ringcat-{user}/control"));
        assert_eq!(places(&nothing).sockets(), Vec::<PathBuf>::new());
        assert_eq!(places(&nothing).listening(), Ok(own.clone()));
        assert_eq!(std::fs::metadata(own.parent().expect("a directory")).expect("it is made").mode() & 0o777, 0o700);
        // The system has a directory for the programs of this user, and a session names one.
        let of_system = run.join(user.to_string());
        std::fs::create_dir_all(&of_system).expect("it can be made");
        assert_eq!(places(&nothing).listening(), Ok(of_system.join("ringcat/control")));
        let session = directory.join("session");
        std::fs::create_dir(&session).expect("it can be made");
        let named = |name: &str| (name == RUNTIME_VARIABLE).then(|| session.clone().into_os_string());
        assert_eq!(places(&named).listening(), Ok(session.join("ringcat/control")));
        // Another program of the user, without a session, looks there, too.
        let all = [session.join("ringcat/control"), of_system.join("ringcat/control"), own.clone()];
        assert_eq!((places(&named).sockets(), places(&nothing).sockets()), (all.to_vec(), all[1..].to_vec()));
        let relative = |name: &str| (name == RUNTIME_VARIABLE).then(|| OsString::from("run"));
        assert_eq!(places(&relative).sockets(), all[1..]);
        std::fs::remove_dir_all(&of_system).expect("it is there");
        let taken = own.parent().expect("a directory");
        std::fs::set_permissions(taken, std::fs::Permissions::from_mode(0o777)).expect("it is writable");
        let refused = places(&nothing).listening().expect_err("all can write it");
        assert!(refused.ends_with(&format!("expected a directory of user {user} that no other user can write")));
        std::fs::remove_dir_all(directory).expect("it is there");
    }

    // covers: daemon
    #[test]
    fn a_directory_that_another_user_could_write_or_has_made_is_no_place() {
        let (directory, user) = (directory("private"), effective_user());
        let inner = directory.join("inner");
        std::fs::create_dir(&inner).expect("it can be made");
        for (mode, is_right) in [(0o700, true), (0o755, true), (0o770, false), (0o777, false)] {
            std::fs::set_permissions(&inner, std::fs::Permissions::from_mode(mode)).expect("it is writable");
            assert_eq!(is_private(&inner, user), is_right, "{mode:o}");
        }
        std::fs::set_permissions(&inner, std::fs::Permissions::from_mode(0o700)).expect("it is writable");
        assert!(!is_private(&inner, user + 1));
        symlink(&inner, directory.join("link")).expect("it can be made");
        assert!(!is_private(&directory.join("link"), user) && !is_private(&directory.join("none"), user));
        std::fs::remove_dir_all(directory).expect("it is there");
    }

    // covers: daemon
    #[test]
    fn a_client_takes_the_first_place_where_a_daemon_listens() {
        let directory = directory("connect");
        let path = |name: &str| directory.join(name);
        let now = || found(vec![path("first"), path("second")], &path("root"));
        assert_eq!(now(), path("root"), "none listens");
        let second = UnixListener::bind(path("second")).expect("it is free");
        assert_eq!(now(), path("second"));
        let first = UnixListener::bind(path("first")).expect("it is free");
        assert_eq!(now(), path("first"));
        // A daemon that was killed has left its socket.
        drop(first);
        assert_eq!(now(), path("second"));
        drop(second);
        let _root = UnixListener::bind(path("root")).expect("it is free");
        assert_eq!(now(), path("root"));
        let named = |name: &str| (name == VARIABLE).then(|| OsString::from("/somewhere"));
        assert_eq!(to_connect_to(named), Path::new("/somewhere"));
        std::fs::remove_dir_all(directory).expect("it is there");
    }
}
