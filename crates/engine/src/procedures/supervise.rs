//! Watching over the segment after activation, and acting on what the supervision datagram shows.
//!
//! The exchange posts one word per cycle: how many SubDevices answered on each link, the OR of their AL status, the OR
//! of their event requests. As long as it does not change, nothing is asked of the bus but one look per second.
//!
//! Changes of the ring are reported from these words alone, by a procedure of their own: a look waits for lost frames.

use alloc::rc::Rc;
use alloc::vec;
use alloc::vec::Vec;
use core::cell::Cell;
use core::time::Duration;

use ringcat_wire::al::AlStatus;
use ringcat_wire::register::{DlStatus, map};

use super::configure::Start;
use super::fleet::{Phase, SharedFleet};
use super::inspect::{Break, Look, locate_break, look_at_all};
use super::recover::{identify, lose, start};
use super::scan::ScanError;
use crate::board::{RingWord, Supervision};
use crate::event::Event;
use crate::ring::RingState;
use crate::supervisor::{Bus, BusError};
use crate::time::Instant;

/// Pause between two looks at the board.
const PAUSE: Duration = Duration::from_millis(1);
/// All SubDevices are looked at so often even if nothing changed: an OR can hide one state behind others.
const ROUTINE: Duration = Duration::from_secs(1);
/// A SubDevice is lost when it was silent in so many looks in a row: at the edge of a cut a copy may have met nobody.
const SILENT_LOOKS: u8 = 2;
/// Pause before a silent SubDevice is looked at again.
const SECOND_LOOK_PAUSE: Duration = Duration::from_millis(2);
/// Supervision results until the counts of both links must be the same twice in a row: at the edge of a cut one copy
/// may meet fewer SubDevices than live on its side.
const SETTLING_RESULTS: u32 = 20;
/// Looks for the place of a break: its neighbours may notice the lost link later than frames do.
const BREAK_LOOKS: u8 = 20;
/// Pause between two of them.
const BREAK_LOOK_PAUSE: Duration = Duration::from_millis(10);

/// Runs for ever.
pub(crate) async fn supervise(bus: Bus, fleet: SharedFleet) {
    let silent = vec![0; fleet.access().members.len()];
    let reported = Rc::new(Cell::new(RingState::Unknown));
    bus.spawn(report_ring(bus.clone(), fleet.clone(), reported.clone()));
    let mut watch = Watch {
        bus,
        fleet,
        silent,
        seen: Supervision::default(),
        ring: RingWord::default(),
        reported,
        seen_reported: RingState::Unknown,
        place: None,
        break_looks: 0,
        next_routine: Instant::default(),
    };
    loop {
        watch.bus.sleep(PAUSE).await;
        if watch.is_called_for() {
            watch.check().await;
        }
    }
}

struct Watch {
    bus: Bus,
    fleet: SharedFleet,
    /// Silent looks in a row, by member.
    silent: Vec<u8>,
    /// The supervision result that the last check was about.
    seen: Supervision,
    ring: RingWord,
    /// The state of the ring that was reported last.
    reported: Rc<Cell<RingState>>,
    /// The same, as of the last check.
    seen_reported: RingState,
    /// The break that was reported last.
    place: Option<Break>,
    /// Looks for it that are left.
    break_looks: u8,
    next_routine: Instant,
}

/// Reports each change of the ring once, with the counts of both links.
async fn report_ring(bus: Bus, fleet: SharedFleet, reported: Rc<Cell<RingState>>) {
    let (mut last, mut results) = (None, 0);
    loop {
        bus.sleep(PAUSE).await;
        let state = fleet.board.ring().state;
        let Some((number, supervision)) = fleet.board.supervision() else { continue };
        if state == reported.get() {
            last = None;
            continue;
        }
        let counts = (supervision.main.0, supervision.redundant.0);
        match last {
            None => results = 0,
            Some((before, _)) if before == number => continue,
            Some((_, before)) if before == counts || results >= SETTLING_RESULTS => {
                let was_open = reported.replace(state) == RingState::Open;
                let (main, redundant) = counts;
                match state {
                    RingState::Open => bus.report(Event::RingOpened { main, redundant }),
                    RingState::Closed if was_open => bus.report(Event::RingClosed { main, redundant }),
                    RingState::Closed | RingState::Unknown => {}
                }
            }
            Some(_) => results += 1,
        }
        last = Some((number, counts));
    }
}

impl Watch {
    fn is_called_for(&mut self) -> bool {
        let ring = self.fleet.board.ring();
        let now = self.bus.now();
        let supervision = self.fleet.board.supervision().map(|(_, supervision)| supervision);
        let reported = self.reported.get();
        let changed = supervision.is_some_and(|supervision| supervision != self.seen)
            || ring != self.ring
            || reported != self.seen_reported;
        if !changed && now < self.next_routine {
            return false;
        }
        self.seen = supervision.unwrap_or(self.seen);
        self.ring = ring;
        if reported != self.seen_reported {
            self.seen_reported = reported;
            self.place = None;
            self.break_looks = BREAK_LOOKS;
        }
        self.next_routine = now + ROUTINE;
        true
    }

    async fn check(&mut self) {
        let Ok(counted) = self.bus.brd(map::AL_STATUS, AlStatus::LEN).await else { return };
        let main = counted.main.0;
        let looks = look_at_all(&self.bus, &self.fleet).await;
        let strangers = self.fleet.access().strangers.len();
        let answered = looks.iter().filter(|look| matches!(look, Look::Answer { .. })).count();
        // When the count and the answers agree, a silent SubDevice is certainly not there.
        let needed = if usize::from(counted.wkc().0) == answered + strangers { 1 } else { SILENT_LOOKS };
        let answering = self.judge(&looks, needed);
        if looks.contains(&Look::Silent) && needed > 1 {
            // Certainty soon, and then again only when something changes.
            self.bus.sleep(SECOND_LOOK_PAUSE).await;
            self.next_routine = self.bus.now();
        }
        self.report_break(&looks);
        if usize::from(counted.wkc().0) > answering + strangers {
            self.find_strangers(main, counted.wkc().0).await;
        }
        // Clears the request of those that nobody looked at.
        if self.bus.brd(map::DL_STATUS, DlStatus::LEN).await.is_err() {
            self.next_routine = self.bus.now();
        }
    }

    /// Acts on what each SubDevice said; returns how many answered. So many silent looks make one lost.
    fn judge(&mut self, looks: &[Look], needed: u8) -> usize {
        let mut answering = 0;
        for (index, look) in looks.iter().enumerate() {
            let phase = self.fleet.phase(index);
            match (look, phase) {
                (Look::Unknown, _) => {}
                (Look::Silent, Phase::Absent) => self.silent[index] = SILENT_LOOKS,
                (Look::Silent, Phase::Configuring | Phase::Settled(_)) => {
                    self.silent[index] = (self.silent[index] + 1).min(SILENT_LOOKS);
                    // One that is being configured is lost by its own procedure.
                    if self.silent[index] >= needed && phase != Phase::Configuring {
                        lose(&self.bus, &self.fleet, index);
                    }
                }
                (Look::Answer { .. }, Phase::Absent) => {
                    answering += 1;
                    self.silent[index] = 0;
                    self.bus.report(Event::Returned { subdevice: index });
                    start(&self.bus, &self.fleet, index, Start::Unknown);
                }
                (Look::Answer { status, code, .. }, Phase::Settled(state)) => {
                    answering += 1;
                    self.silent[index] = 0;
                    if status.error || status.al_state() != Some(state) {
                        self.bus.report(Event::StateError {
                            subdevice: index,
                            requested: None,
                            status: *status,
                            code: *code,
                        });
                        start(&self.bus, &self.fleet, index, Start::Unknown);
                    }
                }
                (Look::Answer { .. }, Phase::Configuring) => {
                    answering += 1;
                    self.silent[index] = 0;
                }
            }
        }
        answering
    }

    /// One event per break, when its neighbours have noticed it.
    fn report_break(&mut self, looks: &[Look]) {
        if self.seen_reported != RingState::Open {
            return;
        }
        match self.break_place(looks) {
            Some(place) if self.place != Some(place) => {
                self.place = Some(place);
                self.bus.report(Event::BreakLocated { after: place.after, before: place.before });
            }
            None if self.place.is_none() && self.break_looks > 0 => {
                self.break_looks -= 1;
                self.next_routine = self.bus.now() + BREAK_LOOK_PAUSE;
            }
            Some(_) | None => {}
        }
    }

    fn break_place(&self, looks: &[Look]) -> Option<Break> {
        let access = self.fleet.access();
        let mut by_position = vec![None; access.topology.nodes.len()];
        for (member, look) in access.members.iter().zip(looks) {
            let (Some(info), Look::Answer { dl_status, .. }) = (&member.info, look) else { continue };
            if let Some(slot) = by_position.get_mut(usize::from(info.position.0)) {
                *slot = Some(*dl_status);
            }
        }
        locate_break(&access.topology, &by_position)
    }

    async fn find_strangers(&mut self, main: u16, count: u16) {
        match identify(&self.bus, &self.fleet, main, count).await {
            // The segment changed under our hands: again when it is quiet.
            Ok(()) | Err(ScanError::Bus(BusError::Wkc { .. } | BusError::Lost { .. })) => {}
            Err(error) => {
                let reason = alloc::string::ToString::to_string(&error);
                self.bus.report(Event::ScanFailed { reason });
            }
        }
        self.next_routine = self.bus.now() + Duration::from_millis(10);
    }
}
