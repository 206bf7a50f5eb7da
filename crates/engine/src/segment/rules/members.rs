//! State changes of the declared SubDevices: each is a state machine of its own, so that a hundred recover at the same
//! time.

use alloc::format;
use alloc::rc::Rc;
use alloc::string::{String, ToString};
use core::time::Duration;

use ringcat_wire::address::Wkc;
use ringcat_wire::al::AlState;

use crate::board::live::Presence;
use crate::declared::SubDeviceId;
use crate::event::Event;
use crate::info::{Direction, SubDeviceInfo};
use crate::ring::RingState;
use crate::segment::attention::Round;
use crate::segment::effect::{Check, Effect, Effects, Shown, Task};
use crate::segment::member::{Incidents, Member, Mistaken, Phase};
use crate::segment::model::Segment;
use crate::segment::observation::{MemberFinding, Problem, ProcessDataStep};
use crate::segment::reading::{Reading, answers};
use crate::segment::repair::Repair;
use crate::segment::round_result::RoundResult;
use crate::segment::setup::Setup;
use crate::segment::start::Start;
use crate::segment::versions::Versions;
use crate::time::Instant;

/// Consecutive rounds without an answer after which a SubDevice is lost: at the moment of a cut a copy may have been
/// processed by none.
const SILENT_READS: u8 = 2;
/// Pause before a silent SubDevice is read again.
const REPEAT_PAUSE: Duration = Duration::from_millis(2);
/// Consecutive rounds in which reads do not return though process data does, or the reverse, before it is tested
/// whether frames hold too many datagrams.
const BLIND_ROUNDS: u8 = 2;

impl Segment {
    /// Processes a complete round of reads.
    pub(in crate::segment) fn observe_round(
        &mut self,
        round_result: &RoundResult<'_>,
        now: Instant,
        effects: &mut Effects,
    ) {
        let RoundResult { versions, readings, before, unassigned, counted } = *round_result;
        self.attention.round = Round::default();
        if versions.isolations != self.slot.isolations() {
            // Some SubDevices were put out of reach on purpose during the round.
            return self.attention.again_in(REPEAT_PAUSE, now);
        }
        // Either reads do not return though SubDevices process those of the exchange, or the reverse.
        let is_blind = match counted {
            Some(counted) if counted != Wkc(0) => readings.contains(&Reading::Unknown),
            Some(_) | None => answers(readings) > 0,
        };
        self.attention.blind = if is_blind { self.attention.blind.saturating_add(1) } else { 0 };
        self.attention.round.is_blind = self.attention.blind == BLIND_ROUNDS;
        let Some(counted) = counted else { return };
        self.attention.rounds += 1;
        self.observe_others(unassigned);
        let others = unassigned.iter().filter(|(_, reading)| reading.is_answer()).count();
        let (counted, answering) = (usize::from(counted.0), answers(readings) + others);
        // If the count agrees with the answers, a silent SubDevice is certainly absent.
        let needed = if counted == answering { 1 } else { SILENT_READS };
        let is_certain = self.evaluate(readings, before, needed, now, effects);
        if needed == 1 {
            self.subdevices.depart(|key| unassigned.contains(&(key, Reading::Silent)));
        }
        if !is_certain {
            // One quick repetition, and then the next round only when something changes.
            self.attention.again_in(REPEAT_PAUSE, now);
        }
        let reported: RingState = self.attention.reported();
        self.observe_breaks(readings, reported, now, effects);
        let status = self.by_position(readings);
        self.observe_local_rings(&status, now, effects);
        self.observe_ports(readings, effects);
        self.attention.round = Round {
            is_certain,
            finds_others: counted > answering && !readings.contains(&Reading::Unknown),
            is_complete: counted <= answering,
            is_blind: self.attention.round.is_blind,
            counts: true,
        };
    }

    /// Derives member states from the answers. True if it is known of all whether they are present.
    fn evaluate(
        &mut self,
        readings: &[Reading],
        before: &[Phase],
        needed: u8,
        now: Instant,
        effects: &mut Effects,
    ) -> bool {
        let mut certain = true;
        for (index, reading) in readings.iter().enumerate() {
            let Some(member) = self.subdevices.member_mut(index) else { continue };
            match (reading, member.phase) {
                (Reading::Unknown | Reading::Doubled, _) => certain = false,
                (Reading::Silent, Phase::Absent) => {
                    (member.silent, member.mistaken) = (SILENT_READS, Mistaken::default());
                }
                (Reading::Silent, Phase::Configuring | Phase::Settled(_)) => {
                    member.silent = (member.silent + 1).min(SILENT_READS);
                    if member.silent >= needed {
                        self.lose(index, effects);
                    } else {
                        certain = false;
                    }
                }
                // The member reached this state after the answer was read: the answer is outdated.
                (Reading::Answer { .. }, Phase::Settled(_)) if before.get(index) != Some(&member.phase) => {
                    member.silent = 0;
                    self.attention.again_in(REPEAT_PAUSE, now);
                }
                (Reading::Answer { status, code, .. }, phase) => {
                    member.silent = 0;
                    if matches!(phase, Phase::Settled(_)) {
                        member.answered = self.attention.rounds;
                    }
                    self.observe_answer(index, phase, (*status, *code), now, effects);
                }
            }
        }
        certain
    }

    /// A member answered.
    fn observe_answer(
        &mut self,
        index: usize,
        phase: Phase,
        (status, code): Shown,
        now: Instant,
        effects: &mut Effects,
    ) {
        let Some(member) = self.subdevices.member_mut(index) else { return };
        match phase {
            Phase::Configuring => {}
            Phase::Settled(state) if !status.error && status.al_state() == Some(state) => {
                if core::mem::take(&mut member.suspended) {
                    self.board.set_taking_part(index, true);
                }
            }
            Phase::Settled(_) => {
                member.suspended = false;
                let count = &mut member.incidents.state_changes;
                *count = count.saturating_add(1);
                effects.report(Event::StateError { subdevice: SubDeviceId(index), requested: None, status, code });
                self.start(index, Start::Unknown, Some((status, code)), Check::None, effects);
            }
            // Its station address answers again: it has come back, if it is the same SubDevice.
            Phase::Absent => {
                member.suspended = false;
                match member.mistaken.pause(now) {
                    Some(pause) => self.attention.again_in(pause, now),
                    None => self.start(index, Start::Unknown, None, Check::Return, effects),
                }
            }
        }
    }

    /// As soon as all SubDevices that the cyclic datagram counts have answered, process data no longer waits for the
    /// others. Whether the others are lost follows later; which inputs are fresh is known now.
    pub(in crate::segment) fn observe_part(
        &mut self,
        versions: Versions,
        readings: &[Reading],
        others: usize,
        counted: Option<Wkc>,
    ) {
        if versions.isolations != self.slot.isolations()
            || counted.map(|counted| usize::from(counted.0)) != Some(answers(readings) + others)
        {
            return;
        }
        for (index, reading) in readings.iter().enumerate() {
            let Some(member) = self.subdevices.member_mut(index).filter(|_| !reading.is_answer()) else { continue };
            if matches!(member.phase, Phase::Settled(_)) && self.board.takes_part(index) {
                self.board.set_taking_part(index, false);
                member.suspended = true;
            }
        }
    }

    /// A member no longer answers. Procedures under way for it end.
    pub(in crate::segment) fn lose(&mut self, index: usize, effects: &mut Effects) {
        let Some(member) = self.subdevices.member_mut(index) else { return };
        member.attempt = member.attempt.wrapping_add(1);
        let answered = member.phase != Phase::Absent;
        if answered {
            member.phase = Phase::Absent;
            member.incidents.absences = member.incidents.absences.saturating_add(1);
            effects.report(Event::Lost { subdevice: SubDeviceId(index) });
        }
        let is_excused = !member.exchanges(member.target);
        if answered {
            self.exclude_from_place(index);
        }
        self.post_presence(index);
        self.board.set_taking_part(index, false);
        self.board.set_unproven(index, false);
        // A member that was on its way to process data counts as missing from now on.
        self.board.set_excused(index, is_excused);
        effects.0.push(Effect::SuspendMailbox { index });
    }

    /// Starts the configuration of a member that answers. `reported`: its error that was reported.
    pub(in crate::segment) fn start(
        &mut self,
        index: usize,
        from: Start,
        reported: Option<Shown>,
        check: Check,
        effects: &mut Effects,
    ) {
        let Some(member) = self.subdevices.member_mut(index) else { return };
        let attempt = member.begin_attempt();
        // Until it is identified it may be another SubDevice.
        if check != Check::Return {
            self.post_presence(index);
        }
        effects.start(Task::BringUp { index, attempt, from, reported, check });
    }

    /// Starts the configuration of all members that were found.
    pub(in crate::segment) fn start_all(&mut self, effects: &mut Effects) {
        let from = self.stage.scanned().map_or(Start::Doubtful, |scanned| scanned.registers);
        for index in 0..self.subdevices.member_count() {
            if self.member(index).is_some_and(|member| member.is_there()) {
                self.start(index, from, None, Check::None, effects);
            }
        }
    }

    /// Processes a finding of an attempt, if it is the current one.
    pub(in crate::segment) fn observe_finding(
        &mut self,
        (index, attempt): (usize, u32),
        finding: MemberFinding<'_>,
        now: Instant,
        effects: &mut Effects,
    ) {
        let rounds = self.attention.rounds;
        let Some(member) = self.current(index, attempt) else { return };
        match finding {
            MemberFinding::Reached(state) => self.settle(index, state, effects),
            MemberFinding::Returned => {
                // It may be another SubDevice of the same type.
                member.reported_warnings = Default::default();
                member.mistaken = Mistaken::default();
                member.answered = rounds;
                self.post_presence(index);
                effects.report(Event::Returned { subdevice: SubDeviceId(index) });
            }
            MemberFinding::NotReturned => self.keep_absent(index, now, effects),
            MemberFinding::Unreachable => self.lose(index, effects),
            MemberFinding::Configured(is) => member.configured = is,
            MemberFinding::Undone(reason) => {
                if member.repair.begin(&reason) {
                    effects.failed(index, reason);
                    // Another SubDevice may answer at its address: a SubDevice that was out of reach since an earlier
                    // session.
                    self.start(index, Start::Doubtful, None, Check::Identity, effects);
                }
            }
            MemberFinding::Held => member.repair = Repair::default(),
            MemberFinding::ProcessData(step) => self.observe_process_data(index, step, effects),
            MemberFinding::Failed(problem) => self.report_problem(index, problem, effects),
            MemberFinding::Shows((status, code)) => {
                effects.report(Event::StateError { subdevice: SubDeviceId(index), requested: None, status, code });
            }
            MemberFinding::Refused(before) => self.refuse(index, before),
            MemberFinding::ReadAgain(info) => self.observe_info(index, info, effects),
            MemberFinding::NotReadAgain(reason) => effects.report(Event::ScanFailed { reason }),
            MemberFinding::Pdos(finding) => {
                if let Some(station) = self.member(index).map(|member| member.station) {
                    self.observe_pdos(station, finding, effects);
                }
            }
            MemberFinding::SettingFinding(what) => {
                if member.reported_warnings.is_new(&what) {
                    effects.report(Event::DeclarationWarning { subdevice: SubDeviceId(index), what });
                }
            }
        }
    }

    /// The SubDevice that answers at a lost member's address is not identified as that member. Its address has been
    /// taken away, and the next round finds it without one, unless that failed.
    fn keep_absent(&mut self, index: usize, now: Instant, effects: &mut Effects) {
        let Some(member) = self.subdevices.member_mut(index) else { return };
        member.phase = Phase::Absent;
        let (pause, is_due) = (member.mistaken.again(now), member.mistaken.is_due());
        self.post_presence(index);
        if is_due && let Some(member) = self.member(index) {
            let reason = format!(
                "the SubDevice at its address {:#06x} is another one or unknown, and does not give up the address",
                member.station.0
            );
            effects.failed(index, reason);
        }
        match pause {
            Some(pause) => self.attention.again_in(pause, now),
            None => self.attention.want(),
        }
    }

    /// A member has reached its requested state.
    fn settle(&mut self, index: usize, state: AlState, effects: &mut Effects) {
        let Some(member) = self.subdevices.member_mut(index) else { return };
        member.phase = Phase::Settled(state);
        let is_excused = !member.exchanges(state);
        self.post_presence(index);
        self.board.set_excused(index, is_excused);
        effects.report(Event::StateReached { subdevice: SubDeviceId(index), state });
    }

    /// A member gets another target state.
    pub(in crate::segment) fn request(&mut self, index: usize, state: AlState, effects: &mut Effects) {
        let Some(member) = self.subdevices.member_mut(index) else { return };
        let before = core::mem::replace(&mut member.target, state);
        let exchanges = member.exchanges(state);
        match member.phase {
            Phase::Absent => self.board.set_excused(index, !exchanges),
            Phase::Settled(is) if is == state => {
                if member.has_commands_within(state) {
                    let attempt = member.begin_again();
                    effects.start(Task::RepeatState { index, attempt });
                }
            }
            Phase::Settled(_) | Phase::Configuring => {
                let attempt = member.begin_attempt();
                effects.start(Task::ChangeState { index, attempt, before });
                self.post_presence(index);
                // On the way up its missing answers are excused until it has joined.
                if !exchanges {
                    self.board.set_excused(index, true);
                }
            }
        }
    }

    fn report_problem(&mut self, index: usize, problem: Problem, effects: &mut Effects) {
        match problem {
            Problem::Refused { requested, shown: (status, code) } => {
                let (subdevice, requested) = (SubDeviceId(index), Some(requested));
                effects.report(Event::StateError { subdevice, requested, status, code });
            }
            Problem::Other(reason) => effects.failed(index, reason),
        }
    }

    /// A member has refused a state, and keeps its previous target.
    fn refuse(&mut self, index: usize, before: AlState) {
        let Some(member) = self.subdevices.member_mut(index) else { return };
        member.target = before;
        let is_excused = !member.exchanges(before);
        self.board.set_excused(index, is_excused);
    }

    /// How a member takes part in process data from now on.
    fn observe_process_data(&mut self, index: usize, step: ProcessDataStep, effects: &mut Effects) {
        let Some(member) = self.subdevices.member_mut(index) else { return };
        let is_seen_alone = member.setup.as_ref().is_some_and(|setup| setup.presence_fmmu.is_some());
        match step {
            ProcessDataStep::Off => self.board.set_taking_part(index, false),
            ProcessDataStep::Unmapped => self.board.set_unproven(index, false),
            ProcessDataStep::Left => {
                self.board.set_taking_part(index, false);
                self.board.set_unproven(index, false);
            }
            // SyncManagers that are active in OP only are still off.
            ProcessDataStep::Mapped => {
                member.mapping = member.mapping.wrapping_add(1);
                let is_op_only = member.setup.as_ref().is_some_and(|setup| setup.plan.is_op_only());
                self.board.set_unproven(index, is_seen_alone || !is_op_only);
            }
            ProcessDataStep::Joined => {
                member.mapping = member.mapping.wrapping_add(1);
                let mapping = member.mapping;
                self.board.set_unproven(index, is_seen_alone);
                self.board.set_taking_part(index, true);
                if is_seen_alone {
                    effects.start(Task::ProveInputs { index, mapping });
                }
            }
        }
    }

    /// A member has delivered all inputs of a mapping. The proof of an earlier mapping is ignored.
    pub(in crate::segment) fn observe_proof(&mut self, index: usize, mapping: u32) {
        if self.member(index).is_some_and(|member| member.mapping == mapping) {
            self.board.set_unproven(index, false);
        }
    }

    /// A member does not deliver the inputs of a mapping.
    pub(in crate::segment) fn observe_missing_inputs(
        &mut self,
        (index, mapping): (usize, u32),
        what: String,
        effects: &mut Effects,
    ) {
        if self.member(index).is_some_and(|member| member.is_mapped_as(mapping)) {
            effects.report(Event::DeclarationWarning { subdevice: SubDeviceId(index), what });
        }
    }

    /// A member's SII was read again.
    fn observe_info(&mut self, index: usize, info: &SubDeviceInfo, effects: &mut Effects) {
        let Some(member) = self.subdevices.member_mut(index) else { return };
        match Setup::new(index, &member.config, info, &self.layout) {
            Ok(setup) => {
                member.take_setup(index, setup, effects);
                self.subdevices.identify(index, info.clone());
                self.tell_scan_of_member(index);
            }
            // The same error as before.
            Err(_) if member.unfit.is_some() => {}
            Err(error) => effects.failed(index, error.to_string()),
        }
    }

    /// Present members will be configured later: an answer meanwhile is not a return.
    pub(in crate::segment) fn delay_all(&mut self) {
        for member in self.subdevices.members_mut().filter(|member| member.is_there()) {
            member.phase = Phase::Configuring;
        }
        (0..self.subdevices.member_count()).for_each(|index| self.post_presence(index));
    }

    /// Posts the phase of a member for readers of the live status.
    fn post_presence(&self, index: usize) {
        let Some(member) = self.member(index) else { return };
        let presence = match member.phase {
            Phase::Absent => Presence::Offline,
            Phase::Configuring => Presence::Configuring,
            Phase::Settled(_) => Presence::Settled,
        };
        self.board.live.post_presence(index, presence);
    }

    /// Resets the incident counters of all members.
    pub(in crate::segment) fn forget_incidents(&mut self) {
        self.subdevices.members_mut().for_each(|member| member.incidents = Incidents::default());
    }

    /// The member, if this attempt is the current one.
    pub(in crate::segment) fn current(&mut self, index: usize, attempt: u32) -> Option<&mut Member> {
        self.subdevices.member_mut(index).filter(|member| member.attempt == attempt)
    }
}

impl Member {
    /// Stores its configuration. A configuration that could not be planned at the activation has no place in the
    /// process image: a SubDevice with outputs must not go to OP without them, so its target is SAFEOP.
    pub(in crate::segment) fn take_setup(&mut self, index: usize, setup: Setup, effects: &mut Effects) {
        if self.unfit.take().is_some() && setup.plan.mapped_areas().count() > setup.process_data_fmmus() {
            let has_outputs = setup.plan.mapped_areas().any(|(_, area)| area.direction == Direction::Outputs);
            let mut what =
                "its SII can be used now: it has no place in the process image before the next activation".to_string();
            if has_outputs && self.target == AlState::Op {
                self.target = AlState::SafeOp;
                what.push_str(", and stays in SAFEOP without outputs");
            }
            effects.report(Event::DeclarationWarning { subdevice: SubDeviceId(index), what });
        }
        self.setup = Some(Rc::new(setup));
    }
}
