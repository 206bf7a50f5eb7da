//! The order of start-up commands: an ENI has commands to registers and those of each protocol in sections of their
//! own, and within a transition they are sent in the order of the sections.

use ringcat_engine::config::{StartupAction, StartupCommand, Transition};

use crate::eni::Place;

/// A section with start-up commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Section {
    Registers,
    CoE,
    SoE,
    EoE,
}

/// Sections in their order.
pub(super) type Order = [Section; 4];

/// The possible orders, first that of the schema. The sections of mailbox protocols are together.
const ORDERS: [Order; 12] = {
    use Section::{CoE, EoE, Registers as R, SoE};
    [
        [CoE, SoE, EoE, R],
        [R, CoE, SoE, EoE],
        [CoE, EoE, SoE, R],
        [SoE, CoE, EoE, R],
        [SoE, EoE, CoE, R],
        [EoE, CoE, SoE, R],
        [EoE, SoE, CoE, R],
        [R, CoE, EoE, SoE],
        [R, SoE, CoE, EoE],
        [R, SoE, EoE, CoE],
        [R, EoE, CoE, SoE],
        [R, EoE, SoE, CoE],
    ]
};
const TRANSITIONS: [Transition; 5] = [Transition::Ip, Transition::Ps, Transition::So, Transition::Os, Transition::Sp];

pub(super) const fn section(action: &StartupAction) -> Option<Section> {
    match action {
        StartupAction::Register(_) => Some(Section::Registers),
        StartupAction::Sdo(_) | StartupAction::Upload(_) => Some(Section::CoE),
        StartupAction::Idn(_) => Some(Section::SoE),
        StartupAction::Ip(_) => Some(Section::EoE),
        _ => None,
    }
}

/// An order of the sections in which the commands of each transition are sent in the same order as these.
pub(super) fn order(commands: &[StartupCommand]) -> Option<Order> {
    ORDERS.into_iter().find(|order| {
        TRANSITIONS.into_iter().all(|transition| {
            let of_transition = commands.iter().filter(|command| command.transition == transition);
            let sections = of_transition.filter_map(|command| section(&command.action));
            sections.map(|section| rank(order, section)).is_sorted()
        })
    })
}

fn rank(order: &Order, section: Section) -> usize {
    order.iter().position(|it| *it == section).unwrap_or(order.len())
}

/// The place of the commands of a section, by which the writer orders the sections.
pub(super) fn place(order: &Order, section: Section) -> Place {
    Place { line: u32::try_from(rank(order, section)).unwrap_or(u32::MAX), column: 0 }
}
