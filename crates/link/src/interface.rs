//! The network interfaces of the host: list, carrier, and other programs that use an interface.
//!
//! Input: names. Output: snapshots. Some calls wait for locks of the kernel; the cyclic thread must not use this
//! module. All results are those of the calling thread's network namespace.

pub mod ethtool;
pub mod free;
mod netlink;
mod use_warning;

use std::ffi::CStr;
use std::os::fd::AsRawFd;

pub use use_warning::{Unknown, UseWarning, Uses, exclusive_use, uses};

use crate::error::LinkError;
use crate::kernel;

/// A network interface.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Interface {
    /// Its name.
    pub name: String,
    /// Its number in this namespace.
    pub index: u32,
    /// Its address; zeros if it has none.
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

/// All interfaces, in the kernel's order. Interfaces that disappear during the call are omitted.
pub fn list() -> Vec<Interface> {
    let Ok(socket) = kernel::request_socket() else { return Vec::new() };
    indexed_names().into_iter().filter_map(|(index, name)| describe(socket.as_raw_fd(), index, name)).collect()
}

/// The error for an interface that is missing; it names those that are there.
pub fn missing(name: &str) -> LinkError {
    LinkError::NoInterface { name: name.to_owned(), present: names() }
}

/// Whether an interface is up and has a link partner; None if there is no such interface or the driver does not report
/// it. May wait milliseconds for a lock of the kernel.
pub fn carrier(name: &str) -> Option<bool> {
    let socket = kernel::request_socket().ok()?;
    kernel::link_up(socket.as_raw_fd(), name).ok()
}

/// Switches an interface on or off, as `ip link set NAME up` does. Waits for a lock of the kernel, with some drivers
/// longer.
///
/// # Errors
/// It is not permitted (CAP_NET_ADMIN), or there is no such interface.
pub fn switch(name: &str, up: bool) -> Result<(), LinkError> {
    let switched = kernel::request_socket().and_then(|socket| kernel::switch(socket.as_raw_fd(), name, up));
    switched.map_err(|errno| match errno {
        libc::EPERM | libc::EACCES => LinkError::MayNotSwitch { name: name.to_owned() },
        libc::ENODEV => missing(name),
        errno => LinkError::from_errno(name, "switching it on or off", errno),
    })
}

/// Index of the other end of a veth pair, if it is in this namespace.
pub(crate) fn peer(name: &str) -> Option<u32> {
    netlink::membership(kernel::index_of(name)?)?.peer
}

/// Names of all interfaces.
pub(crate) fn names() -> Vec<String> {
    indexed_names().into_iter().map(|(_, name)| name).collect()
}

/// Indices of the interfaces with a name that `wanted` accepts.
pub(crate) fn indices(wanted: impl Fn(&str) -> bool) -> Vec<u32> {
    indexed_names().into_iter().filter(|(_, name)| wanted(name)).map(|(index, _)| index).collect()
}

/// Name of the interface with this index.
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

fn describe(socket: libc::c_int, index: u32, name: String) -> Option<Interface> {
    let flags = kernel::interface_request(socket, &name, libc::SIOCGIFFLAGS as _).ok()?;
    let address = kernel::interface_request(socket, &name, libc::SIOCGIFHWADDR as _).ok()?;
    let mtu = kernel::interface_request(socket, &name, libc::SIOCGIFMTU as _).ok()?;
    // SAFETY: each request has filled this member.
    let (flags, address, mtu) =
        unsafe { (flags.ifr_ifru.ifru_flags, address.ifr_ifru.ifru_hwaddr, mtu.ifr_ifru.ifru_mtu) };
    let has = |flag: libc::c_int| libc::c_int::from(flags) & flag != 0;
    let carrier = kernel::link_up(socket, &name).unwrap_or(has(libc::IFF_UP) && has(libc::IFF_RUNNING));
    Some(Interface {
        name,
        index,
        mac: kernel::hardware_address(&address),
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
    fn a_missing_interface_has_no_carrier_state() {
        for name in ["", "no-such", "a-name-that-is-longer-than-the-kernel-allows", "with\0end"] {
            assert_eq!(carrier(name), None, "{name:?}");
            assert!(matches!(switch(name, false), Err(LinkError::NoInterface { .. })), "{name:?}");
        }
    }
}
