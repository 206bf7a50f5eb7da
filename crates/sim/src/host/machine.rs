//! A host: its power, and whether its program runs.

use super::program::{HostProgram, TurnArounds};
use crate::time::SimTime;

/// What a host does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum HostCondition {
    /// It has power, and its program runs.
    Runs,
    /// It has power, and its program does not run: it hangs, or a signal has stopped it. Its interfaces are up and keep
    /// what they receive.
    Stopped,
    /// It has no power.
    Off,
}

/// A host.
#[derive(Debug)]
pub(crate) struct Machine {
    pub(crate) condition: HostCondition,
    /// When the condition changed last, and how often it has.
    pub(crate) since: SimTime,
    pub(crate) changes: u32,
    pub(crate) program: Option<Running>,
}

/// A program that reacts to frames.
#[derive(Debug)]
pub(crate) struct Running {
    pub(crate) program: Box<dyn HostProgram>,
    pub(crate) turn_arounds: TurnArounds,
    /// When it reacts to frames that wait.
    pub(crate) reacts_at: Option<SimTime>,
}

impl Machine {
    pub(crate) const fn new() -> Machine {
        Machine { condition: HostCondition::Runs, since: SimTime::ZERO, changes: 0, program: None }
    }

    /// The condition changes.
    pub(crate) fn enter(&mut self, condition: HostCondition, now: SimTime) {
        if self.condition != condition {
            (self.condition, self.since) = (condition, now);
            self.changes = self.changes.wrapping_add(1);
        }
    }

    /// Whether it will react to frames that wait.
    pub(crate) fn is_reacting(&self) -> bool {
        self.condition == HostCondition::Runs && self.program.as_ref().is_some_and(|it| it.reacts_at.is_some())
    }
}
