//! Watching over the segment after activation, and acting on what the supervision datagram shows.
//!
//! The exchange posts one word per cycle: how many SubDevices answered on each link, the OR of their AL status, the OR
//! of their event requests. As long as it does not change, nothing is asked of the bus but one look per second.

use alloc::vec;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::al::AlStatus;
use ringcat_wire::register::{DlStatus, map};

use super::configure::Start;
use super::fleet::{Phase, SharedFleet};
use super::inspect::{Look, locate_break, look_at_all};
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

/// Runs for ever.
pub(crate) async fn supervise(bus: Bus, fleet: SharedFleet) {
    let silent = vec![0; fleet.access().members.len()];
    let mut watch = Watch {
        bus,
        fleet,
        silent,
        seen: Supervision::default(),
        ring: RingWord::default(),
        reported: RingState::Unknown,
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
    reported: RingState,
    next_routine: Instant,
}

impl Watch {
    fn is_called_for(&mut self) -> bool {
        let ring = self.fleet.board.ring();
        let now = self.bus.now();
        let supervision = self.fleet.board.supervision().map(|(_, supervision)| supervision);
        let changed = supervision.is_some_and(|supervision| supervision != self.seen) || ring != self.ring;
        if !changed && now < self.next_routine {
            return false;
        }
        self.seen = supervision.unwrap_or(self.seen);
        self.ring = ring;
        self.next_routine = now + ROUTINE;
        true
    }

    async fn check(&mut self) {
        let Ok(counted) = self.bus.brd(map::AL_STATUS, AlStatus::LEN).await else { return };
        let (main, redundant) = (counted.main.0, counted.redundant.0);
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
        self.report_ring(main, redundant, &looks);
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

    /// One event per change, with the place of the break where the topology shows it.
    fn report_ring(&mut self, main: u16, redundant: u16, looks: &[Look]) {
        let state = self.fleet.board.ring().state;
        if state == self.reported {
            return;
        }
        let was_open = self.reported == RingState::Open;
        self.reported = state;
        match state {
            RingState::Open => {
                self.bus.report(Event::RingOpened { main, redundant });
                if let Some(place) = self.break_place(looks) {
                    self.bus.report(Event::BreakLocated { after: place.after, before: place.before });
                }
            }
            RingState::Closed if was_open => self.bus.report(Event::RingClosed { main, redundant }),
            RingState::Closed | RingState::Unknown => {}
        }
    }

    fn break_place(&self, looks: &[Look]) -> Option<super::inspect::Break> {
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
