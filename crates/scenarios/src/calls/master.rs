//! The life of a master handle: request, activate, deactivate, release, and the end of a program without release.

use std::collections::VecDeque;
use std::fmt::Display;
use std::time::Duration;

use ringcat::{
    AlState, ClockDatagrams, Error, Event, Instant, LastOutputs, MainDevicePhase, Options, RegisterRequest, Retries,
    SdoRequest, Services, SoeRequest, StateScope, VoeHandler,
};
use ringcat_sim::network::Network;

use super::errno::Errno;
use super::faults::Faults;
use super::plan::Plan;
use super::side::Side;
use super::witness::{Witness, describe};

/// Longest time of a request.
const REQUEST: Duration = Duration::from_secs(3);
/// Longest time of a request until a scan has found something.
const FIRST_SCAN: Duration = Duration::from_millis(300);
/// Step in which a request looks again.
const LOOK: Duration = Duration::from_millis(10);
/// Longest deactivation, without the last cycles.
pub const DEACTIVATION: Duration = Duration::from_millis(300);
/// The last cycles of an application, and a round trip.
const LAST_CYCLES: Duration = Duration::from_millis(30);
/// A base as programs have it that add times in u64 without a check.
const MONOTONIC: u64 = 17_500_062_439_605_732_825;
/// Time in which frames have left the wire.
const ON_THE_WIRE: Duration = Duration::from_millis(1);
/// Lines of the log that a failure prints.
const LOGGED: usize = 200;

/// Requests that belong to the configuration.
#[derive(Debug, Default)]
pub struct Requests {
    /// Requests for objects.
    pub sdo: Vec<SdoRequest>,
    /// Requests for registers.
    pub register: Vec<RegisterRequest>,
    /// Requests for IDNs.
    pub soe: Vec<SoeRequest>,
    /// Vendor messages.
    pub voe: Vec<VoeHandler>,
}

/// A master as `ecrt.h` has it, on a simulated segment.
#[derive(Debug)]
pub struct Ecrt {
    /// The MainDevice.
    pub side: Side,
    options: Options,
    is_reserved: bool,
    /// What was configured.
    pub plan: Plan,
    /// Requests of the configuration.
    pub requests: Requests,
    /// Faults that last.
    pub faults: Faults,
    /// The checker.
    pub witness: Witness,
    /// SYNC pulses may come until all SubDevices were idle again.
    pub pulses_may_come: bool,
    /// The application's time when the host's is zero.
    pub clock_base: u64,
    log: VecDeque<String>,
    /// Events since it was emptied last, for scenarios that check them.
    pub events: Option<Vec<Event>>,
}

impl Drop for Ecrt {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.log.iter().for_each(|line| println!("{line}"));
        }
    }
}

impl Ecrt {
    /// The master of a segment, without a reservation.
    pub fn new(network: Network) -> Ecrt {
        let options = Options::default().with_idle_operation(true).with_retries(Retries::OnRequest);
        Ecrt {
            side: Side::begin(network, &options),
            options,
            is_reserved: false,
            plan: Plan::default(),
            requests: Requests::default(),
            faults: Faults::default(),
            witness: Witness::default(),
            pulses_may_come: false,
            clock_base: MONOTONIC,
            log: VecDeque::new(),
            events: None,
        }
    }

    /// Writes a line that a failure prints.
    pub fn note(&mut self, what: impl Display) {
        if self.log.len() == LOGGED {
            self.log.pop_front();
        }
        self.log.push_back(format!("{:>12} us: {what}", self.side.now().0 / 1_000));
    }

    /// Forgets the lines so far, before memory is measured.
    pub fn forget_log(&mut self) {
        self.log = VecDeque::new();
    }

    /// Host time.
    pub fn now(&self) -> Instant {
        self.side.now()
    }

    /// The segment.
    pub fn network(&mut self) -> &mut Network {
        self.side.links_mut().network_mut()
    }

    /// Whether an application is active.
    pub fn is_active(&self) -> bool {
        self.side.is_active()
    }

    /// Time passes without a call.
    pub fn pause(&mut self, time: Duration) {
        self.side.pass(time);
        self.look();
    }

    /// Looks into the SubDevices, and takes the events.
    pub fn look(&mut self) {
        while let Some(event) = self.side.pop_event() {
            self.note(format!("  {:?}", event.event));
            self.events.iter_mut().for_each(|events| events.push(event.event.clone()));
        }
        let may_come = self.pulses_may_come;
        let network = self.side.links_mut().network();
        self.witness.look(network, may_come);
    }

    /// Runs a call that must not wait.
    pub(super) fn at_once<T>(&mut self, what: &str, call: impl FnOnce(&mut Ecrt) -> T) -> T {
        let begun = self.now();
        let result = call(self);
        assert_eq!(self.now(), begun, "{what} waits");
        self.look();
        result
    }

    /// Runs a call that may wait this long.
    pub(super) fn within<T>(&mut self, limit: Duration, what: &str, call: impl FnOnce(&mut Ecrt) -> T) -> T {
        let begun = self.now();
        let result = call(self);
        let time = self.now().since(begun);
        assert!(time <= limit, "{what} took {time:?} of {limit:?}");
        self.look();
        result
    }

    /// `ecrt_request_master`: reserves, waits for the scan, and requests PREOP of all SubDevices.
    ///
    /// # Errors
    /// [`Errno::Busy`]: it is reserved.
    pub fn request(&mut self) -> Result<(), Errno> {
        self.note("request");
        if self.is_reserved {
            return Err(Errno::Busy);
        }
        self.is_reserved = true;
        self.plan = Plan::default();
        self.within(REQUEST + FIRST_SCAN + LOOK, "request", |own| {
            let end = own.now() + FIRST_SCAN;
            let Some(main_device) = own.side.main_device() else { return };
            main_device.attend(Duration::from_micros(100));
            while main_device.subdevices().is_empty()
                && main_device.engine().phase() != MainDevicePhase::Orphaned
                && main_device.now() < end
            {
                main_device.attend(LOOK);
            }
            let asked = main_device.request_state_of_all(AlState::PreOp, StateScope::All, REQUEST);
            if let Err(error) = asked {
                own.note(format!("  not all in PREOP: {error}"));
            }
        });
        Ok(())
    }

    /// Whether the master is reserved.
    pub fn is_reserved(&self) -> bool {
        self.is_reserved
    }

    /// `ecrt_master_activate`. A second one is a warning.
    ///
    /// # Errors
    /// [`Errno::NoDev`]: not reserved. [`Errno::Inval`]: the configuration does not fit.
    pub fn activate(&mut self) -> Result<(), Errno> {
        self.note("activate");
        if !self.is_reserved {
            return Err(Errno::NoDev);
        }
        self.at_once("activate", |own| {
            let declaration = own.plan.complete();
            let main_device = match std::mem::replace(&mut own.side, Side::Changing) {
                Side::Idle(main_device) => *main_device,
                active => {
                    own.side = active;
                    return Ok(());
                }
            };
            match main_device.activate(declaration) {
                Ok(application) => {
                    own.side = Side::Active(Box::new(application));
                    own.begin();
                    Ok(())
                }
                Err(refused) => {
                    own.side = Side::Idle(Box::new(refused.main_device));
                    own.note(format!("  refused: {}", refused.error));
                    Err(Errno::Inval)
                }
            }
        })
    }

    fn begin(&mut self) {
        let (given, now) = (self.plan.application_time, self.now());
        let first = self.plan.first_application_time;
        self.witness.begin();
        self.pulses_may_come = true;
        let Some(application) = self.side.application() else { return };
        let exchange = application.exchange_mut();
        exchange.set_clock_datagrams(ClockDatagrams::Called);
        if let Some((time, at)) = first {
            exchange.set_first_application_time(time, Instant(at));
        }
        if let Some((time, at)) = given {
            exchange.set_application_time(time.wrapping_add(now.0.wrapping_sub(at)), now);
        }
    }

    /// `ecrt_master_deactivate`: all handles and data pointers of the configuration die.
    ///
    /// # Errors
    /// [`Errno::Inval`]: not active. [`Errno::Io`]: a SubDevice did not follow.
    pub fn deactivate(&mut self) -> Result<(), Errno> {
        self.deactivate_with(LastOutputs::Zero)
    }

    /// As [`Ecrt::deactivate`], with these last outputs.
    ///
    /// # Errors
    /// As [`Ecrt::deactivate`].
    pub fn deactivate_with(&mut self, outputs: LastOutputs) -> Result<(), Errno> {
        self.note("deactivate");
        if !self.is_active() {
            return Err(Errno::Inval);
        }
        if outputs == LastOutputs::Held {
            self.witness.queue();
        }
        self.requests = Requests::default();
        self.plan = Plan::default();
        self.within(DEACTIVATION + LAST_CYCLES, "deactivate", |own| {
            let application = match std::mem::replace(&mut own.side, Side::Changing) {
                Side::Active(application) => *application,
                other => {
                    own.side = other;
                    return Err(Errno::Inval);
                }
            };
            let (side, result) = match application.deactivate(outputs, DEACTIVATION) {
                Ok(main_device) => (main_device, Ok(())),
                Err(refused) => (refused.main_device, Err(refused.error)),
            };
            own.side = Side::Idle(Box::new(side));
            // Outputs of the last cycles are seen as those of the application.
            own.look();
            own.witness.end();
            result.map_err(|error| own.failed(&error))
        })
    }

    fn failed(&mut self, error: &Error) -> Errno {
        self.note(format!("  {error}"));
        assert!(matches!(error, Error::Stop(_)), "a deactivation fails because of SubDevices only: {error}");
        Errno::Io(None)
    }

    /// `ecrt_release_master`.
    pub fn release(&mut self) {
        self.note("release");
        if self.is_active() {
            let _ = self.deactivate();
        }
        self.requests = Requests::default();
        self.plan = Plan::default();
        self.is_reserved = false;
    }

    /// The program ends without a release, and another one begins on the segment as it is.
    pub fn killed(&mut self) {
        self.note("killed");
        let mut network = self.side.links_mut().take_network();
        // Frames that are on the wire reach the SubDevices.
        network.advance_by(ON_THE_WIRE);
        let may_come = self.pulses_may_come;
        self.witness.look(&network, may_come);
        self.requests = Requests::default();
        self.plan = Plan::default();
        self.is_reserved = false;
        self.witness.end();
        self.side = Side::begin(network, &self.options);
        self.look();
    }

    /// `ecrt_master_reset`: failed configurations are tried again.
    pub fn reset(&mut self) {
        self.note("reset");
        match &mut self.side {
            Side::Idle(main_device) => {
                Services::retry(&mut **main_device, None);
            }
            Side::Active(application) => Services::create_retry_request(&mut **application).start(),
            Side::Changing => {}
        }
    }

    /// States of all devices, as text.
    pub fn describe(&mut self) -> String {
        describe(self.side.links_mut().network())
    }
}
