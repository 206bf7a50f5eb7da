//! The reference clock, chosen while an application runs.

use ringcat_wire::address::Position;

use super::MainDevice;
use crate::config::ReferenceClock;
use crate::segment::Observation;
use crate::segment::clocks::ClockObservation;

impl MainDevice {
    /// Chooses the reference clock, also while the clocks run. They keep their time: the new reference was synchronous
    /// with the old one, and delays are written again from there. If the chosen SubDevice does not answer, the first
    /// clock that does is the reference. Until the clocks are set up, the choice takes effect at the end of the set-up.
    /// Returns the position of the reference from then on, if it answers then; `None` without clocks.
    pub fn choose_reference_clock(&mut self, reference: ReferenceClock) -> Option<Position> {
        self.segment.observe(Observation::Clocks(ClockObservation::ReferenceChosen(reference)));
        let view = self.segment.view();
        let clocks = view.clocks();
        let chosen = if clocks.are_set_up() { clocks.reference } else { clocks.elect(|_| true) };
        clocks.node_at(chosen?).map(|node| Position(node.position))
    }
}
