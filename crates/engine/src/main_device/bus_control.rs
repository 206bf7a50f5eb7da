//! Another MainDevice takes control of the segment, or gives it back: the role changes (protocol 9.11).
//!
//! All procedures end with the role ACTIVE; what was found, the requested states and the counters of mailboxes stay.
//! When the role is ACTIVE again the other MainDevice may have changed anything, so the way is that after a crash of
//! the former owner: the first mail of each mailbox has counter 0, and idle operation first compares the number of
//! SubDevices, their station addresses and their states.

use alloc::vec::Vec;

use ringcat_wire::al::AlState;

use super::{MainDevice, supervisor};
use crate::event::EventLog;
use crate::knowledge::{Handover, KnownMailbox};
use crate::mail::InUse;
use crate::procedures::scan::ScanError;
#[cfg(feature = "standby")]
use crate::role::RoleRequest;
use crate::role::{Denial, Function, MainDeviceRole, NotPermitted};
use crate::segment::{KeptState, Observation, UndeclaredObservation, UpkeepProgress};
use crate::time::Instant;

impl MainDevice {
    /// Its role on the segment: [`MainDeviceRole::Active`] unless it was set.
    pub fn role(&self) -> MainDeviceRole {
        self.roles.role()
    }

    /// Sets the role. It decides which functions are refused from now on. With MainDevice redundancy and an application
    /// it takes effect with the next cycle ([`MainDevice::role_control`]), and nothing ends but what runs on the bus.
    ///
    /// INACTIVE ends all that runs: conversations, services, scans, supervision, idle operation, the application. Jobs
    /// under way end without a result, a stop or a deactivation with [`NotPermitted`], a scan with
    /// [`ScanError::RoleChanged`]. From then on nothing is sent; the exchange of an application must not send any
    /// more either. The scan, requested states of SubDevices without a declaration, events and emergencies stay.
    ///
    /// ACTIVE goes on with these: mailboxes are in use again, and idle operation brings each SubDevice to the state
    /// that was requested of it, SubDevices of the former application to PREOP.
    pub fn set_role(&mut self, role: MainDeviceRole) {
        if role == self.role() {
            return;
        }
        #[cfg(feature = "standby")]
        if self.standby.is_some() && self.active().is_some() {
            // The cycles of the application go on in the other role.
            return self.roles.request(match role {
                MainDeviceRole::Active => RoleRequest::Active,
                MainDeviceRole::Inactive => RoleRequest::Inactive,
            });
        }
        match role {
            MainDeviceRole::Inactive => {
                self.end_all();
                self.roles.set(role);
            }
            MainDeviceRole::Active => {
                self.roles.set(role);
                *self.scan_error.borrow_mut() = None;
                self.go_on_with_mailboxes();
                self.begin_idle();
            }
        }
        self.role_followed = self.roles.changes();
    }

    /// Another supervisor, without procedures.
    pub(super) fn renew_supervisor(&mut self, events: EventLog, now: Instant) {
        let (are_reported, sequence) = (self.supervisor.bus().are_commands_reported(), self.supervisor.sequence());
        self.supervisor = supervisor(self.identity, &self.options, now);
        self.supervisor.attach_role(self.roles.clone());
        self.supervisor.set_command_reports(are_reported);
        self.supervisor.go_on_from(sequence);
        self.supervisor.set_events(events);
    }

    /// Ends all procedures.
    fn end_all(&mut self) {
        let denied = |function| NotPermitted { function, role: MainDeviceRole::Inactive, denial: Denial::NeedsTheBus };
        let (was_active, was_scanning) = (self.active().is_some(), self.segment.view().is_scanning());
        let (kept, mailboxes) = self.left();
        let rings = core::mem::take(&mut *self.emergencies.borrow_mut());
        let carriers = self.supervisor.bus().carriers();
        self.end_application(self.supervisor.bus().now());
        // Nothing may be sent in this role: ports that were changed for a moment restore themselves.
        self.segment.observe(Observation::PortsAltered(&[]));
        self.supervisor.set_carriers(carriers);
        if !was_active {
            *self.emergencies.borrow_mut() = rings;
        }
        if was_scanning {
            *self.scan_error.borrow_mut() = Some(ScanError::RoleChanged);
        }
        *self.stopped.borrow_mut() = Some(Err(denied(Function::Stop).into()));
        self.segment.observe_undeclared(UndeclaredObservation::HandedOver(&kept));
        self.left_mailboxes = mailboxes;
    }

    /// The requested states of SubDevices without a declaration, and their mailboxes in use. Outputs in OP have to be
    /// written: such a SubDevice is brought to OP again. PREOP is requested of those that the application has declared.
    fn left(&self) -> (Vec<KeptState>, Vec<(InUse, KnownMailbox)>) {
        let view = self.segment.view();
        let due = UpkeepProgress::Due(self.supervisor.bus().now());
        let to_preop = |station| KeptState { station, target: AlState::PreOp, progress: due, has_left: None };
        let members = view.members().filter(|member| member.info.is_some());
        let mut states: Vec<KeptState> = members.map(|member| to_preop(member.station)).collect();
        let mut mailboxes = Vec::new();
        for key in view.subdevices().unassigned().map(|it| it.key) {
            let Some(upkeep) = view.upkeep(key) else { continue };
            let is_reached = upkeep.progress == UpkeepProgress::Reached && upkeep.target != AlState::Op;
            let progress = match upkeep.progress {
                UpkeepProgress::Left => UpkeepProgress::Left,
                _ if is_reached => UpkeepProgress::Reached,
                _ => due,
            };
            states.push(KeptState { station: key.station, target: upkeep.target, progress, has_left: None });
            let mailbox = self.segment.undeclared.of(key).filter(|_| is_reached);
            mailboxes.extend(mailbox.and_then(|mailbox| mailbox.in_use().zip(mailbox.known())));
        }
        (states, mailboxes)
    }

    /// Uses the mailboxes again that were in use.
    fn go_on_with_mailboxes(&mut self) {
        for (in_use, known) in core::mem::take(&mut self.left_mailboxes) {
            let key = self.segment.view().undeclared_at(in_use.station);
            if let Some(mailbox) = key.and_then(|key| self.segment.undeclared.of(key)) {
                mailbox.adopt(in_use, &known, Handover::AfterCrash);
            }
        }
    }
}
