//! The parts of a cycle with a probe, for an application with its own loop.

use std::time::Duration;

use ringcat_engine::domain::{DomainId, DomainStatus};
use ringcat_engine::time::Instant;

use crate::acyclic::AcyclicHalf;
use crate::application::Application;
use crate::links::Links;
use crate::probe::{CycleJob, CycleProbe, JobTimer};

/// The parts of a cycle, each with its time for the probe. A cycle ends with [`ProbedParts::send`].
#[derive(Debug)]
pub struct ProbedParts<'a, L, H, P> {
    application: &'a mut Application<L, H>,
    probe: &'a mut P,
}

impl<L: Links, H: AcyclicHalf> Application<L, H> {
    /// The parts of a cycle with a probe.
    ///
    /// ```
    /// use ringcat::{AcyclicHalf, Application, DomainId, JobProbe, Links};
    ///
    /// fn cycle<L: Links, H: AcyclicHalf>(application: &mut Application<L, H>, probe: &mut JobProbe) {
    ///     let mut parts = application.probed(probe);
    ///     parts.receive();
    ///     parts.process(DomainId(0));
    ///     parts.queue(DomainId(0));
    ///     parts.send();
    /// }
    /// ```
    pub fn probed<'a, P: CycleProbe>(&'a mut self, probe: &'a mut P) -> ProbedParts<'a, L, H, P> {
        ProbedParts { application: self, probe }
    }

    /// Receives until the last frame of the oldest cycle under way is in, so that its domains can be evaluated, or
    /// until a time; whether the frames are in. It waits as the links wait. With nothing under way it returns at once.
    /// Lost frames are sent again meanwhile where the declaration allows it.
    pub fn receive_until(&mut self, until: Instant) -> bool {
        self.probed(&mut ()).receive_until(until)
    }

    /// Sets the expected time from one [`Application::send`] to the next, for an application with its own loop. Frames
    /// that are sent again must be back before the next send, and the acyclic half keeps the wire free for it. Without
    /// this it is the shortest period of the domains, or 1 ms if none has a period. Longer times than 1 s count as
    /// 1 s.
    pub fn expect_sends_every(&mut self, period: Duration) {
        self.cyclic.expect_sends_every(period);
    }

    /// Whether the acyclic half requests an empty wire now, to measure the delays of clocks
    /// ([`ClockConfig::pauses`](crate::ClockConfig)): the application then leaves out [`Application::send`] in this
    /// cycle. For an application with its own loop, whose frames are on the wire until it receives again.
    pub fn pauses(&mut self) -> bool {
        let until = self.cyclic.exchange.pause_until();
        let pauses = self.links.now() < until;
        if pauses {
            self.window.expect_cycle(until);
        }
        pauses
    }
}

impl<L: Links, H: AcyclicHalf, P: CycleProbe> ProbedParts<'_, L, H, P> {
    /// As [`Application::receive`].
    pub fn receive(&mut self) {
        self.application.receive_probed(self.probe);
    }

    /// As [`Application::receive_until`].
    pub fn receive_until(&mut self, until: Instant) -> bool {
        loop {
            self.receive();
            if !self.application.cyclic.exchange.awaits_frames() {
                return true;
            }
            let now = self.application.now();
            if now >= until {
                return false;
            }
            let Application { links, acyclic, cyclic, .. } = &mut *self.application;
            let wake = until.min(acyclic.wake()).min(cyclic.exchange.decide_at());
            links.wait_from(now, wake.max(now));
        }
    }

    /// As [`Application::process`].
    pub fn process(&mut self, domain: DomainId) -> DomainStatus {
        self.timed(CycleJob::Process, |application| application.process(domain))
    }

    /// As [`Application::queue`].
    pub fn queue(&mut self, domain: DomainId) -> bool {
        self.timed(CycleJob::Queue, |application| application.queue(domain))
    }

    /// As [`Application::send`].
    pub fn send(&mut self) {
        self.timed(CycleJob::Send, Application::send);
        if P::TIMES_JOBS {
            self.probe.cycle_ended();
        }
    }

    /// Runs the work of the application, and takes its time.
    pub fn work<R>(&mut self, work: impl FnOnce(&mut Application<L, H>) -> R) -> R {
        self.timed(CycleJob::Work, work)
    }

    fn timed<R>(&mut self, job: CycleJob, run: impl FnOnce(&mut Application<L, H>) -> R) -> R {
        let mut timer = JobTimer::begin::<P>(|| self.application.now());
        let result = run(self.application);
        timer.done(self.probe, job, || self.application.now());
        result
    }
}
