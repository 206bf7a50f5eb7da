//! Clocks that another MainDevice has set up (protocol 7.2).

use ringcat_wire::al::AlState;

use crate::segment::clocks::{AdoptedClocks, Delays, Life, Running};
use crate::segment::effect::Effects;
use crate::segment::member::Phase;
use crate::segment::model::Segment;
use crate::time::Instant;

/// A delay that differs from the known one by more belongs to other cables.
const SAME_NS: i64 = 30;

impl Segment {
    /// The clocks go on as they are. The system time of the segment differs from that of this host by a shift, so that
    /// no clock jumps.
    pub(super) fn observe_adopted(&mut self, adopted: &AdoptedClocks<'_>, now: Instant, effects: &mut Effects) {
        let AdoptedClocks { known, clocks, time, sent_at } = *adopted;
        self.observe_recall(known);
        let reference = self.clocks.reference;
        self.clocks.take_over(&known.measured.clone().referred_to(reference));
        let mut is_same = true;
        for node in self.clocks.nodes.iter_mut().filter(|node| node.has_clock) {
            let Some(read) = clocks.iter().find(|clock| clock.station == node.station) else { continue };
            (node.offset_ns, node.filter_depths) = (read.offset_ns, Some(read.filters));
            let is_delay_known = node.has_delay();
            is_same &= is_delay_known && (node.delay_ns - i64::from(read.delay_ns)).abs() <= SAME_NS;
        }
        self.note_running_signals();
        let own = self.board.clocks.times.first_epoch().unwrap_or(self.clocks.config.epoch);
        self.clocks.epoch = time.wrapping_sub(sent_at.0);
        let delays = if is_same { Delays::Valid } else { Delays::Doubtful(now) };
        self.clocks.life = Life::Running(Running { delays, ..Running::default() });
        self.words.before.begin(&self.board);
        self.clocks.times.follow_no_first();
        let shift = own.wrapping_sub(self.clocks.epoch);
        let timeline = self.clocks.times.adopt(shift, self.clocks.epoch);
        self.board.clocks.times.post_timeline(timeline);
        self.board.clocks.post_references(self.clocks.references());
        self.report_reference(effects);
        self.report_hidden(effects);
    }

    /// SYNC signals of members that are in SAFEOP or OP run.
    fn note_running_signals(&mut self) {
        let run = |phase| matches!(phase, Phase::Settled(AlState::SafeOp | AlState::Op));
        let running = |index: &usize| self.member(*index).is_some_and(|it| run(it.phase) && it.config.sync.is_some());
        let members: alloc::vec::Vec<usize> = (0..self.subdevices.member_count()).filter(running).collect();
        for node in &mut self.clocks.nodes {
            node.has_signals |= node.member.is_some_and(|member| members.contains(&member));
        }
    }
}
