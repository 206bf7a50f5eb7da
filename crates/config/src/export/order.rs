//! The order of start-up commands: an ENI has commands to registers and those of each protocol in sections of their
//! own, and within a transition they are sent in the order of the sections.

use ringcat_engine::config::{MailMessage, StartupAction, StartupCommand, Transition};

use crate::eni::Place;

/// A section with start-up commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Section {
    CoE,
    SoE,
    EoE,
    AoE,
    FoE,
    VoE,
    Registers,
}

/// Sections in their order.
pub(super) type Order = [Section; 7];

/// Those of mailbox protocols, which are together, in the order of the schema.
const PROTOCOLS: [Section; 6] = [Section::CoE, Section::SoE, Section::AoE, Section::EoE, Section::FoE, Section::VoE];

pub(super) const fn section(action: &StartupAction) -> Option<Section> {
    match action {
        StartupAction::Register(_) => Some(Section::Registers),
        StartupAction::Sdo(_) | StartupAction::Upload(_) => Some(Section::CoE),
        StartupAction::Idn(_) | StartupAction::IdnRead(_) => Some(Section::SoE),
        StartupAction::Ip(_) => Some(Section::EoE),
        StartupAction::Mail(MailMessage::Aoe(_)) => Some(Section::AoE),
        StartupAction::Mail(MailMessage::Voe(_)) => Some(Section::VoE),
        StartupAction::FileWrite(_) | StartupAction::FileRead(_) => Some(Section::FoE),
        _ => None,
    }
}

/// Whether an ENI can have these commands in their order.
#[cfg(feature = "network")]
pub(crate) fn is_expressible(commands: &[StartupCommand]) -> bool {
    order(commands).is_some()
}

/// An order of the sections in which the commands of each transition are sent in the same order as these: the registers
/// behind the mailbox, as in the schema, or before it.
pub(super) fn order(commands: &[StartupCommand]) -> Option<Order> {
    let sequence = |transition| {
        let of_transition = commands.iter().filter(|command| command.transition == transition);
        let mut sections: Vec<Section> = of_transition.filter_map(|command| section(&command.action)).collect();
        sections.dedup();
        sections
    };
    let sequences = Transition::ALL.map(sequence);
    let is_kept = |order: &Order| {
        sequences.iter().all(|sections| sections.iter().map(|section| rank(order, *section)).is_sorted())
    };
    if sequences.iter().any(|sections| sections.len() > PROTOCOLS.len() + 1) {
        return None;
    }
    let (mut protocols, mut found) = (PROTOCOLS, None);
    permutations(&mut protocols, 0, &mut |[a, b, c, d, e, f]| {
        let registers = Section::Registers;
        let orders = [[*a, *b, *c, *d, *e, *f, registers], [registers, *a, *b, *c, *d, *e, *f]];
        found = found.or_else(|| orders.into_iter().find(is_kept));
        found.is_some()
    });
    found
}

/// Calls `done` with each permutation of a list behind a place, the list itself first, until it returns true.
fn permutations(list: &mut [Section; 6], from: usize, done: &mut impl FnMut(&[Section; 6]) -> bool) -> bool {
    if from + 1 >= list.len() {
        return done(list);
    }
    for place in from..list.len() {
        list[from..=place].rotate_right(1);
        let is_done = permutations(list, from + 1, done);
        list[from..=place].rotate_left(1);
        if is_done {
            return true;
        }
    }
    false
}

fn rank(order: &Order, section: Section) -> usize {
    order.iter().position(|it| *it == section).unwrap_or(order.len())
}

/// The place of the commands of a section, by which the writer orders the sections.
pub(super) fn place(order: &Order, section: Section) -> Place {
    Place { line: u32::try_from(rank(order, section)).unwrap_or(u32::MAX), column: 0 }
}
