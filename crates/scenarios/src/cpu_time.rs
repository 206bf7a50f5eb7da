//! CPU time of this process, as the kernel charges it: user and system.

use std::fs;
use std::time::Duration;

/// Linux counts in hundredths of a second here, whatever the kernel's own clock (`USER_HZ`).
const TICK: Duration = Duration::from_millis(10);

/// CPU time so far.
///
/// # Panics
/// Where the kernel has no `/proc/self/stat`.
pub fn process_cpu_time() -> Duration {
    let stat = fs::read_to_string("/proc/self/stat").expect("Linux has /proc/self/stat");
    ticks(&stat).map_or_else(|| panic!("/proc/self/stat is odd: {stat}"), |ticks| TICK * ticks)
}

/// `utime` and `stime`, fields 14 and 15. The name before them, field 2, is in parentheses and may contain any
/// characters.
fn ticks(stat: &str) -> Option<u32> {
    let (_, fields) = stat.rsplit_once(')')?;
    let mut fields = fields.split_whitespace().skip(11);
    let (user, system): (u32, u32) = (fields.next()?.parse().ok()?, fields.next()?.parse().ok()?);
    Some(user + system)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn user_and_system_time_are_found_behind_any_name() {
        let stat = "7 (a ) b) R 1 7 7 0 -1 4194304 90 0 0 0 123 45 0 0 20 0 1 0 100 200 300";
        assert_eq!(ticks(stat), Some(168));
        assert_eq!(ticks("7 a R"), None);
    }
}
