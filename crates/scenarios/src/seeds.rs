//! Seeds of random scenarios from the environment: `SEED=17` is one of them, `SEED=1000..2000` a range without its end.
//! `ci/explore` sets the variable for each explorer that it lists.

use std::ops::Range;

use crate::dice::Dice;

/// Whether lost frames are sent again within their cycle in the scenario of a seed: one in three. A world that fails
/// prints it.
pub const fn sends_again(seed: u64) -> bool {
    Dice::new(seed ^ 0x00A1_0000).one_in(3)
}

/// Whether the links of a seed's scenario record when frames arrive, as packet sockets do, so that cycles of one frame
/// take their fast path: one in two.
pub const fn has_arrival_times(seed: u64) -> bool {
    Dice::new(seed ^ 0x00A2_0000).one_in(2)
}

/// Whether a device of a seed's scenario has one buffer for each area of process data: every second one in one of three
/// scenarios.
pub const fn one_buffer(seed: u64, device: usize) -> bool {
    Dice::new(seed ^ 0x00A3_0000).one_in(3) && Dice::new(seed ^ 0x00A4_0000 ^ (device as u64) << 32).one_in(2)
}

/// Number of seeds in whose scenarios lost frames are sent again.
pub fn sending_again(seeds: &Range<u64>) -> usize {
    seeds.clone().filter(|seed| sends_again(*seed)).count()
}

/// What the environment variable SEED names.
///
/// # Panics
/// If the text names no seeds, so that a misprint is not taken for a run.
pub fn from_environment() -> Option<Range<u64>> {
    let text = std::env::var("SEED").ok()?;
    Some(parse(&text).unwrap_or_else(|| panic!("SEED=17 or SEED=1000..2000 is expected, `{text}` was found")))
}

fn parse(text: &str) -> Option<Range<u64>> {
    match text.split_once("..") {
        Some((first, end)) => {
            let seeds = first.parse().ok()?..end.parse().ok()?;
            (!seeds.is_empty()).then_some(seeds)
        }
        None => text.parse().ok().and_then(|seed: u64| Some(seed..seed.checked_add(1)?)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_names_one_seed_or_a_range_and_nothing_else() {
        assert_eq!(parse("17"), Some(17..18));
        assert_eq!(parse("1000..2000"), Some(1000..2000));
        for text in ["", "..", "5..", "..5", "7..7", "9..3", "a", "1..b", "-1", "18446744073709551615"] {
            assert_eq!(parse(text), None, "{text}");
        }
    }
}
