//! Roles of an application that is one of two MainDevices, and the state of the other one.

use std::time::Duration;

use ringcat_engine::exchange::PartnerMemory;
use ringcat_engine::main_device::{MainDeviceRole, SubDeviceId};
use ringcat_engine::role::{Partner, RoleControl};
use ringcat_engine::time::Instant;

use super::{ForwardingCounters, NotReady, Policy};
use crate::acyclic::AcyclicHalf;
use crate::application::Application;
use crate::error::Error;
use crate::links::Links;
use crate::process_data::ProcessData;

/// In a ring of two MainDevices ([`Options::standby`](crate::Options::standby)). Roles change with
/// [`Application::cycle`], not in a loop of the application's own.
impl<L: Links, H: AcyclicHalf> Application<L, H> {
    /// The role, as of the beginning of this cycle.
    pub fn role(&self) -> MainDeviceRole {
        self.cyclic.exchange.role()
    }

    /// The role, and requests for another one, for any thread. `None` if this MainDevice is alone.
    pub fn role_control(&self) -> Option<RoleControl> {
        self.cyclic.exchange.role_control()
    }

    /// State of the other MainDevice, as determined while this one is ACTIVE.
    pub fn partner(&self) -> Partner {
        self.cyclic.exchange.partner()
    }

    /// Whether a failure of one MainDevice would now cost no more than the time-out of a takeover
    /// ([`NotReady::NOTHING`]), or why not, as of the last cycle. [`RoleControl::readiness`] is the same for any
    /// thread, [`StandbyEvent::Readiness`](super::StandbyEvent) reports changes.
    pub fn takeover_readiness(&self) -> NotReady {
        self.role_control().map_or(NotReady::ABSENT, |control| control.readiness())
    }

    /// When process data of the other MainDevice came last, since this one is INACTIVE.
    pub fn partner_data_at(&self) -> Option<Instant> {
        self.cyclic.of_two.partner_data_at
    }

    /// Frames that the cyclic half has forwarded as INACTIVE.
    pub fn forwarded(&self) -> ForwardingCounters {
        self.cyclic.of_two.counters()
    }

    /// Sets what decides about the role from the next cycle on; `None`: the application does, with requests
    /// ([`Application::role_control`]). To be called before the cycles begin. SubDevices whose watchdog is shorter than
    /// a takeover may last are reported ([`StandbyEvent::WatchdogTooShort`](super::StandbyEvent)).
    pub fn set_policy(&mut self, policy: Option<Policy>) {
        self.cyclic.set_policy(policy, &self.links);
        if let Some(gap) = policy.and_then(|policy| self.longest_gap(&policy)) {
            self.acyclic.report_watchdogs_within(gap, self.cyclic.period(), self.links.now());
        }
    }

    /// Returns the memory that the application gave for process data between both MainDevices
    /// ([`Declaration::place_partner_data`](crate::Declaration::place_partner_data)), in the length that is used. From
    /// then on that data is in memory of the library. Not for the cyclic path: this allocates. `None` if it is in
    /// memory of the library already.
    pub fn give_partner_memory_back(&mut self) -> Option<PartnerMemory> {
        self.cyclic.exchange.give_partner_memory_back()
    }

    /// The SubDevices with outputs whose declared watchdog is not longer than the time for which process data may be
    /// missing in a takeover with this policy: each with its watchdog, and with that time. They leave OP during a
    /// takeover. None if this policy does not take over.
    ///
    /// # Errors
    /// The thread of the acyclic half has ended.
    pub fn short_watchdogs(&self, policy: &Policy) -> Result<Vec<(SubDeviceId, Duration, Duration)>, Error> {
        let within = |gap| self.acyclic.watchdogs_within(gap, self.cyclic.period());
        self.longest_gap(policy).map_or(Ok(Vec::new()), within)
    }

    /// How long process data may be missing in a takeover with this policy ([`Policy::longest_gap_of`]); `None` if it
    /// does not take over, or this MainDevice is alone.
    pub fn longest_gap(&self, policy: &Policy) -> Option<Duration> {
        let is_of_two = self.cyclic.exchange.is_of_two() && policy.takes_over;
        is_of_two.then(|| policy.longest_gap_of(self.cyclic.period()))
    }
}

/// In a ring of two MainDevices ([`Options::standby`](crate::Options::standby)).
impl ProcessData<'_> {
    /// The role in this cycle. As INACTIVE outputs are those that the ACTIVE has sent last, and what is written to them
    /// is not sent.
    pub fn role(&self) -> MainDeviceRole {
        self.exchange.role()
    }

    /// State of the other MainDevice, as determined while this one is ACTIVE.
    pub fn partner(&self) -> Partner {
        self.exchange.partner()
    }

    /// Process data for the other MainDevice, of as many bytes as
    /// [`StandbyOptions::sizes`](super::StandbyOptions::sizes) says for this role. A change of the role does not change
    /// them. [`Declaration::place_partner_data`](crate::Declaration::place_partner_data) puts them into memory of the
    /// application.
    pub fn to_partner_mut(&mut self) -> &mut [u8] {
        self.exchange.to_partner_mut()
    }

    /// Process data of the other MainDevice, of the last cycle in which all of it has arrived; empty before, also after
    /// a change of the role.
    pub fn from_partner(&self) -> &[u8] {
        self.exchange.from_partner()
    }
}
