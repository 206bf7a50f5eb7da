//! What the kernel and the driver report of an interface.

use ringcat_link::interface::ethtool::{Coalescing, Driver, Eee, Link, NoAnswer, Offloads};
use ringcat_link::interface::{Unknown, UseWarning};

use super::super::finding::Level;
use super::specimen::{NAME, Specimen, assert_finding, of};

/// What is changed on a good machine: the finding, how bad it is, what it says, and what corrects it.
type Case = (&'static str, Level, &'static str, &'static str, fn(&mut Specimen));

/// The link, and what else uses it.
const USES: [Case; 14] = [
    ("link", Level::Bad, "switched off", "sudo ip link set enp12s0f1np1abc up", |it| it.interface.up = false),
    ("link", Level::Bad, "no link partner", "plug", |it| it.interface.carrier = false),
    ("link", Level::Bad, "half duplex", "autoneg on", |it| {
        it.settings.link = Ok(Link { mbits: Some(100), full_duplex: Some(false) })
    }),
    ("link", Level::Minor, "1000 Mbit/s", "other end", |it| {
        it.settings.link = Ok(Link { mbits: Some(1_000), full_duplex: Some(true) })
    }),
    ("link", Level::Unknown, "does not report", "", |it| {
        it.settings.link = Ok(Link { mbits: None, full_duplex: None })
    }),
    ("link", Level::Unknown, "does not report", "", |it| it.settings.link = Err(NoAnswer::NotSupported)),
    ("address", Level::Bad, "192.0.2.2", "sudo ip address flush dev enp12s0f1np1abc", |it| {
        note(it, UseWarning::Address { interface: NAME.into(), address: [192, 0, 2, 2].into() })
    }),
    ("address", Level::Bad, "fe80::1", "disable_ipv6=1", |it| {
        note(it, UseWarning::Address { interface: NAME.into(), address: "fe80::1".parse().expect("one") })
    }),
    ("bridge", Level::Bad, "bond bond0", "nomaster", |it| {
        note(it, UseWarning::Member { interface: NAME.into(), controller: "bond0".into(), kind: "bond".into() })
    }),
    ("other-program", Level::Bad, "process 9 (soem)", "sudo kill 9", |it| {
        note(it, UseWarning::Socket { interface: NAME.into(), owner: Some((9, "soem".into())) })
    }),
    ("other-program", Level::Bad, "another program", "sudo ss -0p", |it| {
        note(it, UseWarning::Socket { interface: NAME.into(), owner: None })
    }),
    ("mtu", Level::Bad, "576", "mtu 1500", |it| note(it, UseWarning::SmallMtu { interface: NAME.into(), mtu: 576 })),
    ("other-program", Level::Good, "the daemon ringcatd (process 9)", "", |it| {
        note(it, UseWarning::Socket { interface: NAME.into(), owner: Some((9, "ringcatd".into())) })
    }),
    ("other-program", Level::Unknown, "/proc/net/packet", "", |it| it.uses.unknown.push(Unknown::Sockets)),
];

/// The device.
const DEVICE: [Case; 9] = [
    ("driver", Level::Bad, "behind USB", "PCI", |it| {
        it.settings.driver = Ok(Driver { name: "r8152".into(), bus: "usb-0000:00:14.0-2".into() })
    }),
    ("driver", Level::Bad, "virtio_net", "pass-through", |it| {
        it.settings.driver = Ok(Driver { name: "virtio_net".into(), bus: String::new() })
    }),
    ("driver", Level::Unknown, "does not report", "", |it| it.settings.driver = Err(NoAnswer::NotSupported)),
    ("coalescing", Level::Bad, "adapts", "adaptive-rx off", |it| {
        it.settings.coalescing = Ok(Coalescing { adaptive_rx: true, ..Coalescing::default() })
    }),
    ("coalescing", Level::Bad, "adapts", "rx-usecs 0", |it| {
        it.settings.coalescing = Ok(Coalescing { rx_us: 3, ..Coalescing::default() })
    }),
    ("coalescing", Level::Minor, "wait 5 us", "rx-usecs 0", |it| {
        it.settings.coalescing = Ok(Coalescing { rx_us: 5, ..Coalescing::default() })
    }),
    ("offloads", Level::Minor, "gro and lro on", "gro off lro off", |it| {
        it.settings.offloads = Ok(Offloads { gro: true, lro: true })
    }),
    ("eee", Level::Bad, "active", "eee off", |it| it.settings.eee = Ok(Eee { enabled: true, active: true })),
    ("eee", Level::Unknown, "does not report", "", |it| it.settings.eee = Err(NoAnswer::NotSupported)),
];

// covers: bench
#[test]
fn what_the_kernel_and_the_driver_report_of_an_interface_is_rated() {
    for (id, level, what, mend, change) in USES.into_iter().chain(DEVICE) {
        let mut specimen = Specimen::good();
        change(&mut specimen);
        let findings = specimen.checks();
        assert_finding(&findings, id, level, what, mend);
        assert_eq!(of(&findings, id).interface.as_deref(), Some(NAME));
    }
}

fn note(specimen: &mut Specimen, warning: UseWarning) {
    specimen.uses.found.push(warning);
}

// covers: bench
#[test]
fn all_addresses_are_one_finding() {
    let mut specimen = Specimen::good();
    for address in ["fe80::1", "192.0.2.2", "2001:db8::1", "192.0.2.3"] {
        let address = address.parse().expect("an address");
        note(&mut specimen, UseWarning::Address { interface: NAME.into(), address });
    }
    let findings = specimen.checks();
    assert_finding(&findings, "address", Level::Bad, "192.0.2.2, 192.0.2.3, fe80::1, 2001:db8::1", "disable_ipv6=1");
    assert_eq!(of(&findings, "address").mend.len(), 2);
}

// covers: bench
#[test]
fn a_virtual_interface_has_no_interrupts_that_could_wait() {
    let mut specimen = Specimen::good();
    specimen.settings.driver = Ok(Driver { name: "veth".into(), bus: String::new() });
    specimen.settings.coalescing = Err(NoAnswer::NotSupported);
    specimen.settings.eee = Err(NoAnswer::NotSupported);
    let findings = specimen.checks();
    assert_eq!(of(&findings, "driver").level, Level::Minor);
    assert_eq!((of(&findings, "coalescing").level, of(&findings, "eee").level), (Level::Good, Level::Good));
    specimen.interface.loopback = true;
    assert_finding(&specimen.checks(), "link", Level::Bad, "loopback", "ip link");
}
