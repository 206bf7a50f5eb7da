//! The MainDevice on either side of an activation.

use std::time::Duration;

use ringcat::{Application, Instant, MainDevice, Options, TimedEvent};
use ringcat_engine::main_device::MainDevice as Engine;
use ringcat_sim::network::Network;
use ringcat_sim::time::SimTime;

use super::links::CallLinks;

/// Either side of an activation.
#[derive(Debug)]
pub enum Side {
    /// No application is active.
    Idle(Box<MainDevice<CallLinks>>),
    /// An application is active.
    Active(Box<Application<CallLinks>>),
    /// While it changes.
    Changing,
}

impl Side {
    /// A program begins on a segment.
    pub fn begin(network: Network, options: &Options) -> Side {
        Side::Idle(Box::new(MainDevice::request(CallLinks::new(network), options)))
    }

    /// Whether an application is active.
    pub fn is_active(&self) -> bool {
        matches!(self, Side::Active(_))
    }

    /// The links.
    ///
    /// # Panics
    /// While it changes.
    pub fn links_mut(&mut self) -> &mut CallLinks {
        match self {
            Side::Idle(main_device) => main_device.links_mut(),
            Side::Active(application) => application.links_mut(),
            Side::Changing => unreachable!("it is put back at once"),
        }
    }

    /// The engine.
    ///
    /// # Panics
    /// While it changes.
    pub fn engine(&self) -> &Engine {
        match self {
            Side::Idle(main_device) => main_device.engine(),
            Side::Active(application) => application.engine(),
            Side::Changing => unreachable!("it is put back at once"),
        }
    }

    /// Host time.
    ///
    /// # Panics
    /// While it changes.
    pub fn now(&self) -> Instant {
        match self {
            Side::Idle(main_device) => main_device.now(),
            Side::Active(application) => application.now(),
            Side::Changing => unreachable!("it is put back at once"),
        }
    }

    /// Time passes without a call: the MainDevice works without an application, and waits for calls with one.
    pub fn pass(&mut self, time: Duration) {
        match self {
            Side::Idle(main_device) => main_device.attend(time),
            Side::Active(application) => {
                let end = SimTime(application.now().0 + time.as_nanos() as u64);
                application.links_mut().network_mut().advance(end);
            }
            Side::Changing => {}
        }
    }

    /// The oldest event.
    pub fn pop_event(&mut self) -> Option<TimedEvent> {
        match self {
            Side::Idle(main_device) => main_device.pop_event(),
            Side::Active(application) => application.pop_event(),
            Side::Changing => None,
        }
    }

    /// The application, if one is active.
    pub fn application(&mut self) -> Option<&mut Application<CallLinks>> {
        match self {
            Side::Active(application) => Some(application),
            Side::Idle(_) | Side::Changing => None,
        }
    }

    /// The MainDevice, if no application is active.
    pub fn main_device(&mut self) -> Option<&mut MainDevice<CallLinks>> {
        match self {
            Side::Idle(main_device) => Some(main_device),
            Side::Active(_) | Side::Changing => None,
        }
    }
}
