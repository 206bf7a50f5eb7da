//! Operation without an application: watches links, number and states of the SubDevices, scans after changes.
//!
//! One broadcast read of AL status per period shows how many SubDevices are on each link, the OR of their states, and
//! whether a port has changed. Other datagrams are sent only after a change, and once a second.

mod changes;
pub(super) mod requests;
mod rescue;

use alloc::format;
use alloc::rc::Rc;
use alloc::string::ToString;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::Wkc;
use ringcat_wire::al::AlStatus;
use ringcat_wire::register::{DlStatus, EcatEvent, map};

use changes::nothing;
pub(crate) use changes::scan_again;
use rescue::differences;
pub(crate) use rescue::rescue;

use super::inspect::read_subdevice;
use super::scan::{ScanOptions, scan};
use super::shared_segment::{SharedSegment, until_active};
use crate::event::{Event, Subject};
use crate::link::{Link, LinkSet};
use crate::ring::RingState;
use crate::segment::{Observation, Reading, StateRead, UndeclaredObservation};
use crate::supervisor::Bus;
use crate::time::Instant;

/// Interval of the broadcast: a change is detected within it.
const PERIOD: Duration = Duration::from_millis(20);
/// Interval of reads of all states: an OR can hide one state behind others.
const ROUTINE: Duration = Duration::from_secs(1);
/// Consecutive broadcasts without an answer after which no SubDevice is connected.
const SILENT: u8 = 3;
/// Consecutive failures of a scan after which they are reported.
const PATIENCE: u32 = 20;

/// What the last broadcast showed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Seen {
    counts: (Wkc, Wkc),
    al_status: u8,
    ports_changed: bool,
}

/// Watches the segment until an application is activated, or the MainDevice stops.
pub(crate) async fn watch(bus: Bus, segment: SharedSegment, options: ScanOptions) {
    let mut watch = Watch {
        carriers: bus.carriers(),
        ring: bus.ring(),
        counts: None,
        is_stale: false,
        silent: 0,
        failures: 0,
        next_routine: Instant::default(),
        bus: bus.clone(),
        segment: segment.clone(),
        options,
    };
    until_active(&segment, async move {
        loop {
            watch.turn().await;
            bus.sleep(PERIOD).await;
        }
    })
    .await;
}

struct Watch {
    bus: Bus,
    segment: SharedSegment,
    options: ScanOptions,
    carriers: [Option<bool>; 2],
    ring: RingState,
    /// SubDevices on each link at the last scan.
    counts: Option<(Wkc, Wkc)>,
    /// The last scan does not show the present segment.
    is_stale: bool,
    silent: u8,
    failures: u32,
    next_routine: Instant,
}

impl Watch {
    async fn turn(&mut self) {
        self.report_carriers();
        if self.segment.view().is_scanning() {
            self.counts = None;
            return;
        }
        let Some(seen) = self.broadcast().await else { return };
        // The application may have begun a scan meanwhile.
        if self.segment.view().is_scanning() {
            self.counts = None;
            return;
        }
        self.report_ring(seen);
        if self.segment.view().found().is_none() {
            return self.scan_anew(seen).await;
        }
        self.take_over();
        let is_first = self.counts.is_none();
        if is_first {
            self.counts = Some(self.scanned_counts());
        }
        let wanted = self.segment.idle_rescans.wanted();
        if self.counts != Some(seen.counts) || seen.ports_changed || self.is_stale || wanted.is_some() {
            return self.follow(seen, wanted).await;
        }
        let is_unexpected = {
            let view = self.segment.view();
            let is_other = view.expected_states().is_some_and(|expected| seen.al_status != expected);
            is_other && view.are_undeclared_settled()
        };
        if self.bus.now() >= self.next_routine || is_unexpected {
            self.read_states().await;
        }
    }

    /// SubDevices of the last scan are kept in their states from now on.
    fn take_over(&self) {
        if self.segment.view().has_untouched() {
            self.segment.observe_undeclared(UndeclaredObservation::TakenOver);
        }
    }

    fn scanned_counts(&self) -> (Wkc, Wkc) {
        let view = self.segment.view();
        let Some(found) = view.found() else { return (Wkc(0), Wkc(0)) };
        let redundant = found.subdevices.len().saturating_sub(found.main_count);
        (Wkc(found.main_count as u16), Wkc(redundant as u16))
    }

    fn report_carriers(&mut self) {
        let carriers = self.bus.carriers();
        for link in Link::ALL {
            match (self.carriers[link.index()], carriers[link.index()]) {
                (before, Some(false)) if before != Some(false) => self.bus.report(Event::LinkDown { link }),
                (Some(false), Some(true)) => self.bus.report(Event::LinkUp { link }),
                _ => {}
            }
        }
        self.carriers = carriers;
    }

    fn report_ring(&mut self, seen: Seen) {
        let (main, redundant) = (seen.counts.0.0, seen.counts.1.0);
        match (core::mem::replace(&mut self.ring, self.bus.ring()), self.ring) {
            (RingState::Closed | RingState::Unknown, RingState::Open) => {
                self.bus.report(Event::RingOpened { main, redundant });
            }
            (RingState::Open, RingState::Closed) => {
                self.bus.report(Event::RingClosed { main, redundant, place: None });
            }
            _ => {}
        }
    }

    /// No link has a carrier.
    fn is_unplugged(&self) -> bool {
        let links = if self.bus.links() == LinkSet::Ring { 2 } else { 1 };
        self.carriers.iter().take(links).all(|carrier| *carrier == Some(false))
    }

    /// One broadcast; `None` if a lost frame is no evidence yet.
    async fn broadcast(&mut self) -> Option<Seen> {
        if self.is_unplugged() {
            return Some(Seen::default());
        }
        match self.bus.brd(map::AL_STATUS, AlStatus::LEN).await {
            Ok(reply) => {
                self.silent = 0;
                let al_status = reply.data.first().copied().unwrap_or_default();
                let ports_changed = EcatEvent::from_bits(reply.irq).dl_status;
                Some(Seen { counts: (reply.main, reply.redundant), al_status, ports_changed })
            }
            Err(_) => {
                self.silent = self.silent.saturating_add(1);
                (self.silent >= SILENT).then(Seen::default)
            }
        }
    }

    /// The first scan, as soon as a SubDevice answers.
    async fn scan_anew(&mut self, seen: Seen) {
        if seen.counts == (Wkc(0), Wkc(0)) {
            return;
        }
        self.segment.observe(Observation::ScanBegun);
        let ended = scan(&self.bus, &self.options).await.map_err(|error| error.to_string());
        self.segment.observe(Observation::ScanEnded(ended));
        self.counts = None;
    }

    /// The segment has changed, or a rescan is requested.
    async fn follow(&mut self, seen: Seen, wanted: Option<u64>) {
        if self.counts != Some(seen.counts) && !self.is_stale {
            self.bus.report(Event::Counted { main: seen.counts.0.0, redundant: seen.counts.1.0 });
        }
        self.bus.step(Subject::Scan, || {
            let (main, redundant) = (seen.counts.0, seen.counts.1);
            format!("the segment has changed: {main} SubDevices on MAIN, {redundant} on REDUNDANT")
        });
        self.is_stale = true;
        // Clears the ECAT events of the ports. Changes from now on set them again.
        if seen.ports_changed && self.bus.brd(map::DL_STATUS, DlStatus::LEN).await.is_err() {
            return;
        }
        let versions = self.segment.view().versions();
        let before = self.segment.view().found().cloned().unwrap_or_else(|| Rc::new(nothing()));
        let known = before.subdevices.clone();
        let found = match self.is_unplugged() {
            true => Ok(Some(nothing())),
            false => scan_again(&self.bus, &self.segment, &self.options, &known).await,
        };
        match found {
            Ok(Some(found)) => {
                let differences = differences(&before, &found);
                let (added, removed) = (differences.added.len(), differences.removed.len());
                let subdevices = found.subdevices.len();
                self.segment.observe(Observation::FoundAgain { versions, found: Rc::new(found) });
                (self.is_stale, self.failures) = (false, 0);
                self.counts = Some(self.scanned_counts());
                self.take_over();
                if added + removed > 0 {
                    self.bus.report(Event::SegmentChanged { subdevices, added, removed });
                }
                if let Some(number) = wanted {
                    self.segment.idle_rescans.end(number, differences);
                }
            }
            Ok(None) => self.failures += 1,
            Err(error) => {
                self.failures += 1;
                if self.failures == PATIENCE {
                    self.bus.report(Event::ScanFailed { reason: error.to_string() });
                }
            }
        }
    }

    /// Reads the state of each SubDevice.
    async fn read_states(&mut self) {
        self.next_routine = self.bus.now() + ROUTINE;
        let settled = self.segment.view().settled();
        let readings: Vec<StateRead> = self
            .bus
            .gather(settled, |bus, (key, attempt)| async move {
                StateRead { key, attempt, reading: read_subdevice(&bus, key.station).await }
            })
            .await;
        // A SubDevice without its station address has lost its power.
        self.is_stale |= readings.iter().any(|read| matches!(read.reading, Reading::Silent | Reading::Doubled));
        self.segment.observe_undeclared(UndeclaredObservation::StatesRead(&readings));
    }
}
