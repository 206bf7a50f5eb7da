//! Processors: sleep states, frequencies, isolation, interrupts.

use super::finding::{Finding, Topic};
use super::inspect::{self, Inspect, Unseen};
use super::processor_list::ProcessorList;

const COUNT: Topic = Topic {
    id: "processors",
    why: "on the only processor a cycle shares its time with everything else, and no thread can spin",
};
const SLEEP: Topic = Topic {
    id: "c-states",
    why: "a processor in a deep sleep state takes tens to hundreds of microseconds to wake up",
};
const GOVERNOR: Topic = Topic {
    id: "governor",
    why: "a processor that is slow after a pause takes tens of microseconds longer for a cycle",
};
const ISOLATED: Topic =
    Topic { id: "isolated-processors", why: "other programs run on the processor of the cycle, and empty its caches" };
const TICK: Topic =
    Topic { id: "nohz-full", why: "the timer interrupt of the kernel comes between cycles, for microseconds" };
const INTERRUPTS: Topic =
    Topic { id: "interrupts", why: "interrupts of other devices on the processor of the cycle delay it" };
const SIBLINGS: Topic =
    Topic { id: "siblings", why: "two threads on one core (SMT) take turns; which one waits is not predictable" };

const PROCESSORS: &str = "/sys/devices/system/cpu";
const LATENCY: &str = "/dev/cpu_dma_latency";
/// Sleep states that wake up within this time are no harm, in microseconds.
const SHORT_US: i64 = 10;
/// Processors that are checked one by one.
const MOST: usize = 1_024;

/// All checks of processors. `interfaces` are those of the segment.
pub fn checks(machine: &dyn Inspect, interfaces: &[&str]) -> Vec<Finding> {
    vec![
        COUNT.of(count(machine)),
        SLEEP.of(sleep_states(machine)),
        GOVERNOR.of(governors(machine)),
        ISOLATED.of(isolated(machine)),
        TICK.of(tick(machine)),
        INTERRUPTS.of(interrupts(machine, interfaces)),
        SIBLINGS.of(siblings(machine)),
    ]
}

/// A list of processors in a file.
fn list(machine: &dyn Inspect, path: &str) -> Result<ProcessorList, Unseen> {
    machine.read(path)?.parse().map_err(|()| Unseen::Strange(path.to_owned()))
}

fn online(machine: &dyn Inspect) -> Result<ProcessorList, Unseen> {
    list(machine, &format!("{PROCESSORS}/online"))
}

/// The processor that suits a cycle best: the last one, since the first ones get what is not bound.
fn for_cycles(machine: &dyn Inspect) -> u32 {
    online(machine).ok().and_then(|online| online.last()).unwrap_or(1)
}

fn count(machine: &dyn Inspect) -> Result<Finding, Unseen> {
    Ok(match online(machine)?.count() {
        0 => return Err(Unseen::Strange(format!("{PROCESSORS}/online"))),
        1 => COUNT.minor("there is one", &["take a machine with two processors or more"]),
        count => COUNT.good(format!("there are {count}")),
    })
}

fn sleep_states(machine: &dyn Inspect) -> Result<Finding, Unseen> {
    let mut deepest: Option<(i64, String)> = None;
    for processor in online(machine)?.iter().take(MOST) {
        let directory = format!("{PROCESSORS}/cpu{processor}/cpuidle");
        let states = match machine.list(&directory) {
            Err(Unseen::Missing(_)) => continue,
            states => states?,
        };
        for state in states.iter().filter(|name| name.starts_with("state")).take(MOST) {
            let (latency, is_disabled) =
                (format!("{directory}/{state}/latency"), format!("{directory}/{state}/disable"));
            if machine.read_if_there(&is_disabled)?.is_some_and(|text| text != "0") {
                continue;
            }
            let us = inspect::number(machine, &latency)?;
            if deepest.as_ref().is_none_or(|(longest, _)| us > *longest) {
                deepest = Some((us, machine.read(&format!("{directory}/{state}/name")).unwrap_or_default()));
            }
        }
    }
    let Some((us, name)) = deepest else {
        return Ok(SLEEP.good("the kernel uses none"));
    };
    if us <= SHORT_US {
        return Ok(SLEEP.good(format!("the deepest, {name}, wakes up within {us} us")));
    }
    Ok(match machine.may_write(LATENCY) {
        Ok(true) => SLEEP.good(format!("{name} takes {us} us, but programs with --priority may prevent it")),
        Ok(false) => {
            let rule = "KERNEL==\"cpu_dma_latency\", GROUP=\"ethercat\", MODE=\"0660\"";
            let mend = ["let programs prevent it, by a rule for udev and a restart:", RULES, rule];
            SLEEP.bad(format!("{name} takes {us} us, and this user may not write {LATENCY}"), &mend)
        }
        Err(unseen) => SLEEP.unknown(format!("{name} takes {us} us; {unseen}")),
    })
}

/// The file of rules for udev that has the rule.
const RULES: &str = "sudoedit /etc/udev/rules.d/60-ethercat.rules";

fn governors(machine: &dyn Inspect) -> Result<Finding, Unseen> {
    let mut others: Vec<String> = Vec::new();
    let mut seen = 0;
    for processor in online(machine)?.iter().take(MOST) {
        let path = format!("{PROCESSORS}/cpu{processor}/cpufreq/scaling_governor");
        let Some(governor) = machine.read_if_there(&path)? else { continue };
        seen += 1;
        if governor != "performance" && !others.contains(&governor) {
            others.push(governor);
        }
    }
    Ok(match (seen, others.as_slice()) {
        (0, _) => GOVERNOR.good("this kernel does not change the frequency of processors"),
        (_, []) => GOVERNOR.good("performance"),
        (_, others) => GOVERNOR.minor(others.join(", "), &["sudo cpupower frequency-set -g performance"]),
    })
}

fn isolated(machine: &dyn Inspect) -> Result<Finding, Unseen> {
    let isolated = list(machine, &format!("{PROCESSORS}/isolated"))?;
    if isolated.count() > 0 {
        return Ok(ISOLATED.good(format!("{isolated}; take one of them: --cpu {}", isolated.last().unwrap_or(0))));
    }
    let parameter = format!("isolcpus={}", for_cycles(machine));
    let mend = ["add to the kernel's command line and reboot, see docs/doctor.md:", &parameter];
    Ok(ISOLATED.minor("none", &mend))
}

fn tick(machine: &dyn Inspect) -> Result<Finding, Unseen> {
    let path = format!("{PROCESSORS}/nohz_full");
    // Without the directory, its absence shows nothing.
    online(machine)?;
    let text = match machine.read_if_there(&path)? {
        None => {
            return Ok(TICK.minor("this kernel cannot stop the timer interrupt", &["take a kernel with NO_HZ_FULL"]));
        }
        Some(text) if text.trim() == "(null)" => String::new(),
        Some(text) => text,
    };
    let without: ProcessorList = text.parse().map_err(|()| Unseen::Strange(path))?;
    if without.count() > 0 {
        return Ok(TICK.good(format!("processors {without} are without it")));
    }
    let last = for_cycles(machine);
    let mend = [
        "add to the kernel's command line and reboot, see docs/doctor.md:",
        &format!("nohz_full={last} rcu_nocbs={last}"),
    ];
    Ok(TICK.minor("the timer interrupt comes on all processors", &mend))
}

/// Interrupts of other devices that may come to isolated processors, and what moves interrupts.
fn interrupts(machine: &dyn Inspect, interfaces: &[&str]) -> Result<Finding, Unseen> {
    if inspect::running(machine, &["irqbalance"])?.is_some() {
        let mend = ["sudo systemctl disable --now irqbalance"];
        return Ok(INTERRUPTS.minor("irqbalance runs: it moves interrupts to any processor", &mend));
    }
    let isolated = list(machine, &format!("{PROCESSORS}/isolated"))?;
    if isolated.count() == 0 {
        return Ok(INTERRUPTS.good("irqbalance does not run; no processor is to be kept free"));
    }
    let table = machine.read("/proc/interrupts")?;
    let mut there: Vec<String> = Vec::new();
    for number in machine.list("/proc/irq")?.iter().filter(|name| name.bytes().all(|byte| byte.is_ascii_digit())) {
        let of_segment = table.lines().any(|line| is_of(line, number, interfaces));
        let path = format!("/proc/irq/{number}/effective_affinity_list");
        // Interrupts that are not used have no list.
        let processors = machine.read(&path).ok().and_then(|text| text.parse::<ProcessorList>().ok());
        if !of_segment && processors.is_some_and(|processors| processors.meets(&isolated)) {
            there.push(number.clone());
        }
    }
    let Some(first) = there.first() else {
        return Ok(INTERRUPTS.good(format!("none of other devices comes to the isolated processors {isolated}")));
    };
    let text = format!("{} of other devices come to isolated processors: {}", there.len(), there.join(" "));
    let free = online(machine)?.iter().find(|processor| !isolated.iter().any(|one| one == *processor)).unwrap_or(0);
    let mend = [
        &format!("echo {free} | sudo tee /proc/irq/{first}/smp_affinity_list"),
        &format!("and so on; irqaffinity={free} on the kernel's command line for all"),
    ];
    let mend = mend.map(String::as_str);
    Ok(INTERRUPTS.minor(text, &mend))
}

/// Whether a line of `/proc/interrupts` is that of this interrupt and names one of the interfaces, as in `eth1-rx-0`.
fn is_of(line: &str, number: &str, interfaces: &[&str]) -> bool {
    let Some((head, rest)) = line.split_once(':') else { return false };
    let mut words = rest.split(|c: char| c.is_whitespace() || c == ',' || c == '-');
    head.trim() == number && words.any(|word| interfaces.contains(&word))
}

fn siblings(machine: &dyn Inspect) -> Result<Finding, Unseen> {
    online(machine)?;
    Ok(match machine.read_if_there(&format!("{PROCESSORS}/smt/active"))?.as_deref() {
        None => SIBLINGS.good("this kernel reports none"),
        Some("0") => SIBLINGS.good("each core has one thread"),
        Some(_) => SIBLINGS
            .minor("cores have two threads or more", &["echo off | sudo tee /sys/devices/system/cpu/smt/control"]),
    })
}
