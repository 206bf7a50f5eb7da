//! Converts transitions of a file and creates start-up commands of the engine for them.

use ringcat_engine::config::{StartupCommand, Transition as EngineTransition};

use super::notices::Notices;
use crate::eni::{Place, Transition};

/// The engine's transition; `None` if the engine has no commands there.
pub(super) const fn followed(transition: Transition) -> Option<EngineTransition> {
    match transition {
        Transition::Ip => Some(EngineTransition::Ip),
        Transition::Ps => Some(EngineTransition::Ps),
        Transition::So => Some(EngineTransition::So),
        Transition::Os => Some(EngineTransition::Os),
        Transition::Sp => Some(EngineTransition::Sp),
        Transition::Ii
        | Transition::Pp
        | Transition::Pi
        | Transition::Po
        | Transition::Ss
        | Transition::Si
        | Transition::Op
        | Transition::Oi
        | Transition::Ib
        | Transition::Bi => None,
    }
}

/// Start-up commands for the transitions of a command; a notice reports transitions at which RingCAT sends none.
pub(super) fn at_transitions(
    place: Place,
    transitions: &[Transition],
    index: usize,
    subject: &str,
    notices: &mut Notices,
    mut make: impl FnMut(EngineTransition) -> StartupCommand,
) -> Vec<(Place, StartupCommand)> {
    let mut commands = Vec::new();
    let mut left: Vec<&str> = Vec::new();
    for transition in transitions {
        match followed(*transition) {
            Some(found) => commands.push((place, make(found))),
            // The path between OP and PREOP passes SAFEOP: the command is sent at one half of the path.
            None if *transition == Transition::Op && transitions.contains(&Transition::Sp) => {}
            None if *transition == Transition::Po && transitions.contains(&Transition::Ps) => {}
            None => left.push(transition.name()),
        }
    }
    if !left.is_empty() {
        let reason = format!("not sent at {}: RingCAT sends commands at IP, PS, SO, OS and SP", left.join(", "));
        notices.add(Some(place), Some(index), subject, reason);
    }
    commands
}

/// A comment, if it is not empty.
pub(super) fn comment(text: &str) -> Option<String> {
    (!text.is_empty()).then(|| text.to_owned())
}
