//! A network interface: its link, other users of it, its driver and what that is set to.

use std::net::IpAddr;

use ringcat_link::interface::ethtool::{Coalescing, Driver, NoAnswer, Settings};
use ringcat_link::interface::{Interface, Unknown, UseWarning, Uses};

use super::finding::{Finding, Topic};
use super::inspect::{self, Inspect, Unseen};

const LINK: Topic = Topic { id: "link", why: "without a link at full duplex no frame passes, or frames collide" };
const ADDRESS: Topic =
    Topic { id: "address", why: "with an IP address other programs of this host send into the segment" };
const MEMBERSHIP: Topic =
    Topic { id: "bridge", why: "a bridge or bond takes frames, and sends frames of its own into the segment" };
const SOCKETS: Topic =
    Topic { id: "other-program", why: "two MainDevices that do not know of each other disturb the segment" };
const MTU: Topic = Topic { id: "mtu", why: "EtherCAT frames of full length need an MTU of 1500" };
const MANAGER: Topic = Topic {
    id: "network-manager",
    why: "a network manager requests addresses, sends frames of its own and may switch the interface off",
};
const DRIVER: Topic =
    Topic { id: "driver", why: "behind USB or a virtual device, frames wait for others to be polled" };
const COALESCING: Topic = Topic {
    id: "coalescing",
    why: "a network card that waits before its interrupt lets each returning frame wait too",
};
const OFFLOADS: Topic =
    Topic { id: "offloads", why: "collecting frames into larger ones takes time and never succeeds with EtherCAT" };
const EEE: Topic =
    Topic { id: "eee", why: "a link that sleeps between frames takes tens of microseconds to wake up, or is lost" };
const DEFERRED: Topic =
    Topic { id: "deferred-interrupts", why: "the kernel then collects received frames before it delivers them" };

/// Drivers of interfaces without hardware of this machine.
const VIRTUAL: [&str; 7] = ["veth", "tun", "dummy", "bridge", "bonding", "macvlan", "802.1Q VLAN Support"];
/// Drivers of devices that a virtual machine gets from its host.
const PARAVIRTUAL: [&str; 6] = ["virtio_net", "vmxnet3", "hv_netvsc", "xen_netfront", "ena", "gve"];
/// Drivers for which 1 and 3 us mean that the wait adapts.
const ADAPTIVE_AT_3: [&str; 4] = ["e1000", "e1000e", "igb", "igc"];
/// A wait after a received frame that costs a part of a cycle, in microseconds.
const LONG_WAIT_US: u32 = 20;
/// RingCAT's daemon, as the kernel names its processes.
const DAEMON: &str = "ringcatd";
/// Speed of EtherCAT, in Mbit/s.
const ETHERCAT_MBITS: u32 = 100;

/// All checks of an interface that exists.
pub fn checks(machine: &dyn Inspect, interface: &Interface) -> Vec<Finding> {
    let name = interface.name.as_str();
    if interface.loopback {
        let text = "it is the loopback, which no cable can be plugged into";
        return vec![LINK.bad(text, &["take an Ethernet interface: ip link"]).on(name)];
    }
    let (settings, uses) = (machine.settings(name), machine.uses(name));
    let mut findings = vec![link(interface, &settings)];
    findings.extend(other_users(name, &uses));
    findings.push(MANAGER.of(manager(machine, interface)));
    findings.extend(device(name, &settings));
    findings.push(DEFERRED.of(deferred(machine, interface)));
    findings.into_iter().map(|finding| finding.on(name)).collect()
}

fn link(interface: &Interface, settings: &Settings) -> Finding {
    let name = &interface.name;
    if !interface.up {
        return LINK.bad("the interface is switched off", &[&format!("sudo ip link set {name} up")]);
    }
    if !interface.carrier {
        return LINK.bad("there is no link partner", &["plug the cable in; does the first SubDevice have power?"]);
    }
    let is_virtual = settings.driver.as_ref().is_ok_and(|driver| VIRTUAL.contains(&driver.name.as_str()));
    match &settings.link {
        _ if is_virtual => LINK.good("up, with a link partner"),
        Ok(link) if link.full_duplex == Some(false) => {
            LINK.bad("half duplex", &[&format!("sudo ethtool -s {name} autoneg on")])
        }
        Ok(link) => match link.mbits {
            Some(ETHERCAT_MBITS) => LINK.good("up, 100 Mbit/s"),
            Some(mbits) => LINK.minor(
                format!("{mbits} Mbit/s: most EtherCAT has 100, so this may be no SubDevice"),
                &["see what the other end of the cable is plugged into"],
            ),
            None => LINK.unknown("up, with a link partner; the driver does not report its speed"),
        },
        Err(reason) => LINK.unknown(format!("up, with a link partner; its speed: {reason}")),
    }
}

/// Other programs that use the interface. Kernel modules are checked elsewhere.
fn other_users(name: &str, uses: &Uses) -> Vec<Finding> {
    let mut findings: Vec<Finding> = uses.found.iter().filter_map(other_user).collect();
    findings.extend(addresses(name, &uses.found));
    let has = |findings: &[Finding], topic: Topic| findings.iter().any(|finding| finding.id == topic.id);
    for what in &uses.unknown {
        match what {
            Unknown::Addresses => findings.push(ADDRESS.unknown("the kernel does not report addresses")),
            Unknown::Membership => findings.push(MEMBERSHIP.unknown("the kernel does not report what it belongs to")),
            Unknown::Sockets => findings.push(SOCKETS.unknown("/proc/net/packet cannot be read")),
            _ => {}
        }
    }
    let good = [
        (ADDRESS, "it has no IP address"),
        (MEMBERSHIP, "it is no member of a bridge or bond"),
        (SOCKETS, "no other program receives EtherCAT frames on it"),
        (MTU, "large enough"),
    ];
    for (topic, text) in good {
        if !has(&findings, topic) {
            findings.push(topic.good(text));
        }
    }
    findings
}

/// All addresses in one finding.
fn addresses(name: &str, found: &[UseWarning]) -> Option<Finding> {
    let addresses = found.iter().filter_map(|warning| match warning {
        UseWarning::Address { address, .. } => Some(*address),
        _ => None,
    });
    let (v6, v4): (Vec<IpAddr>, Vec<IpAddr>) = addresses.partition(IpAddr::is_ipv6);
    let all: Vec<String> = v4.iter().chain(&v6).map(ToString::to_string).collect();
    let (flush, off) = (
        format!("sudo ip address flush dev {name}"),
        format!("sudo sysctl net.ipv6.conf.{}.disable_ipv6=1", name.replace('.', "/")),
    );
    let mend = [(&flush, !v4.is_empty()), (&off, !v6.is_empty())];
    let mend: Vec<&str> = mend.iter().filter(|(_, helps)| *helps).map(|(command, _)| command.as_str()).collect();
    (!all.is_empty()).then(|| ADDRESS.bad(all.join(", "), &mend))
}

fn other_user(warning: &UseWarning) -> Option<Finding> {
    Some(match warning {
        UseWarning::Member { interface, controller, kind } => {
            let mend = format!("sudo ip link set {interface} nomaster");
            MEMBERSHIP.bad(format!("it is a member of the {kind} {controller}"), &[&mend])
        }
        UseWarning::Socket { owner: Some((process, name)), .. } if name == DAEMON => {
            SOCKETS.good(format!("the daemon {DAEMON} (process {process}) has it: use --master in place of --main"))
        }
        UseWarning::Socket { owner: Some((process, name)), .. } => {
            let text = format!("process {process} ({name}) receives EtherCAT frames on it");
            SOCKETS.bad(text, &["stop it if it is another MainDevice", &format!("sudo kill {process}")])
        }
        UseWarning::Socket { owner: None, .. } => {
            let mend = ["sudo ss -0p", "stop what it shows if it is another MainDevice"];
            SOCKETS.bad("another program receives EtherCAT frames on it", &mend)
        }
        UseWarning::SmallMtu { interface, mtu } => MTU.bad(mtu, &[&format!("sudo ip link set {interface} mtu 1500")]),
        _ => return None,
    })
}

/// Whether a network manager has the interface.
fn manager(machine: &dyn Inspect, interface: &Interface) -> Result<Finding, Unseen> {
    let (name, index) = (&interface.name, interface.index);
    let runs = inspect::running(machine, &["NetworkManager"])?.is_some();
    let file = format!("/run/NetworkManager/devices/{index}");
    let state = if runs { machine.read_if_there(&file)? } else { None };
    let managed = |key: &str| state.as_deref().and_then(|text| text.lines().find_map(|line| line.strip_prefix(key)));
    match managed("managed=") {
        Some("true") => {
            let mend = format!("sudo nmcli device set {name} managed no");
            return Ok(MANAGER.bad("NetworkManager manages it", &[&mend, "for good: see docs/doctor.md"]));
        }
        Some("false") => return Ok(MANAGER.good("NetworkManager leaves it alone")),
        _ if runs => return Ok(MANAGER.unknown("NetworkManager runs; nmcli device status shows what it manages")),
        _ => {}
    }
    if inspect::running(machine, &["systemd-network"])?.is_none() {
        return Ok(MANAGER.good("no NetworkManager and no systemd-networkd run"));
    }
    let file = format!("/run/systemd/netif/links/{index}");
    let state = machine.read(&file)?;
    match state.lines().find_map(|line| line.strip_prefix("ADMIN_STATE=")) {
        Some("unmanaged") => Ok(MANAGER.good("systemd-networkd leaves it alone")),
        Some(_) => Ok(MANAGER.bad("systemd-networkd manages it", &["Unmanaged=yes: see docs/doctor.md"])),
        None => Err(Unseen::Strange(file)),
    }
}

/// The device: driver, interrupts, offloads, energy-efficient Ethernet.
fn device(name: &str, settings: &Settings) -> Vec<Finding> {
    let driver = match &settings.driver {
        Ok(driver) => driver,
        Err(reason) => &Driver { name: String::new(), bus: reason.to_string() },
    };
    let is_virtual = VIRTUAL.contains(&driver.name.as_str());
    let none = "a virtual interface has none";
    let (coalescing, eee) = match is_virtual {
        true => (COALESCING.good(none), EEE.good(none)),
        false => (coalescing(name, &driver.name, &settings.coalescing), eee(name, settings)),
    };
    vec![device_of(driver), coalescing, offloads(name, settings), eee]
}

fn device_of(driver: &Driver) -> Finding {
    let Driver { name, bus } = driver;
    let on_board = "take an Ethernet port on PCI Express or of the processor";
    match name.as_str() {
        "" => DRIVER.unknown(bus),
        _ if bus.starts_with("usb-") => DRIVER.bad(format!("{name}, behind USB"), &[on_board]),
        name if VIRTUAL.contains(&name) => DRIVER.minor(format!("{name}: a virtual interface"), &[on_board]),
        name if PARAVIRTUAL.contains(&name) => {
            let mend = ["give the virtual machine a network card of its own (PCI pass-through)"];
            DRIVER.bad(format!("{name}: the host of this virtual machine handles its frames"), &mend)
        }
        name => DRIVER.good(name),
    }
}

fn coalescing(interface: &str, driver: &str, found: &Result<Coalescing, NoAnswer>) -> Finding {
    let found = match found {
        Ok(found) => *found,
        Err(reason) => return COALESCING.unknown(reason),
    };
    let Coalescing { rx_us, tx_us, adaptive_rx, adaptive_tx } = found;
    let adapts = adaptive_rx || (ADAPTIVE_AT_3.contains(&driver) && matches!(rx_us, 1 | 3));
    let text = match adapts {
        true => format!("the wait after received frames adapts to their rate (rx-usecs {rx_us})"),
        false => format!("interrupts wait {rx_us} us after received frames, {tx_us} us after sent ones"),
    };
    let quick = format!("sudo ethtool -C {interface} rx-usecs 0 tx-usecs 0");
    let steady = format!("sudo ethtool -C {interface} adaptive-rx off adaptive-tx off");
    let mend: Vec<&str> = match adaptive_rx || adaptive_tx {
        true => vec![&steady, &quick],
        false => vec![&quick],
    };
    if adapts || rx_us >= LONG_WAIT_US {
        COALESCING.bad(text, &mend)
    } else if rx_us > 0 || adaptive_tx {
        COALESCING.minor(text, &mend)
    } else {
        COALESCING.good("an interrupt for each received frame")
    }
}

fn offloads(interface: &str, settings: &Settings) -> Finding {
    match settings.offloads {
        Err(reason) => OFFLOADS.unknown(reason),
        Ok(found) => {
            let names: Vec<&str> =
                [("gro", found.gro), ("lro", found.lro)].iter().filter(|it| it.1).map(|it| it.0).collect();
            if names.is_empty() {
                return OFFLOADS.good("received frames are not collected");
            }
            let off: String = names.iter().map(|name| format!(" {name} off")).collect();
            OFFLOADS.minor(format!("{} on", names.join(" and ")), &[&format!("sudo ethtool -K {interface}{off}")])
        }
    }
}

fn eee(interface: &str, settings: &Settings) -> Finding {
    let mend = format!("sudo ethtool --set-eee {interface} eee off");
    match settings.eee {
        Err(reason) => EEE.unknown(reason),
        Ok(found) if found.active => EEE.bad("energy-efficient Ethernet is active", &[&mend]),
        Ok(found) if found.enabled => {
            EEE.minor("energy-efficient Ethernet is permitted; the link partner does not use it", &[&mend])
        }
        Ok(_) => EEE.good("off"),
    }
}

/// Received frames that the kernel collects (`napi_defer_hard_irqs`, `gro_flush_timeout`).
fn deferred(machine: &dyn Inspect, interface: &Interface) -> Result<Finding, Unseen> {
    let directory = format!("/sys/class/net/{}", interface.name);
    // /sys shows the network namespace in which it was mounted.
    let index = inspect::number(machine, &format!("{directory}/ifindex"))?;
    if index != i64::from(interface.index) {
        return Ok(DEFERRED.unknown("/sys shows the interfaces of another network namespace"));
    }
    let zero = |name: &str| inspect::number(machine, &format!("{directory}/{name}"));
    let (timeout_ns, interrupts) = (zero("gro_flush_timeout")?, zero("napi_defer_hard_irqs")?);
    if timeout_ns == 0 && interrupts == 0 {
        return Ok(DEFERRED.good("off"));
    }
    let command = |file: &str| format!("echo 0 | sudo tee {directory}/{file}");
    Ok(DEFERRED.bad(
        format!("received frames wait for up to {timeout_ns} ns, {interrupts} interrupts are put off"),
        &[&command("napi_defer_hard_irqs"), &command("gro_flush_timeout")],
    ))
}
