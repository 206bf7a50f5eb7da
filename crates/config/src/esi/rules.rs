//! Which descriptions fit a device on the bus, and the times of a clock mode (protocol ES-25 to ES-29, ES-61, ES-62).

use super::model::{OpMode, RevisionCheck, ScaledTime};

impl RevisionCheck {
    /// Whether a revision on the bus fits the configured one.
    pub const fn holds(self, configured: u32, bus: u32) -> bool {
        let (low, bus_low) = (configured & 0xFFFF, bus & 0xFFFF);
        let (high, bus_high) = (configured >> 16, bus >> 16);
        match self {
            RevisionCheck::Unstated | RevisionCheck::None => true,
            RevisionCheck::Equal => bus == configured,
            RevisionCheck::EqualOrGreater => bus >= configured,
            RevisionCheck::LowEqual => bus_low == low,
            RevisionCheck::LowEqualHighEqualOrGreater => bus_low == low && bus_high >= high,
            RevisionCheck::HighEqual => bus_high == high,
            RevisionCheck::HighEqualLowEqualOrGreater => bus_high == high && bus_low >= low,
        }
    }
}

/// The description chosen for a revision on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Choice {
    /// The description of this revision.
    Exact(u32),
    /// An older description of the same variant.
    Older(u32),
    /// A newer description, where these are accepted.
    Newer(u32),
    /// No description; the nearest revision of the same variant, if there is one.
    None(Option<u32>),
}

/// Chooses among the revisions that are described for a vendor and product: the revision itself, else the largest below
/// it with the same low word, else with `accept_newer` the smallest above. Another low word is another variant with
/// other PDOs.
pub fn choose(described: impl IntoIterator<Item = u32>, bus: u32, accept_newer: bool) -> Choice {
    let mut older: Option<u32> = None;
    let mut newer: Option<u32> = None;
    for revision in described.into_iter().filter(|revision| revision & 0xFFFF == bus & 0xFFFF) {
        if revision == bus {
            return Choice::Exact(bus);
        }
        if revision < bus {
            older = older.max(Some(revision));
        } else {
            newer = Some(newer.map_or(revision, |known| known.min(revision)));
        }
    }
    match (older, newer) {
        (Some(older), _) => Choice::Older(older),
        (None, Some(newer)) if accept_newer => Choice::Newer(newer),
        (None, nearest) => Choice::None(nearest),
    }
}

impl ScaledTime {
    /// The time in nanoseconds for a cycle of this length: its factor counts, if it has one.
    pub fn in_cycle_ns(self, cycle_ns: u32) -> i64 {
        match self.factor {
            None | Some(0) => self.ns.into(),
            Some(factor) if factor > 0 => i64::from(cycle_ns) * i64::from(factor),
            Some(factor) => i64::from(cycle_ns) / -i64::from(factor),
        }
    }

    /// The part of the cycle that the factor gives, and the time besides.
    fn sum_in_cycle_ns(self, cycle_ns: u32) -> i64 {
        match self.factor {
            None | Some(0) => self.ns.into(),
            Some(_) => self.in_cycle_ns(cycle_ns) + i64::from(self.ns),
        }
    }
}

impl OpMode {
    /// Shift of SYNC0 in nanoseconds for a bus cycle: the part of the cycle and the time are added (protocol ES-63).
    pub fn sync0_shift_ns(&self, bus_cycle_ns: u32) -> i64 {
        self.shift_0.sum_in_cycle_ns(bus_cycle_ns)
    }

    /// Shift of SYNC1 against SYNC0, as [`Self::sync0_shift_ns`].
    pub fn sync1_shift_ns(&self, bus_cycle_ns: u32) -> i64 {
        self.shift_1.sum_in_cycle_ns(bus_cycle_ns)
    }

    /// Cycle of SYNC0 in nanoseconds for a bus cycle.
    pub fn sync0_cycle_ns(&self, bus_cycle_ns: u32) -> i64 {
        self.cycle_0.in_cycle_ns(bus_cycle_ns)
    }

    /// Cycle of SYNC1 in nanoseconds for a bus cycle: a factor above 0 counts cycles of SYNC0, below 0 parts of the bus
    /// cycle.
    pub fn sync1_cycle_ns(&self, bus_cycle_ns: u32) -> i64 {
        match self.cycle_1.factor {
            Some(factor) if factor > 0 => self.sync0_cycle_ns(bus_cycle_ns).saturating_mul(factor.into()),
            _ => self.cycle_1.in_cycle_ns(bus_cycle_ns),
        }
    }

    /// Whether the mode generates SYNC0 and SYNC1.
    pub const fn signals(&self) -> (bool, bool) {
        (self.assign_activate & 0x0200 != 0, self.assign_activate & 0x0400 != 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: ES-26, ES-27, ES-173
    #[test]
    fn revisions_are_compared_by_the_rule_of_the_file() {
        let rules = [
            RevisionCheck::Equal,
            RevisionCheck::EqualOrGreater,
            RevisionCheck::LowEqual,
            RevisionCheck::LowEqualHighEqualOrGreater,
            RevisionCheck::HighEqual,
            RevisionCheck::HighEqualLowEqualOrGreater,
        ];
        for (bus, expected) in [
            (0x0012_0000, [1, 1, 1, 1, 1, 1]),
            (0x0013_0000, [0, 1, 1, 1, 0, 0]),
            (0x0011_0000, [0, 0, 1, 0, 0, 0]),
            (0x0012_0001, [0, 1, 0, 0, 1, 1]),
            (0x0013_001E, [0, 1, 0, 0, 0, 0]),
        ] {
            assert_eq!(rules.map(|rule| u8::from(rule.holds(0x0012_0000, bus))), expected, "{bus:#010x}");
        }
        assert!(RevisionCheck::None.holds(1, 2) && RevisionCheck::Unstated.holds(1, 2));
    }

    // covers: ES-25, ES-29
    #[test]
    fn a_newer_device_gets_the_newest_older_description_of_its_variant() {
        let known = [0x0010_0000, 0x0012_0000, 0x0013_001E, 0x0015_0000];
        assert_eq!(choose(known, 0x0012_0000, false), Choice::Exact(0x0012_0000));
        assert_eq!(choose(known, 0x0014_0000, false), Choice::Older(0x0012_0000));
        assert_eq!(choose(known, 0x0001_0000, false), Choice::None(Some(0x0010_0000)));
        assert_eq!(choose(known, 0x0001_0000, true), Choice::Newer(0x0010_0000));
        assert_eq!(choose(known, 0x0014_0003, true), Choice::None(None), "another variant has other PDOs");
    }

    // covers: ES-60, ES-61, ES-62, ES-174
    #[test]
    fn clock_times_follow_the_bus_cycle_by_their_factors() {
        let time = |ns, factor| ScaledTime { ns, factor: Some(factor) }.in_cycle_ns(1_000_000);
        assert_eq!([time(0, 1), time(0, 2), time(0, -4), time(62_500, 0)], [1_000_000, 2_000_000, 250_000, 62_500]);
        let mode = |cycle_1| OpMode {
            assign_activate: 0x0700,
            cycle_0: ScaledTime { ns: 0, factor: Some(-4) },
            cycle_1: ScaledTime { ns: 0, factor: Some(cycle_1) },
            ..OpMode::default()
        };
        assert_eq!(mode(-1).sync1_cycle_ns(1_000_000), 1_000_000, "once per bus cycle");
        assert_eq!(mode(2).sync1_cycle_ns(1_000_000), 500_000, "every second SYNC0");
        assert_eq!(mode(2).signals(), (true, true));
        assert_eq!(OpMode { assign_activate: 0x0100, ..OpMode::default() }.signals(), (false, false));
    }
}
