//! The kernel: its kind, real-time throttling, its clock, and whether it runs in a virtual machine.

use super::finding::{Finding, Topic};
use super::inspect::{self, Inspect, Unseen};

const KIND: Topic =
    Topic { id: "kernel", why: "without PREEMPT_RT, drivers and the kernel itself may delay a cycle by milliseconds" };
const THROTTLING: Topic =
    Topic { id: "throttling", why: "real-time threads that spin (--receive busy) are stopped in each period" };
const CLOCK: Topic =
    Topic { id: "clock-source", why: "reading a slow clock takes microseconds, several times in each cycle" };
const VIRTUAL: Topic =
    Topic { id: "virtual-machine", why: "the host of a virtual machine may stop its processors for milliseconds" };

/// Clocks that are read within tens of nanoseconds.
const FAST_CLOCKS: [&str; 4] = ["tsc", "arch_sys_counter", "kvm-clock", "hyperv_clocksource_tsc_page"];

/// All checks of the kernel.
pub fn checks(machine: &dyn Inspect) -> Vec<Finding> {
    vec![
        KIND.of(kind(machine)),
        THROTTLING.of(throttling(machine)),
        CLOCK.of(clock(machine)),
        VIRTUAL.of(virtual_machine(machine)),
    ]
}

fn kind(machine: &dyn Inspect) -> Result<Finding, Unseen> {
    let release = machine.read("/proc/sys/kernel/osrelease")?;
    let is_real_time = match machine.read_if_there("/sys/kernel/realtime")? {
        Some(text) => text == "1",
        None => machine.read("/proc/sys/kernel/version")?.split_whitespace().any(|word| word == "PREEMPT_RT"),
    };
    if is_real_time {
        return Ok(KIND.good(format!("{release} with PREEMPT_RT")));
    }
    let package = match std::env::consts::ARCH {
        "aarch64" => "sudo apt install linux-image-rt-arm64",
        _ => "sudo apt install linux-image-rt-amd64",
    };
    let mend = [package, "then reboot; other distributions: see docs/doctor.md"];
    Ok(KIND.bad(format!("{release} without PREEMPT_RT"), &mend))
}

fn throttling(machine: &dyn Inspect) -> Result<Finding, Unseen> {
    let number = |name: &str| inspect::number(machine, &format!("/proc/sys/kernel/{name}"));
    let (runtime_us, period_us) = (number("sched_rt_runtime_us")?, number("sched_rt_period_us")?);
    Ok(match ringcat_link::realtime::throttled_us(runtime_us, period_us) {
        None => THROTTLING.good("off"),
        Some(us) => THROTTLING.minor(
            format!("threads that spin are stopped for {us} of each {period_us} us"),
            &["sudo sysctl kernel.sched_rt_runtime_us=-1"],
        ),
    })
}

fn clock(machine: &dyn Inspect) -> Result<Finding, Unseen> {
    let source = machine.read("/sys/devices/system/clocksource/clocksource0/current_clocksource")?;
    if FAST_CLOCKS.contains(&source.as_str()) {
        return Ok(CLOCK.good(source));
    }
    let mend =
        ["sudo dmesg | grep -i clocksource", "shows why; tsc=reliable on the kernel's command line if it may be"];
    Ok(CLOCK.minor(source, &mend))
}

fn virtual_machine(machine: &dyn Inspect) -> Result<Finding, Unseen> {
    let text = machine.read("/proc/cpuinfo")?;
    // Processors of ARM have Features, and no flag for this.
    let flags = text.lines().find_map(|line| line.strip_prefix("flags")).and_then(|rest| rest.split_once(':'));
    let Some((_, flags)) = flags else {
        return Ok(VIRTUAL.unknown("the processors do not report it"));
    };
    if flags.split_whitespace().any(|flag| flag == "hypervisor") {
        return Ok(VIRTUAL.bad("this is one", &["run the MainDevice on the hardware itself"]));
    }
    Ok(VIRTUAL.good("this is none"))
}
