//! Values that several commands print.

use ringcat::histogram::Histogram;
use ringcat::{AlState, RingState, SubDeviceState};
use serde::Serialize;

/// How measured times are distributed.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Times {
    /// Number of measured times
    pub count: u64,
    /// The shortest, in nanoseconds
    pub shortest_ns: u64,
    /// Half of them are not longer, in nanoseconds
    pub median_ns: u64,
    /// 99 % of them are not longer, in nanoseconds
    pub percentile_99_ns: u64,
    /// The longest, in nanoseconds
    pub longest_ns: u64,
}

impl Times {
    /// The times of a histogram; `None` where it is empty.
    pub fn of(histogram: &Histogram) -> Option<Times> {
        let ns = |parts_per_million| histogram.quantile(parts_per_million).as_nanos() as u64;
        (histogram.count() > 0).then(|| Times {
            count: histogram.count(),
            shortest_ns: histogram.shortest().as_nanos() as u64,
            median_ns: ns(500_000),
            percentile_99_ns: ns(990_000),
            longest_ns: histogram.longest().as_nanos() as u64,
        })
    }

    /// The times of a sorted list; `None` where it is empty.
    pub fn of_sorted(sorted_ns: &[u64]) -> Option<Times> {
        let (shortest_ns, longest_ns) = (*sorted_ns.first()?, *sorted_ns.last()?);
        let at = |percent: usize| sorted_ns[(sorted_ns.len() * percent / 100).min(sorted_ns.len() - 1)];
        let (count, median_ns, percentile_99_ns) = (sorted_ns.len() as u64, at(50), at(99));
        Some(Times { count, shortest_ns, median_ns, percentile_99_ns, longest_ns })
    }
}

/// A port of a SubDevice.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Port {
    /// Position of the SubDevice, from 0
    pub position: usize,
    /// Number of its port, 0 to 3
    pub port: u8,
}

/// SYNC signals of a SubDevice.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SyncSignals {
    /// AssignActivate word: the value of registers 0x0980 and 0x0981
    pub assign_activate: u16,
    /// Cycle of SYNC0, in nanoseconds
    pub sync0_cycle_ns: u32,
    /// Shift of SYNC0 after the beginning of the cycle, in nanoseconds
    pub sync0_shift_ns: i32,
    /// Cycle of SYNC1, in nanoseconds; 0 without SYNC1
    pub sync1_cycle_ns: u32,
    /// Shift of SYNC1 behind SYNC0, in nanoseconds
    pub sync1_shift_ns: i32,
}

impl From<ringcat::SyncSignals> for SyncSignals {
    fn from(signals: ringcat::SyncSignals) -> SyncSignals {
        SyncSignals {
            assign_activate: signals.assign_activate,
            sync0_cycle_ns: signals.sync0_cycle_ns,
            sync0_shift_ns: signals.sync0_shift_ns,
            sync1_cycle_ns: signals.sync1_cycle_ns,
            sync1_shift_ns: signals.sync1_shift_ns,
        }
    }
}

/// State of a SubDevice of the declaration.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct State {
    /// Index in the declaration, from 0
    pub subdevice: usize,
    /// Its name
    pub name: String,
    /// `absent`, `unknown`, `configuring`, or its AL state: `INIT`, `PREOP`, `BOOT`, `SAFEOP`, `OP`
    pub state: String,
}

impl State {
    /// The states of all SubDevices; `names` by their index.
    pub fn of_all(states: &[SubDeviceState], names: &[String]) -> Vec<State> {
        let state = |(subdevice, state): (usize, &SubDeviceState)| State {
            subdevice,
            name: names.get(subdevice).cloned().unwrap_or_default(),
            state: match state {
                SubDeviceState::Absent => "absent".to_owned(),
                SubDeviceState::Unknown => "unknown".to_owned(),
                SubDeviceState::Settled(state) => al_state(*state),
                _ => "configuring".to_owned(),
            },
        };
        states.iter().enumerate().map(state).collect()
    }
}

fn al_state(state: AlState) -> String {
    state.to_string()
}

/// State of a ring.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Ring {
    /// Both copies of each frame come back.
    Closed,
    /// The ring has a break.
    Open,
    /// Not all copies come back.
    Unknown,
}

impl From<RingState> for Ring {
    fn from(state: RingState) -> Ring {
        match state {
            RingState::Closed => Ring::Closed,
            RingState::Open => Ring::Open,
            RingState::Unknown => Ring::Unknown,
        }
    }
}
