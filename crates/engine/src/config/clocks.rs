//! Distributed clocks as the application declares them: for the whole segment, and for one SubDevice (protocol 7).

use crate::declared::SubDeviceId;
use core::time::Duration;

/// The reference clock that all other clocks follow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ReferenceClock {
    /// The first SubDevice with a clock, declared or not.
    #[default]
    FirstWithClock,
    /// The first SubDevice with a clock among those for which SYNC signals are declared.
    FirstConfigured,
    /// The SubDevice with this index in the declaration. SubDevices that frames pass before it receive a time that the
    /// host predicts instead of the reference time: a reference clock upstream of all others is more exact.
    Declared(SubDeviceId),
}

/// Time that a frame takes through a SubDevice's controller from port to port (protocol 7.1). No register contains it,
/// and receive times show only the sum of both directions. Only differences between both directions and between
/// SubDevices count: a part that all SubDevices have in common is measured with the cables. A missing part of single
/// SubDevices makes the delay to the next SubDevice wrong by half of it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub struct Passage {
    /// Nanoseconds through the processing unit.
    pub processing_ns: u16,
    /// Nanoseconds without the processing unit: on the way back, or through a SubDevice that the frame enters at
    /// another port than 0.
    pub forwarding_ns: u16,
}

impl Passage {
    /// Times with and without the processing unit, in nanoseconds.
    pub const fn new(processing_ns: u16, forwarding_ns: u16) -> Passage {
        Passage { processing_ns, forwarding_ns }
    }
}

/// What the pulses of SYNC0 are aligned to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum PulseGrid {
    /// Multiples of the cycle in system time.
    #[default]
    SystemTime,
    /// Multiples of the cycle after the first time that the application has set (`Exchange::set_application_time`), as
    /// IgH does. Signals wait up to 1 s for this time; if it is not set by then, they are aligned to system time.
    FirstApplicationTime,
}

/// What happens to a SubDevice with SYNC signals when the clocks are not locked in time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum WhenUnlocked {
    /// It stays in SAFEOP; its configuration fails and is tried again.
    #[default]
    StayInSafeOp,
    /// It goes on, and an event reports it, as IgH does.
    GoOn,
}

/// Distributed clocks of the segment.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub struct ClockConfig {
    /// The reference clock that all other clocks follow. When it is lost, the next SubDevice with a clock takes over.
    pub reference: ReferenceClock,
    /// System time when the host's monotonic time is zero, in nanoseconds (protocol 3.12: since 2000).
    pub epoch: u64,
    /// The reference clock follows the host (bus shift). Otherwise it is free-running.
    pub bus_shift: bool,
    /// Number of measurements of the propagation delays; their mean is used.
    pub measurements: u32,
    /// Passage times of SubDevices without a [`SubDeviceConfig::passage`](crate::config::SubDeviceConfig) of their own.
    pub passage: Passage,
    /// Number of distributions of the reference time that the static drift compensation sends as fast as the segment
    /// allows, in addition to the cyclic ones (protocol 7.2: about 15,000).
    pub drift_distributions: u32,
    /// A clock is locked if |0x092C| was at or below this for [`ClockConfig::lock_samples`] samples.
    pub lock_window_ns: u32,
    /// See [`ClockConfig::lock_window_ns`].
    pub lock_samples: u32,
    /// Longest time that a SubDevice with SYNC signals is held in SAFEOP until all clocks are locked.
    pub lock_limit: Duration,
    /// What happens after that time.
    pub when_unlocked: WhenUnlocked,
    /// What the pulses of SYNC0 are aligned to.
    pub pulse_grid: PulseGrid,
    /// Limit of the broadcast read of 0x092C; beyond it the clocks are out of the sync window. The read is the OR of
    /// all magnitudes: at most twice the largest.
    pub sync_window_ns: u32,
    /// Permits delayed cycles. If process data is on the wire all the time, the acyclic half may request a later start
    /// of a cycle to measure propagation delays: once per measurement ([`ClockConfig::measurements`]), by about two
    /// round trips. Without this permission the delays are not measured then, and an event reports it.
    pub pauses: bool,
    /// If a fork without a clock hides the delay of a SubDevice, the middle of the possible range is written, and an
    /// event reports the range. Without this option no delay is written to it, and with SYNC signals it stays in
    /// SAFEOP.
    pub estimated_delays: bool,
}

impl ClockConfig {
    /// Sets [`ClockConfig::reference`].
    #[must_use]
    pub const fn with_reference(mut self, reference: ReferenceClock) -> ClockConfig {
        self.reference = reference;
        self
    }

    /// Sets [`ClockConfig::epoch`].
    #[must_use]
    pub const fn with_epoch(mut self, epoch: u64) -> ClockConfig {
        self.epoch = epoch;
        self
    }

    /// Sets [`ClockConfig::bus_shift`].
    #[must_use]
    pub const fn with_bus_shift(mut self, bus_shift: bool) -> ClockConfig {
        self.bus_shift = bus_shift;
        self
    }

    /// Sets [`ClockConfig::measurements`].
    #[must_use]
    pub const fn with_measurements(mut self, measurements: u32) -> ClockConfig {
        self.measurements = measurements;
        self
    }

    /// Sets [`ClockConfig::passage`].
    #[must_use]
    pub const fn with_passage(mut self, passage: Passage) -> ClockConfig {
        self.passage = passage;
        self
    }

    /// Sets [`ClockConfig::drift_distributions`].
    #[must_use]
    pub const fn with_drift_distributions(mut self, drift_distributions: u32) -> ClockConfig {
        self.drift_distributions = drift_distributions;
        self
    }

    /// Sets [`ClockConfig::lock_window_ns`].
    #[must_use]
    pub const fn with_lock_window_ns(mut self, lock_window_ns: u32) -> ClockConfig {
        self.lock_window_ns = lock_window_ns;
        self
    }

    /// Sets [`ClockConfig::lock_samples`].
    #[must_use]
    pub const fn with_lock_samples(mut self, lock_samples: u32) -> ClockConfig {
        self.lock_samples = lock_samples;
        self
    }

    /// Sets [`ClockConfig::lock_limit`].
    #[must_use]
    pub const fn with_lock_limit(mut self, lock_limit: Duration) -> ClockConfig {
        self.lock_limit = lock_limit;
        self
    }

    /// Sets [`ClockConfig::when_unlocked`].
    #[must_use]
    pub const fn with_when_unlocked(mut self, when_unlocked: WhenUnlocked) -> ClockConfig {
        self.when_unlocked = when_unlocked;
        self
    }

    /// Sets [`ClockConfig::pulse_grid`].
    #[must_use]
    pub const fn with_pulse_grid(mut self, pulse_grid: PulseGrid) -> ClockConfig {
        self.pulse_grid = pulse_grid;
        self
    }

    /// The choices of IgH: clocks count as locked within 10 us, after 5 s a SubDevice goes on without, and pulses are
    /// aligned to the first application time.
    #[must_use]
    pub const fn as_igh(self) -> ClockConfig {
        self.with_lock_window_ns(10_000)
            .with_lock_samples(1)
            .with_lock_limit(Duration::from_secs(5))
            .with_when_unlocked(WhenUnlocked::GoOn)
            .with_pulse_grid(PulseGrid::FirstApplicationTime)
    }

    /// Sets [`ClockConfig::sync_window_ns`].
    #[must_use]
    pub const fn with_sync_window_ns(mut self, sync_window_ns: u32) -> ClockConfig {
        self.sync_window_ns = sync_window_ns;
        self
    }

    /// Sets [`ClockConfig::pauses`].
    #[must_use]
    pub const fn with_pauses(mut self, pauses: bool) -> ClockConfig {
        self.pauses = pauses;
        self
    }

    /// Sets [`ClockConfig::estimated_delays`].
    #[must_use]
    pub const fn with_estimated_delays(mut self, estimated_delays: bool) -> ClockConfig {
        self.estimated_delays = estimated_delays;
        self
    }
}

impl Default for ClockConfig {
    fn default() -> ClockConfig {
        ClockConfig {
            reference: ReferenceClock::default(),
            epoch: 0,
            bus_shift: false,
            measurements: 16,
            passage: Passage::default(),
            drift_distributions: 15_000,
            lock_window_ns: 100,
            lock_samples: 100,
            lock_limit: Duration::from_secs(10),
            when_unlocked: WhenUnlocked::default(),
            pulse_grid: PulseGrid::default(),
            sync_window_ns: 1_000,
            pauses: true,
            estimated_delays: false,
        }
    }
}

/// SYNC signals of one SubDevice (protocol 7.3).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub struct SyncSignals {
    /// Registers 0x0980 (low byte) and 0x0981 (high byte), as AssignActivate in ESI and SII: 0x0300, 0x0700.
    pub assign_activate: u16,
    /// Cycle of SYNC0 in nanoseconds; 0 is a single pulse.
    pub sync0_cycle_ns: u32,
    /// Shift of SYNC0 after the multiples of the cycle in system time; negative: before them.
    pub sync0_shift_ns: i32,
    /// Cycle of SYNC1 in nanoseconds: 0, that of SYNC0, or a multiple of it.
    pub sync1_cycle_ns: u32,
    /// Shift of SYNC1 after SYNC0; a negative value counts back from the next SYNC0.
    pub sync1_shift_ns: i32,
}

impl SyncSignals {
    /// SYNC0 alone.
    pub const fn sync0(cycle_ns: u32, shift_ns: i32) -> SyncSignals {
        SyncSignals {
            assign_activate: 0x0300,
            sync0_cycle_ns: cycle_ns,
            sync0_shift_ns: shift_ns,
            sync1_cycle_ns: 0,
            sync1_shift_ns: 0,
        }
    }

    /// Sets [`SyncSignals::assign_activate`].
    #[must_use]
    pub const fn with_assign_activate(mut self, assign_activate: u16) -> SyncSignals {
        self.assign_activate = assign_activate;
        self
    }

    /// Sets cycle and shift of SYNC1 in nanoseconds.
    #[must_use]
    pub const fn with_sync1(mut self, cycle_ns: u32, shift_ns: i32) -> SyncSignals {
        self.sync1_cycle_ns = cycle_ns;
        self.sync1_shift_ns = shift_ns;
        self
    }

    /// The register value of SYNC1, if it is activated.
    pub(crate) const fn active_sync1_ns(&self) -> u32 {
        const SYNC1: u16 = 0x0400;
        if self.assign_activate & SYNC1 != 0 { self.sync1_register_ns() } else { 0 }
    }

    /// Value of DC_SYNC1_CYCLE: time from SYNC0 to SYNC1; a whole cycle or more divides the rate of SYNC1.
    pub const fn sync1_register_ns(&self) -> u32 {
        let longer = self.sync1_cycle_ns.saturating_sub(self.sync0_cycle_ns);
        let shift = match self.sync0_cycle_ns {
            0 => self.sync1_shift_ns as i64,
            cycle => (self.sync1_shift_ns as i64).rem_euclid(cycle as i64),
        };
        let sum = longer as i64 + shift;
        if sum < 0 {
            0
        } else if sum > u32::MAX as i64 {
            u32::MAX
        } else {
            sum as u32
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: 7.3, dc-sync
    #[test]
    fn the_register_of_sync1_counts_from_sync0() {
        let signals = |cycle, shift| SyncSignals {
            assign_activate: 0x0700,
            sync1_cycle_ns: cycle,
            sync1_shift_ns: shift,
            ..SyncSignals::sync0(1_000_000, 0)
        };
        assert_eq!(signals(0, 0).sync1_register_ns(), 0);
        assert_eq!(signals(1_000_000, 250_000).sync1_register_ns(), 250_000);
        assert_eq!(signals(1_000_000, -250_000).sync1_register_ns(), 750_000);
        assert_eq!(signals(4_000_000, 1).sync1_register_ns(), 3_000_001);
    }
}
