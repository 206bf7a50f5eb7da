//! Error counters of all SubDevices: read on a period, on demand, cleared (facts 2.5).
//!
//! The registers stop at 255. What is kept here goes on: each reading adds what was counted since the last one, and a
//! register that is nearly full is cleared. Whoever else reads or clears them says so here (`error_watch`).

use alloc::rc::Rc;
use alloc::vec::Vec;
use core::cell::{Cell, RefCell};
use core::fmt;
use core::time::Duration;

use ringcat_wire::address::StationAddress;
use ringcat_wire::register::{ErrorCounters, map};

use super::ServiceError;
use crate::procedures::fleet::SharedFleet;
use crate::supervisor::{Bus, Signal};
use crate::time::Instant;

/// A counter that has come so far is cleared.
const NEARLY_FULL: u8 = 0xC0;
/// Counters of the process data watchdog and of the PDI watchdog.
const WATCHDOGS: usize = 2;

/// What a port has counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PortErrors {
    /// Frames whose bad check sequence was seen here first.
    pub invalid_frames: u64,
    /// RX_ER symbols.
    pub rx_errors: u64,
    /// Bad frames that a controller before has marked.
    pub forwarded: u64,
    /// Lost links.
    pub lost_links: u64,
}

/// What a SubDevice has counted since the beginning, or since its counters were cleared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
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
    /// The registers as they were read last.
    pub registers: ErrorCounters,
    /// Register WATCHDOG_COUNTER_PROCESS_DATA, and that of the PDI, as they were read last.
    pub watchdog_registers: [u8; WATCHDOGS],
}

impl Statistics {
    /// Takes in a reading.
    fn take(&mut self, now: Instant, counters: ErrorCounters, watchdogs: [u8; WATCHDOGS]) {
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

/// A register that shows less than before was cleared meanwhile.
fn add(total: &mut u64, before: u8, now: u8) {
    *total += u64::from(if now >= before { now - before } else { now });
}

/// The statistics of all declared SubDevices, and how often they are brought up to date.
#[derive(Clone)]
pub(crate) struct Book {
    all: Rc<RefCell<Vec<Statistics>>>,
    period: Rc<Cell<Option<Duration>>>,
    changed: Signal,
}

impl fmt::Debug for Book {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Book").field("period", &self.period).finish_non_exhaustive()
    }
}

impl Book {
    pub(crate) fn new(bus: &Bus, subdevices: usize, period: Option<Duration>) -> Book {
        let all = Rc::new(RefCell::new((0..subdevices).map(|_| Statistics::default()).collect()));
        Book { all, period: Rc::new(Cell::new(period)), changed: bus.signal() }
    }

    pub(crate) fn set_period(&self, period: Option<Duration>) {
        self.period.set(period);
        self.changed.notify();
    }

    pub(crate) fn find(&self, subdevice: usize) -> Option<Statistics> {
        self.all.borrow().get(subdevice).copied()
    }

    /// Somebody else has read the error counters.
    pub(crate) fn heard(&self, subdevice: usize, counters: &ErrorCounters) {
        self.with(subdevice, |statistics| statistics.count(*counters));
    }

    /// Somebody else has cleared the counters of frames and links.
    pub(crate) fn cleared(&self, subdevice: usize) {
        self.with(subdevice, |statistics| {
            let ErrorCounters { epu, pdi, pdi_code, .. } = statistics.registers;
            statistics.registers = ErrorCounters { epu, pdi, pdi_code, ..ErrorCounters::default() };
        });
    }

    fn with(&self, subdevice: usize, work: impl FnOnce(&mut Statistics)) {
        if let Some(statistics) = self.all.borrow_mut().get_mut(subdevice) {
            work(statistics);
        }
    }
}

/// Runs for ever: reads all counters in turns, with the period between two beginnings.
pub(crate) async fn collect(bus: Bus, fleet: SharedFleet, book: Book) {
    loop {
        let begin = bus.now();
        let period = book.period.get();
        if period.is_some() {
            let stations: Vec<_> = fleet.access().members.iter().map(|member| member.station).enumerate().collect();
            let own = book.clone();
            let read_one = move |bus: Bus, (subdevice, station)| {
                let book = own.clone();
                async move {
                    // One that does not answer is the matter of whoever supervises.
                    let _ = read(&bus, &book, subdevice, station).await;
                }
            };
            bus.gather_in_turns(stations, read_one).await;
        }
        let changed = book.changed.until(|| (book.period.get() != period).then_some(()));
        match period {
            Some(period) => {
                let left = period.saturating_sub(bus.now().since(begin));
                let _ = bus.within(left, changed).await;
            }
            None => changed.await,
        }
    }
}

/// Reads the counters of one SubDevice.
pub(crate) async fn read(
    bus: &Bus,
    book: &Book,
    subdevice: usize,
    station: StationAddress,
) -> Result<Statistics, ServiceError> {
    let counters = bus.fprd_array::<{ ErrorCounters::LEN }>(station, map::RX_ERROR_COUNTER);
    let watchdogs = bus.fprd_array::<WATCHDOGS>(station, map::WATCHDOG_COUNTER_PROCESS_DATA);
    let (counters, watchdogs) = bus.both(counters, watchdogs).await;
    let (bytes, watchdogs) = (counters?, watchdogs?);
    book.with(subdevice, |statistics| statistics.take(bus.now(), ErrorCounters::decode(&bytes), watchdogs));
    if bytes.iter().chain(&watchdogs).any(|counter| *counter >= NEARLY_FULL) {
        clear_registers(bus, book, subdevice, station).await?;
    }
    book.find(subdevice).ok_or(ServiceError::NoSubDevice { subdevice })
}

/// Clears the counters of one SubDevice, and what was kept of them.
pub(crate) async fn clear(
    bus: &Bus,
    book: &Book,
    subdevice: usize,
    station: StationAddress,
) -> Result<(), ServiceError> {
    clear_registers(bus, book, subdevice, station).await?;
    book.with(subdevice, |statistics| *statistics = Statistics::default());
    Ok(())
}

/// What is counted between the reading and the writing is lost.
async fn clear_registers(
    bus: &Bus,
    book: &Book,
    subdevice: usize,
    station: StationAddress,
) -> Result<(), ServiceError> {
    let counters = bus.fpwr(station, map::RX_ERROR_COUNTER, &[0; ErrorCounters::LEN]);
    let watchdogs = bus.fpwr(station, map::WATCHDOG_COUNTER_PROCESS_DATA, &[0; WATCHDOGS]);
    let (counters, watchdogs) = bus.both(counters, watchdogs).await;
    counters?;
    watchdogs?;
    book.with(subdevice, |statistics| {
        (statistics.registers, statistics.watchdog_registers) = (ErrorCounters::default(), [0; WATCHDOGS]);
    });
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_kept_goes_on_where_registers_were_cleared() {
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
