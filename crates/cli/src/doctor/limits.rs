//! What this program is permitted: raw frames, real-time priority, locked memory.

use super::finding::{Finding, Topic};
use super::inspect::{Inspect, Unseen};

const FRAMES: Topic = Topic {
    id: "raw-frames",
    why: "without CAP_NET_RAW no interface can be opened; the daemon ringcatd needs it in place of programs",
};
const PRIORITY: Topic =
    Topic { id: "real-time-priority", why: "without a real-time priority any other program may delay a cycle" };
const MEMORY: Topic = Topic {
    id: "memory-locking",
    why: "memory that is not locked may be swapped out, and a cycle waits until it is back",
};

/// Bits of `linux/capability.h`.
const NET_RAW: u32 = 13;
const IPC_LOCK: u32 = 14;
const SYS_NICE: u32 = 23;

const STATUS: &str = "/proc/self/status";
const LIMITS: &str = "/proc/self/limits";
/// Lasts for members of the group, from their next login on.
const LIMITS_FILE: &str = "sudoedit /etc/security/limits.d/ethercat.conf";

/// All checks of permissions.
pub fn checks(machine: &dyn Inspect) -> Vec<Finding> {
    let setcap = ringcat_link::setcap_command();
    vec![
        FRAMES.of(frames(machine, &setcap)),
        PRIORITY.of(priority(machine, &setcap)),
        MEMORY.of(memory(machine, &setcap)),
    ]
}

fn frames(machine: &dyn Inspect, setcap: &str) -> Result<Finding, Unseen> {
    Ok(match has(machine, NET_RAW)? {
        true => FRAMES.good("permitted by CAP_NET_RAW"),
        false => FRAMES.bad("this program lacks CAP_NET_RAW", &[setcap]),
    })
}

fn priority(machine: &dyn Inspect, setcap: &str) -> Result<Finding, Unseen> {
    if has(machine, SYS_NICE)? {
        return Ok(PRIORITY.good("permitted by CAP_SYS_NICE"));
    }
    let mend = [setcap, "or a limit for a group:", LIMITS_FILE, "@ethercat - rtprio 98"];
    Ok(match limit(machine, "Max realtime priority")?.as_str() {
        "0" => PRIORITY.bad("not permitted: neither CAP_SYS_NICE nor a limit rtprio", &mend),
        limit => PRIORITY.good(format!("permitted up to {limit} by the limit rtprio")),
    })
}

fn memory(machine: &dyn Inspect, setcap: &str) -> Result<Finding, Unseen> {
    if has(machine, IPC_LOCK)? {
        return Ok(MEMORY.good("permitted by CAP_IPC_LOCK"));
    }
    let mend = [setcap, "or a limit for a group:", LIMITS_FILE, "@ethercat - memlock unlimited"];
    Ok(match limit(machine, "Max locked memory")?.as_str() {
        "unlimited" => MEMORY.good("permitted by the limit memlock"),
        limit => MEMORY.bad(format!("not permitted: no CAP_IPC_LOCK, and memlock is {limit} bytes"), &mend),
    })
}

/// Whether this process has a capability.
fn has(machine: &dyn Inspect, number: u32) -> Result<bool, Unseen> {
    let status = machine.read(STATUS)?;
    let set = status.lines().find_map(|line| line.strip_prefix("CapEff:"));
    let set = set.and_then(|hex| u64::from_str_radix(hex.trim(), 16).ok());
    Ok(set.ok_or_else(|| Unseen::Strange(STATUS.to_owned()))? >> number & 1 != 0)
}

/// The soft limit of this name.
fn limit(machine: &dyn Inspect, name: &str) -> Result<String, Unseen> {
    let limits = machine.read(LIMITS)?;
    let value = limits.lines().find_map(|line| line.strip_prefix(name)?.split_whitespace().next());
    let value = value.filter(|value| *value == "unlimited" || value.parse::<u64>().is_ok());
    value.map(str::to_owned).ok_or_else(|| Unseen::Strange(LIMITS.to_owned()))
}
