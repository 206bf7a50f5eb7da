//! SYNC signals of an operation mode in the SII (protocol 4.6, 7.3).

use core::fmt;
use core::time::Duration;

use ringcat_wire::sii::DcMode;

use super::SyncSignals;

/// Bits of the activation register 0x0981: unit enabled, SYNC0, SYNC1.
const UNIT: u16 = 0x0100;
const SYNC0: u16 = 0x0200;
const SYNC1: u16 = 0x0400;

/// Why no SYNC signals follow from an operation mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ModeError {
    /// It activates no signal.
    NoSignals {
        /// Its AssignActivate word.
        assign_activate: u16,
    },
    /// The cycle of SYNC0 is not a whole number of nanoseconds, or does not fit 32 bits.
    Sync0Cycle {
        /// Cycles of the MainDevice per cycle of SYNC0; negative: cycles of SYNC0 per cycle of the MainDevice.
        factor: i16,
    },
    /// The cycle of SYNC1 would be no multiple of that of SYNC0, which controllers cannot do, or does not fit 32 bits.
    Sync1Cycle {
        /// Cycles of SYNC0 per cycle of SYNC1; negative: cycles of SYNC1 per cycle of the MainDevice.
        factor: i16,
    },
}

impl fmt::Display for ModeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ModeError::NoSignals { assign_activate } => {
                write!(f, "AssignActivate {assign_activate:#06x} activates no SYNC signal")
            }
            ModeError::Sync0Cycle { factor } => {
                write!(f, "no SYNC0 cycle in whole nanoseconds follows from factor {factor} and the MainDevice's cycle")
            }
            ModeError::Sync1Cycle { factor } => {
                write!(f, "no SYNC1 cycle that is a multiple of SYNC0's follows from factor {factor}")
            }
        }
    }
}

impl core::error::Error for ModeError {}

impl SyncSignals {
    /// Whether a mode's AssignActivate word activates SYNC0 or SYNC1.
    pub const fn are_in(mode: &DcMode) -> bool {
        mode.assign_activate & UNIT != 0 && mode.assign_activate & (SYNC0 | SYNC1) != 0
    }

    /// The signals of an operation mode of the SII, for a MainDevice with this cycle.
    ///
    /// The cycle of SYNC0 is that of the mode if it has one; otherwise the cycle of the MainDevice times the factor (a
    /// negative factor divides, 0 counts as 1). The cycle of SYNC1 is that of SYNC0 times its factor; with a negative
    /// factor it is the cycle of the MainDevice divided by it (protocol ES-62). Shifts are signed.
    ///
    /// # Errors
    /// A mode without signals, or with impossible cycles.
    pub fn from_mode(mode: &DcMode, cycle: Duration) -> Result<SyncSignals, ModeError> {
        if !SyncSignals::are_in(mode) {
            return Err(ModeError::NoSignals { assign_activate: mode.assign_activate });
        }
        let has_sync1 = mode.assign_activate & SYNC1 != 0;
        let sync0_cycle_ns =
            sync0_cycle(mode, cycle).ok_or(ModeError::Sync0Cycle { factor: mode.sync0_cycle_factor })?;
        let sync1_cycle_ns = if has_sync1 {
            let sync1 = sync1_cycle(mode.sync1_cycle_factor, sync0_cycle_ns, cycle);
            sync1.ok_or(ModeError::Sync1Cycle { factor: mode.sync1_cycle_factor })?
        } else {
            0
        };
        Ok(SyncSignals {
            assign_activate: mode.assign_activate,
            sync0_cycle_ns,
            sync0_shift_ns: mode.sync0_shift_ns as i32,
            sync1_cycle_ns,
            sync1_shift_ns: if has_sync1 { mode.sync1_shift_ns as i32 } else { 0 },
        })
    }
}

fn sync0_cycle(mode: &DcMode, cycle: Duration) -> Option<u32> {
    if mode.sync0_cycle_ns != 0 {
        return Some(mode.sync0_cycle_ns);
    }
    let (cycle, factor) = (cycle.as_nanos(), u128::from(mode.sync0_cycle_factor.unsigned_abs()));
    let wanted = match mode.sync0_cycle_factor {
        0 => cycle,
        1.. => cycle * factor,
        ..0 if cycle.is_multiple_of(factor) => cycle / factor,
        ..0 => return None,
    };
    u32::try_from(wanted).ok().filter(|ns| *ns > 0)
}

fn sync1_cycle(factor: i16, sync0_ns: u32, cycle: Duration) -> Option<u32> {
    let divided = match u32::try_from(factor) {
        Ok(factor) => return factor.checked_mul(sync0_ns),
        Err(_) => cycle.as_nanos() / u128::from(factor.unsigned_abs()),
    };
    let is_whole = cycle.as_nanos().is_multiple_of(factor.unsigned_abs().into());
    u32::try_from(divided).ok().filter(|ns| is_whole && *ns > 0 && ns.is_multiple_of(sync0_ns))
}

#[cfg(test)]
mod tests {
    use super::*;

    const CYCLE: Duration = Duration::from_millis(1);

    fn mode(assign_activate: u16, factors: (i16, i16)) -> DcMode {
        DcMode { assign_activate, sync0_cycle_factor: factors.0, sync1_cycle_factor: factors.1, ..DcMode::default() }
    }

    // covers: 4.6, ES-62, dc-tools
    #[test]
    fn factors_and_shifts_of_a_mode_become_signals() {
        let cycles = |mode: &DcMode| {
            SyncSignals::from_mode(mode, CYCLE).map(|signals| (signals.sync0_cycle_ns, signals.sync1_cycle_ns))
        };
        assert_eq!(cycles(&mode(0x0300, (1, 0))), Ok((1_000_000, 0)));
        assert_eq!(cycles(&mode(0x0300, (0, 7))), Ok((1_000_000, 0)));
        assert_eq!(cycles(&mode(0x0730, (-4, 4))), Ok((250_000, 1_000_000)));
        assert_eq!(cycles(&mode(0x0700, (2, 0))), Ok((2_000_000, 0)));
        assert_eq!(cycles(&mode(0x0700, (1, -1))), Ok((1_000_000, 1_000_000)));
        assert_eq!(cycles(&mode(0x0700, (-4, -1))), Ok((250_000, 1_000_000)));
        assert_eq!(cycles(&mode(0x0700, (-4, -2))), Ok((250_000, 500_000)));
        assert_eq!(cycles(&DcMode { sync0_cycle_ns: 62_500, ..mode(0x0700, (3, 2)) }), Ok((62_500, 125_000)));
        let shifted = DcMode { sync0_shift_ns: -10_000_i32 as u32, sync1_shift_ns: 20_000, ..mode(0x0720, (1, 1)) };
        let signals = SyncSignals::from_mode(&shifted, CYCLE).expect("it has signals");
        assert_eq!(
            (signals.sync0_shift_ns, signals.sync1_shift_ns, signals.assign_activate),
            (-10_000, 20_000, 0x0720)
        );
    }

    // covers: dc-tools
    #[test]
    fn modes_without_signals_or_with_impossible_cycles_are_refused() {
        let error = |mode: &DcMode| SyncSignals::from_mode(mode, CYCLE).expect_err("it must be refused");
        for none in [0x0000, 0x0100, 0x0600, 0x0001] {
            assert_eq!(error(&mode(none, (1, 0))), ModeError::NoSignals { assign_activate: none });
        }
        assert_eq!(error(&mode(0x0300, (-3, 0))), ModeError::Sync0Cycle { factor: -3 });
        assert_eq!(error(&mode(0x0300, (i16::MAX, 0))), ModeError::Sync0Cycle { factor: i16::MAX });
        for (sync0, sync1) in [(1, -2), (2, -1), (-4, -3), (1, i16::MIN), (1, i16::MAX)] {
            assert_eq!(error(&mode(0x0700, (sync0, sync1))), ModeError::Sync1Cycle { factor: sync1 });
        }
    }
}
