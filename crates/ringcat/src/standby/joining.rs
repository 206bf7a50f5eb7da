//! From a controller without information about its ring to a running application in the role that is free: listening,
//! following, becoming ACTIVE (protocol 9.10).

use std::sync::Arc;
use std::time::Duration;

use ringcat_engine::event::CyclicStandbyEvent;
use ringcat_engine::link::Link;
use ringcat_engine::main_device::{ActivateError, Declaration, MainDeviceRole, PartnerStatus};
use ringcat_engine::role::{Requester, RoleControl, RoleRequest};
use ringcat_engine::time::Instant;
use ringcat_engine::{Scan, ScanError};

use super::alarm::ActiveMonitor;
use super::policy::Dice;
use super::{ForwardingCounters, NeedsTwoLinks, Policy};
use crate::acyclic::Inline;
use crate::application::Application;
use crate::error::Error;
use crate::links::Links;
use crate::main_device::{MainDevice, Refused};
use crate::window::Window;

/// Longest time of listening before it is decided again whether there is an ACTIVE.
const SLICE: Duration = Duration::from_millis(10);

/// The next step of one of two MainDevices, before it has an application.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Next {
    /// It continues to listen: it is not yet known whether there is an ACTIVE.
    Listen,
    /// There is an ACTIVE of which all is known: [`MainDevice::follow`].
    Follow,
    /// There is no ACTIVE, or the role was requested: [`MainDevice::become_active`], and then a scan or
    /// [`MainDevice::bring_up`].
    BecomeActive,
}

/// Listens before an application begins, and decides how it begins.
#[derive(Debug)]
pub struct Joining {
    control: RoleControl,
    silent_since: Instant,
    /// Silence after which this one becomes ACTIVE.
    limit: Duration,
    monitor: ActiveMonitor,
}

impl Joining {
    /// Begins to listen. The policy decides whether it is in permanent standby, unless [`RoleControl::hold`] was called
    /// before; later calls change it.
    pub fn begin<L: Links>(main_device: &MainDevice<L>, policy: &Policy) -> Joining {
        let control = main_device.role_control();
        control.begin_held(!policy.takes_over);
        Joining::on(&main_device.links, control, policy)
    }

    pub(crate) fn on(links: &impl Links, control: RoleControl, policy: &Policy) -> Joining {
        let (main, now) = (links.addresses().main, links.now());
        let pause = Dice::new(main, now).up_to(policy.listen);
        let (limit, monitor) = (policy.listen + pause, ActiveMonitor::new(now));
        Joining { control, silent_since: now, limit, monitor }
    }

    /// What follows from the frames that were received. Without a link that is up none can be received: then it listens
    /// on. If no ACTIVE is there and it does not become ACTIVE, [`StandbyEvent::NoActive`](super::StandbyEvent) is
    /// reported.
    pub fn next<L: Links>(&mut self, main_device: &mut MainDevice<L>) -> Next {
        let has_link = Link::ALL.iter().any(|link| main_device.links.carrier(*link) != Some(false));
        let (partner, now) = (main_device.partner_status(), main_device.now());
        if let Some(event) = self.look_out(&partner, now) {
            main_device.engine.report_standby(event.event(|_| String::new()), now);
        }
        self.decide(&partner, has_link, now)
    }

    /// Whether an alarm is to be reported. A MainDevice that may become ACTIVE gets time to do so first.
    pub(crate) fn look_out(&mut self, partner: &PartnerStatus, now: Instant) -> Option<CyclicStandbyEvent> {
        self.monitor.note(partner.at, self.limit.saturating_mul(if self.control.is_held() { 1 } else { 2 }), now)
    }

    pub(crate) fn decide(&mut self, partner: &PartnerStatus, has_link: bool, now: Instant) -> Next {
        // The role was requested, also in permanent standby, and whatever the other MainDevice does.
        if self.control.role() == MainDeviceRole::Active {
            return Next::BecomeActive;
        }
        if !has_link {
            self.silent_since = now;
        }
        self.silent_since = self.silent_since.max(partner.at.unwrap_or_default());
        let is_silent = now.since(self.silent_since) >= self.limit;
        match (partner.is_known, is_silent) {
            (_, true) if !self.control.is_held() => Next::BecomeActive,
            (true, false) => Next::Follow,
            _ => Next::Listen,
        }
    }
}

/// In a ring of two MainDevices ([`Options::standby`](crate::Options::standby)).
impl<L: Links> MainDevice<L> {
    /// The role, and requests for another one, for any thread.
    pub fn role_control(&self) -> RoleControl {
        self.engine.role_control()
    }

    /// What has arrived from the ACTIVE so far.
    pub fn partner_status(&self) -> PartnerStatus {
        self.engine.partner_status()
    }

    /// Frames that were forwarded so far.
    pub fn forwarded(&self) -> ForwardingCounters {
        self.of_two.counters()
    }

    /// Forwards and listens for a time; less if all is known that is needed to follow.
    ///
    /// # Errors
    /// There is no redundant link.
    pub fn listen(&mut self, time: Duration) -> Result<PartnerStatus, Error> {
        if self.links.addresses().redundant.is_none() {
            return Err(NeedsTwoLinks.into());
        }
        let end = self.now() + time;
        while !self.partner_status().is_known && self.now() < end {
            self.work();
            let wake = self.engine.next_deadline().unwrap_or(end);
            self.links.wait(wake.min(end));
        }
        Ok(self.partner_status())
    }

    /// Becomes ACTIVE without an application, whatever the other MainDevice does: then a scan, or
    /// [`MainDevice::bring_up`], is allowed. If another MainDevice is ACTIVE as well, the one with the lower address
    /// stays ACTIVE ([`OnCollision`](super::OnCollision)). The scan of the one that becomes INACTIVE ends with
    /// [`ScanError::RoleChanged`]; it listens again with [`Joining`]. False if it is not ACTIVE: another role was
    /// requested meanwhile, which has priority, or the other MainDevice writes into the memory of a SubDevice.
    pub fn become_active(&mut self) -> bool {
        let control = self.role_control();
        // Otherwise the other request takes effect.
        let _ = control.request_as(RoleRequest::Active, Requester::Policy);
        self.work();
        control.role() == MainDeviceRole::Active
    }

    /// Follows the ACTIVE with an application: nothing is sent before it takes over. `declare` gets what the ACTIVE
    /// has as knowledge of the segment, and returns the declaration, the same as on the ACTIVE.
    ///
    /// # Errors
    /// This MainDevice is ACTIVE, not all is known yet ([`PartnerStatus::is_known`]), or the declaration does not fit.
    /// The error contains the MainDevice for another attempt.
    pub fn follow(
        mut self,
        declare: impl FnOnce(&Scan) -> Declaration,
    ) -> Result<Application<L>, Box<Refused<MainDevice<L>>>> {
        let known = self.engine.partner_knowledge().zip(self.engine.partner_configuration());
        let Some(((knowledge, (session, _)), scan)) = known.zip(self.engine.partner_scan()) else {
            let error = ActivateError::NoScan.into();
            return Err(Box::new(Refused { error, main_device: self }));
        };
        match self.engine.follow(declare(&scan), knowledge, session) {
            Ok(active) => {
                let window = Arc::new(Window::new(self.acyclic_bytes));
                Ok(Application::new(self.links, Inline::new(self.engine), active, window))
            }
            Err(error) => Err(Box::new(Refused { error: error.into(), main_device: self })),
        }
    }

    /// Takes the role that is free: follows an ACTIVE as soon as all is known of it, or becomes ACTIVE if no frame of
    /// one arrives for [`Policy::listen`] and a random pause. Forwards meanwhile. With [`Policy::permanent_standby`] it
    /// waits for an ACTIVE without a limit; [`Joining`] has the same in steps.
    ///
    /// ```no_run
    /// use std::time::Duration;
    /// use ringcat::packet::{PacketLinks, ReceiveMode};
    /// use ringcat::standby::{Policy, StandbyOptions};
    /// use ringcat::{MainDevice, Options, automatic};
    ///
    /// let links = PacketLinks::open_forwarding("eth1", "eth2", ReceiveMode::Blocking)?;
    /// let options = Options::default().with_standby(StandbyOptions::default());
    /// let cycle = Duration::from_millis(2);
    /// let main_device = MainDevice::request(links, &options);
    /// let mut application = main_device.join(&Policy::default(), |scan| automatic(&scan.subdevices, cycle))?;
    /// loop {
    ///     application.cycle(|data| {
    ///         // The same in both roles: what it writes leaves as ACTIVE only.
    ///     });
    ///     while let Some(event) = application.pop_event() {
    ///         println!("{:?}", event.event);
    ///     }
    /// }
    /// # #[allow(unreachable_code)]
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// There is no redundant link; the ACTIVE has the identity of this MainDevice
    /// ([`SameIdentity`](super::SameIdentity)); as [`MainDevice::follow`] and [`MainDevice::bring_up`].
    pub fn join(
        mut self,
        policy: &Policy,
        declare: impl FnOnce(&Scan) -> Declaration,
    ) -> Result<Application<L>, Box<Refused<MainDevice<L>>>> {
        let control = self.role_control();
        let mut joining = Joining::begin(&self, policy);
        let mut application = loop {
            if let Err(error) = self.listen(SLICE) {
                return Err(Box::new(Refused { error, main_device: self }));
            }
            if let Err(error) = self.forwarded().check_identity() {
                return Err(Box::new(Refused { error: error.into(), main_device: self }));
            }
            match joining.next(&mut self) {
                // What the ACTIVE has sent is known, and too old to be followed.
                Next::Listen if self.partner_status().is_known => self.attend(SLICE),
                Next::Listen => {}
                Next::Follow => break self.follow(declare)?,
                Next::BecomeActive if !self.become_active() => {
                    joining = Joining::on(&self.links, control.clone(), policy);
                }
                Next::BecomeActive => match self.scan_for_operation() {
                    Ok(scan) => break self.activate(declare(&scan))?,
                    Err(Error::Scan(ScanError::RoleChanged)) => {
                        joining = Joining::on(&self.links, control.clone(), policy);
                    }
                    Err(error) => return Err(Box::new(Refused { error, main_device: self })),
                },
            }
        };
        application.set_policy(Some(Policy { takes_over: !control.is_held(), ..*policy }));
        Ok(application)
    }
}
