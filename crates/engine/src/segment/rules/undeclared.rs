//! SubDevices without a declaration: requests for states, attempts to reach them, states that were left.

use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;
use ringcat_wire::al::AlState;

use crate::event::Event;
use crate::info::{AliasSource, SiiAssignment};
use crate::segment::addressed::Addressed;
use crate::segment::choices::Retries;
use crate::segment::effect::{Effects, Task};
use crate::segment::key::SubDeviceKey;
use crate::segment::model::Segment;
use crate::segment::pdo_finding::PdoFinding;
use crate::segment::undeclared::{
    AttemptFailure, KeptState, ShownState, StateRead, UndeclaredObservation, Upkeep, UpkeepProgress,
};
use crate::time::Instant;

impl Segment {
    /// Whether SubDevices without a declaration are kept in their requested states.
    pub fn keeps_undeclared(&self) -> bool {
        self.keeping.is_on
    }

    /// Whether broadcasts watch the segment without an application.
    pub fn has_idle_operation(&self) -> bool {
        self.choices.idle_operation
    }

    /// Where aliases are read.
    pub fn alias_source(&self) -> AliasSource {
        self.choices.alias_source
    }

    /// When EEPROMs belong to their PDIs.
    pub fn sii_assignment(&self) -> SiiAssignment {
        self.choices.sii_assignment
    }

    /// What follows a failed configuration.
    pub fn retries(&self) -> Retries {
        self.choices.retries
    }

    /// The requested state of a SubDevice without a declaration, and its progress; `None` without a request.
    pub fn upkeep(&self, key: SubDeviceKey) -> Option<&Upkeep> {
        self.unassigned(key)?.unassigned.upkeep.as_ref()
    }

    /// The SubDevice without a declaration that has a station address.
    pub fn undeclared_at(&self, station: StationAddress) -> Option<SubDeviceKey> {
        self.subdevices.unassigned().map(|it| it.key).find(|key| key.station == station)
    }

    fn upkeeps(&self) -> impl Iterator<Item = (SubDeviceKey, &Upkeep)> {
        self.subdevices.unassigned().filter_map(|it| Some((it.key, it.unassigned.upkeep.as_ref()?)))
    }

    /// Whether a SubDevice is known to be undeclared, and no state was requested of it.
    pub fn has_untouched(&self) -> bool {
        self.subdevices.unassigned().any(|it| it.is_untouched(it.knowledge))
    }

    /// Whether all SubDevices without a declaration are in their requested states, or left as they are.
    pub fn are_undeclared_settled(&self) -> bool {
        self.upkeeps().all(|(_, it)| it.is_settled())
    }

    /// Whether no attempt is running or due without a request: each SubDevice is settled, or waits for a request.
    pub fn are_attempts_ended(&self) -> bool {
        self.upkeeps().all(|(_, it)| it.is_settled() || it.progress == UpkeepProgress::Due(Instant::NEVER))
    }

    /// The OR of their AL states, if each is in its requested state; `None` if some are left in any state.
    pub fn expected_states(&self) -> Option<u8> {
        let is_left = self.upkeeps().any(|(_, it)| it.progress == UpkeepProgress::Left);
        (!is_left).then(|| self.upkeeps().fold(0, |or, (_, it)| or | it.target.code()))
    }

    /// Those in their requested states, or left as they are, with the numbers of their last attempts.
    pub fn settled(&self) -> Vec<(SubDeviceKey, u32)> {
        self.upkeeps().filter(|(_, it)| it.is_settled()).map(|(key, it)| (key, it.attempt)).collect()
    }

    /// All with a requested state, with the numbers of the attempts that have reached it.
    pub fn kept(&self) -> Vec<(SubDeviceKey, Option<u32>)> {
        self.kept_from(0).collect()
    }

    /// The same without the first ones.
    pub fn kept_from(&self, first: usize) -> impl Iterator<Item = (SubDeviceKey, Option<u32>)> + '_ {
        self.upkeeps().skip(first).map(|(key, it)| (key, it.reached()))
    }

    /// SubDevices that are neither in their requested states nor left as they are, with the numbers of their last
    /// attempts.
    pub fn unsettled(&self) -> Vec<(SubDeviceKey, u32)> {
        self.upkeeps().filter(|(_, it)| !it.is_settled()).map(|(key, it)| (key, it.attempt)).collect()
    }

    /// When the next attempt is due.
    pub fn next_attempt(&self) -> Instant {
        let due = self.upkeeps().filter_map(|(_, it)| match it.progress {
            UpkeepProgress::Due(at) => Some(at),
            UpkeepProgress::UnderWay | UpkeepProgress::Reached | UpkeepProgress::Left => None,
        });
        due.min().unwrap_or(Instant::NEVER)
    }

    /// Processes an observation of SubDevices without a declaration.
    pub(in crate::segment) fn observe_undeclared(
        &mut self,
        seen: UndeclaredObservation<'_>,
        now: Instant,
        effects: &mut Effects,
    ) {
        match seen {
            UndeclaredObservation::KeepingBegun => self.keeping.is_on = true,
            UndeclaredObservation::TakenOver => self.take_over(now),
            UndeclaredObservation::HandedOver(kept) => self.go_on(kept, now, effects),
            UndeclaredObservation::AttemptsDue => self.begin_due(now, effects),
            UndeclaredObservation::AttemptEnded { key, attempt, failure } => {
                self.end_attempt((key, attempt), failure, now, effects);
            }
            UndeclaredObservation::Pdos { key, finding } => self.observe_undeclared_pdos(key, finding, effects),
            UndeclaredObservation::DictionaryRead { key, attempt } => {
                let upkeep = self.subdevices.unassigned_mut(key).and_then(|(_, it)| it.upkeep.as_mut());
                upkeep.into_iter().for_each(|upkeep| upkeep.end_dictionary(attempt));
            }
            UndeclaredObservation::StatesRead(read) => self.observe_states(read, now, effects),
            UndeclaredObservation::Forced(key) => self.leave(key),
        }
    }

    /// Each undeclared SubDevice without a requested state is to go to PREOP.
    pub(in crate::segment) fn take_over(&mut self, now: Instant) {
        self.touch();
        for (_, knowledge, it) in self.subdevices.all_unassigned_mut() {
            if it.is_untouched(knowledge) {
                it.upkeep = Some(Upkeep::due(now));
            }
        }
    }

    /// Goes on with SubDevices that another process has kept.
    fn go_on(&mut self, kept: &[KeptState], now: Instant, effects: &mut Effects) {
        self.touch();
        for (key, _, it) in self.subdevices.all_unassigned_mut() {
            let Some(kept) = kept.iter().find(|kept| kept.station == key.station) else { continue };
            if let Some((status, code)) = kept.has_left {
                effects.report(Event::UndeclaredState { position: it.position, status, code });
            }
            let upkeep = it.upkeep.insert(Upkeep::handed_over(kept.target, kept.progress));
            if (kept.target, kept.progress) == (AlState::Op, UpkeepProgress::Reached) {
                effects.start(Task::KeepOutputs { key, attempt: upkeep.attempt });
            }
        }
        if self.keeping.is_on {
            self.take_over(now);
        }
    }

    /// After each observation: those that were found beside an application are kept as well, and each SubDevice with a
    /// requested state has a mailbox.
    pub(in crate::segment) fn keep_undeclared(&mut self, now: Instant, effects: &mut Effects) {
        if self.keeping.is_on && self.is_active() {
            self.take_over(now);
        }
        self.keeping.observe(&self.subdevices, effects);
        self.read_open_pdos(effects);
    }

    /// Begins the attempts that are due.
    fn begin_due(&mut self, now: Instant, effects: &mut Effects) {
        for (key, _, it) in self.subdevices.all_unassigned_mut() {
            if let Some(attempt) = it.upkeep.as_mut().and_then(|upkeep| upkeep.begin_if_due(now)) {
                effects.start(Task::BringUndeclared { key, attempt });
            }
        }
    }

    /// The application requests a state of any SubDevice.
    pub(in crate::segment) fn observe_request(
        &mut self,
        subdevice: Addressed,
        state: AlState,
        now: Instant,
        effects: &mut Effects,
    ) {
        let key = match subdevice {
            Addressed::Member(index) => return self.request(index, state, effects),
            Addressed::Undeclared(key) => key,
        };
        self.touch();
        let Some((_, it)) = self.subdevices.unassigned_mut(key) else { return };
        if let Some(attempt) = it.upkeep.get_or_insert_with(|| Upkeep::due(now)).request(state) {
            effects.start(Task::BringUndeclared { key, attempt });
        }
    }

    /// The application has forced a state: the SubDevice is left as it is until another one is requested.
    fn leave(&mut self, key: SubDeviceKey) {
        self.touch();
        let upkeep = self.subdevices.unassigned_mut(key).and_then(|(_, it)| it.upkeep.as_mut());
        upkeep.into_iter().for_each(Upkeep::leave);
    }

    /// An attempt has ended. It is refused if it is no longer the current one.
    fn end_attempt(
        &mut self,
        (key, attempt): (SubDeviceKey, u32),
        failure: Option<AttemptFailure>,
        now: Instant,
        effects: &mut Effects,
    ) {
        let (retries, is_kept) = (self.choices.retries, self.keeping.is_on);
        let Some((_, it)) = self.subdevices.unassigned_mut(key) else { return };
        let position = it.position;
        let Some(upkeep) = it.upkeep.as_mut().filter(|upkeep| upkeep.is_under_way(attempt)) else { return };
        let is_due = upkeep.end(failure.as_ref(), retries, now);
        match failure {
            None if upkeep.target == AlState::Op => effects.start(Task::KeepOutputs { key, attempt }),
            // A boot loader may bring another dictionary.
            None if upkeep.target == AlState::Boot => {
                self.observe_undeclared_pdos(key, PdoFinding::Outdated, effects);
            }
            None => {}
            Some(AttemptFailure { reason, .. }) if is_due && is_kept => {
                effects.report(Event::UndeclaredFailed { position, reason });
            }
            Some(_) => {}
        }
    }

    /// Failed attempts are repeated now: of one SubDevice, or of all.
    pub(in crate::segment) fn observe_retry(&mut self, subdevice: Option<Addressed>, now: Instant) {
        for (index, member) in self.subdevices.members_mut().enumerate() {
            if subdevice.is_none_or(|it| it == Addressed::Member(index)) {
                member.retries = member.retries.wrapping_add(1);
            }
        }
        for (key, _, it) in self.subdevices.all_unassigned_mut() {
            if let Some(upkeep) = it.upkeep.as_mut()
                && subdevice.is_none_or(|it| it == Addressed::Undeclared(key))
            {
                upkeep.retry(now);
            }
        }
    }

    /// States were read. SubDevices that left theirs without a request are brought back.
    pub(in crate::segment) fn observe_states(&mut self, read: &[StateRead], now: Instant, effects: &mut Effects) {
        if !self.keeping.is_on {
            return;
        }
        for StateRead { key, attempt, shown } in read {
            let (ShownState::Shown((status, code)), Some(attempt)) = (*shown, *attempt) else { continue };
            let Some((_, it)) = self.subdevices.unassigned_mut(*key) else { continue };
            let position = it.position;
            if it.upkeep.as_mut().is_some_and(|upkeep| upkeep.has_left(attempt, status, now)) {
                effects.report(Event::UndeclaredState { position, status, code });
            }
        }
    }
}
