//! Converts transitions of a file and creates start-up commands of the engine for them.

use ringcat_engine::config::{StartupAction, StartupCommand, Transition as EngineTransition};

use super::notices::Notices;
use crate::eni::{Place, Transition};

/// The engine's transition; `None` if the engine has no commands there.
const fn followed(transition: Transition) -> Option<EngineTransition> {
    match transition {
        Transition::Ii => Some(EngineTransition::Ii),
        Transition::Ip => Some(EngineTransition::Ip),
        Transition::Pp => Some(EngineTransition::Pp),
        Transition::Pi => Some(EngineTransition::Pi),
        Transition::Ps => Some(EngineTransition::Ps),
        Transition::Ss => Some(EngineTransition::Ss),
        Transition::Sp => Some(EngineTransition::Sp),
        Transition::Si => Some(EngineTransition::Si),
        Transition::So => Some(EngineTransition::So),
        Transition::Os => Some(EngineTransition::Os),
        Transition::Oi => Some(EngineTransition::Oi),
        Transition::Ib => Some(EngineTransition::Ib),
        Transition::Bi => Some(EngineTransition::Bi),
        Transition::Po | Transition::Op => None,
    }
}

/// A command of a file, for one or several transitions.
pub(super) struct Planned<'a> {
    /// Its position in the file.
    pub place: Place,
    /// Its transitions.
    pub transitions: &'a [Transition],
    /// The SubDevice; `None` for a command to the whole bus.
    pub subdevice: Option<usize>,
    /// Its name in notices.
    pub subject: &'a str,
    /// What it does.
    pub action: StartupAction,
}

impl Planned<'_> {
    /// Its start-up commands; a notice reports transitions at which RingCAT sends none.
    pub fn at_transitions(&self, notices: &mut Notices) -> Vec<(Place, StartupCommand)> {
        let is_mail = !matches!(self.action, StartupAction::Register(_));
        let mut commands = Vec::new();
        let (mut left, mut without_mailbox): (Vec<&str>, bool) = (Vec::new(), false);
        for transition in self.transitions {
            match followed(*transition) {
                Some(EngineTransition::Ii) if is_mail => without_mailbox = true,
                Some(found) => commands.push((self.place, StartupCommand::new(found, self.action.clone()))),
                // The path between OP and PREOP passes through SAFEOP: the command is sent at one of both transitions.
                None if *transition == Transition::Op && self.transitions.contains(&Transition::Sp) => {}
                None if *transition == Transition::Po && self.transitions.contains(&Transition::Ps) => {}
                None => left.push(transition.name()),
            }
        }
        if self.transitions.is_empty() {
            notices.add(Some(self.place), self.subdevice, self.subject, "it has no Transition: not sent");
        }
        if without_mailbox {
            notices.add(Some(self.place), self.subdevice, self.subject, "not sent at II: INIT has no mailbox");
        }
        if !left.is_empty() {
            let reason =
                format!("not sent at {}: RingCAT changes between PREOP and OP by way of SAFEOP", left.join(", "));
            notices.add(Some(self.place), self.subdevice, self.subject, reason);
        }
        commands
    }
}

/// A comment, if it is not empty.
pub(super) fn comment(text: &str) -> Option<String> {
    (!text.is_empty()).then(|| text.to_owned())
}
