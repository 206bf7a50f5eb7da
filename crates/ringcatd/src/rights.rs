//! What a client may do: by the credentials of its process when it connected.
//!
//! The mode has the meaning that it has for a file: its bits state for the user of the daemon, for the members of the
//! group and for all others whether they may read (`r`) and change the bus (`w`). `connect` needs the right to write a
//! socket's file, so the file gets both bits for all that may do anything. Root may change the bus in any case.

use std::fmt;
use std::fs;

use ringcat_control::Right;
use ringcat_link::process::{Peer, effective_user};

/// Bits of one class in a mode.
const READ: u32 = 0o4;
const CHANGE: u32 = 0o2;
/// Bits that a mode can have here.
const BITS: u32 = 0o666;

/// Which clients may read, and which may change the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rights {
    /// The group; without one no client is a member.
    pub group: Option<u32>,
    /// For the user of the daemon, members of the group, and all others.
    pub mode: u32,
}

impl Default for Rights {
    fn default() -> Rights {
        Rights { group: None, mode: 0o660 }
    }
}

impl Rights {
    /// What the process at the other end may do; `None`: nothing.
    pub fn of(&self, peer: &Peer) -> Option<Right> {
        if peer.uid == 0 {
            return Some(Right::Change);
        }
        let is_member = || self.group.is_some_and(|group| peer.groups.contains(&group));
        right(match peer.uid == effective_user() {
            true => self.mode >> 6,
            false if is_member() => self.mode >> 3,
            false => self.mode,
        })
    }

    /// Mode of the socket's file: which processes can connect.
    pub fn file_mode(&self) -> u32 {
        let others = self.mode & 0o7;
        let group = if self.group.is_some() { self.mode >> 3 & 0o7 } else { others };
        [self.mode >> 6 & 0o7, group, others].iter().fold(0, |file, class| {
            let connects = if right(*class).is_some() { READ | CHANGE } else { 0 };
            file << 3 | connects
        })
    }
}

/// What the bits of a class allow. Without the right to read nothing is allowed.
fn right(class: u32) -> Option<Right> {
    match class & (READ | CHANGE) {
        bits if bits == READ | CHANGE => Some(Right::Change),
        READ => Some(Right::Read),
        _ => None,
    }
}

impl fmt::Display for Rights {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let shown = |class| match right(class) {
            Some(Right::Change) => "read and change",
            Some(Right::Read) => "read",
            None => "do nothing",
        };
        write!(f, "mode {:04o}: the user of the daemon may {}, ", self.mode, shown(self.mode >> 6))?;
        match self.group {
            Some(group) => write!(f, "members of group {group} may {}, ", shown(self.mode >> 3))?,
            None => f.write_str("no group is named, ")?,
        }
        write!(f, "all others may {}", shown(self.mode))
    }
}

/// The number of a group by its number or its name in `/etc/group`.
///
/// # Errors
/// There is no such group.
pub fn group(text: &str) -> Result<u32, String> {
    let number = text.parse().ok();
    let file = || fs::read_to_string("/etc/group").unwrap_or_default();
    number.or_else(|| named(&file(), text)).ok_or_else(|| format!("there is no group {text:?} in /etc/group"))
}

fn named(file: &str, name: &str) -> Option<u32> {
    file.lines().find_map(|line| {
        let mut fields = line.split(':');
        (fields.next() == Some(name)).then(|| fields.nth(1)?.parse().ok()).flatten()
    })
}

/// A mode as `chmod` takes it: octal digits, of the bits to read and to change.
///
/// # Errors
/// The text is no such mode.
pub fn mode(text: &str) -> Result<u32, String> {
    let is_octal = !text.is_empty() && text.bytes().all(|it| matches!(it, b'0'..=b'7'));
    let mode = u32::from_str_radix(text, 8).ok().filter(|mode| is_octal && *mode & !BITS == 0);
    let mode = mode.ok_or_else(|| format!("expected octal digits as 0660, 0664 or 0666, got {text:?}"))?;
    let changes_only = |shift: u32| mode >> shift & (READ | CHANGE) == CHANGE;
    match [6, 3, 0].into_iter().any(changes_only) {
        true => Err(format!("{text:?} lets clients change the bus that may not read it; expected 6, 4 or 0")),
        false => Ok(mode),
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::net::UnixStream;

    use super::*;

    fn peer(uid: u32, groups: &[u32]) -> Peer {
        let (near, _far) = UnixStream::pair().expect("a pair");
        let mut peer = Peer::of(&near).expect("it is a Unix socket");
        (peer.uid, peer.groups) = (uid, groups.to_vec());
        peer
    }

    // covers: daemon
    #[test]
    fn a_mode_says_for_user_group_and_others_what_they_may() {
        use Right::{Change, Read};
        let (root, user, other_user) = (peer(0, &[0]), effective_user(), effective_user() + 1);
        let (own, member, other) = (peer(user, &[7]), peer(other_user, &[7, 44]), peer(other_user, &[7, 45]));
        let cases = [
            (0o660, Some(Change), None, 0o660),
            (0o664, Some(Change), Some(Read), 0o666),
            (0o666, Some(Change), Some(Change), 0o666),
            (0o644, Some(Read), Some(Read), 0o666),
            (0o640, Some(Read), None, 0o660),
            (0o600, None, None, 0o600),
        ];
        for (mode, of_member, of_other, file) in cases {
            let rights = Rights { group: Some(44), mode };
            let found = [&root, &own, &member, &other].map(|peer| rights.of(peer));
            assert_eq!(found, [Some(Change), Some(Change), of_member, of_other], "{mode:o}");
            assert_eq!(rights.file_mode(), file, "{mode:o}");
        }
    }

    // covers: daemon
    #[test]
    fn without_a_group_no_client_is_a_member() {
        let other = peer(effective_user() + 1, &[44]);
        assert_eq!(Rights::default().of(&other), None);
        assert_eq!(Rights::default().file_mode(), 0o600);
        let all_read = Rights { group: None, mode: 0o664 };
        assert_eq!((all_read.of(&other), all_read.file_mode()), (Some(Right::Read), 0o666));
        let shown = Rights { group: Some(44), mode: 0o664 }.to_string();
        assert!(shown.ends_with("members of group 44 may read and change, all others may read"), "{shown}");
    }

    // covers: daemon
    #[test]
    fn groups_and_modes_are_read_as_administrators_write_them() {
        let file = "root:x:0:\nethercat:x:44:ann,bob\nbroken\n:x:1:\n";
        assert_eq!((named(file, "ethercat"), named(file, "broken"), named(file, "ether")), (Some(44), None, None));
        assert_eq!(group("123"), Ok(123));
        assert!(group("no such group").is_err());
        assert_eq!((mode("0660"), mode("666")), (Ok(0o660), Ok(0o666)));
        assert!(mode("8").is_err() && mode("7777").is_err() && mode("").is_err());
        assert!(mode("0770").is_err() && mode("+660").is_err());
        assert!(mode("0620").expect_err("it is strange").contains("may not read it"));
    }
}
