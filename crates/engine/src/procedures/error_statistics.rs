//! Error counts of SubDevices (protocol 2.5).
//!
//! The registers saturate at 255. The totals here continue: each reading adds the errors counted since the last one.
//! Other procedures that read or clear the registers report it here (`error_watch`).

use alloc::rc::Rc;
use alloc::vec::Vec;
use core::cell::{Cell, RefCell};
use core::fmt;
use core::time::Duration;

use ringcat_wire::register::ErrorCounters;

use crate::supervisor::{Bus, Signal};
use crate::time::Instant;

/// Counters of the process data watchdog and of the PDI watchdog.
pub(super) const WATCHDOGS: usize = 2;

/// Error counts of a port.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct PortErrors {
    /// Frames with a bad check sequence that this port detected first.
    pub invalid_frames: u64,
    /// RX_ER symbols.
    pub rx_errors: u64,
    /// Bad frames that an earlier controller has marked.
    pub forwarded: u64,
    /// Lost links.
    pub lost_links: u64,
}

/// Error counts of a SubDevice since the beginning, or since its counters were cleared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Statistics {
    /// Port 0..3.
    pub ports: [PortErrors; 4],
    /// Errors of the processing unit, circulating frames among them.
    pub processing_unit: u64,
    /// Errors of the process data interface.
    pub pdi: u64,
    /// Expirations of the process data watchdog.
    pub watchdog_process_data: u64,
    /// Expirations of the PDI watchdog.
    pub watchdog_pdi: u64,
    /// Readings.
    pub readings: u64,
    /// Time of the last reading.
    pub read_at: Option<Instant>,
    /// The registers as of the last reading.
    pub registers: ErrorCounters,
    /// Registers WATCHDOG_COUNTER_PROCESS_DATA and WATCHDOG_COUNTER_PDI as of the last reading.
    pub watchdog_registers: [u8; WATCHDOGS],
}

impl Statistics {
    /// Adds a reading.
    pub(super) fn take(&mut self, now: Instant, counters: ErrorCounters, watchdogs: [u8; WATCHDOGS]) {
        self.count(counters);
        add(&mut self.watchdog_process_data, self.watchdog_registers[0], watchdogs[0]);
        add(&mut self.watchdog_pdi, self.watchdog_registers[1], watchdogs[1]);
        self.watchdog_registers = watchdogs;
        self.readings += 1;
        self.read_at = Some(now);
    }

    fn count(&mut self, counters: ErrorCounters) {
        let before = self.registers;
        for (number, port) in self.ports.iter_mut().enumerate() {
            let (was, is) = (before.rx[number], counters.rx[number]);
            add(&mut port.invalid_frames, was.invalid_frames, is.invalid_frames);
            add(&mut port.rx_errors, was.rx_errors, is.rx_errors);
            add(&mut port.forwarded, before.forwarded[number], counters.forwarded[number]);
            add(&mut port.lost_links, before.lost_link[number], counters.lost_link[number]);
        }
        add(&mut self.processing_unit, before.epu, counters.epu);
        add(&mut self.pdi, before.pdi, counters.pdi);
        self.registers = counters;
    }

    /// Whether there was any error.
    pub fn is_clean(&self) -> bool {
        let ports = self.ports.iter().all(|port| *port == PortErrors::default());
        ports && self.processing_unit + self.pdi + self.watchdog_process_data + self.watchdog_pdi == 0
    }
}

/// A register with a smaller value than before was cleared meanwhile.
fn add(total: &mut u64, before: u8, now: u8) {
    *total += u64::from(if now >= before { now - before } else { now });
}

/// The statistics of all declared SubDevices, and the interval of their readings.
#[derive(Clone)]
pub struct ErrorStatistics {
    all: Rc<RefCell<Vec<Statistics>>>,
    period: Rc<Cell<Option<Duration>>>,
    changed: Signal,
}

impl fmt::Debug for ErrorStatistics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ErrorStatistics").field("period", &self.period).finish_non_exhaustive()
    }
}

impl ErrorStatistics {
    pub(crate) fn new(bus: &Bus, subdevices: usize, period: Option<Duration>) -> ErrorStatistics {
        let all = Rc::new(RefCell::new((0..subdevices).map(|_| Statistics::default()).collect()));
        ErrorStatistics { all, period: Rc::new(Cell::new(period)), changed: bus.signal() }
    }

    pub(crate) fn set_period(&self, period: Option<Duration>) {
        self.period.set(period);
        self.changed.notify();
    }

    pub(super) fn period(&self) -> Option<Duration> {
        self.period.get()
    }

    /// Waits until the interval differs from this one.
    pub(super) async fn until_period(&self, other_than: Option<Duration>) {
        self.changed.until(|| (self.period.get() != other_than).then_some(())).await;
    }

    pub(crate) fn find(&self, subdevice: usize) -> Option<Statistics> {
        self.all.borrow().get(subdevice).copied()
    }

    /// Another procedure has read the error counters.
    pub(crate) fn note_reading(&self, subdevice: usize, counters: &ErrorCounters) {
        self.with(subdevice, |statistics| statistics.count(*counters));
    }

    /// Another procedure has cleared the counters of frames and links.
    pub(crate) fn cleared(&self, subdevice: usize) {
        self.with(subdevice, |statistics| {
            let ErrorCounters { epu, pdi, pdi_code, .. } = statistics.registers;
            statistics.registers = ErrorCounters { epu, pdi, pdi_code, ..ErrorCounters::default() };
        });
    }

    pub(super) fn with(&self, subdevice: usize, work: impl FnOnce(&mut Statistics)) {
        if let Some(statistics) = self.all.borrow_mut().get_mut(subdevice) {
            work(statistics);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: cable-errors
    #[test]
    fn totals_continue_after_registers_were_cleared() {
        let mut statistics = Statistics::default();
        assert!(statistics.is_clean());
        let mut reading = |invalid: u8, lost: u8, watchdog: u8| {
            let mut counters = ErrorCounters::default();
            counters.rx[1].invalid_frames = invalid;
            counters.lost_link[3] = lost;
            statistics.take(Instant(5), counters, [watchdog, 0]);
            (statistics.ports[1].invalid_frames, statistics.ports[3].lost_links, statistics.watchdog_process_data)
        };
        assert_eq!(reading(3, 1, 255), (3, 1, 255));
        assert_eq!(reading(5, 1, 255), (5, 1, 255));
        assert_eq!(reading(2, 0, 1), (7, 1, 256));
        assert!(!statistics.is_clean());
        assert_eq!((statistics.readings, statistics.read_at), (3, Some(Instant(5))));
    }
}
