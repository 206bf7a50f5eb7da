//! SubDevices that are not in their states, with the reasons from events.

use std::collections::VecDeque;
use std::fmt;
use std::time::Duration;

use ringcat_engine::event::{Event, TimedEvent};
use ringcat_engine::main_device::{Address, MainDevice as Engine, SubDeviceId, SubDeviceState};

use crate::subdevice::SubDeviceName;

/// Events that are kept for the application while it waits; older ones are dropped and counted.
const KEPT: usize = 4096;

/// SubDevices that were not in their states at the time limit.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct NotReady {
    /// The time limit.
    pub limit: Duration,
    /// The SubDevices that are not in their states, with the reasons.
    pub subdevices: Vec<(SubDeviceName, Reason)>,
}

/// Why a SubDevice is not in its state.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Reason {
    /// It does not answer.
    Absent,
    /// Its state is unknown: no ACTIVE reports it to this INACTIVE.
    Unknown,
    /// It is being configured, or waits for the next attempt.
    Configuring {
        /// Reason of the last failed attempt, if there is one.
        failed: Option<String>,
    },
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Reason::Absent => f.write_str("does not answer"),
            Reason::Unknown => f.write_str("is unknown: no ACTIVE reports it"),
            Reason::Configuring { failed: None } => f.write_str("is still being configured"),
            Reason::Configuring { failed: Some(reason) } => write!(f, "configuration failed: {reason}"),
        }
    }
}

impl fmt::Display for NotReady {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "not in the declared states within {} ms", self.limit.as_millis())?;
        for (at, (subdevice, reason)) in self.subdevices.iter().enumerate() {
            let separator = if at == 0 { ": " } else { "; " };
            write!(f, "{separator}{subdevice} {reason}")?;
        }
        Ok(())
    }
}

impl std::error::Error for NotReady {}

/// Reasons of the last failed configurations, by index in the declaration.
#[derive(Clone, Debug, Default)]
pub(crate) struct Failures(Vec<Option<String>>);

impl Failures {
    /// Evaluates an event, and logs it. Each event passes here once, before the application takes it.
    pub fn observe(&mut self, timed: &TimedEvent) {
        #[cfg(feature = "tracing")]
        crate::trace::record(timed);
        match &timed.event {
            Event::ConfigurationFailed { subdevice: SubDeviceId(index), reason } => {
                if self.0.len() <= *index {
                    self.0.resize(*index + 1, None);
                }
                self.0[*index] = Some(reason.clone());
            }
            Event::StateReached { subdevice, .. } | Event::Lost { subdevice } => {
                if let Some(reason) = self.0.get_mut(subdevice.0) {
                    *reason = None;
                }
            }
            // The next declaration has other indices.
            Event::ScanFinished { .. } => self.0.clear(),
            _ => {}
        }
    }

    /// SubDevices that are not in their states, with the reasons.
    pub fn explain(&self, engine: &Engine) -> Vec<(SubDeviceName, Reason)> {
        let explain = |(subdevice, state): (SubDeviceId, SubDeviceState)| {
            let name = SubDeviceName::of(engine, Address::Declared(subdevice));
            let failed = self.0.get(subdevice.0).cloned().flatten();
            let reason = match state {
                SubDeviceState::Absent => Reason::Absent,
                SubDeviceState::Unknown => Reason::Unknown,
                _ => Reason::Configuring { failed },
            };
            (name, reason)
        };
        engine.unsettled().into_iter().map(explain).collect()
    }
}

/// Events that were read for their reasons before the application takes them.
#[derive(Debug, Default)]
pub(crate) struct KeptEvents {
    events: VecDeque<TimedEvent>,
    pub failures: Failures,
    pub dropped: u64,
}

impl KeptEvents {
    /// Evaluates all waiting events, and keeps them.
    pub fn take_in(&mut self, mut next: impl FnMut() -> Option<TimedEvent>) {
        while let Some(event) = next() {
            self.failures.observe(&event);
            if self.events.len() == KEPT {
                self.events.pop_front();
                self.dropped += 1;
            }
            self.events.push_back(event);
        }
    }

    /// The oldest event: one that was kept, or the next one.
    pub fn pop(&mut self, next: impl FnOnce() -> Option<TimedEvent>) -> Option<TimedEvent> {
        self.events.pop_front().or_else(|| next().inspect(|event| self.failures.observe(event)))
    }
}
