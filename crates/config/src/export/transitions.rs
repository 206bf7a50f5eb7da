//! Transitions of start-up commands.

use ringcat_engine::config::Transition as EngineTransition;

use crate::eni::Transition;

/// The transition of a file.
pub(super) const fn transition(of: EngineTransition) -> Transition {
    match of {
        EngineTransition::Ip => Transition::Ip,
        EngineTransition::Ps => Transition::Ps,
        EngineTransition::So => Transition::So,
        EngineTransition::Os => Transition::Os,
        EngineTransition::Sp => Transition::Sp,
        EngineTransition::Ii => Transition::Ii,
        EngineTransition::Pp => Transition::Pp,
        EngineTransition::Ss => Transition::Ss,
        EngineTransition::Pi => Transition::Pi,
        EngineTransition::Si => Transition::Si,
        EngineTransition::Oi => Transition::Oi,
        EngineTransition::Ib => Transition::Ib,
        EngineTransition::Bi => Transition::Bi,
    }
}
