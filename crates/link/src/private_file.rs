//! Files of this process that no other user can read, replace or lock.
//!
//! A lock (`flock`) needs only a descriptor, which each user gets that may read the file; and a path in a directory
//! that others write may lead anywhere. So a file has mode 0600, is no link, and belongs to this user. Not for the
//! cyclic path.

use std::fs::{File, OpenOptions, Permissions};
use std::io;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::Path;

use crate::process::effective_user;

/// The mode: read and written by its owner.
const MODE: u32 = 0o600;
/// Bits of a mode that are compared.
const PERMISSIONS: u32 = 0o7777;

/// Opens a file to read and write it, and makes it where there is none. What it contains stays.
///
/// # Errors
/// The system refuses, or there is something else than a file of this user: a link, a directory, a file of another
/// user, a file with a second name.
pub fn open(path: &Path) -> io::Result<File> {
    let mut options = OpenOptions::new();
    options.read(true).write(true).create(true).truncate(false).mode(MODE).custom_flags(libc::O_NOFOLLOW);
    let file = options.open(path).map_err(|error| match error.raw_os_error() {
        Some(libc::ELOOP) => refused("expected a file or nothing, found a symbolic link"),
        _ => error,
    })?;
    let found = file.metadata()?;
    if !found.is_file() {
        return Err(refused("expected a file or nothing, found something else"));
    }
    let (owner, own) = (found.uid(), effective_user());
    if owner != own {
        return Err(refused(&format!("expected a file of user {own}, found one of user {owner}")));
    }
    if found.nlink() > 1 {
        return Err(refused("expected a file with one name, found one with several (hard links)"));
    }
    if found.mode() & PERMISSIONS != MODE {
        file.set_permissions(Permissions::from_mode(MODE))?;
    }
    Ok(file)
}

fn refused(text: &str) -> io::Error {
    io::Error::new(io::ErrorKind::PermissionDenied, text)
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::os::unix::fs::{chown, symlink};
    use std::path::PathBuf;
    use std::process::Command;

    use super::*;

    fn directory(name: &str) -> PathBuf {
        let path = std::env::temp_dir().join(format!("ringcat-link-{name}-{}", std::process::id()));
        fs::create_dir_all(&path).expect("it can be made");
        path
    }

    fn mode(path: &Path) -> u32 {
        fs::metadata(path).expect("it is there").mode() & PERMISSIONS
    }

    // covers: links
    #[test]
    fn a_private_file_is_for_its_owner_only_and_keeps_what_it_has() {
        let directory = directory("private");
        let path = directory.join("file");
        open(&path).expect("it can be made");
        assert_eq!(mode(&path), 0o600);
        fs::write(&path, "kept").expect("it is writable");
        // Earlier versions made the file with this mode.
        fs::set_permissions(&path, Permissions::from_mode(0o644)).expect("it is writable");
        open(&path).expect("it is writable");
        assert_eq!((mode(&path), fs::read_to_string(&path).expect("it is there")), (0o600, "kept".to_owned()));
        fs::remove_dir_all(directory).expect("it is there");
    }

    // covers: links
    #[test]
    fn links_and_what_is_no_file_are_refused_and_stay_as_they_are() {
        let directory = directory("links");
        let (target, path) = (directory.join("target"), directory.join("file"));
        fs::write(&target, "precious").expect("it is writable");
        symlink(&target, &path).expect("it can be made");
        assert!(open(&path).expect_err("it is a link").to_string().contains("symbolic link"));
        fs::remove_file(&path).expect("it is there");
        symlink(directory.join("nothing"), &path).expect("it can be made");
        assert!(open(&path).is_err() && !directory.join("nothing").exists(), "nothing is made behind a link");
        fs::remove_file(&path).expect("it is there");
        fs::hard_link(&target, &path).expect("it can be made");
        assert!(open(&path).expect_err("it has two names").to_string().contains("hard links"));
        fs::remove_file(&path).expect("it is there");
        let made = Command::new("mkfifo").arg(&path).status();
        assert!(made.is_ok_and(|status| status.success()));
        assert!(open(&path).expect_err("it is a pipe").to_string().contains("something else"));
        assert_eq!(fs::read(&target).expect("it is there"), b"precious");
        fs::remove_dir_all(directory).expect("it is there");
    }

    // covers: links
    #[test]
    fn a_file_of_another_user_is_refused() {
        if effective_user() != 0 {
            println!("skipped: only root gives files to other users");
            return;
        }
        let directory = directory("other");
        let path = directory.join("file");
        fs::write(&path, "theirs").expect("it can be made");
        chown(&path, Some(65_534), None).expect("root may");
        let refused = open(&path).expect_err("it is theirs").to_string();
        assert_eq!(refused, "expected a file of user 0, found one of user 65534");
        fs::remove_dir_all(directory).expect("it is there");
    }
}
