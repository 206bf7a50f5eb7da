//! Times on the command line.

use std::time::Duration;

/// A time with its unit.
pub fn time(text: &str) -> Result<Duration, String> {
    let at = text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len());
    let (number, unit) = text.split_at(at);
    let unit_ns = match unit {
        "us" => 1_000,
        "ms" => 1_000_000,
        "s" => 1_000_000_000,
        "min" => 60_000_000_000,
        _ => 0u64,
    };
    let ns = number.parse::<u64>().ok().and_then(|number| number.checked_mul(unit_ns)).filter(|ns| *ns > 0);
    ns.map(Duration::from_nanos).ok_or_else(|| "expected a number with us, ms, s or min behind it, as in 500us".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_have_a_unit() {
        assert_eq!(time("250us"), Ok(Duration::from_micros(250)));
        assert_eq!(time("10s"), Ok(Duration::from_secs(10)));
        for wrong in ["", "1", "ms", "0ms", "1.5ms", "-1s", "99999999999999999999s", "18446744073709551615s"] {
            assert!(time(wrong).is_err(), "{wrong}");
        }
    }
}
