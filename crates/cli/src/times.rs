//! Times on the command line.

use std::ops::RangeInclusive;
use std::time::Duration;

/// Units that times have.
const UNITS: [&str; 4] = ["us", "ms", "s", "min"];
/// Cycles that a MainDevice on network interfaces can run: no interface is faster, and no SubDevice waits for longer.
const CYCLES: RangeInclusive<Duration> = Duration::from_micros(10)..=Duration::from_secs(1);

/// A cycle time with its unit.
pub fn cycle(text: &str) -> Result<Duration, String> {
    let cycle = time(text)?;
    if CYCLES.contains(&cycle) {
        return Ok(cycle);
    }
    Err(format!("expected {} to {}", in_words(*CYCLES.start()), in_words(*CYCLES.end())))
}

/// As the command line has it: `1ms`, `250us`, `1min`.
pub fn in_words(time: Duration) -> String {
    let us = time.as_micros();
    match us {
        _ if us >= 60_000_000 && us.is_multiple_of(60_000_000) => format!("{}min", us / 60_000_000),
        _ if us >= 1_000_000 && us.is_multiple_of(1_000_000) => format!("{}s", us / 1_000_000),
        _ if us >= 1_000 && us.is_multiple_of(1_000) => format!("{}ms", us / 1_000),
        _ => format!("{us}us"),
    }
}

/// A time with its unit.
pub fn time(text: &str) -> Result<Duration, String> {
    let at = text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len());
    let (number, unit) = text.split_at(at);
    if !number.is_empty() && number.bytes().all(|digit| digit == b'0') && UNITS.contains(&unit) {
        return Err("expected more than zero".into());
    }
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

/// A time with its unit, in nanoseconds, that may have a sign; zero too.
pub fn shift(text: &str) -> Result<i64, String> {
    let magnitude = text.trim_start_matches(['+', '-']);
    if text.len() - magnitude.len() > 1 {
        return Err(format!("expected one sign, got \"{text}\""));
    }
    let ns = if matches!(magnitude, "0" | "0us" | "0ms" | "0s") { 0 } else { time(magnitude)?.as_nanos() };
    let ns = i64::try_from(ns).map_err(|_| format!("expected a shorter time, got \"{text}\""))?;
    Ok(if text.starts_with('-') { -ns } else { ns })
}

/// Nanoseconds in microseconds, without zeros behind the point that say nothing.
pub fn us(ns: i64) -> String {
    let text = format!("{:.3}", ns as f64 / 1e3);
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shifts_may_have_a_sign() {
        assert_eq!((shift("250us"), shift("+1ms"), shift("-10us")), (Ok(250_000), Ok(1_000_000), Ok(-10_000)));
        assert_eq!((shift("0us"), shift("-0")), (Ok(0), Ok(0)));
        for wrong in ["", "-", "--1ms", "1", "+5", "-18446744073s"] {
            assert!(shift(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn cycles_are_what_an_interface_and_the_watchdogs_of_subdevices_allow() {
        assert_eq!((cycle("10us"), cycle("1s")), (Ok(Duration::from_micros(10)), Ok(Duration::from_secs(1))));
        for wrong in ["1us", "9us", "1001ms", "100s"] {
            assert_eq!(cycle(wrong), Err("expected 10us to 1s".to_owned()), "{wrong}");
        }
        assert_eq!(cycle("0ms"), Err("expected more than zero".to_owned()));
        for time in ["250us", "1ms", "1500us", "10s", "90s", "5min"] {
            assert_eq!(super::time(time).map(in_words), Ok(time.to_owned()));
        }
    }

    #[test]
    fn times_have_a_unit() {
        assert_eq!(time("250us"), Ok(Duration::from_micros(250)));
        assert_eq!(time("10s"), Ok(Duration::from_secs(10)));
        for wrong in ["", "1", "ms", "0ms", "1.5ms", "-1s", "99999999999999999999s", "18446744073709551615s"] {
            assert!(time(wrong).is_err(), "{wrong}");
        }
    }
}
