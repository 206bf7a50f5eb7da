//! The network interfaces of the host, whether a cable is plugged in, and which other programs use one.
//!
//! In go names, out come snapshots; nothing here is for the cyclic thread, some of it waits for locks of the kernel.
//! All answers are about the network namespace of the calling thread.

mod netlink;
mod use_warning;

use std::ffi::CStr;
use std::os::fd::AsRawFd;

pub use use_warning::{UseWarning, exclusive_use};

use crate::kernel;

/// A network interface.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Interface {
    /// Its name.
    pub name: String,
    /// Its number in this namespace.
    pub index: u32,
    /// Its address; zeros where it has none.
    pub mac: [u8; 6],
    /// Whether it is switched on (`ip link set NAME up`).
    pub up: bool,
    /// Whether it is up and has a link partner.
    pub carrier: bool,
    /// Largest payload of a frame, in bytes.
    pub mtu: u32,
    /// Whether it is the loopback.
    pub loopback: bool,
}

/// All interfaces, in the kernel's order. Those that vanish meanwhile are left out.
pub fn list() -> Vec<Interface> {
    let Ok(questions) = kernel::question_socket() else { return Vec::new() };
    indexed_names().into_iter().filter_map(|(index, name)| describe(questions.as_raw_fd(), index, name)).collect()
}

/// Whether an interface is up and has a link partner; None where there is no such interface or its driver cannot tell.
/// May wait milliseconds for a lock of the kernel.
pub fn carrier(name: &str) -> Option<bool> {
    let questions = kernel::question_socket().ok()?;
    kernel::link_up(questions.as_raw_fd(), name).ok()
}

/// Switches an interface on or off, as `ip link set NAME up` does. False where that is not permitted (CAP_NET_ADMIN) or
/// there is no such interface. Waits for a lock of the kernel, and longer for some drivers.
pub fn switch(name: &str, up: bool) -> bool {
    kernel::question_socket().is_ok_and(|questions| kernel::switch(questions.as_raw_fd(), name, up).is_ok())
}

/// Number of the other end of a veth pair, where that is in this namespace.
pub(crate) fn peer(name: &str) -> Option<u32> {
    netlink::membership(kernel::index_of(name)?)?.peer
}

/// Names of all interfaces.
pub(crate) fn names() -> Vec<String> {
    indexed_names().into_iter().map(|(_, name)| name).collect()
}

/// Numbers of those interfaces whose name is wanted.
pub(crate) fn indices(wanted: impl Fn(&str) -> bool) -> Vec<u32> {
    indexed_names().into_iter().filter(|(_, name)| wanted(name)).map(|(index, _)| index).collect()
}

/// Name of the interface with this number.
pub(crate) fn name_of(index: u32) -> Option<String> {
    indexed_names().into_iter().find(|(number, _)| *number == index).map(|(_, name)| name)
}

fn indexed_names() -> Vec<(u32, String)> {
    let mut found = Vec::new();
    // SAFETY: no pointers are passed.
    let list = unsafe { libc::if_nameindex() };
    if list.is_null() {
        return found;
    }
    let mut at = list;
    // SAFETY: the list is the one just returned; it ends with an entry whose index is 0 and whose name is null, and is
    // freed once, after the last use.
    unsafe {
        while (*at).if_index != 0 && !(*at).if_name.is_null() {
            found.push(((*at).if_index, CStr::from_ptr((*at).if_name).to_string_lossy().into_owned()));
            at = at.add(1);
        }
        libc::if_freenameindex(list);
    }
    found
}

fn describe(questions: libc::c_int, index: u32, name: String) -> Option<Interface> {
    let flags = kernel::ask(questions, &name, libc::SIOCGIFFLAGS as _).ok()?;
    let address = kernel::ask(questions, &name, libc::SIOCGIFHWADDR as _).ok()?;
    let mtu = kernel::ask(questions, &name, libc::SIOCGIFMTU as _).ok()?;
    // SAFETY: the kernel has answered each question by filling this member.
    let (flags, address, mtu) =
        unsafe { (flags.ifr_ifru.ifru_flags, address.ifr_ifru.ifru_hwaddr, mtu.ifr_ifru.ifru_mtu) };
    let has = |flag: libc::c_int| libc::c_int::from(flags) & flag != 0;
    let carrier = kernel::link_up(questions, &name).unwrap_or(has(libc::IFF_UP) && has(libc::IFF_RUNNING));
    Some(Interface {
        name,
        index,
        mac: std::array::from_fn(|i| address.sa_data[i] as u8),
        up: has(libc::IFF_UP),
        carrier,
        mtu: u32::try_from(mtu).unwrap_or(0),
        loopback: has(libc::IFF_LOOPBACK),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_loopback_is_in_the_list() {
        let list = list();
        let lo = list.iter().find(|interface| interface.name == "lo").expect("an interface lo");
        assert!(lo.loopback && lo.mac == [0; 6] && lo.index != 0);
        assert_eq!(list.iter().map(|interface| interface.name.clone()).collect::<Vec<_>>(), names());
    }

    #[test]
    fn an_interface_that_is_not_there_has_no_carrier_to_tell_of() {
        for name in ["", "no-such", "a-name-that-is-longer-than-the-kernel-allows", "with\0end"] {
            assert_eq!(carrier(name), None, "{name:?}");
            assert!(!switch(name, false), "{name:?}");
        }
    }
}
