//! SYNC and LATCH units (protocol 3.12, 7.3).
//!
//! Input: the registers when DC_ACTIVATION is written, the system time. Output: times of pulses, plausibility of the
//! start time, register values after edges at the LATCH pins.

use ringcat_wire::register::{DcActivation, DcActivationStatus};

/// Near future for the plausibility check, if DC_ACTIVATION selects it: 2^31 ns.
const NEAR_FUTURE_NS: u64 = 1 << 31;

/// Register values at the activation of the unit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct SyncSettings {
    /// DC_START_TIME.
    pub start: u64,
    /// DC_SYNC0_CYCLE.
    pub sync0_cycle_ns: u32,
    /// DC_SYNC1_CYCLE.
    pub sync1_cycle_ns: u32,
    /// Whether the clock has 64 bits.
    pub wide: bool,
    /// Whether DC_PULSE_LENGTH is 0: a signal stays until it is acknowledged.
    pub acknowledged: bool,
}

/// The SYNC unit.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SyncUnit {
    activation: DcActivation,
    settings: SyncSettings,
    /// System time of the first pulse, in 64 bits; `None` if the unit is inactive or the time will not occur.
    first: Option<u64>,
    implausible: bool,
    /// Numbers of acknowledged SYNC0 and SYNC1 pulses.
    seen: [u64; 2],
    /// DC_SYSTEM_TIME_OFFSET.
    offset: u64,
    /// Pulses of SYNC0 before `first`.
    before: u64,
}

impl SyncUnit {
    /// Handles a write to DC_ACTIVATION at this system time, in 64 bits.
    pub fn activate(&mut self, activation: DcActivation, settings: SyncSettings, now: u64) {
        let runs = self.activation.cyclic_unit && activation.cyclic_unit;
        self.activation = activation;
        if runs {
            return;
        }
        (self.first, self.implausible, self.seen, self.before) = (None, false, [0; 2], 0);
        if !activation.cyclic_unit {
            return;
        }
        self.settings = settings;
        let extended = activation.extend_start_time || !settings.wide;
        let ahead = if extended {
            // 32 bits: a time in the past occurs again after the clock wraps.
            u64::from((settings.start as u32).wrapping_sub(now as u32))
        } else {
            settings.start.wrapping_sub(now)
        };
        let half = if extended { 1 << 31 } else { 1 << 63 };
        let limit = if activation.near_future_select { NEAR_FUTURE_NS } else { half };
        self.implausible = activation.start_plausibility && ahead >= limit;
        // A 64-bit time in the past occurs again after centuries.
        let comes = extended || ahead < 1 << 63;
        self.first = (!self.implausible && comes).then(|| now.wrapping_add(ahead));
    }

    /// DC_SYSTEM_TIME_OFFSET was written. An active unit compares the system time with the time of its next pulse,
    /// which stays the same: after a jump beyond it there are no pulses, after a jump back none until then.
    pub fn offset_written(&mut self, offset: u64, local: u64) {
        let (was, is) = (local.wrapping_add(self.offset), local.wrapping_add(offset));
        self.offset = offset;
        if was == is || self.first.is_none() {
            return;
        }
        // A pulse at this instant has occurred.
        (self.before, self.first) = (self.pulses(was), self.next_sync0(was.wrapping_add(1)));
        self.first = self.first.filter(|next| next.wrapping_sub(is) < 1 << 63);
    }

    /// Whether a write to the start time activates the unit.
    pub fn awaits_start_time(&self) -> bool {
        self.activation.auto_activation && !self.activation.cyclic_unit
    }

    /// Pulses of SYNC0 up to a system time.
    pub fn pulses(&self, now: u64) -> u64 {
        let later = |first| pulses(first, self.settings.sync0_cycle_ns, now);
        self.before + self.first.filter(|_| self.activation.sync0).map_or(0, later)
    }

    /// Pulses of SYNC1 up to a system time.
    fn sync1_pulses(&self, now: u64) -> u64 {
        let SyncSettings { sync0_cycle_ns: sync0, sync1_cycle_ns: sync1, .. } = self.settings;
        let Some(first) = self.first.filter(|_| self.activation.sync1) else { return 0 };
        let cycle = sync1.checked_div(sync0).map_or(0, |times| sync0.saturating_mul(times + 1));
        pulses(first.wrapping_add(sync1.into()), cycle, now)
    }

    /// Whether SYNC0 (0) or SYNC1 (1) is not acknowledged: DC_SYNC0_STATUS, DC_SYNC1_STATUS.
    pub fn is_active(&self, signal: usize, now: u64) -> bool {
        self.settings.acknowledged && self.signal_pulses(signal, now) > self.seen[signal]
    }

    /// Acknowledges a signal: the PDI has read its status.
    pub fn acknowledge(&mut self, signal: usize, now: u64) {
        self.seen[signal] = self.signal_pulses(signal, now);
    }

    fn signal_pulses(&self, signal: usize, now: u64) -> u64 {
        if signal == 0 { self.pulses(now) } else { self.sync1_pulses(now) }
    }

    /// System time of the first SYNC0 pulse at `now` or later; `None` if there is none.
    pub fn next_sync0(&self, now: u64) -> Option<u64> {
        let first = self.first.filter(|_| self.activation.sync0)?;
        let since = now.wrapping_sub(first);
        if since >= 1 << 63 {
            return Some(first);
        }
        match u64::from(self.settings.sync0_cycle_ns) {
            0 => (since == 0).then_some(first),
            cycle => Some(first.wrapping_add(since.div_ceil(cycle) * cycle)),
        }
    }

    /// System time of the first SYNC1 pulse at `now` or later. It follows SYNC0 after DC_SYNC1_CYCLE, and repeats with
    /// the first SYNC0 after that.
    pub fn next_sync1(&self, now: u64) -> Option<u64> {
        let first = self.first.filter(|_| self.activation.sync1)?.wrapping_add(self.settings.sync1_cycle_ns.into());
        let since = now.wrapping_sub(first);
        if since >= 1 << 63 {
            return Some(first);
        }
        let sync0 = u64::from(self.settings.sync0_cycle_ns);
        let sync1 = u64::from(self.settings.sync1_cycle_ns);
        match sync0 {
            0 => (since == 0).then_some(first),
            sync0 => {
                let cycle = sync0 * (sync1 / sync0 + 1);
                Some(first.wrapping_add(since.div_ceil(cycle) * cycle))
            }
        }
    }

    /// DC_ACTIVATION_STATUS.
    pub fn status(&self) -> DcActivationStatus {
        DcActivationStatus {
            sync0_pending: self.first.is_some() && self.activation.sync0,
            sync1_pending: self.first.is_some() && self.activation.sync1,
            start_implausible: self.implausible,
            ..DcActivationStatus::default()
        }
    }

    /// Whether SYNC0 is activated.
    pub fn has_sync0(&self) -> bool {
        self.activation.cyclic_unit && self.activation.sync0
    }
}

/// Number of pulses from the first one up to a time; a cycle of zero means a single pulse.
fn pulses(first: u64, cycle_ns: u32, now: u64) -> u64 {
    let since = now.wrapping_sub(first);
    match (since < 1 << 63, u64::from(cycle_ns)) {
        (false, _) => 0,
        (true, 0) => 1,
        (true, cycle) => since / cycle + 1,
    }
}

/// Edges detected by a LATCH unit.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LatchUnit {
    seen: [bool; 2],
}

impl LatchUnit {
    /// An edge; `single`: only the first edge is latched until its time is read. Returns whether its time is latched.
    pub fn edge(&mut self, positive: bool, single: bool) -> bool {
        let seen = &mut self.seen[usize::from(!positive)];
        !core::mem::replace(seen, true) || !single
    }

    /// The time of an edge has been read.
    pub fn read(&mut self, positive: bool) {
        self.seen[usize::from(!positive)] = false;
    }

    /// Bits of DC_LATCH0_STATUS or DC_LATCH1_STATUS without the pin.
    pub fn status(&self) -> u8 {
        u8::from(self.seen[0]) | u8::from(self.seen[1]) << 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOTH: DcActivation = DcActivation {
        cyclic_unit: true,
        sync0: true,
        sync1: true,
        auto_activation: false,
        extend_start_time: false,
        start_plausibility: false,
        near_future_select: false,
        debug_pulse: false,
    };

    fn started(start: u64, now: u64, wide: bool, activation: DcActivation) -> SyncUnit {
        let mut unit = SyncUnit::default();
        let settings = SyncSettings { start, sync0_cycle_ns: 1_000, sync1_cycle_ns: 300, wide, acknowledged: true };
        unit.activate(activation, settings, now);
        unit
    }

    #[test]
    fn a_jump_of_the_system_time_moves_no_pulse_and_one_beyond_the_next_pulse_ends_them() {
        let mut unit = SyncUnit::default();
        let cyclic = DcActivation { cyclic_unit: true, sync0: true, ..DcActivation::default() };
        let settings = SyncSettings { start: 10_000, sync0_cycle_ns: 1_000, wide: true, ..SyncSettings::default() };
        unit.activate(cyclic, settings, 0);
        assert_eq!((unit.pulses(12_500), unit.next_sync0(12_500)), (3, Some(13_000)));
        // 300 ns forward before the next pulse, then 5 us back.
        unit.offset_written(300, 12_500);
        assert_eq!((unit.pulses(12_800), unit.next_sync0(12_800)), (3, Some(13_000)));
        unit.offset_written(300_u64.wrapping_sub(5_000), 12_600);
        assert_eq!((unit.pulses(7_900), unit.next_sync0(7_900)), (3, Some(13_000)));
        unit.offset_written(100_000, 12_700);
        assert_eq!((unit.pulses(112_700), unit.next_sync0(112_700)), (3, None));
    }

    // covers: 7.3
    #[test]
    fn a_step_back_at_the_instant_of_a_pulse_does_not_repeat_it() {
        let mut unit = SyncUnit::default();
        let cyclic = DcActivation { cyclic_unit: true, sync0: true, ..DcActivation::default() };
        let settings = SyncSettings { start: 10_000, sync0_cycle_ns: 1_000, wide: true, ..SyncSettings::default() };
        unit.activate(cyclic, settings, 0);
        assert_eq!(unit.pulses(13_000), 4);
        unit.offset_written(500_u64.wrapping_neg(), 13_000);
        assert_eq!((unit.pulses(12_500), unit.pulses(13_000), unit.next_sync0(13_000)), (4, 4, Some(14_000)));
        assert_eq!(unit.pulses(14_000), 5);
    }

    // covers: 7.3
    #[test]
    fn pulses_begin_at_the_start_time_and_repeat_with_the_cycle() {
        let unit = started(10_000, 5_000, true, BOTH);
        assert_eq!((unit.pulses(9_999), unit.pulses(10_000), unit.pulses(12_500)), (0, 1, 3));
        assert_eq!((unit.next_sync0(5_000), unit.next_sync0(10_001)), (Some(10_000), Some(11_000)));
        assert_eq!((unit.next_sync1(5_000), unit.next_sync1(10_301)), (Some(10_300), Some(11_300)));
    }

    // covers: 3.12
    #[test]
    fn a_signal_stays_until_it_is_acknowledged() {
        let mut unit = started(10_000, 5_000, true, BOTH);
        assert!(!unit.is_active(0, 9_999) && unit.is_active(0, 10_000) && !unit.is_active(1, 10_299));
        unit.acknowledge(0, 10_200);
        assert!(!unit.is_active(0, 10_999) && unit.is_active(1, 10_300));
        // Pulses without an acknowledgement count as one.
        unit.acknowledge(0, 14_500);
        assert!(!unit.is_active(0, 14_999) && unit.is_active(0, 15_000));
        let settings = SyncSettings { start: 10_000, sync0_cycle_ns: 1_000, wide: true, ..SyncSettings::default() };
        let mut pulsing = SyncUnit::default();
        pulsing.activate(BOTH, settings, 5_000);
        assert!(pulsing.pulses(12_000) == 3 && !pulsing.is_active(0, 12_000));
    }

    // covers: 7.3
    #[test]
    fn a_start_in_the_past_never_occurs_or_occurs_after_the_wrap() {
        assert_eq!(started(4_999, 5_000, true, BOTH).next_sync0(5_000), None);
        let narrow = started(4_999, 0x7_0000_1388, false, BOTH);
        assert_eq!(narrow.next_sync0(0x7_0000_1388), Some(0x8_0000_1387));
    }

    // covers: 7.3, sim-clocks
    #[test]
    fn an_implausible_start_is_refused_if_the_check_is_enabled() {
        let checked = DcActivation { start_plausibility: true, ..BOTH };
        let past = started(4_999, 5_000, true, checked);
        assert!(past.status().start_implausible && past.next_sync0(5_000).is_none());
        let near = DcActivation { near_future_select: true, ..checked };
        assert!(started(5_000 + (1 << 31), 5_000, true, near).status().start_implausible);
        assert!(started(4_999 + (1 << 31), 5_000, true, near).status().sync0_pending);
    }

    // covers: 7.3
    #[test]
    fn sync1_with_a_longer_time_divides_sync0() {
        let mut unit = SyncUnit::default();
        let settings = SyncSettings {
            start: 10_000,
            sync0_cycle_ns: 1_000,
            sync1_cycle_ns: 3_000,
            wide: true,
            acknowledged: true,
        };
        unit.activate(BOTH, settings, 0);
        assert_eq!((unit.next_sync1(0), unit.next_sync1(13_001)), (Some(13_000), Some(17_000)));
    }
}
