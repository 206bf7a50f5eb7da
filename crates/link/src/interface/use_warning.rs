//! Other users of an interface that EtherCAT needs exclusively.
//!
//! Input: a name. Output: [`UseWarning`]s whose texts contain advice. They are warnings only: some machines and many
//! test benches use an interface so on purpose.

use std::collections::HashSet;
use std::ffi::CStr;
use std::fmt;
use std::fs;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr};

use super::netlink;
use crate::filter::ETHERCAT;

/// Another use of the interface.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum UseWarning {
    /// The interface has an IP address of the host.
    Address {
        /// The interface.
        interface: String,
        /// One of its addresses.
        address: IpAddr,
    },
    /// The interface is a member of a bridge or bond, which takes or sends frames.
    Member {
        /// The interface.
        interface: String,
        /// The bridge or bond.
        controller: String,
        /// "bridge", "bond", ...
        kind: String,
    },
    /// Another socket receives EtherCAT frames on the interface: another MainDevice or another instance of this
    /// program.
    Socket {
        /// The interface.
        interface: String,
        /// Process and its name, if this user may read them.
        owner: Option<(u32, String)>,
    },
    /// Kernel modules of a MainDevice are loaded.
    KernelModule {
        /// The module.
        module: String,
    },
    /// The MTU is too small for an EtherCAT frame of full length.
    SmallMtu {
        /// The interface.
        interface: String,
        /// The MTU.
        mtu: u32,
    },
}

impl fmt::Display for UseWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            UseWarning::Address { interface, address: IpAddr::V6(address) } if address.is_unicast_link_local() => {
                write!(
                    f,
                    "IPv6 is enabled on {interface} ({address}), so the host sends frames of its own into the segment; \
                 sudo sysctl net.ipv6.conf.{interface}.disable_ipv6=1"
                )
            }
            UseWarning::Address { interface, address } => write!(
                f,
                "{interface} has the IP address {address}, so other programs send into the segment; take an interface \
                 for EtherCAT alone, or: sudo ip address flush dev {interface}"
            ),
            UseWarning::Member { interface, controller, kind } => write!(
                f,
                "{interface} is a member of the {kind} {controller}, which sends and takes frames of its own; \
                 sudo ip link set {interface} nomaster"
            ),
            UseWarning::Socket { interface, owner: Some((process, name)) } => write!(
                f,
                "process {process} ({name}) receives EtherCAT frames on {interface} already; stop it if it is another \
                 MainDevice: two that do not know of each other disturb the segment"
            ),
            UseWarning::Socket { interface, owner: None } => write!(
                f,
                "another program receives EtherCAT frames on {interface} already (sudo ss -0p shows which); stop it if \
                 it is another MainDevice: two that do not know of each other disturb the segment"
            ),
            UseWarning::KernelModule { module } => write!(
                f,
                "the kernel module {module} of another EtherCAT MainDevice is loaded and may use the interface; stop \
                 that MainDevice: sudo systemctl stop ethercat"
            ),
            UseWarning::SmallMtu { interface, mtu } => write!(
                f,
                "the MTU of {interface} is {mtu}, too small for whole EtherCAT frames; \
                 sudo ip link set {interface} mtu 1500"
            ),
        }
    }
}

/// Other users of this interface. Empty for an interface that does not exist.
pub fn exclusive_use(name: &str) -> Vec<UseWarning> {
    uses(name).found
}

/// Other users of an interface, and what could not be looked at.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Uses {
    /// What was found.
    pub found: Vec<UseWarning>,
    /// What the kernel did not report: there may be more.
    pub unknown: Vec<Unknown>,
}

/// A use of an interface that the kernel did not report anything about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Unknown {
    /// Addresses of the interface.
    Addresses,
    /// The bridge or bond that it is a member of.
    Membership,
    /// Sockets of other programs.
    Sockets,
    /// Kernel modules.
    KernelModules,
}

/// As [`exclusive_use`], with what could not be looked at.
pub fn uses(name: &str) -> Uses {
    let mut uses = Uses::default();
    let Some(interface) = super::list().into_iter().find(|interface| interface.name == name) else {
        return uses;
    };
    let address = |address| UseWarning::Address { interface: name.to_owned(), address };
    uses.note(Unknown::Addresses, addresses(name).map(|all| all.into_iter().map(address).collect()));
    uses.note(Unknown::Membership, member(name, interface.index));
    uses.note(Unknown::Sockets, sockets(name, interface.index));
    let modules = fs::read_to_string("/proc/modules").ok();
    let modules =
        modules.map(|table| kernel_modules(&table).map(|module| UseWarning::KernelModule { module }).collect());
    uses.note(Unknown::KernelModules, modules);
    if interface.mtu < 1500 {
        uses.found.push(UseWarning::SmallMtu { interface: name.to_owned(), mtu: interface.mtu });
    }
    uses
}

impl Uses {
    fn note(&mut self, what: Unknown, found: Option<Vec<UseWarning>>) {
        match found {
            Some(found) => self.found.extend(found),
            None => self.unknown.push(what),
        }
    }
}

fn read(path: &str) -> String {
    fs::read_to_string(path).unwrap_or_default()
}

/// Addresses of an interface; `None` if the kernel does not list them.
fn addresses(name: &str) -> Option<Vec<IpAddr>> {
    let mut found = Vec::new();
    let mut list: *mut libc::ifaddrs = std::ptr::null_mut();
    // SAFETY: the pointer refers to a live variable for the list.
    if unsafe { libc::getifaddrs(&mut list) } != 0 {
        return None;
    }
    let mut at = list;
    while !at.is_null() {
        // SAFETY: an entry of the list that getifaddrs returned and that is not freed yet.
        let entry = unsafe { &*at };
        // SAFETY: names in the list are null-terminated strings.
        if unsafe { CStr::from_ptr(entry.ifa_name) }.to_bytes() == name.as_bytes() {
            found.extend(address(entry.ifa_addr));
        }
        at = entry.ifa_next;
    }
    // SAFETY: the list is freed once, after its last use.
    unsafe { libc::freeifaddrs(list) };
    Some(found)
}

fn address(address: *const libc::sockaddr) -> Option<IpAddr> {
    if address.is_null() {
        return None;
    }
    // SAFETY: getifaddrs returns addresses of the size of their family, aligned for every family.
    unsafe {
        match libc::c_int::from((*address).sa_family) {
            libc::AF_INET => {
                let v4 = &*address.cast::<libc::sockaddr_in>();
                Some(IpAddr::V4(Ipv4Addr::from(u32::from_be(v4.sin_addr.s_addr))))
            }
            libc::AF_INET6 => {
                let v6 = &*address.cast::<libc::sockaddr_in6>();
                Some(IpAddr::V6(Ipv6Addr::from(v6.sin6_addr.s6_addr)))
            }
            _ => None,
        }
    }
}

/// The bridge or bond of an interface; `None` if the kernel does not respond.
fn member(name: &str, index: u32) -> Option<Vec<UseWarning>> {
    let Some(controller) = netlink::membership(index)?.controller else { return Some(Vec::new()) };
    let kind = netlink::membership(controller).map(|m| m.kind).filter(|kind| !kind.is_empty());
    let controller_name = super::list().into_iter().find(|i| i.index == controller).map(|i| i.name);
    Some(vec![UseWarning::Member {
        interface: name.to_owned(),
        controller: controller_name.unwrap_or_else(|| format!("with index {controller}")),
        kind: kind.unwrap_or_else(|| "interface".to_owned()),
    }])
}

/// Packet sockets for EtherCAT on this interface that belong to other processes, one warning per process;
/// `None` if the kernel's table cannot be read.
fn sockets(name: &str, index: u32) -> Option<Vec<UseWarning>> {
    let inodes = bound_inodes(&fs::read_to_string("/proc/thread-self/net/packet").ok()?, index);
    if inodes.is_empty() {
        return Some(Vec::new());
    }
    let own: HashSet<u64> = socket_inodes("self").collect();
    let mut owners: Vec<Option<(u32, String)>> = Vec::new();
    for inode in inodes.into_iter().filter(|inode| !own.contains(inode)) {
        let owner = owner(inode);
        if !owners.contains(&owner) {
            owners.push(owner);
        }
    }
    Some(owners.into_iter().map(|owner| UseWarning::Socket { interface: name.to_owned(), owner }).collect())
}

/// Inodes of the sockets in the kernel's table that are bound to EtherCAT and this interface.
fn bound_inodes(table: &str, index: u32) -> Vec<u64> {
    let inode = |line: &str| {
        let columns: Vec<&str> = line.split_whitespace().collect();
        let protocol = u16::from_str_radix(columns.get(3)?, 16).ok()?;
        let interface: u32 = columns.get(4)?.parse().ok()?;
        let inode = columns.get(8)?.parse().ok()?;
        (protocol == ETHERCAT && interface == index).then_some(inode)
    };
    table.lines().skip(1).filter_map(inode).collect()
}

/// The process that has this socket open, if this user may read it.
fn owner(inode: u64) -> Option<(u32, String)> {
    for entry in fs::read_dir("/proc").ok()?.flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let Ok(process) = name.parse() else { continue };
        if socket_inodes(&name).any(|of_process| of_process == inode) {
            return Some((process, read(&format!("/proc/{name}/comm")).trim_end().to_owned()));
        }
    }
    None
}

/// Inodes of the sockets that a process has open.
fn socket_inodes(process: &str) -> impl Iterator<Item = u64> + use<> {
    let entries = fs::read_dir(format!("/proc/{process}/fd")).into_iter().flatten().flatten();
    entries.filter_map(|entry| {
        let target = fs::read_link(entry.path()).ok()?;
        target.to_str()?.strip_prefix("socket:[")?.strip_suffix(']')?.parse().ok()
    })
}

/// Loaded kernel modules of EtherCAT MainDevices.
fn kernel_modules(table: &str) -> impl Iterator<Item = String> + use<'_> {
    let name = |line: &'_ str| line.split_whitespace().next().map(str::to_owned);
    table.lines().filter_map(name).filter(|name| name == "ec_master")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sockets_for_ethercat_on_the_interface_are_found_in_the_kernels_table() {
        let table = "sk               RefCnt Type Proto  Iface R Rmem   User   Inode\n\
                     0000000000000000 3      3    88a4   4     1 0      0      111\n\
                     0000000000000000 3      3    88a4   5     1 0      0      222\n\
                     0000000000000000 3      3    0003   4     1 0      0      333\n\
                     0000000000000000 3      3    88a4   4     1 0      0      444\n\
                     short line\n";
        assert_eq!(bound_inodes(table, 4), [111, 444]);
        assert!(bound_inodes("", 4).is_empty());
    }

    #[test]
    fn a_maindevice_inside_the_kernel_is_found_by_its_module() {
        let table = "ec_generic 16384 0 - Live 0x0\nec_master 512000 1 ec_generic, Live 0x0\nveth 4096 0 - Live 0x0\n";
        assert_eq!(kernel_modules(table).collect::<Vec<_>>(), ["ec_master"]);
    }

    #[test]
    fn the_loopback_has_an_address_unless_it_is_down() {
        let lo = crate::interface::list().into_iter().find(|i| i.name == "lo").expect("an interface lo");
        let expected = UseWarning::Address { interface: "lo".to_owned(), address: Ipv4Addr::LOCALHOST.into() };
        assert_eq!(exclusive_use("lo").contains(&expected), lo.up);
        assert!(exclusive_use("no-such").is_empty());
    }

    #[test]
    fn each_warning_contains_advice() {
        let interface = "eth1".to_owned();
        let address = |address: &str| UseWarning::Address {
            interface: interface.clone(),
            address: address.parse().expect("an address"),
        };
        let member = |kind: &str| UseWarning::Member {
            interface: interface.clone(),
            controller: "br0".to_owned(),
            kind: kind.to_owned(),
        };
        let socket = |owner| UseWarning::Socket { interface: interface.clone(), owner };
        let cases = [
            (address("192.168.1.2"), "sudo ip address flush dev eth1"),
            (address("fe80::1"), "sudo sysctl net.ipv6.conf.eth1.disable_ipv6=1"),
            (member("bridge"), "sudo ip link set eth1 nomaster"),
            (socket(None), "sudo ss -0p"),
            (socket(Some((77, "other".to_owned()))), "process 77 (other)"),
            (UseWarning::KernelModule { module: "ec_master".to_owned() }, "sudo systemctl stop ethercat"),
            (UseWarning::SmallMtu { interface: interface.clone(), mtu: 576 }, "sudo ip link set eth1 mtu 1500"),
        ];
        for (warning, advice) in cases {
            assert!(warning.to_string().contains(advice), "{warning}");
        }
    }
}
