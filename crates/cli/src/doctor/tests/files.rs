//! Faults that show in files of a machine.

use std::fs;

use super::super::finding::{Finding, Level};
use super::specimen::{Specimen, assert_finding, with};

/// One fault in a file: the finding, how bad it is, what it says, and what corrects it.
type Fault = (&'static str, Level, &'static str, &'static str, &'static [(&'static str, &'static str)]);

const CPU: &str = "sys/devices/system/cpu";

const FAULTS: [Fault; 26] = [
    (
        "kernel",
        Level::Bad,
        "6.12.9-rt without PREEMPT_RT",
        "sudo apt install linux-image-rt-",
        &[("sys/kernel/realtime", "0")],
    ),
    (
        "throttling",
        Level::Minor,
        "50000 of each 1000000 us",
        "sudo sysctl kernel.sched_rt_runtime_us=-1",
        &[("proc/sys/kernel/sched_rt_runtime_us", "950000")],
    ),
    (
        "clock-source",
        Level::Minor,
        "hpet",
        "dmesg",
        &[("sys/devices/system/clocksource/clocksource0/current_clocksource", "hpet")],
    ),
    ("virtual-machine", Level::Bad, "this is one", "hardware", &[("proc/cpuinfo", "flags\t: fpu hypervisor sse")]),
    ("processors", Level::Minor, "there is one", "two processors", &[("sys/devices/system/cpu/online", "0")]),
    (
        "governor",
        Level::Minor,
        "powersave",
        "sudo cpupower frequency-set -g performance",
        &[("sys/devices/system/cpu/cpu1/cpufreq/scaling_governor", "powersave")],
    ),
    ("isolated-processors", Level::Minor, "none", "isolcpus=3", &[("sys/devices/system/cpu/isolated", "\n")]),
    (
        "nohz-full",
        Level::Minor,
        "all processors",
        "nohz_full=3 rcu_nocbs=3",
        &[("sys/devices/system/cpu/nohz_full", "(null)\n")],
    ),
    (
        "interrupts",
        Level::Minor,
        "1 of other devices come to isolated processors: 25",
        "echo 0 | sudo tee /proc/irq/25/smp_affinity_list",
        &[("proc/irq/25/effective_affinity_list", "2-3")],
    ),
    (
        "interrupts",
        Level::Minor,
        "irqbalance runs",
        "sudo systemctl disable --now irqbalance",
        &[("proc/78/comm", "irqbalance")],
    ),
    ("siblings", Level::Minor, "two threads", "smt/control", &[("sys/devices/system/cpu/smt/active", "1")]),
    (
        "c-states",
        Level::Unknown,
        "C6 takes 400 us; /dev/cpu_dma_latency is not there",
        "",
        &[("sys/devices/system/cpu/cpu1/cpuidle/state2/disable", "0")],
    ),
    (
        "raw-frames",
        Level::Bad,
        "lacks CAP_NET_RAW",
        "sudo setcap cap_net_raw",
        &[("proc/self/status", "CapEff:\t0000000000800000")],
    ),
    (
        "real-time-priority",
        Level::Bad,
        "not permitted",
        "@ethercat - rtprio 98",
        &[("proc/self/status", "CapEff:\t0"), ("proc/self/limits", "Max realtime priority 0 0\n")],
    ),
    (
        "memory-locking",
        Level::Bad,
        "memlock is 8388608 bytes",
        "@ethercat - memlock unlimited",
        &[("proc/self/limits", "Max locked memory 8388608 8388608 bytes\n")],
    ),
    (
        "kernel-modules",
        Level::Bad,
        "loaded: ec_generic ec_master",
        "sudo systemctl disable --now ethercat",
        &[("proc/modules", "ec_generic 1 0\nec_master 1 1 ec_generic\nec_sys 1 0\n")],
    ),
    (
        "ethercat-program",
        Level::Bad,
        "/usr/bin/ethercat is not RingCAT's, and comes before /opt/other/bin/ethercat",
        "first in PATH",
        &[("usr/bin/ethercat", "other"), ("opt/other/bin/ethercat", "RingCAT")],
    ),
    (
        "ethercat-program",
        Level::Minor,
        "/usr/bin/ethercat is not RingCAT's",
        "dpkg -S",
        &[("usr/bin/ethercat", "other")],
    ),
    (
        "ecrt-header",
        Level::Bad,
        "/usr/local/include/ecrt.h is not RingCAT's, and comes before /usr/include/ecrt.h",
        "CPATH",
        &[("usr/local/include/ecrt.h", "other")],
    ),
    (
        "ethercat-library",
        Level::Bad,
        "/lib/libethercat.so.1 is not RingCAT's, and comes before /usr/lib",
        "LD_LIBRARY_PATH",
        &[("lib/libethercat.so.1", "other")],
    ),
    (
        "network-manager",
        Level::Bad,
        "NetworkManager manages it",
        "sudo nmcli device set enp12s0f1np1abc managed no",
        &[("proc/79/comm", "NetworkManager"), ("run/NetworkManager/devices/7", "[device]\nmanaged=true\n")],
    ),
    (
        "network-manager",
        Level::Good,
        "NetworkManager leaves it alone",
        "",
        &[("proc/79/comm", "NetworkManager"), ("run/NetworkManager/devices/7", "[device]\nmanaged=false\n")],
    ),
    ("network-manager", Level::Unknown, "NetworkManager runs", "", &[("proc/79/comm", "NetworkManager")]),
    (
        "network-manager",
        Level::Bad,
        "systemd-networkd manages it",
        "Unmanaged=yes",
        &[("proc/79/comm", "systemd-network"), ("run/systemd/netif/links/7", "ADMIN_STATE=configured\n")],
    ),
    (
        "deferred-interrupts",
        Level::Bad,
        "up to 20000 ns, 2 interrupts",
        "napi_defer_hard_irqs",
        &[
            ("sys/class/net/enp12s0f1np1abc/gro_flush_timeout", "20000"),
            ("sys/class/net/enp12s0f1np1abc/napi_defer_hard_irqs", "2"),
        ],
    ),
    (
        "deferred-interrupts",
        Level::Unknown,
        "another network namespace",
        "",
        &[("sys/class/net/enp12s0f1np1abc/ifindex", "8")],
    ),
];

// covers: bench
#[test]
fn each_fault_in_a_file_is_found_with_its_correction() {
    for (id, level, what, mend, files) in FAULTS {
        let findings = with(files);
        assert_finding(&findings, id, level, what, mend);
        // The status of the process has the permissions of three findings.
        let related =
            |finding: &&Finding| finding.id == id || files.iter().any(|(path, _)| path.starts_with("proc/self"));
        let others = findings.iter().filter(|finding| finding.level != Level::Good && !related(finding));
        let none: Vec<&Finding> =
            others.filter(|finding| id != "processors" || finding.id != "isolated-processors").collect();
        assert!(none.is_empty(), "{id}: {none:?}");
    }
}

// covers: bench
#[test]
fn sleep_states_are_no_harm_where_programs_may_prevent_them() {
    let specimen = Specimen::good();
    specimen.write(&format!("{CPU}/cpu1/cpuidle/state2/disable"), b"0");
    specimen.write("dev/cpu_dma_latency", b"");
    assert_finding(&specimen.checks(), "c-states", Level::Good, "programs with --priority may prevent it", "");
    fs::remove_dir_all(specimen.root.join(CPU).join("cpu0/cpuidle")).expect("it is writable");
    fs::remove_dir_all(specimen.root.join(CPU).join("cpu1/cpuidle")).expect("it is writable");
    assert_finding(&specimen.checks(), "c-states", Level::Good, "the kernel uses none", "");
}
