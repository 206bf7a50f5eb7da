//! The EtherCAT state machine inside a SubDevice (protocol 5.1, 5.3).
//!
//! Input: AL control as written by the MainDevice, and the end times of transitions. Output: the action of the
//! application ([`Reaction`]) and the values of AL status and AL status code. [`settings`](super::settings) checks the
//! configuration.

use core::time::Duration;

use ringcat_wire::al::{AlControl, AlState, AlStatus, AlStatusCode, transition_allowed};

use crate::description::TransitionTimes;
use crate::time::SimTime;

/// Result of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reaction {
    /// None: an error is not acknowledged yet.
    Ignore,
    /// AL status is written again.
    Report,
    /// The configuration is checked and a transition to this state begins.
    Begin(AlState),
}

/// A transition in progress.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pending {
    /// Target state.
    pub to: AlState,
    /// Time at which the application completes it.
    pub at: SimTime,
    /// Time at which the application stops waiting for further conditions.
    pub time_limit: SimTime,
}

/// State, error and the transition in progress.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StateMachine {
    state: AlState,
    error: Option<AlStatusCode>,
    identification: Option<u16>,
    pending: Option<Pending>,
}

impl Default for StateMachine {
    fn default() -> Self {
        StateMachine { state: AlState::Init, error: None, identification: None, pending: None }
    }
}

impl StateMachine {
    /// Current state; the old state during a transition.
    pub const fn state(&self) -> AlState {
        self.state
    }

    /// The transition in progress.
    pub const fn pending(&self) -> Option<Pending> {
        self.pending
    }

    /// Value of AL status.
    pub const fn status(&self) -> AlStatus {
        let mut status = AlStatus::new(self.state);
        status.error = self.error.is_some();
        status.identification = self.identification.is_some();
        status
    }

    /// Value of AL status code: the error, or the requested identification.
    pub const fn code(&self) -> AlStatusCode {
        match (self.error, self.identification) {
            (Some(code), _) => code,
            (None, Some(value)) => AlStatusCode(value),
            (None, None) => AlStatusCode::NO_ERROR,
        }
    }

    /// Handles a write to AL control. `identification` is the device's identification value.
    pub fn request(&mut self, control: AlControl, boot: bool, identification: Option<u16>) -> Reaction {
        let requested = AlState::from_code(control.state);
        if self.error.is_some() && !control.acknowledge && requested != Some(AlState::Init) {
            return Reaction::Ignore;
        }
        self.error = None;
        self.identification = if control.identification { identification } else { None };
        let Some(to) = requested else {
            return self.refuse(AlStatusCode::UNKNOWN_STATE);
        };
        if to == AlState::Boot && !boot && self.state == AlState::Init {
            return self.refuse(AlStatusCode::BOOT_NOT_SUPPORTED);
        }
        if !transition_allowed(self.state, to) {
            return self.refuse(AlStatusCode::INVALID_STATE_CHANGE);
        }
        if to == self.state { Reaction::Report } else { Reaction::Begin(to) }
    }

    /// Refuses the request: the state stays, the error is set.
    pub fn refuse(&mut self, code: AlStatusCode) -> Reaction {
        self.pending = None;
        self.fail(self.state, code)
    }

    /// The application itself leaves its state.
    pub fn fail(&mut self, to: AlState, code: AlStatusCode) -> Reaction {
        self.state = to;
        self.error = Some(code);
        self.identification = None;
        self.pending = None;
        Reaction::Report
    }

    /// Begins a transition with this duration; its other conditions must be met within `patience` after that.
    pub fn begin(&mut self, to: AlState, now: SimTime, takes: Duration, patience: Duration) {
        let at = now + takes;
        self.pending = Some(Pending { to, at, time_limit: at + patience });
    }

    /// Aborts the transition in progress in favour of another request.
    pub fn abandon(&mut self) {
        self.pending = None;
    }

    /// Completes the transition in progress. Returns the previous state.
    pub fn complete(&mut self) -> AlState {
        let from = self.state;
        if let Some(pending) = self.pending.take() {
            self.state = pending.to;
        }
        from
    }
}

/// Duration of a transition.
pub const fn duration(times: &TransitionTimes, from: AlState, to: AlState) -> Duration {
    match (from, to) {
        (_, AlState::Init) => times.to_init,
        (AlState::Init, AlState::PreOp) | (_, AlState::Boot) => times.to_preop,
        (_, AlState::PreOp) => times.back,
        (AlState::Op, AlState::SafeOp) => times.back,
        (_, AlState::SafeOp) => times.to_safeop,
        (_, AlState::Op) => times.to_op,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn machine(state: AlState) -> StateMachine {
        StateMachine { state, ..StateMachine::default() }
    }

    // covers: 5.1, sim-states
    #[test]
    fn each_pair_of_states_begins_or_is_refused_by_the_state_machine() {
        for from in AlState::ALL {
            for to in AlState::ALL {
                let mut machine = machine(from);
                let reaction = machine.request(AlControl::new(to), true, None);
                if from == to {
                    assert_eq!((reaction, machine.code()), (Reaction::Report, AlStatusCode::NO_ERROR));
                } else if transition_allowed(from, to) {
                    assert_eq!(reaction, Reaction::Begin(to), "{from} to {to}");
                } else {
                    assert_eq!(machine.code(), AlStatusCode::INVALID_STATE_CHANGE, "{from} to {to}");
                    assert_eq!(machine.status(), AlStatus::with_error(from));
                }
            }
        }
    }

    #[test]
    fn an_unknown_state_code_is_0x0012() {
        for code in [0, 5, 6, 7, 9, 15] {
            let mut machine = machine(AlState::PreOp);
            machine.request(AlControl { state: code, ..AlControl::new(AlState::Init) }, false, None);
            assert_eq!(machine.code(), AlStatusCode::UNKNOWN_STATE);
        }
    }

    #[test]
    fn boot_without_support_is_0x0013() {
        let mut machine = machine(AlState::Init);
        machine.request(AlControl::new(AlState::Boot), false, None);
        assert_eq!((machine.status(), machine.code().0), (AlStatus::with_error(AlState::Init), 0x0013));
    }

    #[test]
    fn requests_are_ignored_until_the_error_is_acknowledged() {
        let mut machine = machine(AlState::SafeOp);
        machine.fail(AlState::SafeOp, AlStatusCode::SYNC_MANAGER_WATCHDOG);
        assert_eq!(machine.request(AlControl::new(AlState::Op), false, None), Reaction::Ignore);
        assert_eq!(machine.code(), AlStatusCode::SYNC_MANAGER_WATCHDOG);
        assert_eq!(machine.request(AlControl::with_acknowledge(AlState::SafeOp), false, None), Reaction::Report);
        assert_eq!((machine.status(), machine.code()), (AlStatus::new(AlState::SafeOp), AlStatusCode::NO_ERROR));
        assert_eq!(machine.request(AlControl::new(AlState::Op), false, None), Reaction::Begin(AlState::Op));
    }

    #[test]
    fn a_request_for_init_implies_the_acknowledge() {
        let mut machine = machine(AlState::SafeOp);
        machine.fail(AlState::PreOp, AlStatusCode::INVALID_INPUT_CONFIGURATION);
        assert_eq!(machine.request(AlControl::new(AlState::Init), false, None), Reaction::Begin(AlState::Init));
        assert!(!machine.status().error);
    }

    #[test]
    fn identification_is_in_the_status_code_while_it_is_requested() {
        let mut machine = machine(AlState::PreOp);
        let asking = AlControl { identification: true, ..AlControl::new(AlState::PreOp) };
        machine.request(asking, false, Some(0x1234));
        assert_eq!((machine.status().bits(), machine.code().0), (0x0022, 0x1234));
        machine.request(AlControl::new(AlState::PreOp), false, Some(0x1234));
        assert_eq!((machine.status().bits(), machine.code().0), (0x0002, 0));
        machine.request(asking, false, None);
        assert_eq!(machine.status().bits(), 0x0002);
    }
}
