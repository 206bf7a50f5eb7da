//! What an application needs of an acyclic half that runs in a thread of its own.

#[cfg(feature = "standby")]
use std::time::Duration;

use ringcat_engine::AcyclicCounters;
use ringcat_engine::event::TimedEvent;
use ringcat_engine::info::SubDeviceInfo;
use ringcat_engine::link::Link;
use ringcat_engine::main_device::{SubDeviceId, SubDeviceState};
use ringcat_engine::ring_status::RingStatus;
use ringcat_engine::time::Instant;

use super::SupervisorThread;
use crate::acyclic::AcyclicHalf;
use crate::error::Error;
use crate::links::Links;
use crate::not_ready::Reason;
use crate::subdevice::SubDeviceName;
use crate::window::Window;

impl AcyclicHalf for SupervisorThread {
    const SHARES_LINKS: bool = false;

    fn receive(&mut self, _link: Link, _frame: &[u8], _now: Instant) {}

    #[cfg(feature = "standby")]
    fn fill(&mut self, _link: Link, _frame: &mut [u8], _now: Instant) {}

    #[cfg(feature = "standby")]
    fn take_returned(&mut self, _frame: &[u8], _now: Instant) {}

    fn work(&mut self, _links: &mut impl Links, _window: &Window) {}

    fn wake(&self) -> Instant {
        Instant::NEVER
    }

    fn due_at(&mut self, _links: &impl Links) -> Instant {
        Instant::NEVER
    }

    fn known_due_at(&self) -> Instant {
        Instant::NEVER
    }

    #[cfg(feature = "standby")]
    fn report_watchdogs_within(&mut self, gap: Duration, cycle: Duration, now: Instant) {
        // If the thread has ended there is nothing to report.
        let _ = self.begin(move |engine, _| {
            engine.report_watchdogs_within(gap, cycle, now);
            Box::new(|_, _| true)
        });
    }

    #[cfg(feature = "standby")]
    fn watchdogs_within(
        &self,
        gap: Duration,
        cycle: Duration,
    ) -> Result<Vec<(SubDeviceId, Duration, Duration)>, Error> {
        self.act(move |engine| engine.watchdogs_within(gap, cycle))
    }

    fn states(&self) -> Vec<SubDeviceState> {
        SupervisorThread::states(self)
    }

    fn all_settled(&self) -> bool {
        SupervisorThread::all_settled(self)
    }

    fn ring_status(&self) -> RingStatus {
        SupervisorThread::ring_status(self)
    }

    fn pop_event(&mut self, _now: Instant) -> Option<TimedEvent> {
        SupervisorThread::pop_event(self)
    }

    fn counters(&self) -> AcyclicCounters {
        SupervisorThread::counters(self)
    }

    fn sample_each_second(&mut self, take: impl FnMut(Instant, AcyclicCounters) + Send + 'static) {
        // If the thread has ended there is nothing to sample.
        let _ = self.begin(move |engine, _| {
            engine.sample_each_second(take);
            Box::new(|_, _| true)
        });
    }

    fn info(&self, subdevice: SubDeviceId) -> Option<SubDeviceInfo> {
        self.act(move |engine| engine.info(subdevice)).ok().flatten()
    }

    fn keep_events(&mut self, _now: Instant) {}

    fn not_ready(&self) -> Result<Vec<(SubDeviceName, Reason)>, Error> {
        let failures = self.rest().failures;
        self.act(move |engine| failures.explain(engine))
    }
}
