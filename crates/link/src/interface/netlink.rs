//! The bridge or bond that an interface is a member of, and the other end of a veth pair, read through netlink.
//!
//! Input: the index of an interface. Output: its controller, its kind and its other end. `/sys` is no alternative: it
//! is bound to the namespace in which it was mounted.

use std::os::fd::AsRawFd;

use crate::kernel;

const REQUEST_LENGTH: usize = 32;
const HEADER_LENGTH: usize = 16;
/// Header and `ifinfomsg`: offset of the attributes.
const ATTRIBUTES: usize = 32;
/// A response has about 2 KiB. It is longer for an interface with many virtual functions; that part is not needed.
const ANSWER_LENGTH: usize = 32_768;

/// What the interface belongs to.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Membership {
    /// Index of the bridge or bond.
    pub controller: Option<u32>,
    /// Kind of the interface: "bridge", "bond", "veth"; empty for a plain interface.
    pub kind: String,
    /// Index of the other end of a veth pair, if it is in the same namespace.
    pub peer: Option<u32>,
    /// Index of the interface below a VLAN, a macvlan, ..., if it is in the same namespace.
    pub below: Option<u32>,
}

/// Whether an interface sends its frames over another one.
pub fn is_above(index: u32, below: u32) -> bool {
    index != below && membership(index).is_some_and(|it| it.below == Some(below))
}

/// Reads the membership of one interface; None if the kernel does not respond.
pub fn membership(index: u32) -> Option<Membership> {
    let socket = kernel::socket(libc::AF_NETLINK, libc::SOCK_RAW, libc::NETLINK_ROUTE).ok()?;
    let fd = socket.as_raw_fd();
    let request = request(index);
    // SAFETY: pointer and length describe a live request.
    let sent = unsafe { libc::send(fd, request.as_ptr().cast(), request.len(), 0) };
    if sent != request.len() as isize {
        return None;
    }
    let mut answer = vec![0; ANSWER_LENGTH];
    // SAFETY: pointer and length describe a live buffer.
    let received = unsafe { libc::recv(fd, answer.as_mut_ptr().cast(), answer.len(), 0) };
    parse(answer.get(..usize::try_from(received).ok()?)?)
}

/// `RTM_GETLINK` for one interface: `nlmsghdr` and `ifinfomsg`.
fn request(index: u32) -> [u8; REQUEST_LENGTH] {
    let mut request = [0; REQUEST_LENGTH];
    request[..4].copy_from_slice(&(REQUEST_LENGTH as u32).to_ne_bytes());
    request[4..6].copy_from_slice(&libc::RTM_GETLINK.to_ne_bytes());
    request[6..8].copy_from_slice(&(libc::NLM_F_REQUEST as u16).to_ne_bytes());
    request[20..24].copy_from_slice(&index.to_ne_bytes());
    request
}

fn parse(answer: &[u8]) -> Option<Membership> {
    let kind = u16::from_ne_bytes(answer.get(4..6)?.try_into().ok()?);
    if kind != libc::RTM_NEWLINK || answer.len() < HEADER_LENGTH {
        return None;
    }
    let mut membership = Membership::default();
    let (mut link, mut is_elsewhere) = (None, false);
    for (kind, value) in attributes(answer.get(ATTRIBUTES..)?) {
        match kind {
            libc::IFLA_LINK => link = value.try_into().ok().map(u32::from_ne_bytes),
            libc::IFLA_LINK_NETNSID => is_elsewhere = true,
            libc::IFLA_MASTER => membership.controller = value.try_into().ok().map(u32::from_ne_bytes),
            libc::IFLA_LINKINFO => {
                if let Some((_, name)) = attributes(value).find(|(kind, _)| *kind == libc::IFLA_INFO_KIND) {
                    membership.kind = String::from_utf8_lossy(name).trim_end_matches('\0').to_owned();
                }
            }
            _ => {}
        }
    }
    let link = link.filter(|_| !is_elsewhere);
    let is_pair = membership.kind == "veth";
    (membership.peer, membership.below) = (link.filter(|_| is_pair), link.filter(|_| !is_pair));
    Some(membership)
}

/// Kind and value of each attribute; ends at the first truncated attribute.
fn attributes(mut bytes: &[u8]) -> impl Iterator<Item = (u16, &[u8])> {
    std::iter::from_fn(move || {
        let length = usize::from(u16::from_ne_bytes(bytes.get(..2)?.try_into().ok()?));
        let kind = u16::from_ne_bytes(bytes.get(2..4)?.try_into().ok()?);
        let value = bytes.get(4..length)?;
        bytes = bytes.get(length.next_multiple_of(4)..).unwrap_or_default();
        Some((kind & libc::NLA_TYPE_MASK as u16, value))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn attribute(kind: u16, value: &[u8]) -> Vec<u8> {
        let mut bytes = (4 + value.len() as u16).to_ne_bytes().to_vec();
        bytes.extend(kind.to_ne_bytes());
        bytes.extend(value);
        bytes.resize(bytes.len().next_multiple_of(4), 0);
        bytes
    }

    fn answer() -> Vec<u8> {
        let mut answer = vec![0; ATTRIBUTES];
        answer[4..6].copy_from_slice(&libc::RTM_NEWLINK.to_ne_bytes());
        answer.extend(attribute(libc::IFLA_IFNAME, b"x\0"));
        answer.extend(attribute(libc::IFLA_MASTER, &7u32.to_ne_bytes()));
        answer.extend(attribute(libc::IFLA_LINKINFO, &attribute(libc::IFLA_INFO_KIND, b"bridge\0")));
        answer
    }

    #[test]
    fn controller_and_kind_are_found_among_other_attributes() {
        let expected = Membership { controller: Some(7), kind: "bridge".to_owned(), peer: None, below: None };
        assert_eq!(parse(&answer()), Some(expected));
    }

    #[test]
    fn the_other_end_of_a_pair_is_found_in_the_same_namespace() {
        let empty = || answer()[..ATTRIBUTES].to_vec();
        let mut pair = empty();
        pair.extend(attribute(libc::IFLA_LINK, &9u32.to_ne_bytes()));
        pair.extend(attribute(libc::IFLA_LINKINFO, &attribute(libc::IFLA_INFO_KIND, b"veth\0")));
        assert_eq!(parse(&pair).expect("an answer").peer, Some(9));
        pair.extend(attribute(libc::IFLA_LINK_NETNSID, &0u32.to_ne_bytes()));
        assert_eq!(parse(&pair).expect("an answer").peer, None);
        let mut above = empty();
        above.extend(attribute(libc::IFLA_LINK, &9u32.to_ne_bytes()));
        above.extend(attribute(libc::IFLA_LINKINFO, &attribute(libc::IFLA_INFO_KIND, b"macvlan\0")));
        let above = parse(&above).expect("an answer");
        assert_eq!(above.peer, None, "the interface is stacked on the other one, not its peer");
        assert_eq!(above.below, Some(9));
    }

    #[test]
    fn truncated_responses_do_not_panic() {
        let answer = answer();
        for length in 0..answer.len() {
            let _ = parse(&answer[..length]);
        }
        assert_eq!(parse(&[]), None);
    }

    #[test]
    fn the_loopback_belongs_to_nothing() {
        let index = kernel::index_of("lo").expect("an interface lo");
        assert_eq!(membership(index).expect("an answer").controller, None);
        assert_eq!(membership(u32::MAX >> 1), None);
    }
}
