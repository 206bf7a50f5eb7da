//! The option `--sync`: the SYNC signals of SubDevices (protocol 4.6, 7.3).

use std::time::Duration;

use ringcat::{SubDeviceInfo, SyncSignals};

use crate::times::{shift, time, us};

/// AssignActivate where the EEPROM has none: SYNC0, and SYNC0 with SYNC1.
const SYNC0: u16 = 0x0300;
const BOTH: u16 = 0x0700;
/// Bits of that word which activate signals.
const ACTIVATION: u16 = 0x0700;

/// One `--sync`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sync {
    /// A position; `None`: all SubDevices with a clock.
    position: Option<usize>,
    /// SYNC0 and SYNC1; `None`: as the EEPROM says.
    signals: Option<(Signal, Option<Signal>)>,
}

/// A cycle and a shift, in nanoseconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Signal {
    cycle_ns: u32,
    shift_ns: i32,
}

/// Reads `auto`, `PLACE:auto` or `PLACE:SYNC0[:SYNC1]`.
pub fn sync(text: &str) -> Result<Sync, String> {
    if text == "auto" {
        return Ok(Sync { position: None, signals: None });
    }
    let parts: Vec<&str> = text.split(':').collect();
    let (place, signals) = match parts.as_slice() {
        [place, "auto"] => (place, None),
        [place, sync0] => (place, Some((signal(sync0)?, None))),
        [place, sync0, sync1] => (place, Some((signal(sync0)?, Some(signal(sync1)?)))),
        _ => return Err(format!("expected auto or POSITION:SYNC0[:SYNC1], as in 3:1ms+250us, got \"{text}\"")),
    };
    let wrong = |place: &str| format!("expected a position or all before the colon, got \"{place}\"");
    let position = match *place {
        "all" => None,
        place => Some(place.parse().map_err(|_| wrong(place))?),
    };
    Ok(Sync { position, signals })
}

/// A cycle with or without a shift.
fn signal(text: &str) -> Result<Signal, String> {
    let (cycle, shifted) = text.split_at(text.find(['+', '-']).unwrap_or(text.len()));
    let cycle_ns =
        u32::try_from(time(cycle)?.as_nanos()).map_err(|_| format!("a cycle is at most 4 s, got \"{cycle}\""))?;
    let shift_ns = if shifted.is_empty() { 0 } else { shift(shifted)? };
    match i32::try_from(shift_ns) {
        Ok(shift_ns) if shift_ns.unsigned_abs() < cycle_ns => Ok(Signal { cycle_ns, shift_ns }),
        _ => Err(format!("a shift is shorter than the cycle of its signal, got \"{text}\"")),
    }
}

/// The signals of each SubDevice of a scan, for a MainDevice with this cycle.
pub fn choose(options: &[Sync], found: &[SubDeviceInfo], cycle: Duration) -> Result<Vec<Option<SyncSignals>>, String> {
    let mut chosen = vec![None; found.len()];
    let mut for_all = options.iter().filter(|option| option.position.is_none());
    if let Some(option) = for_all.next() {
        for (position, info) in found.iter().enumerate().filter(|(_, info)| takes_part(option, info)) {
            chosen[position] = Some(signals(option, position, info, cycle)?);
        }
        if chosen.iter().all(Option::is_none) {
            return Err(
                "--sync auto: no EEPROM has an operation mode with SYNC signals; give cycles, as in all:1ms".into()
            );
        }
    }
    if for_all.next().is_some() {
        return Err("--sync: auto and all are for all SubDevices; give one of them, and positions beside it".into());
    }
    let mut named = vec![false; found.len()];
    for (option, position) in options.iter().filter_map(|option| Some((option, option.position?))) {
        let last = found.len().saturating_sub(1);
        let info = found.get(position).ok_or_else(|| format!("--sync {position}: there are SubDevices 0 to {last}"))?;
        if std::mem::replace(&mut named[position], true) {
            return Err(format!("--sync {position}: given twice; SYNC1 goes behind SYNC0, as in {position}:1ms:2ms"));
        }
        if !info.controller.features.dc {
            let name = &info.name;
            return Err(format!(
                "--sync {position}: SubDevice {position} \"{name}\" has no distributed clock; leave it out"
            ));
        }
        chosen[position] = Some(signals(option, position, info, cycle)?);
    }
    Ok(chosen)
}

/// Whether a SubDevice without an option of its own gets signals.
fn takes_part(option: &Sync, info: &SubDeviceInfo) -> bool {
    let has_mode = || info.dc_modes.iter().any(SyncSignals::are_in);
    info.controller.features.dc && (option.signals.is_some() || has_mode())
}

fn signals(option: &Sync, position: usize, info: &SubDeviceInfo, cycle: Duration) -> Result<SyncSignals, String> {
    let fails = |reason: String| format!("--sync: SubDevice {position} \"{}\": {reason}", info.name);
    let signals = match option.signals {
        Some((sync0, sync1)) => given(sync0, sync1, info),
        None => {
            let mode = info.dc_modes.iter().find(|mode| SyncSignals::are_in(mode));
            let mode = mode.ok_or_else(|| {
                fails(format!("its EEPROM has no operation mode with SYNC signals; give cycles, as in {position}:1ms"))
            })?;
            let advice = |error| format!("its EEPROM: {error}; give cycles, as in {position}:1ms");
            SyncSignals::from_mode(mode, cycle).map_err(|error| fails(advice(error)))?
        }
    };
    fit(&signals, cycle).map_err(fails)?;
    Ok(signals)
}

/// Cycles and shifts of the command line, with the AssignActivate word of the EEPROM that activates the same signals.
fn given(sync0: Signal, sync1: Option<Signal>, info: &SubDeviceInfo) -> SyncSignals {
    let plain = if sync1.is_some() { BOTH } else { SYNC0 };
    let same = info.dc_modes.iter().map(|mode| mode.assign_activate).find(|word| word & ACTIVATION == plain);
    let signals = SyncSignals::sync0(sync0.cycle_ns, sync0.shift_ns).with_assign_activate(same.unwrap_or(plain));
    sync1.map_or(signals, |sync1| signals.with_sync1(sync1.cycle_ns, sync1.shift_ns))
}

/// Refuses signals that would drift against the cycles.
fn fit(signals: &SyncSignals, cycle: Duration) -> Result<(), String> {
    let (cycle, sync0, sync1) = (cycle.as_nanos() as i64, signals.sync0_cycle_ns.into(), signals.sync1_cycle_ns.into());
    if sync0 == 0 || (sync0 % cycle != 0 && cycle % sync0 != 0) {
        return Err(format!(
            "SYNC0 every {} us does not go with cycles of {} us: one must be a multiple of the other",
            us(sync0),
            us(cycle)
        ));
    }
    if sync1 % sync0 != 0 {
        let (sync1, sync0) = (us(sync1), us(sync0));
        return Err(format!("SYNC1 every {sync1} us: expected a multiple of SYNC0's {sync0} us"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use ringcat::wire::sii::DcMode;

    const CYCLE: Duration = Duration::from_millis(1);

    fn info(dc: bool, modes: &[u16]) -> SubDeviceInfo {
        let mut info = SubDeviceInfo::default();
        info.name = "drive".to_owned();
        info.controller.features.dc = dc;
        let mode = |word: &u16| DcMode { assign_activate: *word, sync0_cycle_factor: 1, ..DcMode::default() };
        info.dc_modes = modes.iter().map(mode).collect();
        info
    }

    fn choice(options: &[&str], found: &[SubDeviceInfo]) -> Result<Vec<Option<SyncSignals>>, String> {
        let options: Result<Vec<Sync>, String> = options.iter().map(|text| sync(text)).collect();
        choose(&options?, found, CYCLE)
    }

    // covers: 4.6, dc-tools
    #[test]
    fn signals_are_given_by_position_or_taken_from_the_eeprom() {
        let found = [info(false, &[]), info(true, &[0x0000, 0x0320, 0x0730]), info(true, &[])];
        let words = |chosen: &[Option<SyncSignals>]| -> Vec<Option<u16>> {
            chosen.iter().map(|signals| signals.map(|signals| signals.assign_activate)).collect()
        };
        assert_eq!(words(&choice(&["auto"], &found).expect("good")), [None, Some(0x0320), None]);
        let chosen = choice(&["all:500us", "1:1ms+250us:4ms-1us"], &found).expect("good");
        assert_eq!(words(&chosen), [None, Some(0x0730), Some(0x0300)]);
        let (named, other) = (chosen[1].expect("named"), chosen[2].expect("one of all"));
        assert_eq!((named.sync0_cycle_ns, named.sync0_shift_ns), (1_000_000, 250_000));
        assert_eq!((named.sync1_cycle_ns, named.sync1_shift_ns), (4_000_000, -1_000));
        assert_eq!((other.sync0_cycle_ns, other.sync0_shift_ns), (500_000, 0));
        assert_eq!(words(&choice(&["2:2ms:2ms"], &found).expect("good")), [None, None, Some(0x0700)]);
        assert_eq!(choice(&[], &found), Ok(vec![None; 3]));
    }

    // covers: dc-tools
    #[test]
    fn signals_that_make_no_sense_are_refused_with_what_is_allowed() {
        let found = [info(false, &[]), info(true, &[0x0300]), info(true, &[])];
        for (options, part) in [
            (&["3:1ms"][..], "there are SubDevices 0 to 2"),
            (&["0:1ms"], "SubDevice 0 \"drive\" has no distributed clock"),
            (&["2:auto"], "give cycles, as in 2:1ms"),
            (&["1:1ms", "1:2ms"], "given twice; SYNC1 goes behind SYNC0"),
            (&["1:1500us"], "SYNC0 every 1500 us does not go with cycles of 1000 us"),
            (&["1:1ms:1500us"], "expected a multiple of SYNC0's 1000 us"),
            (&["1:1ms+1ms"], "shorter than the cycle"),
            (&["1"], "POSITION:SYNC0[:SYNC1]"),
            (&["x:1ms"], "expected a position or all"),
            (&["1:1ms+5"], "with us, ms"),
            (&["all:1ms", "auto"], "give one of them"),
        ] {
            let error = choice(options, &found).expect_err("it must be refused");
            assert!(error.contains(part), "{options:?}: {error}");
        }
        assert!(choice(&["auto"], &found[..1]).is_err_and(|error| error.contains("no EEPROM has an operation mode")));
    }
}
