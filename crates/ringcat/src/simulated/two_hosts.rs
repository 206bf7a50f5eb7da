//! Two MainDevices on one simulated segment, in virtual time.
//!
//! Each of them is a program: any code that uses [`HostLinks`], in a thread of its own. Only one of the programs or the
//! caller runs at a time, and time passes only while all of them wait, so a run depends on nothing but its inputs: the
//! same programs, faults and seed give the same frames at the same times. A program that has received a frame reacts to
//! it after a turn-around time; sending a frame takes a microsecond.
//!
//! Hosts fail as real ones do: a program is killed in the middle of what it does, it hangs and goes on, a host loses
//! its power. A guard takes the links of a host down whose program does not run any more.
//!
//! ```
//! # use std::time::Duration;
//! use ringcat::simulated::two_hosts::TwoHosts;
//! use ringcat::standby::StoreAndForward;
//! use ringcat::{Links, MainDevice, Options};
//! use ringcat::sim::{cable::Host, catalogue, device::Device, network::builder::SegmentBuilder};
//!
//! let devices = vec![Device::new(catalogue::by_name("coupler").unwrap())];
//! let mut hosts = TwoHosts::new(SegmentBuilder::ring_of_two(devices, Host::First).build()?);
//! hosts.start(Host::Second, |mut links| {
//!     let mut standby = StoreAndForward::new(links.addresses()).unwrap();
//!     loop {
//!         links.wait(links.now() + Duration::from_millis(1));
//!         standby.forward(&mut links);
//!     }
//! })?;
//! hosts.start(Host::First, |links| {
//!     let scan = MainDevice::request(links, &Options::default()).scan().unwrap();
//!     assert_eq!(scan.subdevices.len(), 1);
//! })?;
//! hosts.run_for(Duration::from_millis(100));
//! assert!(hosts.has_ended(Host::First));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod links;
mod state;

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

use ringcat_engine::time::Instant;
use ringcat_sim::cable::Host;
use ringcat_sim::fault::Fault;
use ringcat_sim::host::program::TurnAround;
use ringcat_sim::network::Network;
use ringcat_sim::time::SimTime;

pub use links::HostLinks;
use links::Killed;
use state::{Guard, Program, Shared, Turn};

/// Stack of a program.
const STACK: usize = 2 << 20;

/// Two MainDevices on one simulated segment.
#[derive(Debug)]
pub struct TwoHosts {
    shared: Arc<Shared>,
    threads: [Option<JoinHandle<()>>; 2],
}

impl TwoHosts {
    /// Two hosts without programs.
    pub fn new(network: Network) -> TwoHosts {
        TwoHosts { shared: Arc::new(Shared::new(network)), threads: [None, None] }
    }

    /// Starts a program on a host, when the caller lets time pass next. One that runs there is killed.
    ///
    /// # Errors
    /// The system cannot start a thread.
    pub fn start(&mut self, host: Host, program: impl FnOnce(HostLinks) + Send + 'static) -> std::io::Result<()> {
        self.kill(host);
        let mut state = self.shared.lock();
        let now = state.network.now();
        state.slot(host).program = Program::Sleeps(now);
        drop(state);
        let shared = self.shared.clone();
        let body = move || {
            let links = HostLinks::new(shared.clone(), host);
            let run = || {
                links.begin();
                program(links);
            };
            let ended = catch_unwind(AssertUnwindSafe(run));
            let mut state = shared.lock();
            state.end(host, ended.err().filter(|payload| !payload.is::<Killed>()));
            let next = state.proceed();
            shared.give(&mut state, next);
        };
        let name = format!("{host:?} MainDevice");
        let thread = std::thread::Builder::new().name(name).stack_size(STACK).spawn(body);
        match thread {
            Ok(thread) => self.threads[host as usize] = Some(thread),
            Err(error) => {
                self.shared.lock().slot(host).program = Program::None;
                return Err(error);
            }
        }
        Ok(())
    }

    /// The time.
    pub fn now(&self) -> Instant {
        Instant(self.shared.lock().network.now().0)
    }

    /// Lets the programs run until this time.
    ///
    /// # Panics
    /// With the panic of a program.
    pub fn run_until(&mut self, at: Instant) {
        let mut state = self.shared.lock();
        state.caller_until = SimTime(at.0);
        let mut state = self.shared.take_turns(state, Turn::Caller);
        let panic = Host::ALL.into_iter().find_map(|host| state.slot(host).panic.take());
        drop(state);
        if let Some(payload) = panic {
            resume_unwind(payload);
        }
    }

    /// Lets the programs run for this time.
    ///
    /// # Panics
    /// With the panic of a program.
    pub fn run_for(&mut self, time: Duration) {
        self.run_until(self.now() + time);
    }

    /// Whether a host has no program, or its program has ended.
    pub fn has_ended(&self, host: Host) -> bool {
        self.shared.lock().slot(host).program == Program::None
    }

    /// Ends the program of a host where it is, as SIGKILL does: nothing of it leaves any more. Its interfaces stay up.
    pub fn kill(&mut self, host: Host) {
        let mut state = self.shared.lock();
        if state.slot(host).program != Program::None {
            state.slot(host).is_killed = true;
            state.caller_until = state.network.now();
            drop(self.shared.take_turns(state, Turn::Caller));
        } else {
            drop(state);
        }
        if let Some(thread) = self.threads[host as usize].take() {
            // The state has its panic.
            let _ = thread.join();
        }
    }

    /// Gives access to the segment, to read from it or to inject faults, those of hosts too. Time passes only in
    /// [`TwoHosts::run_until`].
    pub fn with_network<R>(&self, look: impl FnOnce(&mut Network) -> R) -> R {
        look(&mut self.shared.lock().network)
    }

    /// A fault, now.
    pub fn apply(&mut self, fault: Fault) {
        self.with_network(|network| network.apply(fault));
        // A host without power has no program.
        self.run_for(Duration::ZERO);
    }

    /// A fault, after a time.
    pub fn apply_in(&mut self, time: Duration, fault: Fault) {
        self.with_network(|network| {
            let at = network.now() + time;
            network.schedule(at, fault);
        });
    }

    /// A guard takes the links of a host down when its program has not run for this time: it has ended, or hangs.
    /// What the program sends then does not leave. Also where the guard has acted before.
    pub fn guard(&mut self, host: Host, limit: Duration) {
        self.shared.lock().slot(host).guard = Guard::Armed(limit);
    }

    /// Whether the guard of a host has acted.
    pub fn guard_has_acted(&self, host: Host) -> bool {
        self.shared.lock().slot(host).guard == Guard::HasActed
    }

    /// No guard watches the host any more.
    pub fn dismiss_guard(&mut self, host: Host) {
        self.shared.lock().slot(host).guard = Guard::None;
    }

    /// Sets how long the program of a host takes to react to a frame.
    pub fn set_turn_around(&mut self, host: Host, turn_around: TurnAround) {
        self.shared.lock().slot(host).turn_around.set(turn_around);
    }

    /// Frames that a program did not take in time, and that were lost.
    pub fn overruns(&self, host: Host) -> u64 {
        self.shared.lock().slot(host).overruns
    }
}

impl Drop for TwoHosts {
    fn drop(&mut self) {
        Host::ALL.into_iter().for_each(|host| self.kill(host));
    }
}
