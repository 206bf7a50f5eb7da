//! A machine whose files are in a directory, and what its findings are held against.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use ringcat_link::interface::ethtool::{Coalescing, Driver, Eee, Link, Offloads, Settings};
use ringcat_link::interface::{Interface, Uses};

use super::super::check_all;
use super::super::finding::{Finding, Level, lines};
use super::super::inspect::{HostFiles, Inspect};

/// As long as names of interfaces can be.
pub const NAME: &str = "enp12s0f1np1abc";

/// A machine whose files are in a directory, which is removed in the end.
pub struct Specimen {
    pub root: PathBuf,
    pub interface: Interface,
    pub uses: Uses,
    pub settings: Settings,
    pub variables: BTreeMap<&'static str, &'static str>,
}

impl Drop for Specimen {
    fn drop(&mut self) {
        fs::remove_dir_all(&self.root).expect("it is writable");
    }
}

impl HostFiles for Specimen {
    fn root(&self) -> &Path {
        &self.root
    }

    fn variable(&self, name: &str) -> Option<String> {
        self.variables.get(name).map(|value| (*value).to_owned())
    }
}

impl Inspect for Specimen {
    fn interface(&self, name: &str) -> Option<Interface> {
        (name == self.interface.name).then(|| self.interface.clone())
    }

    fn uses(&self, _: &str) -> Uses {
        self.uses.clone()
    }

    fn settings(&self, _: &str) -> Settings {
        self.settings.clone()
    }
}

/// Files of a machine on which nothing disturbs a MainDevice.
pub const GOOD: [(&str, &str); 39] = [
    ("proc/1/comm", "systemd\n"),
    ("proc/77/comm", "bash\n"),
    ("proc/sys/kernel/osrelease", "6.12.9-rt\n"),
    ("proc/sys/kernel/version", "#1 SMP PREEMPT_RT Debian 6.12.9\n"),
    ("proc/sys/kernel/sched_rt_runtime_us", "-1\n"),
    ("proc/sys/kernel/sched_rt_period_us", "1000000\n"),
    ("proc/cpuinfo", "processor\t: 0\nflags\t\t: fpu tsc sse\n\nprocessor\t: 1\nflags\t\t: fpu tsc sse\n"),
    ("proc/self/status", "Name:\tringcat\nCapEff:\t0000000000802000\n"),
    ("proc/self/limits", LIMITS),
    ("proc/modules", "igb 200000 0 - Live 0x0\nec_sys 16384 0 - Live 0x0\n"),
    ("proc/interrupts", "      CPU0 CPU1\n  24: 5 0 PCI-MSI enp12s0f1np1abc-rx-0\n  25: 9 0 PCI-MSI nvme0q1\n"),
    ("proc/irq/24/effective_affinity_list", "3\n"),
    ("proc/irq/25/effective_affinity_list", "0\n"),
    ("proc/irq/default_smp_affinity", "7\n"),
    ("sys/kernel/realtime", "1\n"),
    ("sys/devices/system/clocksource/clocksource0/current_clocksource", "tsc\n"),
    ("sys/devices/system/cpu/online", "0-3\n"),
    ("sys/devices/system/cpu/isolated", "3\n"),
    ("sys/devices/system/cpu/nohz_full", "3\n"),
    ("sys/devices/system/cpu/smt/active", "0\n"),
    ("sys/devices/system/cpu/cpu0/cpuidle/state0/name", "POLL\n"),
    ("sys/devices/system/cpu/cpu0/cpuidle/state0/latency", "0\n"),
    ("sys/devices/system/cpu/cpu0/cpuidle/state0/disable", "0\n"),
    ("sys/devices/system/cpu/cpu0/cpuidle/state1/name", "C1\n"),
    ("sys/devices/system/cpu/cpu0/cpuidle/state1/latency", "2\n"),
    ("sys/devices/system/cpu/cpu0/cpuidle/state1/disable", "0\n"),
    ("sys/devices/system/cpu/cpu1/cpuidle/state2/name", "C6\n"),
    ("sys/devices/system/cpu/cpu1/cpuidle/state2/latency", "400\n"),
    ("sys/devices/system/cpu/cpu1/cpuidle/state2/disable", "1\n"),
    ("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "performance\n"),
    ("sys/devices/system/cpu/cpu1/cpufreq/scaling_governor", "performance\n"),
    ("sys/class/net/enp12s0f1np1abc/ifindex", "7\n"),
    ("sys/class/net/enp12s0f1np1abc/gro_flush_timeout", "0\n"),
    ("sys/class/net/enp12s0f1np1abc/napi_defer_hard_irqs", "0\n"),
    ("usr/bin/ethercat", "\u{7f}ELF IgH EtherCAT master 1.6.6 (RingCAT 0.1.0)"),
    ("opt/other/bin/ethercat", "\u{7f}ELF IgH EtherCAT master 1.6.2"),
    ("usr/include/ecrt.h", "/* as RingCAT provides it */"),
    ("usr/lib/libethercat.so.1", "\u{7f}ELF /run/ringcat/control"),
    ("opt/other/lib/libethercat.so.1", "\u{7f}ELF"),
];

pub const LIMITS: &str = "\
Limit                     Soft Limit           Hard Limit           Units
Max locked memory         unlimited            unlimited            bytes
Max realtime priority     98                   98
";

impl Specimen {
    pub fn empty() -> Specimen {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let root = std::env::temp_dir().join(format!("ringcat-doctor-{}-{number}", std::process::id()));
        fs::create_dir_all(&root).expect("the temporary directory is writable");
        let interface = Interface {
            name: NAME.to_owned(),
            index: 7,
            mac: [2, 0, 0, 0, 0, 1],
            up: true,
            carrier: true,
            mtu: 1_500,
            loopback: false,
        };
        let settings = Settings {
            driver: Ok(Driver { name: "igb".to_owned(), bus: "0000:0c:00.1".to_owned() }),
            link: Ok(Link { mbits: Some(100), full_duplex: Some(true) }),
            coalescing: Ok(Coalescing::default()),
            offloads: Ok(Offloads::default()),
            eee: Ok(Eee::default()),
        };
        let variables = [("PATH", "/usr/bin:/opt/other/bin:relative")].into();
        Specimen { root, interface, uses: Uses::default(), settings, variables }
    }

    pub fn good() -> Specimen {
        let specimen = Specimen::empty();
        GOOD.iter().for_each(|(path, text)| specimen.write(path, text.as_bytes()));
        specimen
    }

    pub fn write(&self, path: &str, bytes: &[u8]) {
        let place = self.root.join(path);
        fs::create_dir_all(place.parent().expect("it is below the root")).expect("it is writable");
        fs::write(place, bytes).expect("it is writable");
    }

    pub fn checks(&self) -> Vec<Finding> {
        check_all(self, &[NAME]).expect("the interface is there")
    }
}

pub fn of<'a>(findings: &'a [Finding], id: &str) -> &'a Finding {
    let mut with_id = findings.iter().filter(|finding| finding.id == id);
    let first = with_id.next().unwrap_or_else(|| panic!("no finding {id}"));
    assert!(with_id.next().is_none(), "{id} twice: {findings:?}");
    first
}

/// A good machine with some files changed.
pub fn with(files: &[(&str, &str)]) -> Vec<Finding> {
    let specimen = Specimen::good();
    files.iter().for_each(|(path, text)| specimen.write(path, text.as_bytes()));
    specimen.checks()
}

pub fn assert_finding(findings: &[Finding], id: &str, level: Level, what: &str, mend: &str) {
    let finding = of(findings, id);
    assert_eq!(finding.level, level, "{finding:?}");
    assert!(finding.what.contains(what), "{finding:?}");
    assert!(mend.is_empty() == finding.mend.is_empty(), "{finding:?}");
    assert!(finding.mend.join("\n").contains(mend), "{finding:?}");
    let lines = lines(findings, true);
    assert!(lines.iter().all(|line| line.chars().count() <= 80 || line.contains("ringcat")), "{lines:#?}");
}
