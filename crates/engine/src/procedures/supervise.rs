//! Watching over the segment after activation, and acting on what the supervision datagram shows.
//!
//! The exchange posts one word per cycle: how many SubDevices answered on each link, the OR of their AL status, the OR
//! of their event requests. As long as it does not change, nothing is asked of the bus but one look per second.
//!
//! Changes of the ring are told by a procedure of their own (`ring_watch`): a look waits for lost frames.

use alloc::rc::Rc;
use alloc::vec;
use alloc::vec::Vec;
use core::cell::Cell;
use core::time::Duration;

use ringcat_wire::address::{StationAddress, Wkc};
use ringcat_wire::al::{AlStatus, AlStatusCode};
use ringcat_wire::register::{DlStatus, EcatEvent, map};

use super::cabling::CablingWatch;
use super::configure::Start;
use super::error_watch::watch_errors;
use super::fleet::{Phase, SharedFleet};
use super::frame_limit;
use super::inspect::{Look, is_broken, locate_breaks, look_at_all, look_at_strangers};
use super::junction::{JunctionWatch, note_controls, watch_blocked};
use super::recover::{lose, start, welcome};
use super::ring_watch::watch_ring;
use super::strangers::{self, Search};
use super::verify::verify;
use crate::board::{RingWord, Supervision};
use crate::event::Event;
use crate::junction::JunctionMode;
use crate::ring::RingState;
use crate::ring_status::Cable;
use crate::supervisor::Bus;
use crate::time::Instant;
use crate::topology::{NodeStatus, are_doubtful, ends_of_break};

/// Pause between two looks at the board.
const PAUSE: Duration = Duration::from_micros(500);
/// All SubDevices are looked at so often even if nothing changed: an OR can hide one state behind others.
const ROUTINE: Duration = Duration::from_secs(1);
/// A SubDevice is lost when it was silent in so many looks in a row: at the edge of a cut a copy may have met nobody.
const SILENT_LOOKS: u8 = 2;
/// Pause before a silent SubDevice is looked at again.
const SECOND_LOOK_PAUSE: Duration = Duration::from_millis(2);
/// Looks for the place of a break: its neighbours may notice the lost link later than frames do.
const BREAK_LOOKS: u8 = 25;
/// Pause between two of them, and between the first few.
const BREAK_LOOK_PAUSE: Duration = Duration::from_millis(10);
const FIRST_BREAK_LOOKS: u8 = 5;
const FIRST_BREAK_LOOK_PAUSE: Duration = Duration::from_millis(1);

/// Checks in a row in which looks do not come back though process data does, or the other way round, before it is tried
/// whether frames hold too many datagrams.
const BLIND_CHECKS: u8 = 2;
/// A supervision result that so many came before since a look ended was not out when somebody was looked at.
const SURELY_LATER: u32 = 8;
/// Looks in a row because of a request that stands.
const MOST_MISSED: u8 = 3;
/// Pause between two searches for SubDevices that answer and are not known.
const STRANGER_PAUSE: Duration = Duration::from_millis(10);

/// Runs for ever.
pub(crate) async fn supervise(bus: Bus, fleet: SharedFleet, enhanced_line_crossed: bool, rings: JunctionMode) {
    let members = fleet.access().members.len();
    let reported = Rc::new(Cell::new(RingState::Unknown));
    bus.spawn(watch_ring(bus.clone(), fleet.clone(), reported.clone()));
    bus.spawn(verify(bus.clone(), fleet.clone()));
    let junctions = JunctionWatch::new(&fleet.access());
    let are_known = !fleet.access().closings.is_empty();
    if are_known {
        bus.spawn(watch_blocked(bus.clone(), fleet.clone(), junctions.broken()));
    }
    bus.spawn(watch_errors(bus.clone(), fleet.clone()));
    let cabling = CablingWatch::new(&fleet, enhanced_line_crossed, rings);
    let mut watch = Watch {
        bus,
        fleet,
        silent: vec![0; members],
        suspended: vec![false; members],
        seen: Supervision::default(),
        checked: 0,
        missed: 0,
        ring: RingWord::default(),
        reported,
        seen_reported: RingState::Unknown,
        break_looks: 0,
        breaks: Vec::new(),
        blind: 0,
        next_routine: Instant::default(),
        is_awaited: false,
        is_routine: false,
        search: Search::default(),
        news: 0,
        junctions,
        cabling,
    };
    loop {
        watch.bus.sleep(PAUSE).await;
        watch.take_found_inside();
        if !watch.fleet.is_looking_inside() && watch.is_called_for() {
            watch.check().await;
            watch.checked = watch.fleet.board.supervision().map_or(0, |(number, _)| number);
        }
    }
}

struct Watch {
    bus: Bus,
    fleet: SharedFleet,
    /// Silent looks in a row, by member.
    silent: Vec<u8>,
    /// Process data does not wait for it though it is not lost, by member.
    suspended: Vec<bool>,
    /// The supervision result that the last check was about.
    seen: Supervision,
    /// Number of the result at the end of that check, and checks since only because of what had been missed.
    checked: u32,
    missed: u8,
    ring: RingWord,
    /// The state of the ring that was reported last.
    reported: Rc<Cell<RingState>>,
    /// The same, as of the last check.
    seen_reported: RingState,
    /// Looks for it that are left.
    break_looks: u8,
    /// Broken cables of the open ring that were told.
    breaks: Vec<Cable>,
    /// Checks in a row in which looks were lost.
    blind: u8,
    next_routine: Instant,
    /// The next check was asked for before its time.
    is_awaited: bool,
    /// The check that is under way has no other reason than that its time has come.
    is_routine: bool,
    search: Search,
    /// What had become known at the last check.
    news: u32,
    junctions: JunctionWatch,
    cabling: CablingWatch,
}

impl Watch {
    /// Something is not as it was at the last check.
    fn has_changed(&self) -> bool {
        let supervision = self.fleet.board.supervision().map(|(_, supervision)| supervision);
        supervision.is_some_and(|supervision| supervision != self.seen)
            || self.fleet.board.ring() != self.ring
            || self.reported.get() != self.seen_reported
            || self.fleet.news() != self.news
    }

    /// Ports have changed again right behind a look that took their request for attention away: it stands, as before the
    /// look.
    fn has_missed(&mut self) -> bool {
        let Some((number, supervision)) = self.fleet.board.supervision() else { return false };
        if !EcatEvent::from_bits(supervision.irq).dl_status {
            self.missed = 0;
            return false;
        }
        // Requests of those that nobody looks at stand for ever.
        let is_missed = number.wrapping_sub(self.checked) >= SURELY_LATER && self.missed < MOST_MISSED;
        self.missed += u8::from(is_missed);
        is_missed
    }

    fn is_called_for(&mut self) -> bool {
        let now = self.bus.now();
        let changed = self.has_changed() || self.has_missed();
        if !changed && now < self.next_routine {
            return false;
        }
        self.is_routine = !changed && !self.is_awaited;
        self.is_awaited = false;
        let ring = self.fleet.board.ring();
        let supervision = self.fleet.board.supervision().map(|(_, supervision)| supervision);
        let reported = self.reported.get();
        self.seen = supervision.unwrap_or(self.seen);
        self.ring = ring;
        self.news = self.fleet.news();
        if reported != self.seen_reported {
            self.seen_reported = reported;
            self.break_looks = BREAK_LOOKS;
        }
        self.next_routine = now + ROUTINE;
        true
    }

    async fn check(&mut self) {
        let inside = self.fleet.looks_inside();
        let phases: Vec<Phase> = self.fleet.access().members.iter().map(|member| member.phase).collect();
        let strangers = look_at_strangers(&self.bus, &self.fleet).await;
        let stranger_answers = strangers.iter().filter(|(_, look)| matches!(look, Look::Answer { .. })).count();
        let mut suspended = core::mem::take(&mut self.suspended);
        let is_calm = || self.is_routine && !self.has_changed();
        let so_far = |looks: &[Look]| {
            if !self.fleet.is_looking_inside() {
                suspend(&self.fleet, &mut suspended, looks, stranger_answers);
            }
        };
        let looks = look_at_all(&self.bus, &self.fleet, is_calm, so_far).await;
        self.suspended = suspended;
        if self.fleet.looks_inside() != inside {
            // Some were out of reach on purpose meanwhile.
            return self.again_in(SECOND_LOOK_PAUSE);
        }
        let supervision = self.fleet.board.supervision();
        // Either frames of looks do not come back though SubDevices process those of the exchange, or the other way round.
        let is_blind = match supervision {
            Some((_, seen)) if seen.total() != Wkc(0) => looks.contains(&Look::Unknown),
            Some(_) | None => answers(&looks) > 0,
        };
        self.blind = if is_blind { self.blind.saturating_add(1) } else { 0 };
        if self.blind == BLIND_CHECKS {
            frame_limit::explain(&self.bus, &self.fleet).await;
        }
        let Some((_, seen)) = supervision else { return };
        let (count, answering) = (usize::from(seen.total().0), answers(&looks) + stranger_answers);
        // When the count and the answers agree, a silent SubDevice is certainly not there.
        let needed = if count == answering { 1 } else { SILENT_LOOKS };
        let certain = self.judge(&looks, &phases, needed);
        if needed == 1 {
            self.forget_strangers(&strangers);
        }
        if !certain {
            // Certainty soon, and then again only when something changes.
            self.again_in(SECOND_LOOK_PAUSE);
        }
        self.report_break(&looks);
        self.report_junctions(&looks);
        self.cabling.note(&self.bus, &self.fleet, &looks);
        if certain && !self.junctions.is_empty() {
            note_controls(&self.bus, &self.fleet).await;
        }
        // Who else is there must be known before anybody's place is.
        let mut complete = count <= answering;
        if !complete && !looks.contains(&Look::Unknown) {
            complete = self.find_strangers().await;
        }
        if certain && complete && !strangers::admit_all(&self.bus, &self.fleet).await {
            self.again_in(SECOND_LOOK_PAUSE);
        }
    }

    fn again_in(&mut self, pause: Duration) {
        self.is_awaited = true;
        self.next_routine = self.next_routine.min(self.bus.now() + pause);
    }

    /// Acts on what each SubDevice said, `before` being how far each was then; so many silent looks make one lost. True where it is known of all whether they
    /// are there.
    fn judge(&mut self, looks: &[Look], before: &[Phase], needed: u8) -> bool {
        let mut certain = true;
        for (index, look) in looks.iter().enumerate() {
            match (look, self.fleet.phase(index)) {
                (Look::Unknown | Look::Doubled, _) => certain = false,
                (Look::Silent, Phase::Absent) => self.silent[index] = SILENT_LOOKS,
                (Look::Silent, Phase::Configuring | Phase::Settled(_)) => {
                    self.silent[index] = (self.silent[index] + 1).min(SILENT_LOOKS);
                    if self.silent[index] >= needed {
                        lose(&self.bus, &self.fleet, index);
                    } else {
                        certain = false;
                    }
                }
                // It has got there since: what it said is not what it says now.
                (Look::Answer { .. }, Phase::Settled(_)) if before.get(index) != Some(&self.fleet.phase(index)) => {
                    self.silent[index] = 0;
                    self.again_in(SECOND_LOOK_PAUSE);
                }
                (Look::Answer { status, code, .. }, phase) => {
                    self.silent[index] = 0;
                    self.heard(index, phase, *status, *code);
                }
            }
        }
        certain
    }

    /// A SubDevice answered.
    fn heard(&mut self, index: usize, phase: Phase, status: AlStatus, code: AlStatusCode) {
        let event = match phase {
            Phase::Configuring => return,
            Phase::Settled(state) if !status.error && status.al_state() == Some(state) => {
                if core::mem::take(&mut self.suspended[index]) {
                    self.fleet.board.set_taking_part(index, true);
                }
                return;
            }
            Phase::Settled(_) => {
                self.fleet.count(index, |incidents| &mut incidents.state_changes);
                Event::StateError { subdevice: index, requested: None, status, code }
            }
            Phase::Absent => {
                self.suspended[index] = false;
                return welcome(&self.bus, &self.fleet, index);
            }
        };
        self.bus.report(event);
        self.suspended[index] = false;
        start(&self.bus, &self.fleet, index, Start::Unknown, Some((status, code)));
    }

    /// Strangers that no longer answer are gone.
    fn forget_strangers(&self, looks: &[(StationAddress, Look)]) {
        self.fleet.access().strangers.retain(|stranger| !looks.contains(&(stranger.station, Look::Silent)));
    }

    /// One event per break, when its neighbours have noticed it.
    fn report_break(&mut self, looks: &[Look]) {
        // While everybody was looked at, the ring may have closed.
        if self.seen_reported != RingState::Open || self.reported.get() != RingState::Open {
            return;
        }
        let by_position: Vec<_> = self.by_position(looks).iter().map(|it| it.map(|node| node.dl_status)).collect();
        // An interface's cable is told together with the ring.
        match self.fleet.access().ring.place {
            None => self.breaks.clear(),
            Some(place) if !self.breaks.contains(&place) => self.breaks = vec![place],
            Some(_) => {}
        }
        let broken = self.broken_cables(&by_position);
        for cable in &broken {
            if !self.breaks.contains(cable) {
                self.breaks.push(*cable);
                self.bus.report(Event::BreakLocated { cable: *cable });
            }
        }
        // The last one that is mended closes the ring.
        let mended = |cable: &Cable| !broken.contains(cable) && is_broken(&by_position, cable) == Some(false);
        while let Some(at) = self.breaks.iter().position(mended).filter(|_| self.breaks.len() > 1) {
            self.breaks.remove(at);
        }
        let place = self.breaks.first().copied();
        self.fleet.access().ring.place = place;
        if place.is_none() && self.break_looks > 0 {
            let is_first = BREAK_LOOKS - self.break_looks < FIRST_BREAK_LOOKS;
            self.break_looks -= 1;
            self.again_in(if is_first { FIRST_BREAK_LOOK_PAUSE } else { BREAK_LOOK_PAUSE });
        }
    }

    fn broken_cables(&self, by_position: &[Option<DlStatus>]) -> Vec<Cable> {
        let access = self.fleet.access();
        if !are_doubtful(&access.topology) {
            return locate_breaks(&access.topology, by_position);
        }
        let counts = access.ring.links.map(|link| link.answering);
        let ends = ends_of_break(&access.topology, by_position, counts);
        ends.map(|(near, far)| Cable { near, far }).into_iter().collect()
    }

    /// What members said about their ports, by their position in the scan.
    fn by_position(&self, looks: &[Look]) -> Vec<Option<NodeStatus>> {
        let access = self.fleet.access();
        let mut by_position = vec![None; access.topology.nodes.len()];
        for (member, look) in access.members.iter().zip(looks) {
            let (Some(node), Look::Answer { dl_status, .. }) = (member.node, look) else { continue };
            let ports = member.info.as_ref().map(|info| info.controller.ports).unwrap_or_default();
            if let Some(slot) = by_position.get_mut(node) {
                *slot = Some(NodeStatus { dl_status: *dl_status, receive_times: None, ports });
            }
        }
        by_position
    }

    /// Events of rings behind junctions.
    fn report_junctions(&mut self, looks: &[Look]) {
        let status = self.by_position(looks);
        self.junctions.follow(&self.fleet.access(), &status);
        if !self.junctions.is_empty() {
            self.observe_junctions(&status);
        }
    }

    fn observe_junctions(&mut self, status: &[Option<NodeStatus>]) {
        let bus = self.bus.clone();
        if let Some(pause) = self.junctions.observe(bus.now(), status, |event| bus.report(event)) {
            self.again_in(pause);
        }
        self.junctions.complete_cabling(&mut self.fleet.access());
    }

    /// What was seen in rings of which no frame comes back.
    fn take_found_inside(&mut self) {
        if let Some(status) = self.fleet.take_found_inside() {
            self.junctions.follow(&self.fleet.access(), &status);
            self.observe_junctions(&status);
        }
    }

    /// True where nobody is left that is not known.
    async fn find_strangers(&mut self) -> bool {
        let complete = self.search.run(&self.bus, &self.fleet).await;
        // Clears the requests of those that nobody looks at.
        if self.bus.brd(map::DL_STATUS, DlStatus::LEN).await.is_err() {
            self.again_in(PAUSE);
        }
        self.again_in(STRANGER_PAUSE);
        complete
    }
}

fn answers(looks: &[Look]) -> usize {
    looks.iter().filter(|look| matches!(look, Look::Answer { .. })).count()
}

/// As soon as all that the cyclic datagram counts have answered, process data no longer waits for the others: whether
/// they are lost is seen later, whose inputs are new is seen now.
fn suspend(fleet: &SharedFleet, suspended: &mut [bool], looks: &[Look], strangers: usize) {
    let count = fleet.board.supervision().map(|(_, seen)| usize::from(seen.total().0));
    if count != Some(answers(looks) + strangers) {
        return;
    }
    let silent = looks.iter().enumerate().filter(|(_, look)| !matches!(look, Look::Answer { .. }));
    for (index, _) in silent {
        if matches!(fleet.phase(index), Phase::Settled(_)) && fleet.board.takes_part(index) {
            fleet.board.set_taking_part(index, false);
            suspended[index] = true;
        }
    }
}
