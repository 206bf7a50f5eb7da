//! What a client may do: by the credentials of its process when it connected.
//!
//! Which clients can connect at all follows from owner, group and mode of the socket. Root, the user of the daemon and
//! the members of one group may change the bus; all others that can connect may read.

use std::fs;

use ringcat_control::Right;
use ringcat_link::process::{Peer, effective_user};

/// Which clients may change the bus, and which can connect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rights {
    /// Members of this group may change the bus.
    pub group: Option<u32>,
    /// Mode of the socket.
    pub mode: u32,
}

impl Default for Rights {
    fn default() -> Rights {
        Rights { group: None, mode: 0o660 }
    }
}

impl Rights {
    /// What the process at the other end may do.
    pub fn of(&self, peer: &Peer) -> Right {
        let is_member = self.group.is_some_and(|group| peer.groups.contains(&group));
        if peer.uid == 0 || peer.uid == effective_user() || is_member { Right::Change } else { Right::Read }
    }
}

/// The number of a group by its number or its name in `/etc/group`.
///
/// # Errors
/// There is none.
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

/// A mode as `chmod` takes it: octal digits.
///
/// # Errors
/// It is none.
pub fn mode(text: &str) -> Result<u32, String> {
    let mode = u32::from_str_radix(text, 8).ok().filter(|mode| *mode <= 0o777);
    mode.ok_or_else(|| format!("expected octal digits as 0660, got {text:?}"))
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
    fn root_the_daemons_user_and_members_of_the_group_may_change_others_read() {
        let rights = Rights { group: Some(44), ..Rights::default() };
        let other = effective_user() + 1;
        assert_eq!(rights.of(&peer(0, &[0])), Right::Change);
        assert_eq!(rights.of(&peer(effective_user(), &[7])), Right::Change);
        assert_eq!(rights.of(&peer(other, &[7, 44])), Right::Change);
        assert_eq!(rights.of(&peer(other, &[7, 45])), Right::Read);
        assert_eq!(Rights::default().of(&peer(other, &[44])), Right::Read);
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
    }
}
