//! Two MainDevices at one simulated ring, in one thread and in virtual time: engines whose frames pass from one to the
//! other through the network, without links and threads.
//!
//! Each [`Controller`] runs as an application would: cycles on its own clock as ACTIVE, in step with the frames that it
//! forwards as INACTIVE. [`Two`] gives them the time, and checks the effects on the SubDevices: which of them leave OP,
//! and whether an output goes back to an older value.

mod controller;
mod ethernet_traffic;

use std::time::Duration;

use ringcat::standby::StandbyEvent;
use ringcat::standby::StandbyOptions;
use ringcat::{Event, Instant, MainDeviceRole, TimedEvent};
use ringcat_sim::cable::{Host, HostLink};
use ringcat_sim::fault::Fault;
use ringcat_sim::network::Network;
use ringcat_sim::time::SimTime;
use ringcat_wire::al::{AlState, AlStatus};

pub use self::controller::{CYCLE, Controller, Declare, Settings};
pub use self::ethernet_traffic::EthernetTraffic;

/// Both, and the network.
pub struct Two {
    /// The ring.
    pub network: Network,
    /// The MainDevices.
    pub controllers: [Controller; 2],
    /// AL status of each device at the last check.
    status: Vec<AlStatus>,
    /// Devices that left OP, and when.
    pub left_op: Vec<(SimTime, usize)>,
    /// The last first byte of outputs of each device that has them.
    outputs: Vec<Option<u8>>,
    /// Outputs that went back: when, the device, from, to.
    pub went_back: Vec<(SimTime, usize, u8, u8)>,
    /// Longest time without a change of the outputs of any device in OP, since [`Two::mark`].
    pub longest_gap: Duration,
    changed_at: Vec<SimTime>,
}

impl Two {
    /// Both without an application, the first one ACTIVE.
    pub fn new(network: Network, declare: Declare, standby: StandbyOptions) -> Two {
        let settings = [Settings { standby, declare }, Settings { standby, declare }];
        Two::with(network, settings)
    }

    /// The same with settings for each.
    pub fn with(network: Network, settings: [Settings; 2]) -> Two {
        let count = network.devices().len();
        let now = Instant(network.now().0);
        let [first, second] = settings;
        let controllers = [Controller::new(Host::First, first, now), Controller::new(Host::Second, second, now)];
        let at = network.now();
        Two {
            status: network.devices().map(|device| device.al_status()).collect(),
            outputs: vec![None; count],
            changed_at: vec![at; count],
            network,
            controllers,
            left_op: Vec::new(),
            went_back: Vec::new(),
            longest_gap: Duration::ZERO,
        }
    }

    /// The first one is ACTIVE with all SubDevices in OP, the second one follows and is ready.
    ///
    /// # Panics
    /// When this takes more than 5 s.
    pub fn in_op(network: Network, declare: Declare, standby: StandbyOptions) -> Two {
        let mut two = Two::new(network, declare, standby);
        two.controllers[0].begin_active();
        two.until(Duration::from_secs(5), "the partner is ready", |two| {
            two.all_in_op() && two.controllers[0].partner().is_ready()
        });
        two
    }

    /// The time.
    pub fn now(&self) -> Instant {
        Instant(self.network.now().0)
    }

    /// Whether all devices are in OP, by their own registers.
    pub fn all_in_op(&self) -> bool {
        self.network.devices().all(|device| device.al_status() == AlStatus::new(AlState::Op))
    }

    /// The one that is ACTIVE, if exactly one is.
    pub fn active(&self) -> Option<usize> {
        let is_active = |it: &Controller| !it.is_dead && it.engine.role() == MainDeviceRole::Active;
        match [is_active(&self.controllers[0]), is_active(&self.controllers[1])] {
            [true, false] => Some(0),
            [false, true] => Some(1),
            _ => None,
        }
    }

    /// Begins to measure gaps and to count anew.
    pub fn mark(&mut self) {
        let now = self.network.now();
        self.changed_at.fill(now);
        self.longest_gap = Duration::ZERO;
        self.left_op.clear();
        self.went_back.clear();
        self.controllers.iter_mut().for_each(|it| it.events.clear());
    }

    /// Runs until a time.
    pub fn run_until(&mut self, end: Instant) {
        while self.now() < end {
            self.step(end);
        }
    }

    /// Runs for a time.
    pub fn run(&mut self, time: Duration) {
        let end = self.now() + time;
        self.run_until(end);
    }

    /// Runs until a condition holds.
    ///
    /// # Panics
    /// When it does not hold within a time.
    pub fn until(&mut self, limit: Duration, what: &str, condition: impl Fn(&Two) -> bool) {
        let end = self.now() + limit;
        while !condition(self) {
            assert!(self.now() < end, "not within {limit:?}: {what}\n{}", self.log());
            self.step(end);
        }
    }

    /// What is due now, and the way to the next moment.
    fn step(&mut self, end: Instant) {
        let Two { network, controllers, .. } = self;
        controllers.iter_mut().for_each(|it| it.work(network));
        let wake = controllers.iter().map(Controller::wakes_at).min().unwrap_or(end).min(end);
        network.advance_until_received(SimTime(wake.0.max(network.now().0)));
        self.look();
    }

    /// Checks the devices.
    fn look(&mut self) {
        let now = self.network.now();
        let op = AlStatus::new(AlState::Op);
        for (number, device) in self.network.devices().enumerate() {
            let status = device.al_status();
            if std::mem::replace(&mut self.status[number], status) == op && status != op {
                self.left_op.push((now, number));
            }
            let Some(value) = device.outputs().first().copied().filter(|_| status == op) else { continue };
            let before = self.outputs[number].replace(value);
            if before == Some(value) {
                continue;
            }
            self.longest_gap = self.longest_gap.max(now - self.changed_at[number]);
            self.changed_at[number] = now;
            // Outputs count up by one each cycle.
            if let Some(before) = before
                && value.wrapping_sub(before) > 0x80
            {
                self.went_back.push((now, number, before, value));
            }
        }
    }

    /// A controller fails: it does nothing any more, and its links go down.
    pub fn kill(&mut self, number: usize) {
        self.controllers[number].is_dead = true;
        self.links_of(number).into_iter().for_each(|link| self.network.disconnect(link, true));
    }

    /// The links of a controller.
    pub fn links_of(&self, number: usize) -> [HostLink; 2] {
        if number == 0 { [HostLink::Main, HostLink::Redundant] } else { HostLink::SECOND }
    }

    /// A controller that has failed begins anew.
    pub fn revive(&mut self, number: usize) {
        let now = self.now();
        self.controllers[number].begin_anew(now);
        self.links_of(number).into_iter().for_each(|link| self.network.disconnect(link, false));
    }

    /// Applies a fault now.
    pub fn fault(&mut self, fault: Fault) {
        self.network.apply(fault);
    }

    /// Events of MainDevice redundancy of a controller since the last mark.
    pub fn standby_events(&self, number: usize) -> Vec<StandbyEvent> {
        let of = |timed: &TimedEvent| match &timed.event {
            Event::Standby(event) => Some(event.clone()),
            _ => None,
        };
        self.controllers[number].events.iter().filter_map(of).collect()
    }

    /// All events as text.
    pub fn log(&self) -> String {
        let mut text = format!("at {}\n", self.network.now());
        for (number, controller) in self.controllers.iter().enumerate() {
            for event in &controller.events {
                text += &format!("{number}: {:>12.3} us  {:?}\n", event.at.0 as f64 / 1e3, event.event);
            }
            text += &format!("{number}: {}, states {:?}\n", controller.engine.role(), controller.engine.states());
        }
        for (number, device) in self.network.devices().enumerate() {
            text += &format!("device {number} ({}): {}\n", device.name(), device.al_status());
        }
        text
    }
}
