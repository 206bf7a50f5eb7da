//! History of a world: events, evaluations of domains, changes of AL status, and a text log.

use ringcat::{Instant, TimedEvent};
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::network::Network;
use ringcat_wire::al::{AlState, AlStatus, AlStatusCode};

use crate::check::Evaluated;

/// Change of a device's AL status, seen at the beginning of a cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step {
    /// Time.
    pub at: Instant,
    /// Device.
    pub device: DeviceIndex,
    /// AL status before.
    pub from: AlStatus,
    /// AL status after.
    pub to: AlStatus,
    /// AL status code after.
    pub code: AlStatusCode,
}

impl Step {
    /// Whether the device left OP.
    pub fn leaves_op(&self) -> bool {
        self.from.al_state() == Some(AlState::Op) && self.to != AlStatus::new(AlState::Op)
    }
}

/// Recorded events, in order.
#[derive(Debug, Default)]
pub(super) struct Journal {
    pub(super) lines: Vec<(Instant, String)>,
    pub(super) events: Vec<TimedEvent>,
    pub(super) evaluated: Vec<Evaluated>,
    pub(super) steps: Vec<Step>,
    pub(super) status: Vec<AlStatus>,
}

impl Journal {
    /// Records an event.
    pub(super) fn event(&mut self, event: TimedEvent) {
        self.lines.push((event.at, format!("{:?}", event.event)));
        self.events.push(event);
    }

    /// Records an evaluation; the log has only those that differ from the one before.
    pub(super) fn evaluate(&mut self, evaluated: Evaluated) {
        let before = self.evaluated.iter().rev().find(|before| before.domain == evaluated.domain);
        if before
            .is_none_or(|before| before.delivery != evaluated.delivery || before.status.wkc != evaluated.status.wkc)
        {
            let Evaluated { domain, at, status, delivery, .. } = &evaluated;
            let line = format!("  domain {}: {delivery:?}, {} of {}", domain.0, status.wkc, status.expected);
            self.lines.push((*at, line));
        }
        self.evaluated.push(evaluated);
    }

    /// Records the states of the devices.
    pub(super) fn watch(&mut self, at: Instant, network: &Network) {
        for (number, device) in network.devices().enumerate() {
            let to = device.al_status();
            let from = std::mem::replace(&mut self.status[number], to);
            if from != to {
                let code = device.al_status_code();
                self.lines.push((at, format!("  device {number} ({}): {from} to {to}, {code}", device.name())));
                self.steps.push(Step { at, device: DeviceIndex(number), from, to, code });
            }
        }
    }
}
