//! Quantiles of measured times.

/// The value at a part of sorted times, in microseconds.
pub fn quantile_us(sorted_ns: &[u64], percent: usize) -> f64 {
    let at = (sorted_ns.len() * percent / 100).min(sorted_ns.len().saturating_sub(1));
    sorted_ns.get(at).map_or(0.0, |ns| *ns as f64 / 1e3)
}

#[cfg(test)]
mod tests {
    use super::quantile_us;

    // covers: bench
    #[test]
    fn quantiles_stay_within_the_times() {
        assert_eq!(quantile_us(&[], 50), 0.0);
        assert_eq!(quantile_us(&[1_000, 2_000, 3_000], 0), 1.0);
        assert_eq!(quantile_us(&[1_000, 2_000, 3_000], 50), 2.0);
        assert_eq!(quantile_us(&[1_000, 2_000, 3_000], 100), 3.0);
    }
}
