//! Another MainDevice of the ring has controlled the bus, or does so from now on (protocol MR-16, MR-18).

use alloc::vec::Vec;

use ringcat_wire::al::{AlState, AlStatus};

use crate::board::live::{Life, Presence};
use crate::declared::SubDeviceId;
use crate::event::Event;
use crate::segment::effect::{Check, Effects, Watch};
use crate::segment::key::SubDeviceKey;
use crate::segment::knowledge::Knowledge;
use crate::segment::member::Phase;
use crate::segment::model::Segment;
use crate::segment::observation::StandbyObservation;
use crate::segment::start::Start;
use crate::segment::undeclared::Upkeep;

impl Segment {
    /// Observes what another MainDevice of the ring does.
    pub(super) fn observe_standby(&mut self, seen: StandbyObservation<'_>, effects: &mut Effects) {
        // The procedures of the role before have ended.
        if matches!(seen, StandbyObservation::TookOver { .. } | StandbyObservation::Yielded) {
            self.link_control.restore(effects);
        }
        match seen {
            StandbyObservation::TookOver { lives, is_hot, is_of_other } => {
                if is_of_other && is_hot {
                    self.report_missing(lives, effects);
                }
                self.take_bus(lives, is_hot, effects);
            }
            StandbyObservation::Yielded => self.yield_bus(),
            StandbyObservation::Mirrored => self.mirror(),
        }
    }

    /// This MainDevice controls the bus: members that the other one had in their target states stay as they are, the
    /// others are configured. The first round of reads compares all of them with what was known.
    fn take_bus(&mut self, lives: &[Life], is_hot: bool, effects: &mut Effects) {
        if let Some(scanned) = self.stage.scanned_mut() {
            scanned.registers = Start::Doubtful;
        }
        self.end_tasks();
        if !is_hot {
            return self.begin_procedures(effects);
        }
        self.begin_watches(Watch::AdoptedClocks, effects);
        for (index, life) in lives.iter().enumerate() {
            match life.presence {
                Presence::Offline => self.expect_absent(index),
                Presence::Configuring | Presence::Settled => self.adopt_member(index, *life, effects),
            }
        }
        self.attention.want();
    }

    /// Members that did not answer to the other MainDevice are reported here as well (protocol MR-23): the application
    /// here has not got the events of the other MainDevice.
    fn report_missing(&self, lives: &[Life], effects: &mut Effects) {
        for (index, _) in lives.iter().enumerate().filter(|(_, life)| life.presence == Presence::Offline) {
            let Some(member) = self.member(index) else { return };
            effects.report(Event::Missing { subdevice: SubDeviceId(index), optional: member.config.optional });
        }
    }

    /// A member that did not answer to the other MainDevice.
    fn expect_absent(&mut self, index: usize) {
        let Some(member) = self.subdevices.member_mut(index) else { return };
        member.phase = Phase::Absent;
        let is_excused = !member.exchanges(member.target);
        self.board.set_taking_part(index, false);
        self.board.set_excused(index, is_excused);
        self.board.live.post_presence(index, Presence::Offline);
    }

    /// A member that has answered to the other MainDevice.
    fn adopt_member(&mut self, index: usize, life: Life, effects: &mut Effects) {
        let Some(member) = self.subdevices.member_mut(index) else { return };
        let status = AlStatus::decode(&[life.al_status, 0]);
        let state = status.al_state();
        member.configured = matches!(state, Some(AlState::SafeOp | AlState::Op));
        member.silent = 0;
        let is_as_wanted = life.presence == Presence::Settled && !status.error && state == Some(member.target);
        if !is_as_wanted {
            // It may only have fallen back: then an acknowledgement is enough.
            return self.start(index, Start::Unknown, None, Check::None, effects);
        }
        member.phase = Phase::Settled(member.target);
        member.mapping = member.mapping.wrapping_add(1);
        let exchanges = member.exchanges(member.target);
        self.board.set_excused(index, !exchanges);
        self.board.set_unproven(index, false);
        self.board.set_taking_part(index, exchanges);
    }

    /// Another MainDevice controls the bus: it restores what was altered for a moment. Attempts, rounds of reads and
    /// searches have ended without a result; they begin again when this MainDevice controls the bus.
    fn yield_bus(&mut self) {
        self.slot = self.slot.emptied();
        self.altered.clear();
        self.port_controls.clear();
        self.end_tasks();
    }

    /// All tasks have ended without a result, and begin again when they are needed. At the beginning of a role as well:
    /// a role that is given up and taken again at once shows no end.
    fn end_tasks(&mut self) {
        // Numbers of rounds go on. Nothing was seen since the last one.
        self.attention = self.attention.begun_anew();
        self.crossings.end_search();
        self.hot_connect.end_following();
        // Those that were being read get another address, and are read again.
        let unread = |(key, knowledge, _): (SubDeviceKey, &mut Knowledge, _)| knowledge.info().is_none().then_some(key);
        let unread: Vec<SubDeviceKey> = self.subdevices.all_unassigned_mut().filter_map(unread).collect();
        self.subdevices.remove(|key| unread.contains(&key));
        for member in self.subdevices.members_mut() {
            member.attempt = member.attempt.wrapping_add(1);
        }
        for (_, _, unassigned) in self.subdevices.all_unassigned_mut() {
            unassigned.upkeep.iter_mut().for_each(Upkeep::end_attempt);
            unassigned.presence.since = None;
        }
    }

    /// Shows the states of the members that the other MainDevice has seen. Nothing is reported: it reports them.
    fn mirror(&mut self) {
        for (index, member) in self.subdevices.members_mut().enumerate() {
            let Some(life) = self.board.live.life(index) else { return };
            let state = AlStatus::decode(&[life.al_status, 0]).al_state();
            member.phase = match (life.presence, state) {
                (Presence::Offline, _) => Phase::Absent,
                (Presence::Settled, Some(state)) => Phase::Settled(state),
                (Presence::Settled | Presence::Configuring, _) => Phase::Configuring,
            };
        }
    }
}
