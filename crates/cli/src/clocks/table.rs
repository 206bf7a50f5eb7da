//! Clocks as a table for people and as the keys of JSON.

use ringcat::histogram::Histogram;
use ringcat::text::Names;
use ringcat::{ClockStatus, SyncSignals};

use crate::clock_options::signals_in_words;
use crate::json::clocks::{Clock, Clocks, HiddenDelay};
use crate::json::values::Times;

fn name<'a>(clock: &ClockStatus, names: &'a Names) -> &'a str {
    clock.subdevice.and_then(|subdevice| names.0.get(subdevice.0)).map_or("", String::as_str)
}

fn signals_of(clock: &ClockStatus, signals: &[Option<SyncSignals>]) -> Option<SyncSignals> {
    clock.subdevice.and_then(|subdevice| signals.get(subdevice.0).copied().flatten())
}

/// Whether a delay is known, or one was estimated.
fn is_written(clock: &ClockStatus) -> bool {
    clock.hidden.is_none_or(|hidden| hidden.is_estimated)
}

/// The delay, `~` before an estimate, `-` where none was written.
fn delay(clock: &ClockStatus) -> String {
    match clock.hidden {
        None => clock.delay_ns.to_string(),
        Some(_) if is_written(clock) => format!("~{}", clock.delay_ns),
        Some(_) => "-".to_owned(),
    }
}

/// One line per clock, below a heading. `signals` by SubDevice.
pub fn lines(clocks: &[ClockStatus], names: &Names, signals: &[Option<SyncSignals>]) -> Vec<String> {
    let heading =
        "pos  station  delay/ns  drift/ppm   now/ns  worst/ns  locked              offset/ns  name  SYNC/us".to_owned();
    let line = |clock: &ClockStatus| {
        let difference = clock.difference_ns.map_or_else(|| "-".to_owned(), |ns| ns.to_string());
        let state = match clock {
            ClockStatus { is_reference: true, .. } => "reference",
            ClockStatus { is_locked: true, .. } => "yes",
            ClockStatus { is_required: true, .. } => "no",
            _ => "not used",
        };
        let words = signals_of(clock, signals).map(|signals| format!("  {}", signals_in_words(&signals)));
        format!(
            "{:>3}  {}  {:>8}  {:>9.3}  {:>7}  {:>8}  {:<9}  {:>20}  {}{}",
            clock.position,
            clock.station,
            delay(clock),
            clock.drift_ppb as f64 / 1e3,
            difference,
            clock.worst_ns,
            state,
            clock.offset_ns,
            name(clock, names),
            words.unwrap_or_default()
        )
    };
    std::iter::once(heading).chain(clocks.iter().map(line)).collect()
}

/// Clocks as JSON, with how far cycles began from their phase.
pub fn json(
    clocks: &[ClockStatus],
    names: &Names,
    signals: &[Option<SyncSignals>],
    locked: bool,
    phase_errors: &Histogram,
) -> Clocks {
    let clock = |clock: &ClockStatus| Clock {
        position: clock.position.0,
        station: clock.station.0,
        name: name(clock, names).to_owned(),
        reference: clock.is_reference,
        locked: clock.is_locked,
        required: clock.is_required,
        delay_ns: is_written(clock).then_some(clock.delay_ns),
        delay_hidden: clock.hidden.map(|hidden| HiddenDelay {
            fork: hidden.fork.map(|fork| fork.0),
            least_ns: hidden.range.map(|range| range.least_ns),
            most_ns: hidden.range.map(|range| range.most_ns),
            estimated: hidden.is_estimated,
        }),
        offset_ns: clock.offset_ns,
        drift_ppb: clock.drift_ppb,
        difference_ns: clock.difference_ns,
        worst_ns: clock.worst_ns,
        sync: signals_of(clock, signals).map(Into::into),
    };
    Clocks { locked, phase_errors: Times::of(phase_errors), clocks: clocks.iter().map(clock).collect() }
}

#[cfg(test)]
mod tests {
    use ringcat::SubDeviceId;

    use super::*;
    use ringcat::wire::address::{Position, StationAddress};
    use ringcat::{DelayRange, HiddenDelay};

    fn clock() -> ClockStatus {
        let mut clock = ClockStatus::default();
        clock.position = Position(3);
        clock.station = StationAddress(0x1004);
        clock.subdevice = Some(SubDeviceId(0));
        clock.delay_ns = 1_050;
        clock.offset_ns = -7;
        clock.drift_ppb = -12_345;
        clock.difference_ns = Some(-9);
        clock.worst_ns = 31;
        clock.is_locked = true;
        clock
    }

    // covers: dc-tools
    #[test]
    fn a_line_shows_what_is_known_of_a_clock() {
        let signals = [Some(SyncSignals::sync0(1_000_000, 250_000))];
        let lines = lines(&[clock()], &Names(vec!["servo".to_owned()]), &signals);
        let words: Vec<&str> = lines[1].split_whitespace().collect();
        let expected = ["3", "0x1004", "1050", "-12.345", "-9", "31", "yes", "-7", "servo", "SYNC0", "1000+250"];
        assert_eq!(words, expected);
    }

    // covers: dc-delays
    #[test]
    fn a_delay_that_is_not_known_is_none_and_an_estimate_is_marked() {
        let one = |is_estimated| {
            let mut hidden = HiddenDelay::default();
            hidden.fork = Some(Position(2));
            hidden.range = Some(DelayRange::new(0, 2_100));
            hidden.is_estimated = is_estimated;
            let mut clock = clock();
            clock.hidden = Some(hidden);
            clock
        };
        let words = |clock: ClockStatus| {
            let lines = lines(&[clock], &Names::default(), &[None]);
            let clocks = json(&[clock], &Names::default(), &[None], true, &Histogram::default());
            let hidden = clocks.clocks[0].delay_hidden.expect("it is hidden");
            assert_eq!((hidden.fork, hidden.least_ns, hidden.most_ns), (Some(2), Some(0), Some(2_100)));
            let delay = lines[1].split_whitespace().nth(2).map(str::to_owned);
            (delay, clocks.clocks[0].delay_ns, hidden.estimated)
        };
        assert_eq!(words(one(true)), (Some("~1050".to_owned()), Some(1_050), true));
        assert_eq!(words(one(false)), (Some("-".to_owned()), None, false));
    }

    // covers: dc-tools
    #[test]
    fn json_has_the_same_figures() {
        let phase_errors = Histogram::default();
        let clocks = json(&[clock()], &Names::default(), &[None], true, &phase_errors);
        assert_eq!(
            (clocks.clocks[0].delay_ns, clocks.clocks[0].sync.is_none(), clocks.locked),
            (Some(1_050), true, true)
        );
        assert!(clocks.phase_errors.is_none());
        phase_errors.record(std::time::Duration::from_micros(3));
        let clocks = json(&[], &Names::default(), &[], false, &phase_errors);
        assert_eq!(clocks.phase_errors.map(|times| (times.count, times.longest_ns)), Some((1, 3_000)));
    }
}
