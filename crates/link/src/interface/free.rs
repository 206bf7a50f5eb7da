//! Whether EtherCAT may take an interface that is not named, and what prevents that.
//!
//! Input: an interface of the list. Output: why not, or nothing. An interface that is not named is taken only if the
//! host does not use it at all; every doubt prevents it. The host's network must never be disturbed.

use std::fs;
use std::path::Path;

use super::{Interface, exclusive_use, netlink};
use crate::interface::UseWarning;

/// Kinds of interfaces with a cable: those of a driver have none.
const WITH_CABLE: [&str; 2] = ["", "veth"];

/// Why EtherCAT must not take this interface unless it is named; `None`: it may.
pub fn hindrance(interface: &Interface) -> Option<String> {
    let name = &interface.name;
    if let Some(reason) = in_use(interface) {
        return Some(reason);
    }
    if !interface.up {
        return Some(format!("it is switched off; sudo ip link set {name} up"));
    }
    (!interface.carrier).then(|| "it has no cable, or nothing is at its other end".to_owned())
}

/// What of the host uses this interface, whether it is switched on or not.
pub fn in_use(interface: &Interface) -> Option<String> {
    let name = &interface.name;
    if interface.loopback {
        return Some("it is the loopback".to_owned());
    }
    let Some(membership) = netlink::membership(interface.index) else {
        return Some("the kernel does not say what it belongs to".to_owned());
    };
    if !WITH_CABLE.contains(&membership.kind.as_str()) {
        return Some(format!("it is of the kind {:?}", membership.kind));
    }
    // `/sys` may be that of another namespace: then one more is left alone.
    let of_system = |file: &str| Path::new("/sys/class/net").join(name).join(file).exists();
    if of_system("wireless") || of_system("phy80211") {
        return Some("it is wireless".to_owned());
    }
    let warnings = exclusive_use(name);
    if let Some(warning) = warnings.into_iter().find(|it| !matches!(it, UseWarning::SmallMtu { .. })) {
        // Without the advice in the warning: nothing of the host is to be changed for an interface that was not named.
        return warning.to_string().split(';').next().map(str::to_owned);
    }
    if has_route_v4(&read("/proc/thread-self/net/route"), name) {
        return Some(format!("the host has a route over it; ip route show dev {name}"));
    }
    if has_default_v6(&read("/proc/thread-self/net/ipv6_route"), name) {
        return Some(format!("the host has a default route over it; ip -6 route show dev {name}"));
    }
    let above = super::list().into_iter().find(|other| netlink::is_above(other.index, interface.index));
    above.map(|other| format!("{} uses it", other.name))
}

/// Whether it is an interface with a cable, none that is made of another one.
pub fn has_cable(interface: &Interface) -> bool {
    netlink::membership(interface.index).is_some_and(|it| WITH_CABLE.contains(&it.kind.as_str()))
}

fn read(path: &str) -> String {
    fs::read_to_string(path).unwrap_or_default()
}

/// Any route of the kernel's table for IPv4: interface, destination, ...
fn has_route_v4(table: &str, name: &str) -> bool {
    table.lines().skip(1).any(|line| line.split_whitespace().next() == Some(name))
}

/// A default route of the kernel's table for IPv6: destination, length of its prefix, ..., interface.
fn has_default_v6(table: &str, name: &str) -> bool {
    table.lines().any(|line| {
        let mut columns = line.split_whitespace();
        let (_, prefix) = (columns.next(), columns.next());
        prefix == Some("00") && columns.next_back() == Some(name)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn routes_are_found_in_the_kernels_tables() {
        let table = "Iface\tDestination\tGateway\tFlags\neth0\t00000000\t0100A8C0\t0003\neth2\t0000FEA9\t0\t1\n\n";
        let found = ["eth0", "eth1", "eth2", "eth"].map(|name| has_route_v4(table, name));
        assert_eq!(found, [true, false, true, false]);
        assert!(!has_route_v4("", "eth0"));
        let zeros = "0".repeat(32);
        let line = |to: &str, prefix: &str, name: &str| {
            format!("{to} {prefix} {zeros} 00 {zeros} 00000400 00000001 00000000 00000001    {name}\n")
        };
        let group = format!("ff{}", "0".repeat(30));
        let table = line(&zeros, "00", "eth0") + &line(&group, "08", "eth1") + "short\n";
        assert_eq!(["eth0", "eth1"].map(|name| has_default_v6(&table, name)), [true, false]);
    }

    #[test]
    fn the_loopback_and_an_interface_that_is_gone_are_in_use() {
        let list = crate::interface::list();
        let mut lo = list.iter().find(|it| it.loopback).expect("an interface lo").clone();
        assert!(hindrance(&lo).is_some());
        (lo.loopback, lo.index, lo.name) = (false, u32::MAX >> 1, "no-such".to_owned());
        assert!(in_use(&lo).expect("it is not there").contains("does not say"));
    }
}
