//! The application behind a SubDevice controller: the PDI side (protocol 3.4, 5, 6).
//!
//! Input: AL events and virtual time, through [`Application::run`], and faults. Output: AL status, responses in the
//! mailbox, inputs and latched outputs. Parts: [`state_machine`] evaluates state requests, [`settings`] checks the
//! configuration, [`process_data`] moves data, [`mailbox`] passes messages to the [`servers`], one per protocol:
//! [`coe`] with its [`dictionary`], [`foe`], [`eoe`], [`soe`], [`aoe`], [`voe`]. [`behaviours`] and [`servo`] compute
//! inputs, `transitions` changes states. This module combines them.

pub mod answer;
pub mod aoe;
pub mod behaviours;
pub mod coe;
pub mod dictionary;
pub mod eoe;
pub mod foe;
mod mail;
pub mod mailbox;
pub mod mapping;
pub mod process_data;
pub mod servers;
pub mod servo;
pub mod settings;
pub mod soe;
pub mod state_machine;
mod transitions;
pub mod voe;

use ringcat_wire::al::{AlState, AlStatus, AlStatusCode};
use ringcat_wire::register::map;

use crate::controller::Controller;
use crate::description::DeviceDescription;
use crate::time::SimTime;
use dictionary::Dictionary;
use foe::files::FileStore;
use mailbox::Mailbox;
use mailbox::faults::MailFaults;
use process_data::ProcessData;
use servers::Servers;
use settings::Layout;
use state_machine::{Pending, StateMachine};

pub use behaviours::{Behaviour, InputFunction, InputSource};
pub use mailbox::record::ServedMail;

/// AL_EVENT bits (protocol 3.5).
const EVENT_AL_CONTROL: u32 = 1 << 0;
const EVENT_SYNC_MANAGER: u32 = 1 << 4;
const EVENT_WATCHDOG: u32 = 1 << 6;

/// A transition that is refused for a test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Refusal {
    to: AlState,
    code: AlStatusCode,
    times: u32,
}

/// State of the application of one device.
#[derive(Clone, Debug)]
pub struct Application {
    machine: StateMachine,
    dictionary: Dictionary,
    process_data: ProcessData,
    mailbox: Option<Mailbox>,
    servers: Servers,
    /// Next time at which the servers have work without a request.
    servers_due: Option<SimTime>,
    /// Non-volatile data.
    files: FileStore,
    faults: MailFaults,
    layout: Layout,
    /// Served requests, if they are recorded.
    record: Option<Vec<ServedMail>>,
    /// Time at which PREOP was entered.
    preop_since: SimTime,
    refusals: Vec<Refusal>,
    hanging: bool,
    interest: u32,
    polled: bool,
    /// Last AL state seen on a device whose controller emulates the state machine.
    emulated_state: AlState,
    last_run: SimTime,
}

impl Application {
    /// The application of a device before power-on.
    pub fn new(description: &DeviceDescription) -> Application {
        let mut application = Application {
            machine: StateMachine::default(),
            dictionary: Dictionary::new(description),
            process_data: ProcessData::new(&description.behaviour),
            mailbox: None,
            servers: Servers::default(),
            servers_due: None,
            files: FileStore::new(&description.services.foe),
            faults: MailFaults::default(),
            layout: Layout::default(),
            record: None,
            preop_since: SimTime::ZERO,
            refusals: Vec::new(),
            hanging: false,
            interest: 0,
            polled: false,
            emulated_state: AlState::Init,
            last_run: SimTime::ZERO,
        };
        application.watch(description);
        application
    }

    /// Restarts after power-on or a reset of the controller. Faults and the source of the inputs stay.
    pub fn restart(&mut self, description: &DeviceDescription, now: SimTime) {
        self.machine = StateMachine::default();
        self.dictionary = Dictionary::new(description);
        self.process_data.stop(now);
        self.process_data.power_on(now);
        self.mailbox = None;
        self.servers = Servers::default();
        self.servers_due = None;
        self.layout = Layout::default();
        self.emulated_state = AlState::Init;
        self.last_run = now;
        self.watch(description);
    }

    /// The next `times` requests for `to` are refused with `code`.
    pub fn refuse(&mut self, to: AlState, code: AlStatusCode, times: u32) {
        if times == 0 {
            self.refusals.retain(|refusal| refusal.to != to);
            return;
        }
        self.refusals.push(Refusal { to, code, times });
    }

    /// Makes the application hang: it does not react.
    pub fn hang(&mut self, hanging: bool) {
        self.hanging = hanging;
    }

    /// Whether a transition is in progress; a transition out of OP sets the outputs to the safe state at once.
    pub const fn is_changing_state(&self) -> bool {
        self.machine.pending().is_some()
    }

    /// Whether the application hangs.
    pub const fn is_hanging(&self) -> bool {
        self.hanging
    }

    /// The process data.
    pub const fn process_data(&self) -> &ProcessData {
        &self.process_data
    }

    /// The object dictionary.
    pub const fn dictionary(&self) -> &Dictionary {
        &self.dictionary
    }

    /// The files of the device.
    pub const fn files(&self) -> &FileStore {
        &self.files
    }

    /// The protocol servers; without an open mailbox they have no state.
    pub const fn servers(&self) -> &Servers {
        &self.servers
    }

    /// Sets the source of the inputs.
    pub fn set_source(&mut self, source: InputSource, description: &DeviceDescription, controller: &mut Controller) {
        self.process_data.set_source(source, controller, self.last_run);
        self.watch(description);
    }

    /// Changes an object from inside the device.
    pub fn set_object(&mut self, index: u16, sub_index: u8, value: &[u8]) {
        self.dictionary.set(index, sub_index, value);
    }

    /// Whether [`Application::run`] has something to do now.
    pub fn needs_run(&self, events: u32) -> bool {
        !self.hanging && (self.polled || events & self.interest != 0)
    }

    /// Next time at which [`Application::run`] has work without a frame.
    pub fn next_deadline(&self) -> Option<SimTime> {
        if self.hanging {
            return None;
        }
        let due = |pending: Pending| if self.is_waiting(pending) { pending.time_limit } else { pending.at };
        let transition = self.machine.pending().map(due);
        let mail = self.mailbox.as_ref();
        let answer = mail.and_then(Mailbox::next_deadline);
        let full = mail.and(self.faults.full_until());
        let service = mail.and(self.servers_due);
        [transition, answer, full, service].into_iter().flatten().min()
    }

    /// Whether the transition could be completed, but a condition is missing.
    fn is_waiting(&self, pending: Pending) -> bool {
        pending.at <= self.last_run
    }

    /// Reacts to events of the controller.
    pub fn run(&mut self, description: &DeviceDescription, controller: &mut Controller, now: SimTime) {
        if self.hanging || !controller.pdi_operational() {
            return;
        }
        self.last_run = now;
        if description.emulation {
            self.run_emulated(description, controller, now);
        } else {
            self.run_checked(description, controller, now);
        }
        self.watch(description);
    }

    fn run_checked(&mut self, description: &DeviceDescription, controller: &mut Controller, now: SimTime) {
        let events = controller.al_event();
        if self.machine.pending().is_none() {
            if events & EVENT_SYNC_MANAGER != 0 {
                self.sync_managers_changed(description, controller, now);
            }
            if events & EVENT_AL_CONTROL != 0 {
                self.requested(description, controller, now);
            }
        }
        let operating = self.machine.state() == AlState::Op && self.machine.pending().is_none();
        self.process_data.exchange(&self.dictionary, controller, events, operating, now);
        self.check_watchdog(controller, events, now);
        self.run_mailbox(description, controller, events, now);
        if let Some(pending) = self.machine.pending()
            && pending.at <= now
        {
            self.finish(pending, description, controller, now);
        }
    }

    /// A SyncManager was enabled or disabled, or the last answer is requested again (protocol 5.2, 6.2).
    fn sync_managers_changed(&mut self, description: &DeviceDescription, controller: &mut Controller, now: SimTime) {
        let actual = settings::sync_managers(controller, now);
        let state = self.machine.state();
        if let Some(mailbox) = &mut self.mailbox {
            if !settings::mailbox_matches(description, mailbox.layout(), &actual) {
                let code = if state == AlState::Boot {
                    AlStatusCode::INVALID_MAILBOX_CONFIGURATION_BOOT
                } else {
                    AlStatusCode::INVALID_MAILBOX_CONFIGURATION_PREOP
                };
                self.mailbox = None;
                self.process_data.stop(now);
                self.machine.fail(AlState::Init, code);
                self.report(controller, now);
                return;
            }
            mailbox.check_repeat(controller, now);
        }
        if !matches!(state, AlState::SafeOp | AlState::Op) {
            return;
        }
        let ram_kib = controller.config().ram_kib;
        if let Err(code) = settings::process_data(description, &self.dictionary, &actual, ram_kib) {
            self.process_data.stop(now);
            self.machine.fail(AlState::PreOp, code);
            self.report(controller, now);
        }
    }

    fn check_watchdog(&mut self, controller: &mut Controller, events: u32, now: SimTime) {
        if events & EVENT_WATCHDOG == 0 {
            return;
        }
        // Reading the status clears the event.
        settings::read_u16(controller, map::WATCHDOG_STATUS, now);
        let expired = !controller.process_data_watchdog_ok();
        let operating = self.machine.state() == AlState::Op && self.machine.pending().is_none();
        if expired && operating && self.process_data.is_watched() {
            self.process_data.make_safe(controller, now);
            self.machine.fail(AlState::SafeOp, AlStatusCode::SYNC_MANAGER_WATCHDOG);
            self.report(controller, now);
        }
    }

    /// The controller itself copies AL control; only the process data is updated here.
    fn run_emulated(&mut self, description: &DeviceDescription, controller: &mut Controller, now: SimTime) {
        let events = controller.al_event();
        let bytes = controller.register(map::AL_STATUS, AlStatus::LEN);
        let status = bytes.first_chunk().map_or(AlStatus::new(AlState::Init), AlStatus::decode);
        let state = status.al_state().unwrap_or(AlState::Init);
        if state != self.emulated_state || events & EVENT_SYNC_MANAGER != 0 {
            let actual = settings::sync_managers(controller, now);
            let active = matches!(state, AlState::SafeOp | AlState::Op);
            let layout = if active { settings::unchecked(description, &actual) } else { Layout::default() };
            if *self.process_data.layout() != layout {
                self.process_data.start(layout, &self.dictionary, controller, now);
            }
        }
        // Outputs of a SyncManager without watchdog stay valid for any watchdog status.
        let alive = controller.process_data_watchdog_ok() || !self.process_data.is_watched();
        let operating = state == AlState::Op && alive;
        if !operating && self.process_data.outputs().iter().any(|byte| *byte != 0) {
            self.process_data.make_safe(controller, now);
        }
        self.process_data.exchange(&self.dictionary, controller, events, operating, now);
        self.emulated_state = state;
    }

    fn report(&mut self, controller: &mut Controller, now: SimTime) {
        controller.set_al_status(self.machine.status(), self.machine.code(), now);
    }

    /// Sets the mask of the relevant events.
    fn watch(&mut self, description: &DeviceDescription) {
        if description.emulation {
            self.polled = description.has_process_data();
            self.interest = 0;
            return;
        }
        let mut interest = self.process_data.events();
        match self.machine.pending() {
            None => interest |= EVENT_AL_CONTROL | EVENT_SYNC_MANAGER | EVENT_WATCHDOG,
            Some(pending) if self.is_waiting(pending) => interest |= EVENT_AL_CONTROL,
            Some(_) => {}
        }
        if let Some(mailbox) = &self.mailbox {
            interest |= mailbox.events(&self.faults);
        }
        self.interest = interest;
        self.polled = self.process_data.is_polled();
    }
}
