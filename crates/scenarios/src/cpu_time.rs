//! CPU time of this process, as the kernel charges it: user and system.

use std::fs;
use std::hint::black_box;
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

/// CPU time of [`reference_work`] on the machine for which bars are stated: figures are converted to it.
pub const REFERENCE: Duration = Duration::from_millis(250);
/// Words that [`reference_work`] changes: 8 MiB, about what the simulator of a thousand SubDevices touches.
const REFERENCE_WORDS: usize = 1 << 20;
const REFERENCE_STEPS: u64 = 50_000_000;

/// CPU time of a fixed work that computes and reads memory. A busy or slow machine charges more for it, as it does for
/// what is measured beside it: the ratio of both is a figure of the program.
pub fn reference_work() -> Duration {
    let mut words = vec![1_u64; REFERENCE_WORDS];
    let begin = process_cpu_time();
    let mut state = 0x9E37_79B9_7F4A_7C15_u64;
    for _ in 0..REFERENCE_STEPS {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        let word = &mut words[(state >> 44) as usize % REFERENCE_WORDS];
        *word = word.wrapping_add(state);
    }
    black_box(&words);
    process_cpu_time() - begin
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
