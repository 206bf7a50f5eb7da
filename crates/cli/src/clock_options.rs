//! The options of `ringcat run` and `ringcat clocks` about distributed clocks: the reference, and SYNC signals.
//!
//! Input: options and the result of a scan. Output: a declaration, or an error with what is allowed.

pub mod sync;

use clap::Args;
use ringcat::{
    ClockConfig, ClockStatus, Declaration, ReferenceClock, SubDeviceId, SubDeviceInfo, SyncSignals, Trigger,
    system_time,
};

use crate::failure::Failure;
use crate::interfaces::now;
use crate::output::warn;
use crate::times::{shift, us};
use sync::{Sync, choose, sync};

/// How `--sync` is explained.
pub const SYNC_HELP: &str = "SYNC signals: auto, or POSITION:SYNC0[:SYNC1] as in 3:1ms+250us";
pub const SYNC_LONG_HELP: &str = "SYNC signals: auto, or POSITION:SYNC0[:SYNC1] as in 3:1ms+250us\n\n\
    auto takes the operation modes of the EEPROMs. SYNC0 and SYNC1 are a cycle with or without a shift: 3:1ms, \
    3:1ms+250us, 3:500us:1ms-100us. POSITION may be all, SYNC0 may be auto. The option may be given several times; one \
    with a position goes before one for all.";

/// Options about clocks.
#[derive(Args, Clone, Debug, Default)]
#[command(next_help_heading = "Clocks")]
pub struct ClockOptions {
    /// When cycles begin, relative to the system time of the segment
    ///
    /// The time from the multiples of the cycle time, which is also that of an unshifted SYNC0, to the beginning of
    /// a cycle: 300us or -300us; 0us by default. Cycles then follow the reference clock (master shift).
    #[arg(long, value_name = "TIME", allow_hyphen_values = true, value_parser = shift, conflicts_with = "bus_shift")]
    phase: Option<i64>,
    /// The reference clock follows this host (bus shift)
    ///
    /// Without it the cycles follow the reference clock (master shift).
    #[arg(long)]
    pub bus_shift: bool,
    /// Reference clock: first, sync or a position
    ///
    /// first is the first SubDevice with a clock, sync the first one with SYNC signals; first by default.
    #[arg(long, value_name = "CLOCK", value_parser = reference)]
    reference: Option<ReferenceClock>,
    /// Write estimates for propagation delays that cannot be measured
    ///
    /// A fork without a clock hides the delay of the SubDevices behind it. The estimate is the middle of the possible
    /// range. Without this option no delay is written there, and SubDevices with SYNC signals stay in SAFEOP.
    #[arg(long)]
    estimate_delays: bool,
    #[arg(long, value_name = "SIGNALS", value_parser = sync, help = SYNC_HELP, long_help = SYNC_LONG_HELP)]
    sync: Vec<Sync>,
}

/// `first`, `sync` or a position.
fn reference(text: &str) -> Result<ReferenceClock, String> {
    match text {
        "first" => Ok(ReferenceClock::FirstWithClock),
        "sync" => Ok(ReferenceClock::FirstConfigured),
        text => {
            let position = text.parse().map(|index| ReferenceClock::Declared(SubDeviceId(index)));
            position.map_err(|_| format!("expected first, sync or a position, got \"{text}\""))
        }
    }
}

impl ClockOptions {
    /// Whether one of them is given: clocks are then in use.
    pub fn are_given(&self) -> bool {
        let given = self.phase.is_some() || self.bus_shift || self.estimate_delays || !self.sync.is_empty();
        given || self.reference.is_some()
    }

    /// Declares the clocks of a segment whose SubDevices are declared in the order of the scan.
    pub fn declare(&self, declaration: &mut Declaration, found: &[SubDeviceInfo]) -> Result<(), Failure> {
        let cycle = declaration.domains.iter().map(|domain| domain.period).min().unwrap_or_default();
        if !found.iter().any(|info| info.controller.features.dc) {
            return Err(Failure::new("no SubDevice of this segment has a distributed clock"));
        }
        let signals = choose(&self.sync, found, cycle).map_err(Failure::new)?;
        self.check(found, &signals, cycle.as_nanos() as u64).map_err(Failure::new)?;
        for (config, signals) in declaration.subdevices.iter_mut().zip(signals) {
            config.sync = signals;
        }
        let epoch = system_time::epoch(now());
        let config = ClockConfig::default()
            .with_reference(self.reference.unwrap_or_default())
            .with_bus_shift(self.bus_shift)
            .with_estimated_delays(self.estimate_delays)
            .with_epoch(epoch);
        if let Some(words) = in_front(self.reference.unwrap_or_default(), found, declaration) {
            warn(words);
        }
        declaration.clocks = Some(config);
        Ok(())
    }

    fn check(&self, found: &[SubDeviceInfo], signals: &[Option<SyncSignals>], cycle_ns: u64) -> Result<(), String> {
        if let Some(phase) = self.phase.filter(|phase| phase.unsigned_abs() >= cycle_ns) {
            return Err(format!(
                "--phase: expected less than the cycle of {} us, got {} us",
                us(cycle_ns as i64),
                us(phase)
            ));
        }
        match self.reference.unwrap_or_default() {
            ReferenceClock::FirstConfigured if signals.iter().any(Option::is_some) => Ok(()),
            ReferenceClock::FirstConfigured => {
                Err("--reference sync: no SubDevice has SYNC signals; add --sync".into())
            }
            ReferenceClock::Declared(position) => match found.get(position.0) {
                None => Err(format!("--reference {position}: there are SubDevices 0 to {}", found.len() - 1)),
                Some(info) if info.controller.features.dc => Ok(()),
                Some(info) => Err(format!(
                    "--reference {position}: SubDevice {position} \"{}\" has no distributed clock; `ringcat clocks` \
                     lists all clocks",
                    info.name
                )),
            },
            _ => Ok(()),
        }
    }

    /// Whether the options fit the declaration of a file: SYNC signals and the reference are those of the file.
    pub fn check_with_file(&self, declaration: &Declaration, asked: bool) -> Result<(), Failure> {
        if !self.sync.is_empty() {
            return Err(Failure::new("--sync: with --eni or --network the SYNC signals are those of the file"));
        }
        if self.reference.is_some() {
            return Err(Failure::new("--reference: with --eni or --network the reference clock is that of the file"));
        }
        if declaration.clocks.is_none() {
            return if asked { Err(Failure::new("the file has no distributed clocks")) } else { Ok(()) };
        }
        let cycle = declaration.domains.iter().map(|domain| domain.period).min().unwrap_or_default();
        self.check(&[], &[], cycle.as_nanos() as u64).map_err(Failure::new)
    }

    /// As [`ClockOptions::declare`] for the declaration of a file, after [`ClockOptions::check_with_file`]: only master
    /// shift or bus shift and estimated delays are taken from the options.
    pub fn adapt(&self, declaration: &mut Declaration) {
        let Some(config) = &mut declaration.clocks else { return };
        config.epoch = system_time::epoch(now());
        config.bus_shift = (config.bus_shift || self.bus_shift) && self.phase.is_none();
        config.estimated_delays |= self.estimate_delays;
    }

    /// What makes cycles begin, with bus shift or without.
    pub fn trigger(&self, bus_shift: bool) -> Trigger {
        if bus_shift { Trigger::Time } else { Trigger::ReferenceClock { phase_ns: self.phase.unwrap_or(0) } }
    }
}

/// A warning where frames reach other clocks before the reference: those receive this host's estimate of its time.
fn in_front(reference: ReferenceClock, found: &[SubDeviceInfo], declaration: &Declaration) -> Option<String> {
    let position = match reference {
        ReferenceClock::FirstConfigured => declaration.subdevices.iter().position(|config| config.sync.is_some())?,
        ReferenceClock::Declared(SubDeviceId(position)) => position,
        _ => return None,
    };
    let first = found[..position].iter().position(|info| info.controller.features.dc)?;
    Some(format!(
        "the clock of position {first} is upstream of the reference clock, position {position}: it follows this host's \
         estimate of the reference, and locks only as exactly as this host sends"
    ))
}

/// SYNC signals in words, in microseconds.
pub fn signals_in_words(signals: &SyncSignals) -> String {
    let signal = |name: &str, cycle: u32, shift: i32| {
        let shift = if shift == 0 {
            String::new()
        } else {
            format!("{}{}", if shift > 0 { "+" } else { "" }, us(shift.into()))
        };
        format!("{name} {}{shift}", us(cycle.into()))
    };
    let sync0 = signal("SYNC0", signals.sync0_cycle_ns, signals.sync0_shift_ns);
    if signals.assign_activate & 0x0400 == 0 {
        return sync0;
    }
    let cycle = if signals.sync1_cycle_ns == 0 { signals.sync0_cycle_ns } else { signals.sync1_cycle_ns };
    format!("{sync0}, {}", signal("SYNC1", cycle, signals.sync1_shift_ns))
}

/// The clock that is farthest from the reference, of those that were locked.
pub fn farthest(clocks: &[ClockStatus]) -> Option<&ClockStatus> {
    clocks.iter().max_by_key(|clock| clock.worst_ns)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_reference_is_a_rule_or_a_position() {
        assert_eq!(reference("first"), Ok(ReferenceClock::FirstWithClock));
        assert_eq!(reference("sync"), Ok(ReferenceClock::FirstConfigured));
        assert_eq!(reference("12"), Ok(ReferenceClock::Declared(SubDeviceId(12))));
        assert!(reference("-1").is_err() && reference("last").is_err());
    }

    // covers: dc-tools
    #[test]
    fn options_that_do_not_fit_are_refused_with_what_is_allowed() {
        let mut found = vec![SubDeviceInfo::default(), SubDeviceInfo::default()];
        found[1].controller.features.dc = true;
        found[0].name = "coupler".to_owned();
        let error =
            |options: ClockOptions| options.check(&found, &[None, None], 1_000_000).expect_err("it must be refused");
        let with = |reference| ClockOptions { reference: Some(reference), ..ClockOptions::default() };
        assert!(error(with(ReferenceClock::Declared(SubDeviceId(0)))).contains("\"coupler\" has no distributed clock"));
        assert!(error(with(ReferenceClock::Declared(SubDeviceId(2)))).contains("SubDevices 0 to 1"));
        assert!(error(with(ReferenceClock::FirstConfigured)).contains("add --sync"));
        let far = ClockOptions { phase: Some(-1_000_000), ..ClockOptions::default() };
        assert!(error(far).contains("less than the cycle of 1000 us, got -1000 us"));
        let good = ClockOptions {
            phase: Some(-999_999),
            reference: Some(ReferenceClock::Declared(SubDeviceId(1))),
            ..ClockOptions::default()
        };
        assert!(good.are_given() && good.check(&found, &[None, None], 1_000_000).is_ok());
        assert!(!ClockOptions::default().are_given());
    }

    // covers: dc-tools
    #[test]
    fn clocks_upstream_of_the_reference_are_warned_of() {
        let mut found = vec![SubDeviceInfo::default(); 3];
        found[1].controller.features.dc = true;
        let mut declaration = ringcat::automatic(&found, std::time::Duration::from_millis(1));
        declaration.subdevices[2].sync = Some(SyncSignals::sync0(1_000_000, 0));
        let warned = |reference| in_front(reference, &found, &declaration).is_some();
        assert!(warned(ReferenceClock::Declared(SubDeviceId(2))) && warned(ReferenceClock::FirstConfigured));
        assert!(!warned(ReferenceClock::Declared(SubDeviceId(1))) && !warned(ReferenceClock::FirstWithClock));
    }

    #[test]
    fn signals_are_printed_in_microseconds() {
        assert_eq!(signals_in_words(&SyncSignals::sync0(62_500, -100_000)), "SYNC0 62.5-100");
        let both = SyncSignals::sync0(1_000_000, 0).with_assign_activate(0x0700).with_sync1(2_000_000, 5_000);
        assert_eq!(signals_in_words(&both), "SYNC0 1000, SYNC1 2000+5");
    }
}
