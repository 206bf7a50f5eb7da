//! Tasks end with the role in which they began.

use super::*;
use crate::board::live::{Life, Presence};

// covers: standby, MR-16, MR-17
#[test]
fn a_round_of_reads_begins_after_a_role_that_ended_during_one() {
    // A role that is given up and taken again between two polls shows no end.
    for shows_end in [true, false] {
        let is_round = |effect: &Effect| matches!(effect, Effect::Start(Task::Round { .. }));
        let mut ring = Ring::closed(4);
        ring.now += QUIET;
        ring.counts(3, 0, RingState::Closed);
        assert!(ring.cycle().iter().any(is_round), "a round is under way");
        assert!(!ring.cycle().iter().any(is_round));
        if shows_end {
            ring.observe(Observation::Standby(StandbyObservation::Yielded));
        }
        let lives = [Life { presence: Presence::Settled, al_status: 8, code: 0 }; 4];
        ring.observe(Observation::Standby(StandbyObservation::TookOver {
            lives: &lives,
            is_of_other: true,
            is_hot: true,
        }));
        assert!(ring.cycle().iter().any(is_round), "its end was shown: {shows_end}");
    }
}
