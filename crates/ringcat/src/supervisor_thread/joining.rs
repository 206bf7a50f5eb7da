//! As `standby::joining`, with the acyclic half in a thread of its own: the calling thread forwards on the links of the
//! cyclic half until there is an application.

use std::time::Duration;

use ringcat_engine::main_device::{ActivateError, Active, Declaration, Listener, MainDevice as Engine, MainDeviceRole};
use ringcat_engine::role::{Requester, RoleControl, RoleRequest};
use ringcat_engine::{Scan, ScanError};

use super::{Activated, Ended, SupervisorThread};
use crate::application::Application;
use crate::error::Error;
use crate::job::Job;
use crate::links::Links;
use crate::main_device::Refused;
use crate::of_two::OfTwo;
use crate::standby::{Joining, NeedsTwoLinks, Next, Policy};

/// Longest wait for a frame before it is decided again what follows.
const SLICE: Duration = Duration::from_millis(1);

/// What follows the ACTIVE, or why not; `None` if not all is known any more.
type Followed = Option<Result<Active, ActivateError>>;

/// Listens on the links of the cyclic half.
struct Listening<C> {
    supervisor: SupervisorThread,
    links: C,
    of_two: OfTwo,
    listener: Listener,
}

/// In a ring of two MainDevices ([`Options::standby`](crate::Options::standby)).
impl SupervisorThread {
    /// The role, and requests for another one, for any thread.
    ///
    /// # Errors
    /// The thread has ended.
    pub fn role_control(&self) -> Result<RoleControl, Error> {
        self.act(|engine| engine.role_control())
    }

    /// Takes the role that is free, as [`MainDevice::join`](crate::MainDevice::join). Cycles use `links`, on which the
    /// calling thread forwards meanwhile, also while the application that follows is prepared.
    ///
    /// # Errors
    /// As [`MainDevice::join`](crate::MainDevice::join). The error contains the handle and the links for another
    /// attempt.
    pub fn join<C: Links>(
        self,
        policy: &Policy,
        declare: impl Fn(&Scan) -> Declaration + Clone + Send + 'static,
        links: C,
    ) -> Activated<C> {
        let has_ring = links.addresses().redundant.is_some();
        let listener = self.act(|engine| engine.split_listener()).map(|it| it.filter(|_| has_ring));
        let listener = match listener {
            Ok(Some(listener)) => listener,
            other => {
                let error = other.err().unwrap_or(NeedsTwoLinks.into());
                return Err(Box::new(Refused { error, main_device: Ended { supervisor: self, links } }));
            }
        };
        let of_two = OfTwo::new(&links, None);
        let control = listener.role_control();
        control.begin_held(!policy.takes_over);
        let mut application = Listening { supervisor: self, links, of_two, listener }.join(policy, declare)?;
        application.set_policy(Some(Policy { takes_over: !control.is_held(), ..*policy }));
        Ok(application)
    }

    /// Prepares an application that follows the ACTIVE.
    fn start_following(&self, declare: impl FnOnce(&Scan) -> Declaration + Send + 'static) -> Job<Followed> {
        let (published, mut declare) = (self.0.published.clone(), Some(declare));
        self.ask(move |engine: &mut Engine| {
            let declare = declare.take()?;
            let known = engine.partner_knowledge().zip(engine.partner_configuration()).zip(engine.partner_scan());
            let followed =
                known.map(|((knowledge, (session, _)), scan)| engine.follow(declare(&scan), knowledge, session));
            published.states_of(engine);
            Some(followed)
        })
    }

    /// Becomes ACTIVE without an application; false as with
    /// [`MainDevice::become_active`](crate::MainDevice::become_active).
    fn become_active(&self) -> Result<bool, Error> {
        self.act(|engine| {
            // Otherwise the other request takes effect.
            let _ = engine.role_control().request_as(RoleRequest::Active, Requester::Policy);
            engine.poll(engine.bus().now());
            engine.role() == MainDeviceRole::Active
        })
    }
}

impl<C: Links> Listening<C> {
    fn join(
        mut self,
        policy: &Policy,
        declare: impl Fn(&Scan) -> Declaration + Clone + Send + 'static,
    ) -> Activated<C> {
        let control = self.listener.role_control();
        let mut joining = Joining::on(&self.links, control.clone(), policy);
        loop {
            self.forward();
            if let Err(error) = self.of_two.counters().check_identity() {
                return Err(self.refused(error.into()));
            }
            let has_link = self.supervisor.ring_status().links.iter().any(|link| link.carrier != Some(false));
            let (partner, now) = (self.listener.partner_status(), self.links.now());
            if let Some(event) = joining.look_out(&partner, now) {
                // It does not wait: frames have to be forwarded.
                let _ = self.supervisor.begin(move |engine, _| {
                    engine.report_standby(event.event(|_| String::new()), now);
                    Box::new(|_, _| true)
                });
            }
            match joining.decide(&partner, has_link, now) {
                Next::Listen => {}
                Next::Follow => match self.follow(declare.clone()) {
                    Ok(Some(active)) => return Ok(self.run(active)),
                    Ok(None) => {}
                    Err(error) => return Err(self.refused(error)),
                },
                Next::BecomeActive => {
                    let scan = self.supervisor.become_active().and_then(|is_active| match is_active {
                        true => self.supervisor.scan_for_operation().map(Some),
                        false => Ok(None),
                    });
                    match scan {
                        Ok(Some(scan)) => return self.supervisor.activate(declare(&scan), self.links),
                        // Another role was requested, or another MainDevice is ACTIVE as well, and stays ACTIVE.
                        Ok(None) | Err(Error::Scan(ScanError::RoleChanged)) => {
                            joining = Joining::on(&self.links, control.clone(), policy);
                        }
                        Err(error) => return Err(self.refused(error)),
                    }
                }
            }
        }
    }

    /// Waits for frames for a moment, and forwards them.
    fn forward(&mut self) {
        let until = self.links.now() + SLICE;
        self.links.wait(until);
        self.of_two.listen(&mut self.links, &mut self.listener);
    }

    /// Prepares the application, and forwards until it is there. `None` if not all is known any more.
    fn follow(&mut self, declare: impl FnOnce(&Scan) -> Declaration + Send + 'static) -> Result<Option<Active>, Error> {
        let mut followed = self.supervisor.start_following(declare);
        loop {
            if let Some(followed) = followed.take() {
                return Ok(followed?.transpose()?);
            }
            self.forward();
        }
    }

    fn run(self, active: Active) -> Application<C, SupervisorThread> {
        let Listening { supervisor, links, .. } = self;
        let (window, published) = (supervisor.0.window.clone(), supervisor.0.published.clone());
        let application = Application::new(links, supervisor, active, window);
        published.observes(&application.cyclic.observed);
        application
    }

    fn refused(self, error: Error) -> Box<Refused<Ended<C>>> {
        Box::new(Refused { error, main_device: Ended { supervisor: self.supervisor, links: self.links } })
    }
}
