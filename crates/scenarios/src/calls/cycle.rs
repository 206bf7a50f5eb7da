//! The calls of a cycle, each alone, and the loop that most programs have.

use std::time::Duration;

use ringcat::{DomainId, DomainStatus, Services, SubDeviceId};
use ringcat::{SegmentStatus, SubDeviceStatus};

use super::errno::Errno;
use super::master::Ecrt;

/// Period of the usual loop.
pub const PERIOD: Duration = Duration::from_millis(1);
/// Time in which frames are back.
const BACK: Duration = Duration::from_micros(400);

impl Ecrt {
    /// `ecrt_master_receive`.
    pub fn receive(&mut self) {
        self.at_once("receive", |own| {
            if let Some(application) = own.side.application() {
                application.receive();
            }
        });
    }

    /// `ecrt_master_send`.
    pub fn send(&mut self) {
        self.at_once("send", |own| {
            if let Some(application) = own.side.application() {
                application.send();
            }
        });
    }

    /// `ecrt_domain_process`, and `ecrt_domain_state`; `None` without an activation.
    pub fn process(&mut self, domain: DomainId) -> Option<DomainStatus> {
        self.at_once("process", |own| Some(own.side.application()?.process(domain)))
    }

    /// `ecrt_domain_queue`; false while its frames are on the wire.
    pub fn queue(&mut self, domain: DomainId) -> bool {
        self.at_once("queue", |own| {
            let Some(application) = own.side.application() else { return false };
            let is_queued = application.queue(domain);
            if is_queued {
                own.witness.queue();
            }
            is_queued
        })
    }

    /// Fills all outputs with the next number.
    pub fn write(&mut self) {
        let Some(application) = self.side.application() else { return };
        let byte = self.witness.write();
        application.process_data().fill_outputs(byte);
    }

    /// `ecrt_domain_data`: the image; `None` without an activation, or where it is empty.
    pub fn data(&mut self, domain: DomainId) -> Option<&mut [u8]> {
        let image = self.side.application()?.exchange_mut().image_mut(domain);
        (!image.is_empty()).then_some(image)
    }

    /// Number of domains.
    pub fn domains(&mut self) -> usize {
        match self.side.application() {
            Some(application) => application.exchange().domain_count(),
            None => self.plan.declaration.domains.len(),
        }
    }

    /// `ecrt_master_application_time`.
    pub fn application_time(&mut self, time: u64) {
        let now = self.now();
        match self.side.application() {
            Some(application) => application.exchange_mut().set_application_time(time, now),
            None => {
                self.plan.application_time = Some((time, now.0));
                let first = self.plan.first_application_time.or(self.plan.application_time);
                self.plan.first_application_time = first.filter(|(time, _)| *time != 0);
            }
        }
    }

    /// `ecrt_master_sync_reference_clock`.
    ///
    /// # Errors
    /// [`Errno::NxIo`]: no clocks are set up.
    pub fn sync_reference_clock(&mut self) -> Result<(), Errno> {
        let now = self.now();
        self.clocks()?.sync_reference(now);
        Ok(())
    }

    /// `ecrt_master_sync_reference_clock_to`.
    ///
    /// # Errors
    /// As [`Ecrt::sync_reference_clock`].
    pub fn sync_reference_clock_to(&mut self, time: u64) -> Result<(), Errno> {
        self.clocks()?.sync_reference_to(time);
        Ok(())
    }

    /// `ecrt_master_sync_slave_clocks`.
    ///
    /// # Errors
    /// As [`Ecrt::sync_reference_clock`].
    pub fn sync_slave_clocks(&mut self) -> Result<(), Errno> {
        self.clocks()?.sync_clocks();
        Ok(())
    }

    /// `ecrt_master_sync_monitor_queue`.
    ///
    /// # Errors
    /// As [`Ecrt::sync_reference_clock`].
    pub fn sync_monitor_queue(&mut self) -> Result<(), Errno> {
        self.clocks()?.monitor_clocks();
        Ok(())
    }

    /// `ecrt_master_sync_monitor_process`.
    pub fn sync_monitor_process(&mut self) -> u32 {
        self.side.application().and_then(|it| it.exchange().clock_spread_ns()).unwrap_or(u32::MAX)
    }

    /// `ecrt_master_reference_clock_time`.
    ///
    /// # Errors
    /// [`Errno::NxIo`]: no clocks. [`Errno::Io`]: it was not read.
    pub fn reference_clock_time(&mut self) -> Result<u32, Errno> {
        self.clocks()?.reference_time().map(|read| read.time as u32).ok_or(Errno::Io(None))
    }

    fn clocks(&mut self) -> Result<&mut ringcat::Exchange, Errno> {
        let has_clocks = self.plan.clocks;
        let application = self.side.application().ok_or(Errno::NxIo)?;
        if has_clocks && !application.clocks().is_empty() {
            return Ok(application.exchange_mut());
        }
        Err(Errno::NxIo)
    }

    /// `ecrt_master_state`: without an activation as the last broadcast shows it.
    pub fn master_state(&mut self) -> SegmentStatus {
        match self.side.application() {
            Some(application) => Services::live_status(application).segment(),
            None => self.side.engine().live_status().segment(),
        }
    }

    /// `ecrt_slave_config_state`.
    pub fn slave_config_state(&mut self, config: SubDeviceId) -> Option<SubDeviceStatus> {
        let application = self.side.application()?;
        Services::live_status(application).subdevice(config)
    }

    /// One cycle of the usual loop: receive, process, write, queue, send, sleep.
    pub fn cycle(&mut self) {
        self.receive();
        let domains = self.domains();
        for domain in 0..domains {
            self.process(DomainId(domain));
        }
        self.write();
        for domain in 0..domains {
            self.queue(DomainId(domain));
        }
        if self.plan.clocks && self.is_active() {
            let time = self.application_clock();
            self.application_time(time);
            let _ = self.sync_reference_clock();
            let _ = self.sync_slave_clocks();
        }
        self.send();
        self.pause(BACK);
        self.receive();
        self.pause(PERIOD - BACK);
    }

    /// The time that this program gives: the host's and a base.
    pub fn application_clock(&self) -> u64 {
        self.now().0.wrapping_add(self.clock_base)
    }

    /// Some cycles of the usual loop.
    pub fn cycles(&mut self, count: usize) {
        (0..count).for_each(|_| self.cycle());
    }

    /// Some cycles of a loop that exchanges no process data and sets no application time.
    pub fn cycles_without_time(&mut self, count: usize) {
        for _ in 0..count {
            self.receive();
            self.send();
            self.pause(PERIOD);
        }
    }

    /// Runs the usual loop until all configured SubDevices are in OP and all domains are complete.
    ///
    /// # Errors
    /// What is missing at the limit.
    pub fn cycle_until_op(&mut self, limit: Duration) -> Result<Duration, String> {
        let begun = self.now();
        while !self.is_running() {
            if self.now().since(begun) >= limit {
                let states = self.side.application().map(|it| it.states());
                return Err(format!("not in OP within {limit:?}: {states:?}; {}", self.describe()));
            }
            self.cycle();
        }
        Ok(self.now().since(begun))
    }

    /// All configured SubDevices are in OP, and all domains with process data were complete.
    pub fn is_running(&mut self) -> bool {
        let Some(application) = self.side.application() else { return false };
        let exchange = application.exchange();
        let mut states = (0..exchange.domain_count()).filter_map(|domain| exchange.status(DomainId(domain)));
        application.all_settled()
            && states.all(|status| status.expected == 0 || status.state == ringcat::DomainState::Complete)
    }
}
